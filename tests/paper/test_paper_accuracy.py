"""Noise that explains errors, noise margins, and the verdicts of the accuracy comparison."""

import dataclasses
import math

import numpy as np
import pytest

from inscal.parameters import COUNT, KIND_OF, KINDS, vector
from pipeline.config.load import load
from pipeline.config.setup import Setup, parameter_vector
from pipeline.paper import noise as paper_noise
from pipeline.paper import values as paper_values
from pipeline.paper.accuracy_report import margin_cells
from pipeline.paper.accuracy_study import kind_probability
from pipeline.paper.noise import SCALES, explain, margins, predicted_std, scaled
from pipeline.study import verdict as paper_verdicts


def power_law_table():
    """Sigma of gyro parameters follows the gyros' noise, that of the others the other noise."""
    gyro = np.array([kind.startswith("gyro") for kind in KIND_OF])
    table = np.empty((len(SCALES), len(SCALES), COUNT))
    table[..., gyro] = SCALES[:, None, None]
    table[..., ~gyro] = SCALES[None, :, None]
    return table, gyro


def test_explanation_finds_the_noise_that_made_the_errors():
    table, gyro = power_law_table()
    sign = np.where(np.arange(COUNT) % 2, 1.0, -1.0)
    found = explain(sign * np.where(gyro, 3.0, 20.0), table)
    # the grid of the search is a thirty-fifth of an octave
    assert found.gyro == pytest.approx(3.0, rel=0.03)
    assert found.other == pytest.approx(20.0, rel=0.03)
    assert found.chi_square == pytest.approx(COUNT, rel=0.06)
    assert found.gyro_range[0] < 3.0 < found.gyro_range[1]
    # 18 errors say more than 9
    widths = [math.log(b / a) for a, b in (found.gyro_range, found.other_range)]
    assert widths[0] > widths[1]


def test_margin_is_where_the_bound_is_the_wanted_number_of_sigmas():
    bound = np.full(COUNT, 10.0)
    found = margins(lambda scale: np.full(COUNT, scale), bound)
    assert found == pytest.approx(dict.fromkeys(KINDS, 10.0 / 2.5758), rel=1e-4)


def test_margin_is_that_of_the_worst_parameter_of_a_kind():
    weight = np.ones(COUNT)
    weight[KIND_OF.index("gyro_bias")] = 2.0
    found = margins(lambda scale: scale * weight, np.full(COUNT, 10.0))
    assert found["gyro_bias"] == pytest.approx(0.5 * found["accel_bias"], rel=1e-6)


def test_margins_beyond_the_sweep():
    bound = np.full(COUNT, 10.0)
    assert set(margins(lambda _: np.full(COUNT, 1.0), bound).values()) == {np.inf}
    assert set(margins(lambda _: np.full(COUNT, 9.0), bound).values()) == {0.0}
    assert margin_cells(np.inf, 2.0) == ("above 5.1e+02", "above 256")
    assert margin_cells(0.0, 2.0) == ("none", "none")
    assert margin_cells(1.5, 2.0) == ("3", "1.50")


def test_kinds_with_errors_too_small_and_too_large_stand_out():
    sigma, error = np.ones(COUNT), np.ones(COUNT)
    error[[kind == "gyro_bias" for kind in KIND_OF]] = 0.01
    error[[kind == "lever_arm" for kind in KIND_OF]] = 5.0
    probability = kind_probability(error, sigma)
    assert probability["gyro_bias"] < 0.001
    assert probability["lever_arm"] > 0.999
    assert 0.1 < probability["accel_installation"] < 0.9


def test_scaled_noise_scales_sigma(reference):
    short = dataclasses.replace(
        reference,
        schedule=dataclasses.replace(
            reference.schedule, position_duration_s=40.0, rotations=reference.schedule.rotations[:5]
        ),
    )
    tenth = scaled(short, 0.1, 0.1)
    assert tenth.noise.position_observation_m == pytest.approx(0.01)
    assert scaled(short, 1.0, 9.0, 1.0).noise.velocity_observation_m_per_s == pytest.approx(0.001)
    assert (predicted_std(tenth) < predicted_std(short)).all()


def test_paper_estimates_are_near_the_truth_of_their_kind():
    paper = load(["truth=paper"])
    error = vector(paper_values.TABLE_3_ESTIMATES) - parameter_vector(paper.truth)
    assert (np.abs(error) <= Setup(paper).bound).all()


def test_verdicts():
    assert paper_verdicts.within("c", 1.0, 1.0, "f").word == "met"
    assert paper_verdicts.within("c", 1.1, 1.0, "f").word == "not met"
    assert paper_verdicts.within("c", np.nan, 1.0, "f").word == "not met"
    assert paper_verdicts.near("c", 2.7, 2.5, 0.1, "f").word == "met"
    assert paper_verdicts.near("c", 2.2, 2.5, 0.1, "f").word == "not met"
    assert paper_verdicts.share("c", 0.991, 0.999, 0.99, "f").word == "met"
    assert paper_verdicts.share("c", 0.95, 0.98, 0.99, "f").word == "not met"
    undecided = paper_verdicts.share("c", 0.98, 0.995, 0.99, "f").word
    assert undecided.startswith("cannot be judged, because")
    assert "98.0 % to 99.5 %" in undecided


def test_sweep_covers_the_configured_noise():
    assert SCALES[2] == pytest.approx(1.0)
    assert paper_noise.SIGMAS == pytest.approx(2.5758, abs=1e-4)
