"""What the manual adds to Sphinx: formulas as MathML, and two tables made from the code.

- Formulas are turned into MathML when the manual is built (latex2mathml), which browsers draw by
  themselves: no script and no font is needed to read them.
- ``config-reference`` lists every key of ``conf/`` with its unit, default and meaning. The meaning
  is that of the schema's docstring in ``pipeline/``, the remark that of the YAML file.
- ``stage-reference`` lists the stages of ``pipeline/`` with the usage lines of their docstrings.
"""

import ast
import dataclasses
import inspect
import re
import typing
from collections.abc import Iterator
from pathlib import Path

import yaml
from docutils import nodes
from docutils.statemachine import StringList
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

_ROOT = Path(__file__).resolve().parent.parent

UNITS: dict[str, str] = {
    "deg_per_sqrt_h": "deg/√h",
    "ug_per_sqrt_hz": "µg/√Hz",
    "deg_per_h": "deg/h",
    "deg_per_s": "deg/s",
    "pulses_per_m_per_s": "pulses per m/s",
    "m_per_s": "m/s",
    "1e_9": "1e-9 of `sensor.quadratic_unit`",
    "arcsec": "arcsec",
    "ppm": "ppm",
    "deg": "deg",
    "ug": "µg",
    "mm": "mm",
    "hz": "Hz",
    "g": "g",
    "m": "m",
    "s": "s",
}
"""Endings of keys and the units they stand for, longest first."""


@dataclasses.dataclass(frozen=True)
class Key:
    """One key of the configuration.

    Attributes
    ----------
    name : str
        With its group, as on the command line.
    unit, default, meaning, remark : str
        Text; `unit` and `remark` may be empty.
    """

    name: str
    unit: str
    default: str
    meaning: str
    remark: str


def unit_of(key: str) -> str:
    """Unit that the ending of a key names; empty for a key without one."""
    return next((text for end, text in UNITS.items() if key.endswith(f"_{end}")), "")


def meanings(schema: type) -> dict[str, str]:
    """Meaning of the fields of a schema class, from the Attributes section of its docstrings."""
    out: dict[str, str] = {}
    for cls in reversed(schema.__mro__[:-1]):
        doc = inspect.getdoc(cls) or ""
        section = re.split(r"\nAttributes\n-+\n", doc)
        if len(section) == 2:
            joined = re.sub(r"\\\n\s*", "", section[1])
            for names, body in re.findall(
                r"^(\S[^:\n]*) : [^\n]*\n((?:(?: .*)?\n?)+)", joined, re.M
            ):
                out |= dict.fromkeys(names.split(", "), " ".join(body.split()))
        else:
            own = [field.name for field in dataclasses.fields(cls) if field.name not in out]
            out |= dict.fromkeys(own, " ".join(doc.split("\n\n")[0].split()))
    return out


def remarks(text: str) -> dict[str, str]:
    """Comments behind the keys of a YAML file, by key."""
    found = re.findall(r"^\s*(\w+):[^#\n]*#\s*(.+)$", text, re.M)
    return dict(found)


def groups() -> Iterator[tuple[str, type, str, list[str]]]:
    """Name, schema class, default choice and all choices of every group of ``conf/``."""
    from pipeline.config.schema import Config

    entries = yaml.safe_load((_ROOT / "conf/config.yaml").read_text())["defaults"]
    chosen = {
        group: choice
        for entry in entries
        if isinstance(entry, dict)
        for group, choice in entry.items()
        if "/" not in group
    }
    schema = typing.get_type_hints(Config)
    for group, choice in chosen.items():
        choices = sorted(path.stem for path in (_ROOT / "conf" / group).glob("*.yaml"))
        yield group, schema[group], choice, choices


def keys_of(group: str, schema: type, choice: str) -> list[Key]:
    """Keys of a group, with the values of a composed default configuration."""
    from pipeline.config.load import load

    comments: dict[str, str] = {}
    for path in _ancestry(group, choice):
        comments |= remarks(path.read_text())
    return list(_keys(group, schema, getattr(load([]), group), comments))


def _ancestry(group: str, choice: str) -> list[Path]:
    """Files that make up a choice, those it builds on first."""
    path = _ROOT / "conf" / group / f"{choice}.yaml"
    below = yaml.safe_load(path.read_text()).get("defaults", [])
    return [p for name in below if name != "_self_" for p in _ancestry(group, name)] + [path]


def _keys(prefix: str, schema: type, values: object, comments: dict[str, str]) -> Iterator[Key]:
    known = meanings(schema)
    for field in dataclasses.fields(schema):  # type: ignore[arg-type]
        name, value = f"{prefix}.{field.name}" if prefix else field.name, None
        value = getattr(values, field.name)
        if dataclasses.is_dataclass(value):
            if prefix:
                yield from _keys(name, type(value), value, comments)
            continue
        yield Key(
            name=name,
            unit=unit_of(field.name),
            default=_short(value),
            meaning=_kind(field.name) or known.get(field.name, ""),
            remark=comments.get(field.name, ""),
        )


def _kind(key: str) -> str:
    """Kind of parameter, in words, of a key that holds values of a kind."""
    from pipeline.config.schema import KIND_KEYS

    kind = {key: kind for kind, key in KIND_KEYS.items()}.get(key)
    return f"{kind.replace('_', ' ').capitalize()}." if kind else ""


def _short(value: object) -> str:
    text = (
        "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
    )
    return "see the file" if len(text) > 80 else f"`{text}`"


def top_keys() -> list[Key]:
    """Keys of no group."""
    from pipeline.config.load import load
    from pipeline.config.schema import Config

    comments = remarks((_ROOT / "conf/config.yaml").read_text())
    return list(_keys("", Config, load([]), comments))


def wing_groups() -> Iterator[tuple[str, type, list[Key]]]:
    """Name, schema class and keys of the groups that ``conf/paper.yaml`` adds, if it is there."""
    path = _ROOT / "conf/paper.yaml"
    if not path.exists():
        return
    from pipeline.config.load import PRODUCT, load
    from pipeline.paper.config import PROGRAM

    values, comments = load([], PROGRAM), remarks(path.read_text())
    schema = typing.get_type_hints(PROGRAM.schema)
    for group in [name for name in schema if name not in typing.get_type_hints(PRODUCT.schema)]:
        own = schema[group]
        yield group, own, list(_keys(group, own, getattr(values, group), comments))


def configuration_text() -> str:
    """Markdown of the configuration reference."""
    parts = []
    for group, schema, choice, choices in groups():
        named = ", ".join(
            f"`{name}`" + (" (default)" if name == choice else "") for name in choices
        )
        parts += [f"## {group}", _first(schema), f"Choices: {named}."]
        parts.append(_table(keys_of(group, schema, choice)))
    parts += ["## Keys of no group", _table(top_keys())]
    for group, schema, keys in wing_groups():
        where = f"In `conf/paper.yaml`, read by `pipeline.paper_{group}` alone."
        parts += [f"## {group}", _first(schema), where, _table(keys)]
    return "\n\n".join(parts) + "\n"


def _first(schema: type) -> str:
    """First paragraph of the docstring of a class."""
    return (inspect.getdoc(schema) or "").split("\n\n")[0].replace("\n", " ")


def _table(keys: list[Key]) -> str:
    rows = ["| key | unit | default | meaning |", "| --- | --- | --- | --- |"]
    for key in keys:
        meaning = key.meaning.replace("``", "`")
        if key.remark and key.remark.lower() not in meaning.lower():
            meaning = f"{meaning} <br>{key.remark[0].upper()}{key.remark[1:]}"
        cells = (f"`{key.name}`", key.unit, key.default, meaning)
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows)


def _doors() -> list[Path]:
    """Files of the stages."""
    folder = _ROOT / "pipeline"
    return sorted([*folder.glob("*.py"), *folder.glob("*/__main__.py")])


def stages() -> list[tuple[str, str, str]]:
    """Module name, summary and usage line of every stage."""
    out = []
    for path in _doors():
        doc = ast.get_docstring(ast.parse(path.read_text())) or ""
        found = re.match(r"Stage `[\w-]+`: (.*?)\n\n(.*)", doc, re.S)
        if found:
            usage = re.search(r"Usage:\s*``(.+?)``", found[2], re.S)
            assert usage, f"{path} has no usage line"
            summary = " ".join(found[1].split()).replace("``", "`")
            out.append(
                (
                    path.stem if path.stem != "__main__" else path.parent.name,
                    summary,
                    " ".join(usage[1].split()),
                )
            )
    return out


def stages_text() -> str:
    """Markdown of the stage reference."""
    rows = ["| what it does | usage |", "| --- | --- |"]
    for _, summary, usage in stages():
        escaped = usage.replace("|", "\\|")
        rows.append(f"| {summary[0].upper()}{summary[1:]} | `{escaped}` |")
    return "\n".join(rows) + "\n"


class _Generated(SphinxDirective):
    """Markdown made by a function, in place of the directive."""

    @staticmethod
    def text() -> str:
        raise NotImplementedError

    def run(self) -> list[nodes.Node]:
        for path in [*(_ROOT / "conf").rglob("*.yaml"), *_doors()]:
            self.env.note_dependency(str(path))
        self.content = StringList(self.text().splitlines(), "generated")
        self.content_offset = 0
        return self.parse_content_to_nodes(allow_section_headings=True)


class ConfigReference(_Generated):
    """Every key of ``conf/``."""

    text = staticmethod(configuration_text)


class StageReference(_Generated):
    """Every stage of ``pipeline/``."""

    text = staticmethod(stages_text)


def _inline(translator, node: nodes.math) -> None:
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(translator, node: nodes.math_block) -> None:
    latex = node.astext().strip()
    latex = re.sub(r"(begin|end)\{aligned\}", r"\1{align*}", latex)  # which latex2mathml knows
    if re.search(r"&|\\\\", re.sub(r"\\begin\{([\w*]+)\}.*?\\end\{\1\}", "", latex, flags=re.S)):
        latex = rf"\begin{{align*}}{latex}\end{{align*}}"
    translator.body.append(f'<div class="math">{convert(latex, display="block")}</div>\n')
    raise nodes.SkipNode


def _plain_text(app, what, name, obj, options, lines: list[str]) -> None:
    """Prepare docstrings written as text: indented formulas, magnitudes between bars, units."""
    before = ""
    out: list[str] = []
    if what in ("data", "attribute"):
        # an empty comment, or napoleon takes what stands before a colon for a type
        out += ["..", ""]
    for number, line in enumerate(lines):
        formula = (
            line.startswith("    ")
            and number > 0
            and not lines[number - 1].strip()
            and before
            and not before.startswith((" ", ".. "))
            and not before.endswith("::")
        )
        if formula:
            out += ["::", ""]
        if line.strip():
            before = "::" if formula or (before == "::" and line.startswith("    ")) else line
        if before != "::":
            line = re.sub(r"\|(\w+)\|", r"\\|\1\\|", line)
            line = re.sub(r"^(\s+[A-Za-z])\.(?=\s|$)", r"\1\\.", line)  # the unit "s.": no list
        out.append(line)
    lines[:] = _one_by_one(out) if what == "class" else out


def _one_by_one(lines: list[str]) -> list[str]:
    """Give names that share an entry of a docstring an entry each: napoleon takes them for one."""
    out: list[str] = []
    for number, line in enumerate(lines):
        shared = re.fullmatch(r"(\w+(?:, \w+)+) : (.*)", line)
        if not shared:
            out.append(line)
            continue
        body = []
        for following in lines[number + 1 :]:
            if not following.startswith(" "):
                break
            body.append(following)
        *first, last = shared[1].split(", ")
        for name in first:
            out += [f"{name} : {shared[2]}", *body]
        out.append(f"{last} : {shared[2]}")
    return out


def _outside(app: Sphinx, name: str, source: list[str]) -> None:
    """Name files outside the manual where the Markdown links to them: on a git host links work."""
    folder = Path(app.env.doc2path(name)).parent
    manual = Path(app.srcdir)

    def replaced(match: re.Match[str]) -> str:
        text, target = match[1], (folder / match[2]).resolve()
        if target.is_relative_to(manual):
            return match[0]
        path = target.relative_to(manual.parent).as_posix()
        return f"`{path}`" if text.rstrip("/") in path else f"{text} (`{path}`)"

    source[0] = re.sub(r"\[([^\]]+)\]\((\.\./[^)#]+)\)", replaced, source[0])


def _unwanted(app, what, name, obj, skip, options) -> bool | None:
    """Leave out what named tuples add by themselves."""
    doc = getattr(obj, "__doc__", "") or ""
    return True if doc.startswith("Alias for field number") else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("config-reference", ConfigReference)
    app.add_directive("stage-reference", StageReference)
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("autodoc-process-docstring", _plain_text, priority=100)  # before napoleon
    app.connect("source-read", _outside)
    app.connect("autodoc-skip-member", _unwanted)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
