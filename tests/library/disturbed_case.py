"""A short calibration on the paper's path, its filter, and disturbances put into it."""

import dataclasses
from functools import cache

import numpy as np
from conftest import paper_schedule, paper_truth

from inscal import parameters
from inscal.budget import System
from inscal.disturbance import Disturbance
from inscal.disturbed import disturb
from inscal.estimator import Belief
from inscal.experiment import prepare
from inscal.motion import Site
from inscal.path import path_of
from inscal.recursion import InitialStd, compute_gains
from inscal.simulation import Truth, TruthModel
from inscal.state_model import NoiseModel, StateModel, build_transitions

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.01, 0.01, 0.05]), 0.01, 1.0, 0.1 * SIZE)
SCHEDULE = paper_schedule(25, position_duration=60.0)
TIMES = {"gyro_wander_time": 200.0, "accel_wander_time": 200.0, "vibration_frequency": 3.3}
MODEL = StateModel()
STEPS = {"update_interval": 1.0, "dwell_step": 1.0, "turn_step": 0.1}
# sizes that move some estimate by about a sigma, and others by no more
SIZES = {
    **{"gyro_drift": 1e-8, "accel_drift": 1e-5, "gyro_scale_drift": 1e-6},
    **{"accel_scale_drift": 1e-6, "off_axis_lever_arm": 1e-3, "table_offset": 1e-3},
    **{"gyro_accel_delay": 1e-5, "accel_asymmetry": 1e-6, "accel_cubic": 1e-8},
    **{"accel_cross_coupling": 1e-7, "accel_pendulous": 1e-7, "gyro_asymmetry": 1e-6},
    **{"gyro_g_sensitivity": 1e-10, "gravity": 1e-5, "latitude": 1e-5, "deflection": 1e-5},
    **{"turn_angle": 1e-5, "turn_rate": 1e-5, "table_axis": 1e-5, "base_tilt": 1e-4},
    **{"vibration": 1e-2, "observation_bias": 1e-4},
}


@cache
def filtered():
    """Transitions, and gains of the first pass."""
    transitions = build_transitions(SCHEDULE, SITE, MODEL, NOISE, update_interval=1.0)
    return transitions, compute_gains(transitions, MODEL, NOISE, STD)


@cache
def plain():
    """Experiment without disturbances."""
    return prepare(
        9,
        SCHEDULE,
        SITE,
        Truth(TruthModel("fixed", np.zeros(27)), NOISE, STD, Disturbance()),
        Belief(NOISE, STD, passes=2, update_interval=STEPS["update_interval"]),
        dwell_step=STEPS["dwell_step"],
        turn_step=STEPS["turn_step"],
    )


def disturbed_by(**sizes):
    """The same experiment with disturbances."""
    about = Disturbance(**TIMES | sizes)
    made = disturb(about, path_of(SCHEDULE, SITE, **STEPS), STEPS["update_interval"])
    truth = dataclasses.replace(plain().truth, disturbance=about)
    return dataclasses.replace(plain(), truth=truth, disturbed=made)


def system_of(experiment):
    """The filter and what it knows nothing of."""
    about = experiment.truth.disturbance
    return System(*filtered(), MODEL, NOISE, STD, experiment.disturbed, about)


@cache
def every_system():
    """With a little of everything that is constant."""
    return system_of(disturbed_by(**SIZES))
