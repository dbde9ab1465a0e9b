"""What Hydra and OmegaConf say about keys, types and syntax, in one line for the user."""

import re
from collections.abc import Mapping, Sequence

from hydra.errors import MissingConfigException, OverrideParseException
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

_MUST = (
    (r"could not be converted to Float", "must be a number"),
    (r"could not be converted to Integer", "must be an integer"),
    (r"could not be converted to String|not a subclass of str|to string: ", "must be text"),
    (r"is not Optional|Incompatible value 'None'", "must not be null"),
    (r"is not a ListConfig", "must be a list"),
)
"""OmegaConf's reasons for a refusal, and what to say instead."""


def one_line(
    error: Exception, overrides: Sequence[str], allowed_keys: Mapping[str, Sequence[str]]
) -> str:
    """Say in one line what an error of Hydra or OmegaConf means for the user.

    Parameters
    ----------
    error : Exception
        The error.
    overrides : sequence of str
        What the user gave, named if the error names no key.
    allowed_keys : mapping of str to sequence of str
        Keys of each class of the schema, by the name of the class.

    Returns
    -------
    str
        The line: the key, its value where known, and what is allowed.
    """
    if isinstance(error, MissingConfigException) and error.options and error.missing_cfg_file:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        return f"{group} = {choice}: must be one of {', '.join(error.options)}"
    if isinstance(error, OverrideParseException):
        return f"{error.override!r}: must be group=option or key=value ({_joined(error.message)})"
    cause = error.__cause__ if isinstance(error.__cause__, OmegaConfBaseException) else error
    text = str(cause)
    key = re.search(r"full_key: (\S+)", text)
    if key is None:
        return f"{_joined(text)} (given: {' '.join(' '.join(overrides).split())})"
    unknown = re.search(r"Key '.*' not in '(\w+)'", text)
    if unknown and unknown[1] in allowed_keys:
        return f"{key[1]}: unknown key; must be one of {', '.join(allowed_keys[unknown[1]])}"
    if isinstance(cause, MissingMandatoryValue):
        return f"{key[1]}: must be given"
    return f"{key[1]}{_value(str(error), text)}: {_reason(text)}"


def _value(outer: str, inner: str) -> str:
    merged = re.search(r"Error merging override [^=]*=(.*)", outer, re.DOTALL)
    found = merged or re.search(r"Value '(.*)' of type", inner, re.DOTALL)
    return f" = {' '.join(found[1].split()) or repr('')}" if found else ""


def _reason(text: str) -> str:
    for pattern, must in _MUST:
        if re.search(pattern, text):
            return must
    return _joined(text)


def _joined(text: str) -> str:
    lines = [line.strip() for line in text.splitlines()]
    context = re.compile(r"(full_key: |object_type=|reference_type=|See https:)")
    return "; ".join(line for line in lines if line and not context.match(line))
