"""A log's turns beside those of the schedule that its header names."""

import numpy as np

from inscal.directions import AXES
from inscal.recorded import Increments, Stretch
from inscal.schedule import Turn, turns_of
from pipeline.config.load import load
from pipeline.console.errors import ConfigError, DataError
from pipeline.logs.header import Header

_OFF = np.deg2rad(10.0)
"""By which a turn may differ: tables are better, hands are not."""


def refuse_other_schedule(about: Header, record: Increments, parts: list[Stretch]) -> None:
    """Refuse a log that shows other turns than its schedule; times and rates may be any.

    Parameters
    ----------
    about : Header
    record : Increments
    parts : list of Stretch
        Of the record.

    Raises
    ------
    DataError
        If a turn is another one or missing; if there is no such schedule.
    """
    if about.schedule is None:
        return
    try:
        planned = turns_of(load([f"schedule={about.schedule}"]).schedule.rotations)
    except ConfigError as error:
        raise DataError(f"{about.data[0]}: the header's schedule: {error}") from None
    seen = [part for part in parts if part.turns]
    for number, (turn, part) in enumerate(zip(planned, seen, strict=False), 1):
        angle = record.angle[part.first : part.end].sum(axis=0)
        wanted = np.zeros(3)
        wanted[turn.axis] = turn.angle
        if np.linalg.norm(angle - wanted) > _OFF:
            axis = int(np.argmax(np.abs(angle)))
            saw = _words(Turn(float(angle[axis]), axis))
            raise DataError(
                f"{about.data[0]}: row {part.first + 1}: position {number}: expected "
                f"{_words(turn)}, saw {saw} at {part.first * record.interval:.6g} s"
            )
    if len(seen) != len(planned):
        raise DataError(
            f"{about.data[0]}: row {len(record.angle)}, {record.duration:.6g} s: {len(seen)} turns "
            f"in all; the schedule {about.schedule} has {len(planned)}"
        )


def _words(turn: Turn) -> str:
    return f"{np.rad2deg(turn.angle):+.0f} about {AXES[turn.axis]}"
