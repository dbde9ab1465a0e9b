"""Stage `paper`: one page of all claims of the paper and what became of them.

Usage: ``python -m pipeline.paper``, after the stages that write its pages. Writes
``results/paper/README.md`` and, for the report, ``claims.json``: the claims as those stages left
them; nothing is judged here.

Reads: nothing.
"""

from dataclasses import asdict

from pipeline.config.schema import Config
from pipeline.config.stage import stage
from pipeline.console.output import write_json, write_text
from pipeline.paper.claims import FOLDER, claims_for_report, page_of_claims, read_pages
from pipeline.study.claims import PATH


@stage
def main(config: Config) -> None:
    """Write the page and the file."""
    pages = read_pages()
    write_json(PATH, asdict(claims_for_report(pages)))
    write_text(FOLDER / "README.md", page_of_claims(pages))
    print(FOLDER / "README.md")


if __name__ == "__main__":
    main()
