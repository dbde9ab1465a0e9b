"""Designed paths: blocks against the recursion, the share of a box against draws, the search."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import SITES, paper_schedule, paper_truth
from scipy.stats import multivariate_normal

from inscal import parameters
from inscal.augmentation import augment
from inscal.blocks import Believed, Builder
from inscal.box import share_within
from inscal.design import covariance, tables
from inscal.disturbance import Disturbance
from inscal.estimator import CONSTANTS, initial_constants
from inscal.parameters import AUGMENTATIONS
from inscal.path import path_of
from inscal.recursion import InitialStd, compute_gains
from inscal.schedule import Schedule, initial_attitude, turns_of
from inscal.search import OBJECTIVES, Problem, advance, begin, energy_of
from inscal.state_model import NoiseModel, StateModel, build_transitions

NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)
POSTURE = ("North", "East", "Down")
RATE = np.deg2rad(10.0)
FULL = StateModel()
SIZES_OF = {
    **{"off_axis_lever_arm": 0.02, "table_offset": 0.02, "gyro_accel_delay": 1e-3},
    **{"accel_cubic": 1e-7, "accel_asymmetry": 1e-5, "gyro_g_sensitivity": 1e-9, "gravity": 1e-6},
    **{"gyro_asymmetry": 1e-6, "accel_cross_coupling": 1e-8, "latitude": 5e-6},
}
SIZES = Disturbance(**SIZES_OF)
AUGMENTED = StateModel(
    (*FULL.groups, *(name for name, about in AUGMENTATIONS.items() if about.source in SIZES_OF))
)
CLASSIC = StateModel(("gyro_bias", "accel_bias", "gyro_k", "accel_k"))


def tables_of(site, model, angles=(90, -90, 180), acceleration=None, interval=1.0, most=24):
    builder = Builder(site, model, NOISE, interval, Believed(SIZES, 1.0, 0.5))
    moves = turns_of([(angle, axis) for axis in "XYZ" for angle in angles])
    return tables(
        builder, STD, initial_attitude(POSTURE), moves, rate=RATE, acceleration=acceleration,
        longest=int(120 / interval), most_postures=most,
    )  # fmt: skip


def by_recursion(site, model, rotations, acceleration, interval, last):
    schedule = Schedule(POSTURE, turns_of(rotations), 60.0, RATE, acceleration, last)
    transitions = build_transitions(schedule, site, model, NOISE, update_interval=interval)
    path = path_of(schedule, site, update_interval=interval, dwell_step=1.0, turn_step=0.5)
    if further := augment(model, SIZES, path, interval):
        transitions = replace(transitions, augmented=further.transitions)
    full = compute_gains(transitions, model, NOISE, STD).covariance
    prior = initial_constants(transitions, STD)
    own = np.concatenate([model.columns, np.arange(CONSTANTS, len(prior))])
    return full[np.ix_(own, own)] / np.outer(prior[own], prior[own])


@pytest.mark.parametrize(
    ("place", "model", "angles", "acceleration", "interval"),
    [
        ("laboratory", FULL, (90, -90, 180), None, 1.0),
        ("south", FULL, (90, 180), np.deg2rad(10.0), 1.0),
        ("laboratory", CLASSIC, (90, -90), None, 2.0),
        ("laboratory", FULL, (45, 90, -135), None, 1.0),
        ("laboratory", AUGMENTED, (45, 90, -135), None, 1.0),
        ("south", AUGMENTED, (90, -90), np.deg2rad(10.0), 1.0),
    ],
)
def test_blocks_are_the_recursion(place, model, angles, acceleration, interval):
    """Random paths of unequal dwells: sigmas and correlations, update by update or as blocks."""
    site, rng = SITES[place], np.random.default_rng(7)
    about = tables_of(site, model, angles, acceleration, interval, most=40)
    moves, posture = [], 0
    for _ in range(9):
        allowed = np.flatnonzero(about.after[posture] >= 0)
        if not len(allowed):  # as many postures as there may be
            break
        move = int(rng.choice(allowed))
        moves.append(move)
        posture = about.after[posture, move]
    assert len(moves) > 2
    rests = rng.integers(1, 60, len(moves) + 1)
    found = covariance(about, np.array(moves), rests)
    durations = (rests[:-1] + about.updates[moves]) * interval
    rotations = [
        (np.rad2deg(about.moves[m].angle), "XYZ"[about.moves[m].axis], time)
        for m, time in zip(moves, durations, strict=True)
    ]
    expected = by_recursion(site, model, rotations, acceleration, interval, rests[-1] * interval)
    sigma = np.sqrt(np.diag(expected))
    difference = (found - expected) / np.outer(sigma, sigma)
    assert np.abs(difference).max() < 1e-6


def test_the_share_of_a_box_is_that_of_draws():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((6, 6)) + 2.0 * np.eye(6)
    bound = 1.5 * np.sqrt(np.diag(root @ root.T))
    drawn = rng.standard_normal((400_000, 6)) @ root.T
    inside = (np.abs(drawn) <= bound).all(axis=1).mean()
    found = share_within(root @ root.T, bound, 1 << 17)
    assert found == pytest.approx(inside, abs=4.0 * np.sqrt(inside * (1 - inside) / 400_000))
    flat = multivariate_normal(np.zeros(6), root @ root.T)
    assert found == pytest.approx(flat.cdf(bound, lower_limit=-bound), abs=2e-4)
    assert share_within(np.diag([1.0, 4.0]), np.array([1.96, 3.92])) == pytest.approx(0.95**2, 1e-4)


def problem_of(objective, **rules):
    about = tables_of(SITES["laboratory"], FULL)
    return Problem(about, np.full(27, 0.01), objective, 2, 4, **rules)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_a_search_is_better_than_where_it_began_and_repeats(objective):
    problem = problem_of(objective)
    ended = []
    for _ in range(2):
        rng = np.random.default_rng(5)
        chain = begin(problem, np.full(8, 60), rng)
        start = chain.energy
        for part in range(2):
            chain = advance(problem, chain, rng, 150, part / 2, (part + 1) / 2)
        assert chain.best_energy < start
        assert chain.best_durations.sum() == 480
        assert chain.best_energy == energy_of(problem, chain.best_moves, chain.best_durations)
        ended.append(chain)
    assert (ended[0].best_moves == ended[1].best_moves).all()
    assert (ended[0].best_durations == ended[1].best_durations).all()


def test_rules_are_kept():
    problem = problem_of("worst", last=0, cable=np.pi * 1.01)
    rng = np.random.default_rng(2)
    chain = advance(problem, begin(problem, np.full(6, 60), rng), rng, 400, 0.0, 1.0)
    turns = [problem.about.moves[m] for m in chain.best_moves]
    for axis in range(3):
        wound = np.cumsum([turn.angle * (turn.axis == axis) for turn in turns])
        assert np.abs(wound).max() <= np.pi * 1.01
    posture = 0
    for move in chain.best_moves:
        posture = problem.about.after[posture, move]
    assert posture == 0
    rests = chain.best_durations - np.append(problem.about.updates[chain.best_moves], 0)
    assert rests.min() >= 4
    with pytest.raises(ValueError, match="no path of these turns"):
        begin(problem_of("worst", cable=0.1), np.full(6, 60), rng)


def test_the_paper_s_path_is_known():
    assert len(tables_of(SITES["laboratory"], FULL).attitudes) == 24
    assert len(paper_schedule(25, position_duration=60.0).turns) == 24
