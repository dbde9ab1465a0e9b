"""The claims of every page: verdicts kept as data, and the page and the file made of them all."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from pipeline.console.errors import DataError
from pipeline.console.output import write_json
from pipeline.paper.noise import SCALES
from pipeline.paper.tables import TABLE_1_ROTATIONS, TABLE_2_RANKS
from pipeline.study import claims, findings
from pipeline.study.claims import Judged
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED, Verdict
from pipeline.words import markdown as md
from pipeline.words.render import render

FOLDER = Path("results/paper")
TEMPLATES = Path(__file__).parent / "templates"

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

_ALL = (MET, NOT_MET, UNDECIDED)


@dataclass(frozen=True)
class Page(Judged):
    """Claims of one page as its stage leaves them.

    Attributes
    ----------
    bold : sequence of str
        Verdicts set in bold type, by how they begin.
    """

    bold: Sequence[str] = _ALL

    @property
    def table(self) -> str:
        """Markdown table of the claims."""
        rows = [[*row, self._set(word)] for *row, word in self.rows]
        return md.table(self.headings, rows, len(self.headings))

    def _set(self, word: str) -> str:
        return f"**{word}**" if word.startswith(tuple(self.bold)) else word


def page_of(
    title: str,
    verdicts: Iterable[Verdict],
    headings: Sequence[str] = ("claim", "found", "verdict"),
    bold: Sequence[str] = _ALL,
) -> Page:
    """Make the claims of a page of its verdicts.

    Parameters
    ----------
    title : str
    verdicts : iterable of Verdict
    headings : sequence of str
    bold : sequence of str
        Verdicts set in bold type, by how they begin.

    Returns
    -------
    Page
    """
    return Page(title, headings, [(v.claim, v.found, v.word) for v in verdicts], bold)


def path_of(name: str) -> Path:
    """File that keeps the claims of a page."""
    return FOLDER / "claims" / f"{name}.json"


def write(name: str, page: Page) -> None:
    """Keep the claims of a page."""
    write_json(path_of(name), asdict(page))


def read_pages() -> dict[str, Page]:
    """Read the claims of all pages.

    Raises
    ------
    DataError
        If those of one are missing or of another form.
    """
    return {name: _read(path_of(name)) for name in PAGES}


def _read(path: Path) -> Page:
    try:
        return Page(**json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise DataError(f"{path}: not found; make it with dvc repro paper") from None
    except (OSError, ValueError, TypeError):
        raise DataError(f"{path}: cannot be read; make it anew with dvc repro paper") from None


def page_of_claims(pages: Mapping[str, Page]) -> str:
    """Compose the page of all claims.

    Parameters
    ----------
    pages : mapping of str to Page
        By name.

    Returns
    -------
    str
        Markdown.
    """
    return render(TEMPLATES, "README.md.jinja", pages=pages)


def claims_for_report(pages: Mapping[str, Page]) -> claims.Claims:
    """Put together what the report takes of the reproduction.

    Raises
    ------
    DataError
        If the numbers of Table 3 are missing.
    """
    accuracy = findings.read_json(FOLDER / "accuracy.json", "paper_accuracy")
    keys = ("unit", "truth", "paper_estimate", "one_run", "mean", "rmse")
    return claims.Claims(
        judged=[Judged(page.title, page.headings, page.rows) for page in pages.values()],
        estimates={
            name: {key: row[key] for key in keys} for name, row in accuracy["parameters"].items()
        },
        margins=accuracy["margins"],
        largest_noise=float(SCALES[-1]),
        rotations=TABLE_1_ROTATIONS,
        ranks=TABLE_2_RANKS,
    )
