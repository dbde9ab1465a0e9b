"""What ``--help`` prints: a stage's purpose, examples, and what it reads of the configuration.

Everything is taken from where it is written already: the stage's docstring, read without running
the module (the libraries that stages import take seconds), and the files and comments of ``conf/``.
Of a docstring that are the first paragraph, ``Usage: ``...`` ``, the block after ``For example::``,
and ``Reads:`` with groups (``noise``) and keys (``campaign.runs``, ``out``).
"""

import ast
import re
import signal
import sys
import textwrap
from pathlib import Path

from pipeline.console import conf

_WIDTH = 100
_REMARK = 34  # column of the remarks
_KEY = re.compile(r"^(\w+):[ ]*([^#\n]*?)[ ]*(?:#[ ]*(.*))?$", re.M)


def is_asked(arguments: list[str]) -> bool:
    """Whether command line arguments ask for help."""
    return bool({"--help", "-h"} & {*arguments})


def answer_early() -> None:
    """Print the help that ``python -m pipeline.<stage> --help`` asks for, and end the process.

    Called while the package is imported, before the stage's module is.
    """
    if "-m" in sys.orig_argv and is_asked(sys.argv[1:]):
        name = sys.orig_argv[sys.orig_argv.index("-m") + 1]
        place = conf.SHIPPED.parent / name.replace(".", "/")
        path = place / "__main__.py" if place.is_dir() else place.with_suffix(".py")
        conf.take(sys.argv[1:])
        found = help_text(path) if path.exists() else None
        if found:
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # as for `... --help | head`
            print(found)
            raise SystemExit(0)


def help_text(path: Path) -> str | None:
    """Help of the stage in a source file; None if its docstring does not say what it reads.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str or None
        Lines of at most 100 columns.
    """
    doc = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    entries = read_by(doc)
    if not entries:
        return None
    name = path.parent.name if path.stem == "__main__" else path.stem
    summary = re.sub(r"^Stage (\S+):", rf"{name}:", doc.split("\n\n")[0]).replace("`", "")
    usage = re.search(r"Usage:\s*``(.+?)``", doc, re.S)
    examples = re.search(r"^For example::\n\n((?:    .*\n?)+)", doc, re.M)
    parts = [textwrap.fill(" ".join(summary.split()), _WIDTH)]
    if usage:
        parts.append(_wrapped("usage: ", " ".join(usage[1].split())))
    if examples:
        parts.append(
            "for example:\n" + textwrap.indent(textwrap.dedent(examples[1]), "  ").rstrip()
        )
    if entries != ["nothing"]:
        lines = [_entry(entry) for entry in entries]
        parts.append("\n".join(["reads of the configuration, the default first:", *lines]))
        parts.append(
            "More keys, units and remarks: conf/GROUP/*.yaml; change any with GROUP.KEY=VALUE. "
            "As it is\nwith these arguments: --cfg job"
        )
    return "\n\n".join(parts)


def read_by(doc: str) -> list[str]:
    """Groups and keys that the docstring of a stage says it reads; empty if it does not say."""
    said = re.search(r"^Reads: (.*?)\.$", doc, re.M | re.S)
    return said[1].replace(",", " ").split() if said else []


def choices(group: str) -> list[str]:
    """Names of the choices of a group, the default first."""
    found = sorted(file.stem for file in conf.every(f"{group}/*.yaml"))
    text = conf.find("config.yaml").read_text(encoding="utf-8")
    defaults = re.search(rf"^  - {group}: (\S+)", text, re.M)
    default = defaults[1] if defaults else ""
    return sorted(found, key=lambda name: name != default)


def _entry(entry: str) -> str:
    group, _, key = entry.partition(".")
    if conf.is_group(group) and not key:
        names = choices(group)
        if len(names) > 1:
            return _wrapped(f"  {group}=", "|".join(names), "|")
        text = conf.find(f"{group}/{names[0]}.yaml").read_text(encoding="utf-8")
        return _group_entry(group, text)
    if not key and (text := _group_text(group)):
        return _group_entry(group, text)
    if key:
        files = [conf.find(f"{group}/{name}.yaml") for name in choices(group)]
    else:
        files, key = [conf.find("config.yaml")], group
    for file in files:
        if key in (found := _keys(file.read_text(encoding="utf-8"))):
            value, remark = found[key]
            start = f"  {entry}={value}"
            return _wrapped(f"{start.ljust(_REMARK - 1)} ", remark) if remark else start
    raise KeyError(f"{entry}: no such key in {files[0].parent}")


def _group_entry(group: str, text: str) -> str:
    return _wrapped(f"  {group}.KEY".ljust(_REMARK - 1) + " ", ", ".join(_keys(text)))


def _group_text(group: str) -> str:
    """YAML of a group that stands in a file with others, as in ``paper.yaml``; or nothing."""
    for file in conf.every("*.yaml"):
        found = re.search(rf"^{group}:\n((?:  .*\n)+)", file.read_text(encoding="utf-8"), re.M)
        if found:
            return textwrap.dedent(found[1])
    return ""


def _keys(text: str) -> dict[str, tuple[str, str]]:
    """Value and remark of the keys on the outermost level of a YAML text."""
    return {key: (value, remark) for key, value, remark in _KEY.findall(text)}


def _wrapped(start: str, text: str, separator: str = " ") -> str:
    """Text behind a start, broken at separators; what follows is indented like its beginning."""
    lines, width = [""], _WIDTH - len(start)
    for word in re.findall(rf"[^{separator}]+[{separator}]?", text):
        if len(lines[-1]) + len(word.rstrip()) > width:
            lines.append("")
        lines[-1] += word
    return start + f"\n{' ' * len(start)}".join(line.rstrip() for line in lines)
