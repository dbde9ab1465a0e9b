import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from conftest import paper_schedule
from scipy.spatial.transform import Rotation

from inscal.schedule import (
    Schedule,
    Turn,
    attitudes,
    initial_attitude,
    postures,
    segments,
    turns_of,
    weak_pairs,
)

# the postures of the paper's Table 1, first letters of X, Y, Z
TABLE_1 = (
    "NED UEN DES UEN EDN WUN EDN ENU ESD ENU EUS ESD EDN DWN WUN UEN SEU DES NED "
    "SWD SEU NED SEU SWD NED"
)


def test_postures_are_the_papers_table_1():
    assert [
        "".join(name[0] for name in row) for row in postures(paper_schedule())
    ] == TABLE_1.split()


def test_19_positions_are_the_head_of_25():
    assert postures(paper_schedule(19)) == postures(paper_schedule())[:19]


def test_full_path_has_no_weak_pair():
    assert weak_pairs(paper_schedule()) == []
    assert weak_pairs(paper_schedule(19)) == []


def test_path_that_never_shows_y_up_names_the_pair():
    yaw_and_pitch = tuple(Turn(np.pi / 2, axis) for axis in (1, 1, 1, 1, 2, 2, 2, 2))
    roll_down = (Turn(np.pi / 2, 0), Turn(-np.pi / 2, 0))
    schedule = Schedule(("North", "East", "Down"), (*yaw_and_pitch, *roll_down), 100.0, 0.2)
    assert ("accel_k22", "accel_quadratic_y", "+y up") in weak_pairs(schedule) or (
        "accel_k22",
        "accel_quadratic_y",
        "+y down",
    ) in weak_pairs(schedule)
    assert all(pair[0] == "accel_k22" for pair in weak_pairs(schedule))


def test_axis_never_level_merges_bias_and_quadratic():
    schedule = Schedule(("North", "East", "Down"), (Turn(np.pi, 0),), 100.0, 0.2)
    assert ("accel_bias_z", "accel_quadratic_z", "z level") in weak_pairs(schedule)


def test_turns_go_the_way_of_their_sign():
    # right-handed about x: y goes to where z was; the other way round, z goes to where y was
    names = ("North", "East", "Down")
    for angle, expected in (
        (np.pi / 2, ("North", "Down", "West")),
        (-np.pi / 2, ("North", "Up", "East")),
        (np.pi, ("North", "West", "Up")),
        (-1.5 * np.pi, ("North", "Down", "West")),
        (-2 * np.pi, names),
    ):
        schedule = Schedule(names, (Turn(angle, 0),), 100.0, 0.2)
        assert postures(schedule)[1] == expected
        turn = segments(schedule)[1]
        assert turn.rate.tolist() == [np.sign(angle) * 0.2, 0.0, 0.0]
        assert turn.end - turn.start == pytest.approx(abs(angle) / 0.2)


def test_a_turn_of_45_degrees_is_half_of_one_of_90():
    names = ("South", "Up", "West")
    half = attitudes(Schedule(names, turns_of([(-45.0, "Z")] * 2), 100.0, 0.2))
    whole = attitudes(Schedule(names, turns_of([(-90.0, "Z")]), 100.0, 0.2))
    np.testing.assert_allclose(half[-1], whole[-1], atol=1e-15)
    # x is midway between where it was, south, and where it goes: -y, that is down
    np.testing.assert_allclose(half[1][:, 0], [-np.sqrt(0.5), 0.0, np.sqrt(0.5)], atol=1e-15)
    with pytest.raises(ValueError, match="position 2 points an axis along no named direction"):
        postures(Schedule(names, turns_of([(45.0, "X")]), 100.0, 0.2))


def test_segments_follow_each_other_without_gaps():
    parts = segments(paper_schedule())
    assert parts[0].start == 0.0
    assert parts[-1].end == 12_500.0
    assert [p.end for p in parts[:-1]] == [p.start for p in parts[1:]]
    turning = sum(p.end - p.start for p in parts if p.rate.any())
    assert turning == pytest.approx((12 * 90 + 12 * 180) / 10.0)


def test_left_handed_posture_and_long_turn_are_refused():
    with pytest.raises(ValueError, match="right-handed"):
        initial_attitude(("North", "East", "Up"))
    with pytest.raises(ValueError, match="longer than a position"):
        segments(paper_schedule(2, position_duration=5.0))


RAMPED = [(90.0, "Y"), (-180.0, "X"), (45.0, "Z"), (-360.0, "Y")]


@pytest.mark.parametrize("acceleration", [5.0, 20.0, 500.0])
def test_ramps_join_rest_and_rate_without_a_jump(acceleration):
    schedule = Schedule(
        ("South", "Up", "West"), turns_of(RAMPED), 60.0, np.deg2rad(30.0), np.deg2rad(acceleration)
    )
    parts = segments(schedule)
    for before, after in pairwise(parts):
        assert before.end == after.start
        end = np.array([before.end])
        np.testing.assert_allclose(before.rate_at(end)[0], after.rate, atol=1e-11)
        reached = before.attitude @ Rotation.from_rotvec(before.turned_at(end)[0]).as_matrix()
        np.testing.assert_allclose(reached, after.attitude, atol=1e-11)
    assert parts[-1].end == 300.0
    assert max(np.abs(p.rate).max() for p in parts) <= np.deg2rad(30.0)
    assert np.unique([p.turn for p in parts]).tolist() == [-1, 0, 1, 2, 3]


def test_ramps_begin_earlier_and_end_in_time():
    names, turns = ("North", "East", "Down"), turns_of([(-90.0, "X")])
    rest, up, steady, down, last = segments(Schedule(names, turns, 100.0, 0.2, 0.05))
    assert rest.end == up.start == pytest.approx(100.0 - np.pi / 2 / 0.2 - 4.0)
    assert up.end - up.start == pytest.approx(4.0) == pytest.approx(down.end - down.start)
    assert down.end == last.start == 100.0
    assert up.acceleration.tolist() == pytest.approx([-0.05, 0.0, 0.0])
    assert down.acceleration.tolist() == pytest.approx([0.05, 0.0, 0.0])
    assert steady.rate.tolist() == [-0.2, 0.0, 0.0]
    assert not steady.is_ramp
    assert [p.is_turn for p in (rest, up, steady, down, last)] == [False, True, True, True, False]
    # too small a turn for the full rate goes up and down again
    small = segments(Schedule(names, turns, 100.0, 2.0, 0.05))
    assert len(small) == 4
    assert np.abs(small[2].rate).max() == pytest.approx(np.sqrt(np.pi / 2 * 0.05))


def test_ramps_must_fit_into_the_position_too():
    schedule = dataclasses.replace(paper_schedule(3), position_duration=18.4)
    assert len(segments(schedule)) == 5
    with pytest.raises(ValueError, match=r"turn 2 takes 18\.5 s, which is longer than a position"):
        segments(dataclasses.replace(schedule, turn_acceleration=np.deg2rad(20.0)))
