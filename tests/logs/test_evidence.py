"""What speaks against a calibration without truth, and what of a log is told or refused besides."""

import json
import zlib

import numpy as np
import pandas as pd
import pytest
import yaml
from campaigns import run_stage
from log_case import PATH, calibrate_it

from inscal.calibrator import empty_history
from inscal.chance import too_long_p
from inscal.disturbance import draw_constants
from inscal.experiment import tiles
from inscal.innovations import whiten
from inscal.path import path_of
from inscal.record_tests import scores, traces_of
from inscal.response import response
from inscal.state_model import build_transitions
from inscal.suspects import suspects
from pipeline import calibrate, navigate, noise
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.logs.checked import read_increments
from pipeline.logs.evidence import evidence
from pipeline.logs.header import read_header

NARROW = "calibration.prior_factor=1"


def changed(log, folder, change=None, **keys):
    """Header of a log with other rows and other keys."""
    header = yaml.safe_load(log.read_text()) | keys
    frame = pd.read_parquet(log.with_suffix(".parquet"))
    if change is not None:
        change(frame)
    frame.to_parquet(folder / "run.parquet", index=False)
    (folder / "run.yaml").write_text(yaml.safe_dump({k: v for k, v in header.items() if v}))
    return folder / "run.yaml"


def judged_log(header, *overrides):
    config = load([*PATH, f"log={header}", NARROW, *overrides])
    return evidence(calibrate_it(f"log={header}", NARROW, *overrides), config)


def test_nothing_speaks_against_a_right_filter(log):
    tests = judged_log(log)
    assert len(tests.tests) > 90
    assert {one.kind for one in tests.tests} == {"whiteness", "position", "suspect", "halves"}
    assert tests.found == []
    assert tests.alike == {}
    assert tests.ratio == pytest.approx(1.0, abs=0.05)
    assert tests.findable["gravity"] is None
    size, unit = tests.findable["gyro_accel_delay"]
    assert unit == "ms"
    assert 0.0 < size < 1.0


def test_a_bias_that_steps_is_found_and_named(log, tmp_path):
    def step(frame):
        half = len(frame) // 2
        frame.loc[half:, "accel_x"] += 30.0 * 9.80665e-6 / 20.0  # ug, at 20 Hz

    tests = judged_log(changed(log, tmp_path, step))
    kinds = {one.kind for one in tests.found}
    assert {"suspect", "halves"} <= kinds
    halves = {one.name for one in tests.found if one.kind == "halves"}
    assert {"all", "accel_bias_x"} <= halves
    assert tests.alike["halves"][0].name in ("accel_wander", "accel_bias_x_drift")
    assert tests.alike["halves"][0].unit == "ug"
    assert 5.0 < tests.alike["halves"][0].size < 150.0


def test_a_delay_is_found_as_one(log, tmp_path):
    def late(frame):
        ahead = np.roll(frame[["accel_x", "accel_y", "accel_z"]].to_numpy(), 1, axis=0)
        ahead[0] = ahead[1]
        share = 0.02  # of 50 ms
        for place, name in enumerate(("accel_x", "accel_y", "accel_z")):
            frame[name] = (1.0 - share) * frame[name] + share * ahead[:, place]

    tests = judged_log(changed(log, tmp_path, late), "calibration.halves=false")
    suspects_found = [one.name for one in tests.found if one.kind == "suspect"]
    assert suspects_found[0] == "gyro_accel_delay"


def test_two_calibrations_are_compared(log, tmp_path):
    out = tmp_path / "first.json"
    first = run_stage(calibrate, *PATH, f"log={log}", NARROW, f"out={out}")
    assert first.code == 0, first.err
    again = judged_log(log, f"calibration.compare_to={out}")
    assert not [one for one in again.tests if one.kind == "other" and one.found]

    def other_scale(frame):
        frame["accel_z"] *= 1.0 + 200e-6

    page = tmp_path / "second.json"
    second = run_stage(
        calibrate, *PATH, NARROW, f"out={page}", f"calibration.compare_to={out}",
        f"log={changed(log, tmp_path, other_scale)}",
    )  # fmt: skip
    assert second.code == 0, second.err
    data = json.loads(page.read_text())
    moved = {one["name"] for one in data["tests"] if one["kind"] == "other" and one["found"]}
    assert "accel_k33" in moved
    assert "the two calibrations" in page.with_suffix(".md").read_text()


@pytest.mark.parametrize(
    ("text", "said"), [(None, "not found"), ("{}", "must be what this stage wrote"), ("x", "JSON")]
)
def test_what_is_no_calibration_is_not_compared_with(log, tmp_path, text, said):
    path = tmp_path / "other.json"
    if text is not None:
        path.write_text(text)
    ended = run_stage(calibrate, *PATH, f"log={log}", NARROW, f"calibration.compare_to={path}")
    assert ended.code == 2
    assert said in ended.err
    assert len(ended.err.strip().splitlines()) == 1


def test_rests_that_are_left_out_are_foretold(log, found):
    left_out = [4, 9, 14]
    less = calibrate_it(f"log={log}", NARROW, f"calibration.left_out={left_out}")
    assert (less.std > found.std).all()
    from pipeline.logs.result import force_less_gravity

    force = force_less_gravity(less)
    assert len(force) == 19
    assert np.abs(force[[n - 1 for n in left_out]]).max() < 1e-4  # 10 ug


def test_another_schedule_is_told(log, tmp_path):
    turns = yaml.safe_load((log.parent / "run.yaml").read_text())["schedule"]
    assert turns == "position19"
    path = changed(log, tmp_path, schedule="position25")
    ended = run_stage(calibrate, *PATH, f"log={path}", NARROW)
    assert ended.code == 2
    assert "18 turns in all; the schedule position25 has 24" in ended.err

    def backwards(frame):
        axes = [
            name for name in frame if name.startswith(("gyro_x", "accel_x", "gyro_z", "accel_z"))
        ]
        frame[axes] *= -1.0  # turned by half a turn about y

    path = changed(log, tmp_path, backwards)
    ended = run_stage(calibrate, *PATH, f"log={path}", NARROW)
    assert ended.code == 2
    assert "position 4: expected +90 about Z, saw -90 about Z" in ended.err
    path = changed(log, tmp_path, schedule="nothing")
    assert "the header's schedule" in run_stage(calibrate, *PATH, f"log={path}", NARROW).err


def test_an_observation_that_is_missing_is_told(log, tmp_path):
    def gap(frame):
        frame.loc[59, "velocity_e"] = np.nan  # the third second at 20 Hz

    ended = run_stage(calibrate, *PATH, f"log={changed(log, tmp_path, gap)}", NARROW)
    assert ended.code == 2
    assert "row 60, 3 s: no observation" in ended.err


def test_the_header_is_never_written_over(log):
    before = log.read_text()
    ended = run_stage(calibrate, *PATH, f"log={log}", NARROW, f"out={log.with_suffix('.json')}")
    assert ended.code == 2
    assert "would be replaced, and no stage wrote it" in ended.err
    assert log.read_text() == before


# formats


def as_novatel(frame):
    """The same increments as messages of counts."""
    lines = ["<OK", "#BESTPOSA,COM1,0,1;SOL_COMPUTED*12345678"]
    scale = 2.0**-33
    for row in frame.itertuples():
        week, second = 2209, 100.0 + row.time
        six = [row.accel_z, -row.accel_y, row.accel_x, row.gyro_z, -row.gyro_y, row.gyro_x]
        counts = ",".join(str(round(value / scale)) for value in six)
        text = f"RAWIMUSXA,{week},{second:.3f};04,41,{week},{second:.9f},ea59fe00,{counts}"
        crc = zlib.crc32(text.encode(), 0xFFFFFFFF) ^ 0xFFFFFFFF
        lines.append(f"%{text}*{crc:08x}")
    return lines


def test_messages_of_a_receiver_are_read_and_checked(log, tmp_path):
    frame = pd.read_parquet(log.with_suffix(".parquet")).iloc[:400]
    lines = as_novatel(frame)
    about = {"data": "x.asc", "format": "novatel", "latitude_deg": 39.98}
    about |= {"gyro_scale": 2.0**-33, "accel_scale": 2.0**-33}
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(about))
    (tmp_path / "x.asc").write_text("\n".join(lines))
    record = read_increments(read_header(tmp_path / "x.yaml"))
    assert record.interval == pytest.approx(0.05)
    expected = frame[["gyro_x", "gyro_y", "gyro_z"]].to_numpy()
    np.testing.assert_allclose(record.angle, expected, atol=1e-10)
    for bad, said in (
        (lines[10].replace(",ea59fe00,", ",ea59fe00,9"), "line 11: its checksum"),
        (lines[10][:-4], "line 11: cut short"),
    ):
        (tmp_path / "x.asc").write_text("\n".join([*lines[:10], bad, *lines[11:]]))
        ended = run_stage(calibrate, f"log={tmp_path / 'x.yaml'}")
        assert ended.code == 2
        assert said in ended.err


def test_counts_have_a_zero_and_binary_numbers_are_read(log, tmp_path):
    frame = pd.read_parquet(log.with_suffix(".parquet")).iloc[:400]
    seven = ["time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    values = frame[seven].to_numpy()
    shifted = values + np.r_[0.0, np.full(3, 5.0), np.full(3, 7.0)]
    shifted.astype("<f8").tofile(tmp_path / "x.bin")
    about = {"data": "x.bin", "format": "float64", "latitude_deg": 39.98}
    about |= {"gyro_offset": 5.0, "accel_offset": 7.0}
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(about))
    record = read_increments(read_header(tmp_path / "x.yaml"))
    np.testing.assert_allclose(record.angle, values[:, 1:4], atol=1e-14)
    np.testing.assert_allclose(record.velocity, values[:, 4:7], atol=1e-14)


# stages beside it


def test_noise_of_a_rest_becomes_configuration(log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "noise.json"
    ended = run_stage(noise, *PATH, f"log={log}", "name=found", f"out={out}")
    assert ended.code == 0, ended.err
    data = json.loads(out.read_text())
    true = {"gyro": 0.0002, "accel": 2.0}  # of the group quiet
    for sensor, size in true.items():
        white = data[sensor]["white"]
        for low, high in zip(white["lower"], white["upper"], strict=True):
            assert low < size < high
    settings = yaml.safe_load((tmp_path / "conf/noise/found.yaml").read_text())
    assert settings["gyro_angle_random_walk_deg_per_sqrt_h"] == pytest.approx(0.0002, rel=0.2)
    assert yaml.safe_load((tmp_path / "conf/disturbance/found.yaml").read_text())["name"] == "found"
    assert "Allan deviation" in out.with_suffix(".md").read_text()
    assert run_stage(noise, *PATH, f"log={log}", "name=found").code == 0  # its own files
    (tmp_path / "conf/noise/found.yaml").write_text("name: mine\n")
    ended = run_stage(noise, *PATH, f"log={log}", "name=found")
    assert ended.code == 2
    assert (tmp_path / "conf/noise/found.yaml").read_text() == "name: mine\n"


def test_compensation_makes_free_navigation_better(log, tmp_path):
    out = tmp_path / "found.json"
    assert run_stage(calibrate, *PATH, f"log={log}", NARROW, f"out={out}").code == 0
    flight = tmp_path / "flight.json"
    both = f"log={log}", f"compensation={out.with_suffix('.yaml')}"
    ended = run_stage(navigate, *both, f"out={flight}")
    assert ended.code == 0, ended.err
    data = json.loads(flight.read_text())
    size = {name: np.abs(data[name]["position_m"]).max() for name in ("without", "with")}
    assert size["with"] < 0.01 * size["without"]
    assert flight.with_suffix(".png").is_file()
    for text, said in (("a: [", "readable"), ("x: 1", "parameter"), ("gyro_k11: north", "number")):
        (tmp_path / "x.yaml").write_text(text)
        ended = run_stage(navigate, f"log={log}", f"compensation={tmp_path / 'x.yaml'}")
        assert ended.code == 2
        assert said in ended.err


# how much is found, of whole runs at the reference case


def injected(runs, *overrides):
    """P-values of suspects in the second pass of so many runs, and the runs' delays."""
    setup = Setup(load(list(overrides)))
    experiment, belief = setup.experiment, setup.belief
    steps = setup.config.simulation
    path = path_of(
        setup.schedule, setup.site, update_interval=belief.update_interval,
        dwell_step=steps.dwell_step_s, turn_step=steps.turn_step_s,
    )  # fmt: skip
    transitions = build_transitions(
        setup.schedule, setup.site, belief.model, belief.noise,
        update_interval=belief.update_interval,
    )  # fmt: skip
    every = suspects(path, response(path, belief.update_interval), belief.model)
    traces = traces_of(experiment.estimator, 1, transitions, belief, every)
    history = empty_history(2, experiment.motion.updates, estimates=False)
    p = {name: [] for name, one in traces.suspects.items() if one.dof}
    for _, truth, _ in tiles(experiment, range(runs), history=history):
        unit = whiten(
            history.innovation[1, :, :, : len(truth)],
            experiment.estimator.gains(1).innovation_covariance,
        )
        for name, total in scores(traces, unit).items():
            if name in p:
                p[name].append(too_long_p(total, traces.suspects[name].dof))
    return setup, {name: np.concatenate(values) for name, values in p.items()}


def test_a_microgram_of_wander_and_a_tenth_of_a_millisecond_are_found():
    """At 1 % false alarms of all suspects together, in 95 % of runs and more."""
    runs = 128
    _, p = injected(runs, "disturbance.accel_wander_ug=1", "disturbance.accel_wander_time_s=1000")
    level = 0.01 / len(p)
    assert (p["accel_wander"] < level).mean() >= 0.95
    setup, p = injected(runs, "disturbance.gyro_accel_delay_ms=0.1")
    delay = draw_constants(
        setup.experiment.truth.disturbance,
        "gyro_accel_delay",
        len(setup.schedule.turns),
        seed=setup.config.campaign.seed,
        runs=range(runs),
    )[0]
    large = np.abs(delay) >= 1e-4
    assert large.sum() > 25
    assert (p["gyro_accel_delay"][large] < level).all()


def test_a_right_filter_is_seldom_suspected():
    """By chance in 1 % of runs: five of 128 are so with a probability of 1 %."""
    _, p = injected(128)
    alarms = (np.array(list(p.values())) < 0.01 / len(p)).any(axis=0).sum()
    assert alarms <= 5
