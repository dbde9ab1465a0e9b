"""What a command line may hold, looked at before Hydra takes it apart."""

import os
import re
from collections.abc import Sequence

from pipeline.console import conf
from pipeline.console.errors import ConfigError
from pipeline.console.help import choices

DEEPEST = 20
"""Brackets within brackets, in overrides and in configuration files."""

_FLAGS = {"--cfg": 1, "-c": 1, "--multirun": 0, "-m": 0} | dict.fromkeys(conf.SWITCHES, 1)
"""Hydra's own switches that stages take, and how many words follow."""
_SUPPORTED = "--help, --cfg job, --config-dir DIR, --multirun"


def checked(arguments: Sequence[str]) -> list[str]:
    """Arguments that Hydra may be given; a leading ``~/`` of a value is the home folder.

    Parameters
    ----------
    arguments : sequence of str
        Of a command line, without the program.

    Returns
    -------
    list of str

    Raises
    ------
    ConfigError
        If one of them is none that a stage takes.
    """
    out, rest, multirun = [], list(arguments), bool({"--multirun", "-m"} & {*arguments})
    while rest:
        word = rest.pop(0)
        if word.startswith("-") and "=" not in word:
            values, rest = rest[: _FLAGS.get(word, 0)], rest[_FLAGS.get(word, 0) :]
            _check_flag(word, values)
            out += [word, *values]
        else:
            out.append(_checked_override(word, multirun))
    return out


def _check_flag(word: str, values: Sequence[str]) -> None:
    if word not in _FLAGS:
        raise ConfigError(f"{word}: not supported; must be one of {_SUPPORTED}")
    if len(values) < _FLAGS[word]:
        raise ConfigError(f"{word}: must be followed by a word; as in {_SUPPORTED}")
    if word in ("--cfg", "-c") and values != ["job"]:
        raise ConfigError(f"{word} {values[0]}: must be --cfg job")


def _checked_override(word: str, multirun: bool) -> str:
    if not word.isprintable():
        raise ConfigError(f"{word!r}: must be without line breaks and control characters")
    if depth(word) > DEEPEST:
        raise ConfigError(f"{word.partition('=')[0]}: brackets nested more than {DEEPEST} deep")
    key, equals, value = word.partition("=")
    if re.match(r"[+~]*hydra\b", key):
        raise ConfigError(f"{key.lstrip('+~')}: not supported; a stage decides this itself")
    if equals and value.startswith("~/"):
        return f"{key}={os.path.expanduser(value)}"
    if equals and key.isidentifier() and conf.is_group(key):
        found = value.split(",") if multirun else [value]
        allowed = sorted(choices(key))
        for choice in found:
            if choice.strip("'\"") not in allowed:
                raise ConfigError(f"{key} = {choice}: must be one of {', '.join(allowed)}")
    return word


def depth(text: str) -> int:
    """How deep brackets are nested in a text."""
    deepest = level = 0
    for letter in text:
        level += (letter in "[{(") - (letter in "]})")
        deepest = max(deepest, level)
    return deepest
