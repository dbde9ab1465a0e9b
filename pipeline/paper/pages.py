"""A page of the paper's study: text, numbers, claims and figure of one name."""

from matplotlib.figure import Figure

from pipeline.charts import style
from pipeline.console.output import write_text
from pipeline.paper import claims
from pipeline.paper.claims import FOLDER


def write_page(name: str, text: str, judged: claims.Page, numbers: str, figure: Figure) -> None:
    """Write ``name.md``, ``.json`` and ``.png``, keep the claims, and say where the page is.

    Parameters
    ----------
    name : str
    text : str
        Markdown.
    judged : Page
        Its claims.
    numbers : str
        JSON.
    figure : Figure
    """
    page = FOLDER / f"{name}.md"
    claims.write(name, judged)
    write_text(FOLDER / f"{name}.json", numbers)
    write_text(page, text)
    style.save(figure, FOLDER / f"{name}.png")
    print(page)
