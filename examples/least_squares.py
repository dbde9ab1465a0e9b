"""Another calibrator: least squares of dwells and turns, with no filter of this library in it.

A unit that is turned about a point which stands still feels nothing but gravity and the Earth's
rate. So its increments, compensated and carried to the navigation frame by its own gyros, say

- in every dwell: the specific force is as long as gravity, and as level as in the dwell before;
- in every turn: the velocity at its end is that at its start, zero.

The 27 parameters and the attitude at the start for which all of that holds best, weighted by the
sensors' noise, are found with Gauss and Newton's method, run by run, and written as a table that
`python -m pipeline.judge` reads.

    python -m pipeline.export runs=0:32 rate_hz=10 log=results/logs/unit.parquet
    python examples/least_squares.py results/logs/unit-*.parquet estimates.csv
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.linalg import lstsq
from scipy.spatial.transform import Rotation

from inscal import earth, parameters, units

LATITUDE, HEIGHT = 39.98 * units.DEGREE, 50.0
GRAVITY, SPIN = earth.gravity_ned(LATITUDE, HEIGHT), earth.earth_rate_ned(LATITUDE)
GYRO_NOISE, ACCEL_NOISE = 0.0005 * units.DEG_PER_SQRT_HOUR, 5.0 * units.MICRO_G
UNIT = parameters.si_units(units.quadratic_unit(pulses_per_m_per_s=1673.84))
ROUNDS, STEP = 4, 0.01  # of Gauss and Newton; for derivatives, in printed units
STILL = 0.5 * units.DEGREE  # rad/s: less is a dwell
SIZE = np.concatenate([UNIT, [units.ARCSEC] * 3])  # of the unknowns: attitude at the start is last


class Record:
    """Increments of a run, sample by sample in turns, and whole dwells."""

    def __init__(self, table: pd.DataFrame):
        time = table["time"].to_numpy()
        step = time[1] - time[0]
        angle, velocity = (
            table[[f"{name}_{axis}" for axis in "xyz"]].to_numpy() for name in ("gyro", "accel")
        )
        turning = np.linalg.norm(angle, axis=1) > STILL * step
        edges = np.flatnonzero(np.diff(turning, prepend=False)) if not turning[0] else None
        if edges is None or turning[-1] or len(edges) % 2:
            raise SystemExit("a run must begin and end with a dwell")
        starts, ends = edges.reshape(-1, 2).T
        length = (ends - starts).max()
        place = starts[:, None] + np.arange(length)  # turns side by side, the shorter ones padded
        inside = (place < ends[:, None])[..., None]
        place = np.minimum(place, len(time) - 1)
        self.step, self.turn_time = step, (ends - starts) * step
        self.turn_angle, self.turn_velocity = angle[place], velocity[place]
        self.inside = inside
        dwells = list(zip([0, *ends], [*starts, len(time)], strict=True))
        self.dwell_time = np.array([(b - a) * step for a, b in dwells])
        self.dwell_angle = np.array([angle[a:b].sum(axis=0) for a, b in dwells])
        self.dwell_velocity = np.array([velocity[a:b].sum(axis=0) for a, b in dwells])


def compensated(p: np.ndarray, angle: np.ndarray, velocity: np.ndarray, dt: np.ndarray):
    """Increments corrected by 27 parameters, as docs/method.md has it."""
    rate, force = angle / dt, velocity / dt
    gyro, accel = np.eye(3), np.eye(3)
    columns, rows = np.triu_indices(3)
    gyro[rows, columns] += p[6:12]
    accel += p[12:21].reshape(3, 3).T
    rate = rate @ gyro.T + p[0:3]
    squared = np.square(rate)
    arms = (squared.sum(axis=-1, keepdims=True) - squared) * p[24:27]
    force = (force + p[21:24] * np.square(force)) @ accel.T + p[3:6] + arms
    return rate * dt, force * dt


def misfit(unknown: np.ndarray, run: Record, attitude: np.ndarray) -> np.ndarray:
    """What a set of unknowns leaves unexplained, in sigmas."""
    p, off = np.split(unknown * SIZE, [27])
    first, force = compensated(p, run.dwell_angle, run.dwell_velocity, run.dwell_time[:, None])
    angle, velocity = compensated(p, run.turn_angle, run.turn_velocity, run.step)
    angle, velocity = angle * run.inside, velocity * run.inside
    turn, moved = np.broadcast_to(np.eye(3), (len(angle), 3, 3)), np.zeros((len(angle), 3))
    for k in range(angle.shape[1]):  # all turns at once: each from its own start
        half = Rotation.from_rotvec(0.5 * angle[:, k]).as_matrix()
        moved = moved + (turn @ half @ velocity[:, k, :, None])[..., 0]
        turn = turn @ half @ half
    now = Rotation.from_rotvec(off).as_matrix() @ attitude
    level, ended = [], []
    for k, time in enumerate(run.dwell_time):
        half = Rotation.from_rotvec(0.5 * first[k]).as_matrix()
        of_earth = Rotation.from_rotvec(-0.5 * SPIN * time).as_matrix()
        level.append(of_earth @ now @ half @ force[k] / time + GRAVITY)
        now = of_earth @ of_earth @ now @ half @ half
        if k < len(turn):
            time = run.turn_time[k]
            of_earth = Rotation.from_rotvec(-0.5 * SPIN * time).as_matrix()
            ended.append(of_earth @ now @ moved[k] + GRAVITY * time)
            now = of_earth @ of_earth @ now @ turn[k]
    level, ended = np.array(level), np.array(ended)
    time = run.dwell_time[:, None]
    noise = ACCEL_NOISE / np.sqrt(time)
    drift = np.hypot(GRAVITY[2] * GYRO_NOISE * np.sqrt(time), noise)  # of the level, dwell to dwell
    # what a turn adds is known about the level that dwells show, not the one it is said to have
    about = 0.5 * (level[1:] + level[:-1]) * run.turn_time[:, None]
    in_turn = ACCEL_NOISE * np.sqrt(run.turn_time[:, None])
    return np.concatenate(
        [
            level[:, 2] / noise[:, 0],
            (np.diff(level[:, :2], axis=0) / drift[1:]).ravel(),
            level[0, :2] / drift[0],
            ((ended - about) / in_turn).ravel(),
        ]
    )


def calibrate(run: Record) -> tuple[np.ndarray, np.ndarray]:
    """Parameters and their sigmas, SI."""
    force, rate = run.dwell_velocity[0], run.dwell_angle[0]
    body, ned = (np.stack([a, np.cross(a, b)]) for a, b in ((-force, rate), (GRAVITY, SPIN)))
    unit = [v / np.linalg.norm(v, axis=1, keepdims=True) for v in (ned, body)]
    attitude = Rotation.align_vectors(*unit)[0].as_matrix()
    x = np.zeros(30)
    for _ in range(ROUNDS):
        left = misfit(x, run, attitude)
        moved = [misfit(x + step, run, attitude) - left for step in np.diag(np.full(30, STEP))]
        slope = np.array(moved).T / STEP
        x -= lstsq(slope, left)[0]
    sigma = np.sqrt(np.diag(np.linalg.pinv(slope.T @ slope)))
    return x[:27] * UNIT, sigma[:27] * UNIT


def main() -> None:
    """Calibrate every log, and write the table."""
    *logs, out = sys.argv[1:]
    rows = []
    for log in sorted(logs):
        estimate, sigma = calibrate(Record(pd.read_parquet(log)))
        row = {"run": int(Path(log).stem.rsplit("-", 1)[1])}
        for name, value, std, unit in zip(parameters.NAMES, estimate, sigma, UNIT, strict=True):
            row |= {name: value / unit, f"{name}_std": std / unit}
        rows.append(row)
        print(f"{log}: gyro_bias_x {row['gyro_bias_x']:.5f} +- {row['gyro_bias_x_std']:.5f} deg/h")
    pd.DataFrame(rows).to_csv(out, index=False)


if __name__ == "__main__":
    main()
