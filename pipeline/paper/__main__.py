"""Stage `paper`: one page of all claims of the paper and what became of them.

Usage: ``python -m pipeline.paper``, after the stages that write the pages it draws on. Every claim
is copied from its page, words and all; nothing is judged here.

Reads: nothing.
"""

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_text
from pipeline.paper.claims import page_of_claims, read_pages
from pipeline.paper.pages import FOLDER


@stage
def main(config: Config) -> None:
    """Write the page."""
    write_text(FOLDER / "README.md", page_of_claims(read_pages(FOLDER)))
    print(FOLDER / "README.md")


if __name__ == "__main__":
    main()
