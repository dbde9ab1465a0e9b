"""Verdicts of the effect studies, of the convergence and of the virtual laboratory experiment."""

import dataclasses

import numpy as np
import pytest

from inscal.effects import Course
from inscal.free_inertial import Flight, fly
from inscal.motion import build_motion
from inscal.parameters import COUNT, INDEX, si_units
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.paper import convergence as paper_convergence
from pipeline.paper import effects as paper_effects
from pipeline.paper import laboratory_report as paper_laboratory_report
from pipeline.paper import laboratory_study as laboratory
from pipeline.paper.config import PROGRAM
from pipeline.paper.convergence import GROUPS, LEVER_ARM, QUADRATIC, settled_at
from pipeline.paper.effects import REST, SWING, VIBRATION
from pipeline.paper.laboratory_report import NAVIGATION_POSITION_ERROR_NMI, converged, reach_text
from pipeline.paper.laboratory_study import COMPENSATED, PERFECT, UNCOMPENSATED, Residual
from pipeline.paper.values import TABLE_4


@pytest.fixture(scope="module")
def reference():
    """Configuration of the reference case, with the groups of the paper's experiments."""
    return load([], PROGRAM)


# effects


def effect_study(config, vibration, swing, rest=0.0):
    """Study with given largest errors by the quadratic term and by the lever arm."""
    time = np.array([10.0, 20.0])

    def course(quadratic, lever_arm):
        return Course(time, np.array([[0.0, 0.0], [quadratic, lever_arm]]))

    return paper_effects.Study(
        config,
        {REST: course(rest, rest), VIBRATION: course(vibration, 0.0), SWING: course(0.0, swing)},
        {"X": course(0.0, 0.0), "Y": course(-1.0, 0.0)},
        {},
        1e-3,
    )


def words(verdicts):
    return [verdict.word for verdict in verdicts]


def test_effects_of_the_papers_size_are_met(reference):
    judged = paper_effects.judge(effect_study(reference, -2.48, -3.02))
    assert words(judged) == ["met"] * 6


def test_effects_of_another_size_or_in_another_place_are_not_met(reference):
    judged = paper_effects.judge(effect_study(reference, -1.5, 3.02, rest=0.028))
    found = {verdict.claim: verdict.word for verdict in judged}
    assert found["quadratic term in vibration: 2.5 m/s"] == "not met"
    assert found["inner lever arm in swing: 3 m/s"] == "met"
    # negligible is relative to what the same error makes elsewhere
    assert found["quadratic term in rest: negligible (under 0.025 m/s)"] == "not met"
    assert found["inner lever arm in rest: negligible (under 0.03 m/s)"] == "met"


def test_swings_that_tilt_are_named(reference):
    study = effect_study(reference, 2.5, 3.0)
    assert "1 m/s about Y" in paper_effects.other_swings_text(study)
    assert "about X" not in paper_effects.other_swings_text(study)


def test_effects_take_the_configured_errors_of_the_north_accelerometer(reference):
    truth = paper_effects.truths(reference)
    assert truth[INDEX["accel_quadratic"], 0] == pytest.approx([30 * 1673.84e-9, 0.0, 0.0])
    assert truth[INDEX["lever_arm"], 1] == pytest.approx([0.02, 0.0, 0.0])
    assert np.count_nonzero(truth) == 2


# convergence


def test_settled_is_from_the_last_time_outside_on():
    time = np.array([1.0, 2.0, 3.0, 4.0])
    assert settled_at(time, np.array([9.0, 0.0, 9.0, 0.0]), 1.0) == 4.0
    assert settled_at(time, np.array([9.0, 1.0, 1.0, 0.0]), 1.0) == 2.0
    assert settled_at(time, np.zeros(4), 1.0) == 1.0
    assert settled_at(time, np.array([0.0, 0.0, 0.0, 2.0]), 1.0) == np.inf


def convergence_study(config, quadratic_s, lever_arm_s):
    """All runs leave their bounds of 1 at given times."""
    time = np.arange(100.0, 12501.0, 100.0)
    ends = {QUADRATIC: quadratic_s, LEVER_ARM: lever_arm_s}
    error = {
        group: np.where(time < end, 5.0, 0.5)[:, None, None] * np.ones((1, 3, 8))
        for group, end in ends.items()
    }
    ones = {group: np.ones(3) for group in GROUPS}
    sigma = {group: np.ones((len(time), 3)) for group in GROUPS}
    return paper_convergence.Study(config, time, error, sigma, ones, 0)


@pytest.mark.parametrize(
    ("quadratic_s", "lever_arm_s", "expected"),
    [
        (4500.0, 10000.0, ["met", "met"]),
        (4500.0, 1500.0, ["met", "not met"]),
        (7000.0, 1e9, ["not met", "not met"]),
    ],
)
def test_claims_of_settling(reference, quadratic_s, lever_arm_s, expected):
    study = convergence_study(reference, quadratic_s, lever_arm_s)
    assert words(paper_convergence.judge(study)) == expected


def test_text_of_the_lever_arm_follows_when_it_settles(reference):
    early = paper_convergence.lever_arm_text(convergence_study(reference, 4500.0, 1500.0))
    late = paper_convergence.lever_arm_text(convergence_study(reference, 4500.0, 10000.0))
    assert "from 1500 s on, before the last turns begin" in early
    assert "needs the last turns" in late
    assert "factor of 10.00" in late


# laboratory


def test_coarse_scale_leaves_the_same_sensor(reference):
    """True rate and force from raw readings, with and without coarse factors, are the same."""
    coarse, pulses = [442000.0, 440000.0, 443000.0], [1673.0, 1670.0, 1716.0]
    unit = si_units(Setup(reference).quadratic_unit)
    left = laboratory.residual_truth(TABLE_4[0], coarse, pulses, unit)
    raw = laboratory.residual_truth(TABLE_4[0], [0.0] * 3, TABLE_4[0].accel_pulses, unit)
    reading = np.array([0.1, -0.2, 0.3])
    factor = 1.0 + 1e-6 * np.array(coarse)

    def gyro(truth):
        a = truth[INDEX["gyro_k"]]
        return np.array([[a[0], 0.0, 0.0], [a[1], a[3], 0.0], [a[2], a[4], a[5]]]) + np.eye(3)

    np.testing.assert_allclose(gyro(left) @ (factor * reading), gyro(raw) @ reading, rtol=1e-12)
    assert raw[INDEX["gyro_k"]][0] == pytest.approx(0.4424033)
    ratio = np.array(pulses) / np.array(TABLE_4[0].accel_pulses)
    matrices = [np.eye(3) + truth[INDEX["accel_k"]].reshape(3, 3).T for truth in (raw, left)]
    np.testing.assert_allclose(matrices[1], matrices[0] * ratio, rtol=1e-12)
    same = [i for i in range(COUNT) if i not in {*range(6, 21)}]
    np.testing.assert_array_equal(left[same], raw[same])


def test_perfect_sensors_stay_and_a_bias_does_not(reference):
    short = dataclasses.replace(
        reference.schedule, position_duration_s=60.0, rotations=reference.schedule.rotations[:3]
    )
    config, site = dataclasses.replace(reference, schedule=short), Setup(reference).site
    motion = build_motion(
        Setup(config).schedule, site, update_interval=1.0, dwell_step=1.0, turn_step=0.5
    )
    sensors = np.concatenate([motion.angle, motion.velocity], axis=1)[:, :, None].repeat(2, axis=2)
    known = np.zeros((COUNT, 2))
    known[INDEX["accel_bias"].start, 1] = 1e-3
    flight = fly(sensors, known, motion, site, every=10)
    assert np.abs(flight.velocity[..., 0]).max() < 1e-6
    assert np.abs(flight.position[..., 0]).max() < 1e-3
    # the bias points north for the first 51 s
    first = flight.time < 50.0
    np.testing.assert_allclose(flight.velocity[first, 0, 1], 1e-3 * flight.time[first], rtol=1e-3)
    np.testing.assert_allclose(
        flight.position[first, 0, 1], 0.5e-3 * flight.time[first] ** 2, rtol=2e-2, atol=1e-4
    )


def residual(ppm, failed=0, nees=27.0):
    return Residual("gyro", ppm, 2, failed, 32, nees)


def test_convergence_needs_all_runs_and_honest_errors():
    assert converged(residual(300.0))
    assert not converged(residual(300.0, failed=1))
    assert not converged(residual(300.0, nees=40.0))
    assert not converged(residual(300.0, failed=32, nees=float("nan")))


def test_reach_stops_at_the_first_failure():
    good, bad = residual(300.0), residual(1000.0, failed=2)
    assert reach_text([good]) == "all converge, up to 300 ppm"
    assert reach_text([good, bad, residual(3000.0)]) == "converges up to 300 ppm, not at 1000 ppm"
    for failing_first in ([bad], [bad, residual(3000.0)]):
        assert reach_text(failing_first) == "does not converge at 1000 ppm, the smallest tried"


def flight_of(velocity, distance_nmi):
    """Flights of 8 runs with given errors at the end."""
    size = np.zeros((2, 2, 8))
    fast, far = size.copy(), size.copy()
    fast[1, 0], far[1, 1] = velocity, 1852.0 * distance_nmi
    return Flight(np.array([10.0, 12500.0]), fast, far)


def laboratory_study(nees, velocity, distance_nmi, floor_nmi):
    return laboratory.Study(
        load(["estimator=laboratory"], PROGRAM),
        np.zeros((2, COUNT)),
        np.zeros((2, 8, COUNT)),
        np.full((2, 8), nees),
        np.ones(COUNT),
        {
            COMPENSATED: flight_of(velocity, distance_nmi),
            UNCOMPENSATED: flight_of(100.0, 50.0),
            PERFECT: flight_of(0.1, floor_nmi),
        },
        [residual(300.0)],
    )


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ((27.0, 0.2, 0.1, 0.09), ["met", "met", "not met", "not met", "met"]),
        ((27.0, 0.6, 0.4, 0.004), ["met", "not met", "not met", "met", "not met"]),
        ((60.0, 0.2, 0.004, 0.003), ["not met", "met", "met", "met", "met"]),
        ((np.nan, 0.2, 0.1, 0.09), ["not met", "met", "not met", "not met", "met"]),
    ],
)
def test_claims_of_the_laboratory(case, expected):
    assert words(paper_laboratory_report.judge(laboratory_study(*case))) == expected


def test_texts_of_the_bounds_follow_the_numbers():
    swing = 2.0 * NAVIGATION_POSITION_ERROR_NMI
    assert "do not go together" in paper_laboratory_report.bounds_text(swing)
    assert "bounds agree" in paper_laboratory_report.bounds_text(0.5 * swing)
    assert "errors add little" in paper_laboratory_report.text(
        laboratory_study(27.0, 0.2, 0.1, 0.09)
    )
    assert "errors add much" in paper_laboratory_report.text(laboratory_study(27.0, 0.2, 0.3, 0.09))


def test_repeatability_measures_the_drift_of_the_truth():
    study = laboratory_study(27.0, 0.2, 0.1, 0.09)
    moved = dataclasses.replace(study, truth=np.array([np.zeros(COUNT), np.full(COUNT, 3.0)]))
    paper, ours, predicted = paper_laboratory_report.repeatability(moved)
    np.testing.assert_array_equal(paper, 3.0)
    np.testing.assert_array_equal(ours, 0.0)
    np.testing.assert_allclose(predicted, np.sqrt(2.0))
