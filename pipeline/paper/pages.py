"""A page of the paper's study: text, numbers and figure of one name in ``results/paper``."""

from pathlib import Path

from matplotlib.figure import Figure

from pipeline.charts import style
from pipeline.console.output import write_text

FOLDER = Path("results/paper")


def write_page(name: str, text: str, numbers: str, figure: Figure) -> None:
    """Write ``name.md``, ``name.json`` and ``name.png``, and say where the page is.

    Parameters
    ----------
    name : str
    text : str
        Markdown.
    numbers : str
        JSON.
    figure : Figure
    """
    page = FOLDER / f"{name}.md"
    write_text(FOLDER / f"{name}.json", numbers)
    write_text(page, text)
    style.save(figure, FOLDER / f"{name}.png")
    print(page)
