"""Logs as increments in body axes, and what of them cannot be believed."""

import numpy as np

from inscal import earth
from inscal.motion import Site
from inscal.recorded import Increments, Stretch, stretches, turned_between
from inscal.units import DEGREE
from pipeline.console.errors import DataError
from pipeline.logs.formats.rows import Rows
from pipeline.logs.header import Header
from pipeline.logs.readers import read_rows

_DIGITS = 8  # of an interval that times of single precision give
_LATE = 0.5  # of an interval: a time that far from its place is wrong
_FORCE = 0.05  # of gravity: accelerometers at rest read no more beside it
_TURN = 3.0 * DEGREE  # by which the turns of gyros and of gravity may differ
_FASTEST = 20.0  # rad/s: no table turns so fast
_STUCK = 20  # samples of the same largest value: no noise gives that
_SUDDEN = 1e-3  # of a value: a steady turn without noise is come to smoothly
_SPIN = 0.25  # of the Earth's rate: gyros that read it this well know the latitude
_LATITUDE = 3.0 * DEGREE


def read_increments(about: Header) -> Increments:
    """Read a log.

    Parameters
    ----------
    about : Header

    Returns
    -------
    Increments

    Raises
    ------
    DataError
        If rows are missing, out of order, not finite or saturated.
    """
    rows = read_rows(about)
    name = about.data[0]
    if len(rows.time) < 10:
        raise DataError(f"{name}: {len(rows.time)} rows are no log")
    _refuse_bad_numbers(name, rows)
    interval = 1.0 / about.rate_hz if about.rate_hz else float(np.median(np.diff(rows.time)))
    _refuse_bad_times(name, rows.time, interval)
    if about.rate_hz is None:  # steps of times are rounded, their sum is not
        mean = float(rows.time[-1] - rows.time[0]) / (len(rows.time) - 1)
        interval = float(f"{mean:.{_DIGITS}g}")
    _refuse_stuck(name, rows)
    turned = about.rotation
    gyro_unit = about.gyro_unit_si * (1.0 if about.gyro_increments else interval)
    accel_unit = about.accel_unit_si * (1.0 if about.accel_increments else interval)
    return Increments(
        interval,
        (rows.gyro - about.gyro_offset) @ (gyro_unit * turned.T),
        (rows.accel - about.accel_offset) @ (accel_unit * turned.T),
        rows.observed,
    )


def refuse_unobserved(name: str, record: Increments, update_interval: float) -> None:
    """Refuse a log that does not have every observation that it says it has.

    Parameters
    ----------
    name : str
        Of the log, for messages.
    record : Increments
        A whole number of updates long.
    update_interval : float
        s.

    Raises
    ------
    DataError
        If one is missing.
    """
    if record.observed is None:
        return
    samples = round(update_interval / record.interval)
    bad = ~np.isfinite(record.observed[samples - 1 :: samples]).all(axis=1)
    if bad.any():
        row = (int(np.argmax(bad)) + 1) * samples - 1
        raise DataError(
            f"{name}: {_where(row, (row + 1) * record.interval)}: no observation; one is due every "
            f"{update_interval:g} s"
        )


def _where(row: int, seconds: float) -> str:
    return f"row {row + 1}, {seconds:.6g} s"


def _refuse_bad_numbers(name: str, rows: Rows) -> None:
    bad = {}
    for what, values in (("accelerometers", rows.accel), ("gyros", rows.gyro), ("time", rows.time)):
        finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
        if not finite.all():
            bad[int(np.argmin(finite))] = what
    if bad:
        row = min(bad)
        raise DataError(f"{name}: row {row + 1}: {bad[row]}: not finite")


def _refuse_bad_times(name: str, time: np.ndarray, interval: float) -> None:
    if not interval > 0.0:
        raise DataError(f"{name}: times do not rise")
    step = np.diff(time)
    for wrong, said in (
        (step < 0.0, "time goes back by {:.6g} s"),
        (step == 0.0, "time is that of the row before"),
        (step > (1.0 + _LATE) * interval, "{:.6g} s after the row before: rows are missing"),
        (step < (1.0 - _LATE) * interval, "only {:.6g} s after the row before"),
    ):
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0]) + 1
            text = f"{said.format(abs(step[row - 1]))}; an interval is {interval:g} s"
            raise DataError(f"{name}: {_where(row, time[row])}: {text}")


def _refuse_stuck(name: str, rows: Rows) -> None:
    """A sensor at the end of its range repeats its largest number, and comes there at once."""
    for sensor, values in (("gyro", rows.gyro), ("accelerometer", rows.accel)):
        for axis, signed in zip("xyz", values.T, strict=True):
            column = np.abs(signed)
            top = column == column.max()
            edges = np.flatnonzero(np.diff(top, prepend=False, append=False)).reshape(-1, 2)
            for first, end in edges[np.diff(edges).ravel() >= _STUCK]:
                if first and column[first] - column[first - 1] > _SUDDEN * column[first]:
                    where = _where(first, rows.time[first])
                    raise DataError(
                        f"{name}: {where}: {sensor} {axis} is saturated: it stays at "
                        f"{column[first]:.6g}, its largest number, for {end - first} rows"
                    )


def rests_and_turns(name: str, record: Increments) -> list[Stretch]:
    """Rests and turns of a log.

    Parameters
    ----------
    name : str
        Of the log, for messages.
    record : Increments

    Returns
    -------
    list of Stretch

    Raises
    ------
    DataError
        If it turns faster than any table, never rests, or begins with a turn.
    """
    fastest = np.abs(record.angle).max() / record.interval
    if fastest > _FASTEST:
        row = int(np.argmax(np.abs(record.angle).max(axis=1)))
        raise DataError(
            f"{name}: {_where(row, row * record.interval)}: a rate of {fastest:.3g} rad/s: must be "
            f"below {_FASTEST:g}; is gyro_unit right?"
        )
    try:
        parts = stretches(record)
    except ValueError as error:
        raise DataError(f"{name}: {error}") from None
    if parts[0].turns:
        raise DataError(f"{name}: {_where(0, 0.0)}: begins with a turn; must begin at rest")
    return parts


def refuse_wrong_log(
    name: str, record: Increments, parts: list[Stretch], site: Site, *, spin_seen: bool
) -> None:
    """Refuse a log whose units, axes or site cannot be right.

    Parameters
    ----------
    name : str
        Of the log, for messages.
    record : Increments
    parts : list of Stretch
        Of the record.
    site : Site
    spin_seen : bool
        Whether gyros that read about the Earth's rate at rest read it.

    Raises
    ------
    DataError
        If the numbers contradict gravity, each other, or the site.
    """
    rests = [part for part in parts if not part.turns]
    _refuse_wrong_gravity(name, record, rests, site)
    _refuse_wrong_turns(name, record, parts)
    if spin_seen:
        _refuse_wrong_site(name, record, rests[0], site)


def _force(record: Increments, part: Stretch) -> np.ndarray:
    return np.asarray(record.velocity[part.first : part.end].mean(axis=0) / record.interval)


def _refuse_wrong_gravity(name: str, record: Increments, rests: list[Stretch], site: Site) -> None:
    gravity = float(earth.gravity_ned(site.latitude, site.height)[2])
    for part in rests:
        force = np.linalg.norm(_force(record, part))
        if abs(force / gravity - 1.0) > _FORCE:
            raise DataError(
                f"{name}: {_where(part.first, part.first * record.interval)}: at rest "
                f"accelerometers read {force:.4g} m/s^2, gravity is {gravity:.4g}: is accel_unit "
                "or accel_scale right?"
            )


def _refuse_wrong_turns(name: str, record: Increments, parts: list[Stretch]) -> None:
    """Gyros must see the turns that gravity makes in the body."""
    inside = [n for n, part in enumerate(parts) if part.turns and 0 < n < len(parts) - 1]
    bounds = np.array([(parts[n].first, parts[n].end) for n in inside]).reshape(-1, 2)
    rotations = turned_between(record.angle, bounds, np.eye(3), np.zeros(3))
    for n, rotation in zip(inside, rotations, strict=True):
        turn = parts[n]
        down = [-_force(record, part) for part in (parts[n - 1], parts[n + 1])]
        down = [one / np.linalg.norm(one) for one in down]
        off = float(np.arccos(np.clip(down[0] @ rotation @ down[1], -1.0, 1.0)))
        if off > _TURN:
            raise DataError(
                f"{name}: {_where(turn.first, turn.first * record.interval)}: after this "
                f"turn gravity is {np.rad2deg(off):.3g} deg from where the gyros say: are units, "
                "columns, signs and axes right, and right-handed?"
            )


def _refuse_wrong_site(name: str, record: Increments, rest: Stretch, site: Site) -> None:
    """Gyros that see the Earth's rate know the latitude."""
    spin = record.angle[rest.first : rest.end].mean(axis=0) / record.interval
    down = -_force(record, rest)
    size = np.linalg.norm(spin)
    if abs(size / earth.EARTH_RATE - 1.0) > _SPIN:
        return
    found = float(np.arcsin(np.clip(-spin @ down / np.linalg.norm(down) / size, -1.0, 1.0)))
    if abs(found - site.latitude) > _LATITUDE:
        raise DataError(
            f"{name}: {_where(0, 0.0)}: the gyros see the Earth's rate of latitude "
            f"{np.rad2deg(found):.1f} deg, the header's latitude_deg is "
            f"{np.rad2deg(site.latitude):g}"
        )
