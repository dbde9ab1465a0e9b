"""How long must a position last? Predicted first, then proven where it matters.

The filter's covariance needs no simulation, so a sweep over the duration of a position costs a
fraction of a second a point. The figure shows, for the worst parameter of each kind, 3 predicted
sigmas over the bound: below 1 the bound is met in 99.7 % of calibrations. Most kinds hardly profit
from longer positions; the gyro biases decide how long a calibration takes.

Then 200 calibrations are simulated at the shortest duration that should meet every bound. Their
scatter (dots: 3 RMSE) lies on the prediction, and the mean NEES is near 27, the number of
parameters: the filter's own sigma can be trusted, and so can the duration it suggests.

    python examples/position_duration.py [figure.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

from inscal import parameters, units
from inscal.estimator import Belief, build_estimator
from inscal.experiment import prepare, run
from inscal.motion import Site
from inscal.parameters import members
from inscal.recursion import InitialStd
from inscal.schedule import Schedule, turns_of
from inscal.simulation import Truth, TruthModel
from inscal.state_model import NoiseModel

DURATIONS = np.array([60, 100, 150, 200, 300, 400, 500, 600, 700, 800, 1000])  # s
RUNS = 200

# the table: turns in degrees about body axes, at 10 deg/s
TURNS = """90Y 180Y 180Y 90Z 180Z 180Z 90X 180X 180X 90X 90X 90X
           90Z 90Z 90Z 90Y 90Y 90Y 180Z 180X 180Y 180Y 180X 180Z"""
turns = turns_of((float(turn[:-1]), turn[-1]) for turn in TURNS.split())
site = Site(latitude=39.98 * units.DEGREE, height=50.0)

# the unit: its noise and that of the reference, how well its errors are known before, its bounds
noise = NoiseModel(
    gyro=0.0005 * units.DEG_PER_SQRT_HOUR, accel=5.0 * units.MICRO_G, velocity=0.001, position=0.1
)
unit = parameters.si_units(units.quadratic_unit(pulses_per_m_per_s=1673.84))
known = unit * parameters.vector(
    {
        "gyro_bias": 0.05,  # deg/h
        "accel_bias": 200.0,  # ug
        "gyro_scale_factor": 500.0,  # ppm
        "gyro_installation": 206.26,  # arcsec
        "accel_scale_factor": 500.0,
        "accel_installation": 206.26,
        "accel_quadratic": 30.0,  # 1e-9 s/pulse
        "lever_arm": (10.0, 20.0, 30.0),  # mm
    }
)
attitude = np.array([0.1, 0.1, 0.5]) * units.DEGREE
prior = InitialStd(attitude, velocity=0.01, position=1.0, parameter=known)
bound = unit * parameters.vector(
    {
        "gyro_bias": 0.001,  # in the same units
        "accel_bias": 9.0,
        "gyro_scale_factor": 3.0,
        "gyro_installation": 1.0,
        "accel_scale_factor": 2.0,
        "accel_installation": 3.0,
        "accel_quadratic": 0.4,
        "lever_arm": 3.0,
    }
)


def path_of(duration):
    """Path with positions of a duration in s."""
    return Schedule(("North", "East", "Down"), turns, float(duration), 10.0 * units.DEGREE)


def predicted_sigma(duration):
    """What the filter will claim after such a path, with no run simulated."""
    belief = Belief(noise, prior, passes=1, update_interval=1.0)
    return build_estimator(path_of(duration), site, belief).predicted_std


def worst_of_each_kind(values):
    """Largest of 27 values within each kind of parameter."""
    return {kind: values[..., members(kind)].max(axis=-1) for kind in parameters.KINDS}


# prediction at every duration, then proof at the shortest that should do
predicted = np.array([3.0 * predicted_sigma(t) / bound for t in DURATIONS])
chosen = float(DURATIONS[(predicted < 1.0).all(axis=1)][0])
truth = Truth(TruthModel("normal", known), noise, prior)  # another unit in every run
belief = Belief(noise, prior, passes=2, update_interval=1.0)
experiment = prepare(1, path_of(chosen), site, truth, belief, dwell_step=1.0, turn_step=0.5)
outcome = run(experiment, range(RUNS))
error = (outcome.estimate - outcome.truth) / bound
found = 3.0 * np.sqrt((error**2).mean(axis=0))

print("shortest position that meets the bound, of those tried:")
for kind, ratio in worst_of_each_kind(predicted).items():
    print(f"  {kind:20}{DURATIONS[ratio < 1.0][0]:5} s")
print(
    f"{RUNS} calibrations with positions of {chosen:g} s, {25 * chosen / 3600:.1f} h each:\n"
    f"  every bound met in   {100 * (np.abs(error) < 1.0).all(axis=1).mean():5.1f} %\n"
    f"  mean NEES of 27      {outcome.nees.mean():5.1f}"
)

plt.rcParams |= {"axes.spines.top": False, "axes.spines.right": False, "font.size": 9.0}
figure, axes = plt.subplots(figsize=(8.5, 5.2), layout="constrained")
lines, dots = worst_of_each_kind(predicted), worst_of_each_kind(found)
colors = ["#D55E00", "#56B4E9", "#0072B2", "#CC79A7", "#009E73", "#E69F00", "#882255", "#666666"]
height = 0.0
for kind, color in sorted(zip(lines, colors, strict=True), key=lambda pair: lines[pair[0]][-1]):
    axes.plot(DURATIONS, lines[kind], color=color, linewidth=1.6)
    axes.plot(chosen, dots[kind], "o", color=color, markersize=5.0)
    height = max(lines[kind][-1], 1.13 * height)  # no name over another
    name = kind.replace("_", " ").replace("accel", "accel.")
    axes.text(1.02 * DURATIONS[-1], height, name, color=color, va="center")
axes.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
axes.text(DURATIONS[0], 1.05, "bound")
axes.axvline(chosen, color="#bbbbbb", linewidth=0.8, zorder=0)
axes.set_xscale("log")
axes.set_yscale("log")
axes.set_xticks(DURATIONS, map(str, DURATIONS))
axes.set_xticks([], minor=True)
axes.set_yticks([0.1, 0.3, 1.0, 3.0, 10.0], ["0.1", "0.3", "1", "3", "10"])
axes.set_xlabel("duration of a position, s")
axes.set_ylabel("3 sigma over bound, worst parameter of the kind")
axes.set_title(f"25 positions: predicted (lines), and {RUNS} calibrations (dots)", loc="left")
figure.savefig(next((a for a in sys.argv if a.endswith(".png")), "position_duration.png"), dpi=120)
