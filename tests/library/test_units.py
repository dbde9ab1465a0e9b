import numpy as np
import pytest
from conftest import paper_truth

from inscal import parameters, units


def test_units_against_their_definitions():
    assert units.DEG_PER_HOUR * 3600 * 180 / np.pi == pytest.approx(1.0)
    assert units.ARCSEC * 3600 * 360 / (2 * np.pi) == pytest.approx(1.0)
    # an angle random walk of 1 deg/sqrt(h) is one degree after an hour
    assert units.DEG_PER_SQRT_HOUR * np.sqrt(3600) == pytest.approx(np.pi / 180)
    # the paper's 206.26 arcsec is 1e-3 rad
    assert 206.26 * units.ARCSEC == pytest.approx(1e-3, rel=1e-4)


def test_quadratic_term_in_the_pulse_domain():
    # 30e-9 in the pulse domain is 492 ug/g^2
    effect = 30 * units.quadratic_unit(1673.84) * units.STANDARD_GRAVITY**2
    assert effect / units.MICRO_G == pytest.approx(492, abs=1)


def test_parameters_are_the_papers_in_its_order():
    assert parameters.COUNT == 27
    assert parameters.NAMES[:6] == (
        *(f"gyro_bias_{a}" for a in "xyz"),
        *(f"accel_bias_{a}" for a in "xyz"),
    )
    assert parameters.NAMES[6:12] == tuple(
        f"gyro_k{ij}" for ij in ("11", "21", "31", "22", "32", "33")
    )
    assert parameters.NAMES[12:21] == tuple(
        f"accel_k{r}{c}" for c in "123" for r in "123"
    )  # column by column
    assert [parameters.UNITS[parameters.NAMES.index(n)] for n in ("gyro_k11", "gyro_k21")] == [
        "ppm",
        "arcsec",
    ]


def test_members_of_a_kind_are_its_parameters_in_state_order():
    for kind in parameters.KINDS:
        own = parameters.members(kind)
        assert [parameters.NAMES[i] for i in own] == [
            name for name in parameters.NAMES if parameters.kind_of(name) == kind
        ]
    with pytest.raises(KeyError):
        parameters.members("gyro_drift")


def test_vector_spreads_kinds_and_checks_them():
    truth = paper_truth()
    assert truth[parameters.INDEX["lever_arm"]].tolist() == [10, 20, 30]
    assert truth[parameters.NAMES.index("accel_k23")] == 206.26
    bounds = {kind: 1.0 for kind in parameters.KINDS}
    with pytest.raises(ValueError, match="missing or unknown"):
        parameters.vector({**bounds, "gyro_drift": 1.0})
    with pytest.raises(ValueError, match="gyro_bias takes one number or 3, not 2"):
        parameters.vector({**bounds, "gyro_bias": [1.0, 2.0]})
    with pytest.raises(KeyError):
        parameters.kind_of("gyro_k12")
