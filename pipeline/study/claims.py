"""What a reproduced paper claims and what became of it: data that a wing leaves for the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.console.errors import DataError
from pipeline.console.output import json_data

PATH = Path("results/paper/claims.json")


@dataclass(frozen=True)
class Judged:
    """Claims of one page of the reproduction.

    Attributes
    ----------
    title : str
    headings : sequence of str
    rows : sequence of sequence of str
        Claim, what was found, and the verdict last.
    """

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Claims:
    """All of it.

    Attributes
    ----------
    judged : sequence of Judged
    estimates : mapping of str to mapping
        By parameter: its ``unit``, ``truth`` and ``paper_estimate``, and what a campaign with that
        truth gives, ``one_run``, ``mean`` and ``rmse``.
    margins : mapping of str to mapping of str to float
        By kind and sensor, the largest noise at which the bound holds, over the configured one.
    largest_noise : float
        Up to which it was sought; margins beyond are infinite.
    rotations : sequence of (float, str)
        The paper's path: degrees and axis of the turn after each position.
    ranks : sequence of int
        The paper's ranks after each position.
    """

    judged: Sequence[Judged]
    estimates: Mapping[str, Mapping[str, Any]]
    margins: Mapping[str, Mapping[str, float]]
    largest_noise: float
    rotations: Sequence[tuple[float, str]]
    ranks: Sequence[int]


def read(path: Path = PATH) -> Claims | None:
    """Read what the wing left; None if it left nothing.

    Raises
    ------
    DataError
        If it is of another form.
    """
    try:
        data = json_data(path.read_text(encoding="utf-8"))
        judged = [Judged(**page) for page in data.pop("judged")]
        rotations = [(angle, axis) for angle, axis in data.pop("rotations")]
        return Claims(judged, rotations=rotations, **data)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        raise DataError(f"{path}: cannot be read; make it anew, or remove it") from None
