"""Ranks of the paper's kind on the paper's path, and what sigma says beyond them."""

import numpy as np
import pytest
from campaigns import run_stage
from conftest import paper_schedule
from scipy.spatial.transform import Rotation

from inscal import earth
from inscal import observability as obs
from inscal.motion import Site
from inscal.parameters import INDEX, NAMES
from inscal.schedule import attitudes, turn_vector
from pipeline import observe
from pipeline.config.load import load
from pipeline.config.setup import Setup

SITE = Site(np.deg2rad(39.98), 50.0)
TURNING = {"gyro": "turning", "lever": "turning"}
SEARCHED = obs.Convention(
    lever="turning",
    lever_from=20,
    window=obs.Window(100.0, np.deg2rad(20.0)),
    quadratic_scale=1673.84,
)
PAPER = [12, 18, 23, 26, 30] + [33] * 15 + [36] * 5
NO_Y_UP = "schedule.rotations=[[180,Y],[90,Y],[180,Y],[90,Y],[-90,X]]"


def both(convention, **keys):
    return observe.rank_counts(load([f"{k}={v}" for k, v in keys.items()]), convention)


@pytest.mark.parametrize(
    ("convention", "expected"),
    [
        (obs.Convention(), [12, 18, 23, 23, 29, 31, 31] + [33] * 18),
        (obs.Convention(lever="earth"), [12, 18, 23, 23, 29, 31, 31, 34] + [35] * 17),
        (obs.Convention(gyro="turning"), [12, 18, 23, 25, 29, 31, 31] + [33] * 18),
        (obs.Convention(**TURNING), [12, 18, 23, 28, 32, 34, 34] + [36] * 18),
        (
            obs.Convention(**TURNING, lever_from=19),
            [12, 18, 23, 25, 29, 31, 31] + [33] * 12 + [36] * 6,
        ),
        (
            obs.Convention(**TURNING, lever_from=20),
            [12, 18, 23, 25, 29, 31, 31] + [33] * 13 + [36] * 5,
        ),
    ],
)
def test_conventions_that_follow_from_an_idea_have_clear_ranks(convention, expected):
    by_default, unit_free = both(convention)
    assert by_default.rank.tolist() == expected
    assert unit_free.rank.tolist() == expected
    kept, dropped = unit_free.margins
    assert kept > 100
    assert dropped < 1e-3


def test_searched_convention_owes_the_papers_ranks_to_the_tolerance():
    by_default, unit_free = both(SEARCHED)
    assert by_default.rank.tolist() == [12, 18, 22, *PAPER[3:]]
    assert unit_free.rank.tolist() == [12, 18, 23, 28, 32, *PAPER[5:]]
    low, high = by_default.tolerances_for(PAPER)
    assert low == pytest.approx(0.826, abs=2e-3)
    assert high == pytest.approx(0.9991, abs=5e-4)
    low, high = unit_free.tolerances_for(PAPER)
    assert low > high
    dynamics = obs.system_matrices(paper_schedule(), SITE, SEARCHED)
    assert obs.ranks(dynamics, "matlab").rank.tolist() == PAPER


def test_ranks_are_numpys():
    dynamics = obs.system_matrices(paper_schedule(4), SITE, obs.Convention(gyro="turning"))
    stacked = obs.stripped_blocks(dynamics).reshape(-1, obs.STATES)
    assert obs.ranks(dynamics).rank[-1] == np.linalg.matrix_rank(stacked)


def test_stripped_blocks_are_powers_of_the_dynamics():
    dynamics = np.random.default_rng(1).normal(size=(2, obs.STATES, obs.STATES))
    blocks = obs.stripped_blocks(dynamics, 3)
    observed = np.eye(obs.STATES)[3:9]
    assert blocks.shape == (2, 18, obs.STATES)
    np.testing.assert_allclose(blocks[1, 12:], observed @ dynamics[1] @ dynamics[1])


def test_no_rank_depends_on_the_gravity_gradient():
    dynamics = obs.system_matrices(paper_schedule(), SITE, obs.Convention(**TURNING))
    with_gradient = dynamics.copy()
    with_gradient[:, 5, 8] = -3.086e-6
    assert obs.ranks(with_gradient).rank.tolist() == obs.ranks(dynamics).rank.tolist()


def test_units_do_not_change_unit_free_ranks():
    dynamics = obs.system_matrices(paper_schedule(), SITE, SEARCHED)
    sigma, noise = np.ones(obs.STATES), np.ones(6)
    scale = 10.0 ** np.random.default_rng(2).uniform(-3, 3, obs.STATES)
    other = scale[:, None] * dynamics / scale
    a = obs.unit_free_ranks(dynamics, sigma, noise, 500.0)
    b = obs.unit_free_ranks(other, sigma * scale, noise * scale[3:9], 500.0)
    np.testing.assert_allclose(a.values[:, :12], b.values[:, :12], rtol=1e-6)


def test_window_averages_force_and_rates_over_both_turns():
    schedule, position, rate = paper_schedule(), 4, np.deg2rad(20.0)
    dynamics = obs.system_matrices(schedule, SITE, SEARCHED)[position]
    dwells, force, weight = attitudes(schedule), np.zeros(3), 100.0
    down = earth.gravity_ned(SITE.latitude, SITE.height)
    force -= 100.0 * dwells[position].T @ down
    for turn in (position - 1, position):
        vector = turn_vector(schedule.turns[turn])
        length = np.linalg.norm(vector) / rate
        for share in (np.arange(4000) + 0.5) / 4000:
            attitude = dwells[turn] @ Rotation.from_rotvec(share * vector).as_matrix()
            force -= length / 4000 * attitude.T @ down
        weight += length
    force /= weight
    # the columns of ka11, ka12, ka13 are minus the first column of C times f_x, f_y, f_z
    columns = [9 + NAMES.index(name) for name in ("accel_k11", "accel_k12", "accel_k13")]
    found = -dwells[position][:, 0] @ dynamics[3:6, columns]
    np.testing.assert_allclose(found, force, atol=1e-6)


def test_window_averages_rates_over_both_turns():
    """Earth rate over dwell and turns, and the turns themselves over the same time."""
    schedule, rate = paper_schedule(), np.deg2rad(20.0)
    convention = obs.Convention(gyro="turning", window=SEARCHED.window)
    columns = [9 + NAMES.index(name) for name in ("gyro_k11", "gyro_k22", "gyro_k33")]
    dwells = attitudes(schedule)
    for position in (0, 4, 24):
        dynamics = obs.system_matrices(schedule, SITE, convention)[position]
        earth_ned = earth.earth_rate_ned(SITE.latitude)
        whole, seen = 100.0, 100.0 * dwells[position].T @ earth_ned
        for turn in (position - 1, position):
            if not 0 <= turn < len(schedule.turns):
                continue
            vector = turn_vector(schedule.turns[turn])
            length = np.linalg.norm(vector) / rate
            seen += vector
            for share in (np.arange(4000) + 0.5) / 4000:
                attitude = dwells[turn] @ Rotation.from_rotvec(share * vector).as_matrix()
                seen += length / 4000 * attitude.T @ earth_ned
            whole += length
        # the column of k_ii is that of C times the rate about i
        found = np.diag(dwells[position].T @ dynamics[0:3, columns])
        np.testing.assert_allclose(found, seen / whole, atol=1e-10)


def test_without_a_window_rates_are_those_of_dwell_and_of_the_turn_that_ends_it():
    schedule = paper_schedule()
    dynamics = obs.system_matrices(schedule, SITE, obs.Convention(gyro="turning", lever="earth"))
    columns = [9 + NAMES.index(name) for name in ("gyro_k11", "gyro_k22", "gyro_k33")]
    lever = [9 + NAMES.index(f"lever_arm_{axis}") for axis in "xyz"]
    for position, attitude in enumerate(attitudes(schedule)):
        own = attitude.T @ earth.earth_rate_ned(SITE.latitude)
        rate = own.copy()
        if position < len(schedule.turns):
            turn = schedule.turns[position]
            rate[turn.axis] += np.sign(turn.angle) * schedule.turn_rate
        found = np.diag(attitude.T @ dynamics[position, 0:3, columns].T)
        np.testing.assert_allclose(found, rate, atol=1e-15)
        arm = np.diag(-attitude.T @ dynamics[position, 3:6, lever].T)
        np.testing.assert_allclose(arm, own @ own - own**2, atol=1e-20)


def test_lever_arm_columns_start_where_told():
    dynamics = obs.system_matrices(paper_schedule(), SITE, SEARCHED)
    lever = dynamics[:, 3:6, 9:][..., INDEX["lever_arm"]]
    assert not lever[:20].any()
    assert lever[20:].any(axis=(1, 2)).all()


def test_sigma_share_is_taken_at_the_ends_of_positions():
    history = np.arange(1.0, 13.0)[:, None] * np.ones(27)
    share = obs.sigma_share(history, np.full(27, 2.0), paper_schedule(3, 20.0), 5.0)
    assert share[:, 0].tolist() == [2.0, 4.0, 6.0]


def test_weakest_direction_is_the_one_left_at_its_prior():
    prior = np.linspace(1.0, 5.0, 27)
    known = np.zeros(27)
    known[[3, 7]] = np.sqrt(0.5), -np.sqrt(0.5)
    covariance = np.outer(prior, prior) * (0.01 * np.eye(27) + 0.99 * np.outer(known, known))
    direction, *others = obs.weakest_directions(covariance, prior, 2)
    assert direction.share == pytest.approx(1.0)
    assert {index for index, _ in direction.weights} == {3, 7}
    assert sum(weight for _, weight in direction.weights) == pytest.approx(0.0)
    assert others[0].share == pytest.approx(0.1)


def test_path_without_y_up_is_told_by_its_weakest_directions():
    course = observe.observability_of(Setup(load([NO_Y_UP])))
    named = [{NAMES[i] for i, _ in d.weights} for d in course.directions if d.share > 0.1]
    assert any({"accel_k22", "accel_quadratic_y"} <= names for names in named)


def test_normal_path_observes_all_but_ties_biases_to_quadratic_terms():
    course = observe.observability_of(Setup(load([])))
    assert course.directions[0].share < 0.01
    pairs = {(NAMES[i], NAMES[j]) for i, j, _ in course.tied}
    assert pairs == {(f"accel_bias_{a}", f"accel_quadratic_{a}") for a in "xyz"}
    assert all(correlation < -0.9 for _, _, correlation in course.tied)


def test_what_is_not_modelled_is_tied_to_nothing():
    course = observe.observability_of(Setup(load(["estimator=states30"])))
    quadratic = range(27)[INDEX["accel_quadratic"]]
    assert not {i for pair in course.tied for i in pair[:2]} & set(quadratic)
    assert not course.share[:, INDEX["accel_quadratic"]].any()


def test_stage_prints_any_path_and_writes_what_it_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(observe, NO_Y_UP, "out=deep/course.csv")
    assert ended.code == 0
    assert "never shows +y up" in ended.err
    assert "Least known combinations" in ended.out
    assert "accel_quadratic_y" in ended.out.split("Least known")[1]
    assert sorted(p.name for p in (tmp_path / "deep").iterdir()) == ["course.csv", "course.png"]
    heading, first, *_ = (tmp_path / "deep/course.csv").read_text().splitlines()
    assert heading.split(",") == ["parameter", *(f"position_{n}" for n in range(1, 7))]
    assert first.startswith("gyro_bias_x,")


def test_stage_wants_a_csv_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(observe, "out=course.png")
    assert ended.code == 2
    assert "must be a file whose name ends with .csv" in ended.err
