"""One page of all claims of the paper and what became of them."""

from pathlib import Path

from pipeline.console.errors import DataError

PAGES = (
    "observability",
    "accuracy",
    "effects",
    "convergence",
    "laboratory",
    "ablation",
    "quadratic_unit",
)
"""Pages in the order of the paper's sections."""

_INTRODUCTION = """\
# The paper, reproduced

A systematic calibration of a ring-laser-gyro inertial navigation system with a 36-state Kalman
filter on a 25-position path, which adds the accelerometers' quadratic terms and the inner lever arm
to the classic 30 states: every table and figure of that paper, made again by this code. Each claim
stands here with what was found and a verdict that follows from the numbers; the pages have the
tables, figures, intervals and conventions. The paper gives no noise, site, rates or timing; ours
are those of `conf/`, and a page names them where they matter.
"""


def first_table(text: str) -> list[str]:
    """Lines of the first Markdown table of a page, shape and all."""
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if line.startswith("|")), len(lines))
    end = next((i for i in range(start, len(lines)) if not lines[i].startswith("|")), len(lines))
    return lines[start:end]


def page_of_claims(pages: dict[str, str]) -> str:
    """Compose the page.

    Parameters
    ----------
    pages : dict of str to str
        Text of each page by name, its heading in the first line.

    Returns
    -------
    str
        Markdown.
    """
    parts = [_INTRODUCTION]
    for name, text in pages.items():
        heading = text.splitlines()[0].removeprefix("# ")
        claims = "\n".join(first_table(text))
        parts.append(f"## {heading}\n\n{claims}\n\nIn full: [{name}.md]({name}.md)\n")
    return "\n".join(parts)


def read_pages(folder: Path) -> dict[str, str]:
    """Text of the pages.

    Raises
    ------
    DataError
        If one is missing.
    """
    missing = [name for name in PAGES if not (folder / f"{name}.md").exists()]
    if missing:
        raise DataError(f"{folder}/{missing[0]}.md: not found; make it with dvc repro paper")
    return {name: (folder / f"{name}.md").read_text() for name in PAGES}
