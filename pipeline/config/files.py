"""What a configuration file may hold, looked at before it is read.

Hydra reads YAML 1.1, where ``010`` is eight, ``1:30`` ninety and ``no`` false; on the command line
they are ten, and text. What would mean two things is refused, and so are nested aliases: a few
lines of them stand for more than a machine can hold.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from pipeline.config.arguments import DEEPEST, depth
from pipeline.console.errors import ConfigError, DataError

_MOST_BYTES = 1_000_000
_AMBIGUOUS = re.compile(
    r"[-+]?0[0-9_]+|[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?|[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}.*|"
    r"yes|Yes|YES|no|No|NO|on|On|ON|off|Off|OFF"
)
_SUSPECT = re.compile(r"[&*]\w|\b(?:0[0-9_]+|[0-9]+:[0-9]|[0-9]{4}-[0-9]|(?i:yes|no|on|off)\b)")
_MOST_VALUES = 100_000
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the fast one, where it was built


def check(folder: Path) -> None:
    """Check all configuration files of a folder.

    Raises
    ------
    ConfigError
        At the first that cannot be used; the line names file, line and remedy.
    """
    for file in sorted(folder.rglob("*.yaml")):
        _check(file)


def mapping(path: str | Path, key: str, form: str) -> dict[Any, Any]:
    """Read a YAML file that a user wrote or was given.

    Parameters
    ----------
    path : str or Path
    key : str
        Of the configuration, that names it.
    form : str
        What it must be, for the message.

    Returns
    -------
    dict

    Raises
    ------
    DataError
        If there is none, or it cannot be used.
    """
    where, file = f"{key} = {path}", Path(path)
    if not file.exists():
        raise DataError(f"{where}: not found")
    try:
        _check(file)
        found = yaml.load(file.read_text(encoding="utf-8-sig"), Loader=yaml.SafeLoader)
    except (ConfigError, yaml.YAMLError, RecursionError, ValueError) as error:
        why = f" ({error})" if isinstance(error, ConfigError) else ""
        raise DataError(f"{where}: must be {form}{why}") from None
    if not isinstance(found, dict):
        raise DataError(f"{where}: must be {form}")
    return found


def _check(file: Path) -> None:
    if not file.is_file():
        raise ConfigError(f"{file}: must be a file")
    if file.stat().st_size > _MOST_BYTES:
        raise ConfigError(f"{file}: must be smaller than {_MOST_BYTES} bytes")
    try:
        content = file.read_bytes()
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: must be UTF-8, and is not at byte {error.start}") from None
    code = re.sub(r"(^|\s)#.*", "", text, flags=re.M)
    if depth(code) > DEEPEST or re.search(rf"^ {{{10 * DEEPEST},}}\S", code, re.M):
        raise ConfigError(f"{file}: nested more than {DEEPEST} deep")
    if _SUSPECT.search(code):
        for line, said in _refused(text):
            raise ConfigError(f"{file}:{line}: {said}")


def _refused(text: str) -> Iterator[tuple[int, str]]:
    try:
        root = yaml.compose(text, _LOADER)
        if root is not None and (count := _values(root, {})) > _MOST_VALUES:
            yield 1, f"its aliases stand for {count:.3g} values; {_MOST_VALUES} are allowed"
        for token in yaml.scan(text, _LOADER):
            line = token.start_mark.line + 1
            if isinstance(token, yaml.ScalarToken) and token.plain:
                value = str(token.value)
                if _AMBIGUOUS.fullmatch(value):
                    yield line, f"{value}: means two things; quote text, write numbers plainly"
    except yaml.YAMLError:
        return  # said where it is read


def _values(node: yaml.Node, known: dict[int, int]) -> int:
    """Values that a node stands for when every alias is written out."""
    if id(node) not in known:
        known[id(node)] = 1  # of an alias to what it is in
        children = node.value if isinstance(node, yaml.CollectionNode) else []
        pairs = [child if isinstance(child, tuple) else (child,) for child in children]
        known[id(node)] = 1 + sum(_values(part, known) for pair in pairs for part in pair)
    return known[id(node)]
