"""Logs: exported runs calibrated, frames, and damaged logs refused in one line."""

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from campaigns import run_stage
from log_case import PATH, RATE, RUN, calibrate_it
from scipy.spatial.transform import Rotation

from inscal.frames import ARMS, in_accelerometer_frame
from inscal.parameters import NAMES
from inscal.record_filter import calibrate_record
from inscal.recorded import Increments, aligned, stretches
from inscal.sensor import matrices
from pipeline import calibrate, export
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.logs.checked import read_increments
from pipeline.logs.exported import frames
from pipeline.logs.header import read_header
from pipeline.logs.result import force_less_gravity


def test_an_exported_run_gives_its_truth_within_its_sigmas(found):
    from inscal.simulation import draw_truth

    setup = Setup(load([*PATH]))
    truth = draw_truth(setup.truth, setup.config.campaign.seed, RUN)
    deviation = (found.outcome.estimate - truth) / found.outcome.estimator.predicted_std
    assert np.abs(deviation).max() < 4.5  # of 27 normal ones
    assert 8.0 < np.sum(deviation**2) < 60.0
    assert found.given == [True] * 27
    assert found.parameter == list(NAMES)
    assert len([part for part in found.outcome.parts if not part.turns]) == 19


def test_a_log_gives_what_the_run_in_memory_does_bit_for_bit(found, log):
    [(number, frame)] = frames(load([*PATH, f"only_run={RUN}"]))
    assert number == RUN
    values = frame.to_numpy()
    record = Increments(1.0 / RATE, *(values[:, a:b].copy() for a, b in ((1, 4), (4, 7), (7, 13))))
    from pipeline.logs.calibration import _belief

    config = load([*PATH, "calibration.prior_factor=1"])
    site = found.outcome.path.site
    again = calibrate_record(
        record, stretches(record), site, _belief(config), rounds=config.calibration.rounds
    )
    assert again.estimate.tobytes() == found.outcome.estimate.tobytes()


def test_csv_is_as_good_and_many_runs_have_their_numbers(log, tmp_path):
    path = tmp_path / "run.csv"
    short = ("schedule=position19", "schedule.position_duration_s=20", "rate_hz=10")
    ended = run_stage(export, *short, "runs=2:4", f"log={path}")
    assert ended.out.split() == [str(tmp_path / f"run-00000{n}.yaml") for n in (2, 3)]
    read = read_increments(read_header(tmp_path / "run-000003.yaml"))
    both = dict(frames(load([*short, "runs=2:4"])))
    assert read.angle.tobytes() == both[3].to_numpy()[:, 1:4].tobytes()


def test_the_stage_writes_estimates_page_and_compensation(log, tmp_path):
    out = tmp_path / "found.json"
    ended = run_stage(
        calibrate, *PATH, f"log={log}", f"out={out}", "calibration.frame=accelerometer"
    )
    assert ended.code == 0, ended.err
    data = json.loads(out.read_text())
    assert {"parameter", "unit", "estimate", "std", "given", "dwells", "from_s", "to_s"} <= set(
        data
    )
    assert data["dwells"] == 19
    assert len(data["from_s"]) == len(data["to_s"]) == 19
    assert "gyro_k12" in data["parameter"]
    assert "accel_k12" not in data["parameter"]
    compensation = yaml.safe_load(out.with_suffix(".yaml").read_text())
    assert list(compensation) == list(NAMES)
    assert "19 rests and 18 turns" in out.with_suffix(".md").read_text()


def test_another_frame_reports_the_same():
    """What sensors report of any motion does not depend on the frame that describes them."""
    rng = np.random.default_rng(4)
    values = dict(zip(NAMES, 1e-3 * rng.standard_normal(27), strict=True))
    values |= {f"lever_arm_{end}": rng.standard_normal() for end in ARMS}
    values["gyro_accel_delay"] = 1e-3
    other = in_accelerometer_frame(values)
    gyro, accel = np.linalg.inv(np.eye(3) + matrices(np.array([[values[n]] for n in NAMES]))[:, 0])
    own = np.eye(3) + np.array(
        [[other.get(f"accel_k{i}{j}", 0.0) for j in (1, 2, 3)] for i in (1, 2, 3)]
    )
    theirs = np.eye(3) + np.array([[other[f"gyro_k{i}{j}"] for j in (1, 2, 3)] for i in (1, 2, 3)])
    turned = np.linalg.solve(own, accel)  # from the gyros' axes
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
    assert Rotation.from_matrix(turned).magnitude() < 0.01
    np.testing.assert_allclose(theirs @ turned, gyro, atol=1e-12)
    bias = gyro @ [values[f"gyro_bias_{a}"] for a in "xyz"]
    np.testing.assert_allclose([other[f"gyro_bias_{a}"] for a in "xyz"], bias, atol=1e-15)
    arms = np.array([values[f"lever_arm_{end}"] for end in ARMS]).reshape(3, 3)
    from_z = np.array([other[f"lever_arm_{end}"] for end in ARMS[:3]])
    np.testing.assert_allclose(turned.T @ from_z, arms[2] - arms[0], atol=1e-12)


def test_alignment_is_the_posture_s(log):
    record = read_increments(read_header(log))
    site = Setup(load([*PATH])).site
    attitude = aligned(record, stretches(record)[0], site)
    assert Rotation.from_matrix(attitude).magnitude() < np.deg2rad(1.0)


# damage


def _set(column, row, value):
    def change(frame, header):
        frame.iloc[row, frame.columns.get_loc(column)] = value

    return change


def _scaled(columns, factor):
    def change(frame, header):
        frame[columns] *= factor

    return change


def _drop(*rows):
    return lambda frame, header: frame.drop(index=list(rows))


def _swap(one, other):
    def change(frame, header):
        frame[[one, other]] = frame[[other, one]].to_numpy()

    return change


def _head(**keys):
    def change(frame, header):
        header.update(keys)

    return change


def _clip(column, limit):
    def change(frame, header):
        frame[column] = frame[column].clip(-limit, limit)

    return change


GYROS, ACCELS = ["gyro_x", "gyro_y", "gyro_z"], ["accel_x", "accel_y", "accel_z"]
G = 9.80665
DAMAGE = {
    **{f"NaN in {c}": (_set(c, 700, np.nan), "row 701") for c in (*GYROS, *ACCELS, "time")},
    **{f"infinity in {c}": (_set(c, 5, np.inf), "row 6") for c in ("gyro_y", "accel_z")},
    "gap of a row": (_drop(400), "rows are missing"),
    "gap of many rows": (_drop(*range(400, 600)), "row 401"),
    "repeated time": (_set("time", 300, 300 / RATE), "row 301"),
    "time goes back": (_set("time", 300, 1.0), "time goes back"),
    "late row": (_set("time", 300, 301.6 / RATE), "rows are missing"),
    "early row": (_set("time", 301, 301.4 / RATE), "row 303"),
    "first time late": (_set("time", 0, -5.0), "row 2"),
    "degrees for radians": (_scaled(GYROS, 180 / np.pi), "gyros say"),
    "radians for degrees": (_head(gyro_unit="deg"), "row"),
    "arcsec for radians": (_head(gyro_unit="arcsec"), "row"),
    "g for m/s^2": (_scaled(ACCELS, 1 / G), "accel_unit"),
    "a factor of 9.8": (_scaled(ACCELS, G), "accel_unit"),
    "rates for increments": (_head(gyro_unit="rad/s", accel_unit="m/s^2"), "row"),
    "milli-g": (_head(accel_unit="mg"), "accel_unit"),
    "gyro scale": (_head(gyro_scale=1.1), "gyros say"),
    "accelerometer scale": (_head(accel_scale=0.9), "accel_scale"),
    "gyros x and y swapped": (_swap("gyro_x", "gyro_y"), "gyros say"),
    "gyros y and z swapped": (_swap("gyro_y", "gyro_z"), "gyros say"),
    "accelerometers x and z swapped": (_swap("accel_x", "accel_z"), "gyros say"),
    "one gyro reversed": (_scaled(["gyro_y"], -1.0), "gyros say"),
    "all gyros reversed": (_scaled(GYROS, -1.0), "gyros say"),
    "left-handed axes": (_head(axes=["x", "y", "-z"]), "right-handed"),
    "two axes alike": (_head(axes=["x", "x", "z"]), "axes"),
    "no such axis": (_head(axes=["x", "y", "w"]), "axes"),
    "down for up": (_scaled(ACCELS, -1.0), "latitude"),
    "saturated gyro": (_clip("gyro_y", 0.1 / RATE), "saturated"),
    "saturated accelerometer": (_clip("accel_z", 9.0 / RATE), "row"),
    "wrong site": (_head(latitude_deg=49.98), "latitude"),
    "wrong hemisphere": (_head(latitude_deg=-39.98), "latitude"),
    "no latitude": (_head(latitude_deg="north"), "latitude_deg"),
    "latitude beyond the pole": (_head(latitude_deg=99), "latitude_deg"),
    "missing column": (lambda f, h: f.drop(columns="accel_y"), "no column accel_y"),
    "missing time": (lambda f, h: f.drop(columns="time"), "no column time"),
    "no rows": (lambda f, h: f.iloc[:0], "0 rows"),
    "no format": (_head(format="telepathy"), "format"),
    "unknown unit": (_head(gyro_unit="gon"), "gyro_unit"),
    "unknown key": (_head(latitude=3), "latitude"),
    "negative rate": (_head(rate_hz=-5), "rate_hz"),
    "other rate": (_head(rate_hz=50), "row 2"),
    "no file": (_head(data="nothing.parquet"), "not found"),
    "two files": (_head(data=["a.parquet", "b.parquet"]), "data"),
}


@pytest.mark.parametrize("name", list(DAMAGE))
def test_a_damaged_log_is_refused_in_one_line(log, tmp_path, name):
    change, said = DAMAGE[name]
    header = yaml.safe_load(log.read_text())
    frame = pd.read_parquet(log.with_suffix(".parquet"))
    changed = change(frame, header)
    frame = frame if changed is None else changed
    frame.to_parquet(tmp_path / "run.parquet", index=False)
    (tmp_path / "run.yaml").write_text(yaml.safe_dump(header))
    before = sorted(tmp_path.iterdir())
    ended = run_stage(
        calibrate, *PATH, f"log={tmp_path / 'run.yaml'}", f"out={tmp_path / 'x.json'}"
    )
    assert ended.code == 2, name
    assert said in ended.err, ended.err
    assert len(ended.err.strip().splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("text", [b"", b"\xff\xfe\x00", b"a: [", b"- 1", b"data: x.csv\n"])
def test_what_is_no_header_is_said_to_be_none(tmp_path, text):
    (tmp_path / "x.yaml").write_bytes(text)
    ended = run_stage(calibrate, f"log={tmp_path / 'x.yaml'}")
    assert ended.code == 2
    assert len(ended.err.strip().splitlines()) == 1


def test_binary_that_is_cut_short_is_no_log(tmp_path):
    (tmp_path / "x.bin").write_bytes(b"\0" * 29)
    about = {"data": "x.bin", "format": "psins_bin", "latitude_deg": 1.0}
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(about))
    ended = run_stage(calibrate, f"log={tmp_path / 'x.yaml'}")
    assert (ended.code, "cut short" in ended.err) == (2, True)


# a peer's record

TRUTH = {
    **{"gyro_k11": -10, "gyro_k12": 10, "gyro_k13": 20, "gyro_k21": 30, "gyro_k22": -20},
    **{"gyro_k23": 40, "gyro_k31": 50, "gyro_k32": 60, "gyro_k33": -30},
    **{"accel_k11": -10, "accel_k21": 10, "accel_k22": -20, "accel_k31": 20, "accel_k32": 30},
    **{"accel_k33": -30, "gyro_bias_x": 0.1, "gyro_bias_y": 0.2, "gyro_bias_z": 0.3},
    **{"accel_quadratic_x": 10, "accel_quadratic_y": 20, "accel_quadratic_z": 30},
    **{"lever_arm_x": 10, "lever_arm_xy": 20, "lever_arm_xz": 30},
    **{"lever_arm_yx": 40, "lever_arm_y": 50, "lever_arm_yz": 60},
}
WITHIN = {"deg/h": 1e-4, "ppm": 0.1, "arcsec": 0.1, "ug": 0.2, "ug/g^2": 0.1, "mm": 0.3}
DATA = os.environ.get("INSCAL_DATA")


@pytest.mark.skipif(DATA is None, reason="INSCAL_DATA names no folder of recordings")
def test_a_peer_s_record_gives_the_peer_s_truth(tmp_path):
    about = {"data": str(Path(DATA) / "psins_imusysclbt.bin"), "format": "psins_bin"}
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(about | {"latitude_deg": 34.0}))
    options = ["estimator=states43", "noise=quiet", "calibration.frame=accelerometer"]
    found = calibrate_it(*options, f"log={tmp_path / 'x.yaml'}", path=())
    rows = dict(zip(found.parameter, zip(found.estimate, found.unit, strict=True), strict=True))
    for name, truth in TRUTH.items():
        value, unit = rows[name]
        assert abs(value - truth) < WITHIN[unit], name
    # without a filter: up and down of an axis add up to twice bias and quadratic term
    record, up, down = found.log.record, [], []
    for part in found.outcome.parts:
        if not part.turns:
            force = record.velocity[part.first : part.end].mean(axis=0) / record.interval
            (up if force[0] > 9.0 else down if force[0] < -9.0 else []).append(force[0])
    both = -0.5 * (np.mean(up) + np.mean(down)) / 9.80665e-6
    assert both == pytest.approx(rows["accel_bias_x"][0] + rows["accel_quadratic_x"][0], abs=0.2)


@pytest.mark.skipif(DATA is None, reason="INSCAL_DATA names no folder of recordings")
def test_dirty_recordings_are_read_or_refused(tmp_path):
    about = {"data": str(Path(DATA) / "psins_lasergyro.imu"), "format": "psins_imu"}
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(about | {"latitude_deg": 34.2}))
    record = read_increments(read_header(tmp_path / "x.yaml"))
    assert record.interval == pytest.approx(0.01, rel=1e-3)
    force = np.linalg.norm(record.velocity.mean(axis=0)) / record.interval
    assert force == pytest.approx(9.8, rel=0.02)


def test_only_velocity_at_rest_knows_less(log, found, tmp_path):
    header = yaml.safe_load(log.read_text()) | {"observation": "velocity_at_rest"}
    header["data"] = str(log.with_suffix(".parquet"))
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(header))
    less = calibrate_it(f"log={tmp_path / 'x.yaml'}", "calibration.prior_factor=1")
    assert (less.std > found.std).all()
    setup = Setup(load([*PATH]))
    from inscal.simulation import draw_truth

    truth = draw_truth(setup.truth, setup.config.campaign.seed, RUN)
    deviation = (less.outcome.estimate - truth) / less.outcome.estimator.predicted_std
    assert np.abs(deviation).max() < 4.5
    assert dataclasses.asdict(less.log.header)["observation"] == "velocity_at_rest"


def test_states_that_are_named_after_another_source_have_its_unit(log):
    """A group's name, that of its states and that of its source may all differ."""
    groups = "[gyro_bias,accel_bias,gyro_k,accel_k,accel_quadratic,lever_arm,accel_cross]"
    found = calibrate_it(f"log={log}", f"estimator.states={groups}")
    units = dict(zip(found.parameter, found.unit, strict=True))
    assert units["accel_cross_xy"] == units["accel_cross_zy"] == "ug/g^2"


@pytest.mark.skipif(DATA is None, reason="INSCAL_DATA names no folder of recordings")
def test_a_unit_turned_by_hand_gives_the_published_scales(tmp_path):
    """Of 38 rests seven are left out, and foretold."""
    about = {
        "data": [str(Path(DATA) / f"imu_tk_xsens_{kind}.mat") for kind in ("acc", "gyro")],
        **{"format": "counts", "latitude_deg": 45.4, "observation": "velocity_at_rest"},
        **{"gyro_unit": "rad/s", "gyro_scale": 1 / 5000, "gyro_offset": 32768, "rate_hz": 100},
        **{"accel_unit": "m/s^2", "accel_scale": 1 / 400, "accel_offset": 32768},
    }
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(about))
    options = ("estimator=mems", "noise=mems", "calibration.first_guess=true")
    options = (*options, "calibration.prior_factor=1", f"log={tmp_path / 'x.yaml'}")
    found = calibrate_it(*options, "calibration.left_out=[5,10,15,20,25,30,35]", path=())
    assert len(found.log.rests) >= 35
    value = dict(zip(found.parameter, found.estimate, strict=True))
    for axis in "123":
        assert 405 < 400 / (1.0 + 1e-6 * value[f"accel_k{axis}{axis}"]) < 425
        assert 4600 < 5000 / (1.0 + 1e-6 * value[f"gyro_k{axis}{axis}"]) < 4950
    force = force_less_gravity(found)
    assert np.abs(force[4:35:5]).max() < 0.05
