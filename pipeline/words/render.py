"""Texts from their templates: sentences stand in those, numbers and verdicts come from Python."""

import re
from functools import cache
from pathlib import Path
from typing import Any

from pipeline.words import markdown

_SENTENCES = "sentences.md.jinja"


def render(folder: Path, name: str, **values: object) -> str:
    """Fill in a template.

    Beside the filters of jinja2 it may use those of `pipeline.words.markdown` and

    - ``number(".2f")``: a number by Python's format specification;
    - ``rows|table(headings, left)``: a table;
    - ``unwrapped``: every paragraph and every item of a list on one line.

    Parameters
    ----------
    folder : Path
        Of the templates.
    name : str
        Of the file.
    **values : object
        What it may name; anything else it names is an error.

    Returns
    -------
    str
    """
    return _environment(folder).get_template(name).render(values)


def sentence(folder: Path, block: str, /, **values: object) -> str:
    """Fill in one block of ``sentences.md.jinja``, and put it on one line.

    Parameters
    ----------
    folder : Path
        Of the templates.
    block : str
        Its name.
    **values : object
        What it may name; anything else it names is an error.

    Returns
    -------
    str
    """
    template = _environment(folder).get_template(_SENTENCES)
    text = "".join(template.blocks[block](template.new_context(values)))
    return re.sub(r"[ \n]+", " ", text).strip()


def unwrapped(text: str) -> str:
    """Put every paragraph and every item of a list on one line.

    Headings, rows of tables, pictures and items start with a mark that tells them from a line that
    goes on.
    """
    return re.sub(r"(?<=[^\n])\n *(?!\n|#|\||!\[|- |\Z)", " ", text)


@cache
def _environment(folder: Path) -> Any:
    import jinja2  # few stages write texts, and all others start sooner without it

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "bullets": markdown.bullets,
        "code": markdown.code,
        "codes": markdown.codes,
        "ends": markdown.ends,
        "listed": markdown.listed,
        "named": markdown.named,
        "number": format,
        "percent": markdown.percent,
        "sizes": markdown.sizes,
        "table": lambda rows, headings, left: markdown.table(headings, rows, left),
        "unwrapped": unwrapped,
    }
    return environment
