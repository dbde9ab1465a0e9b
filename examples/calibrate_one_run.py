"""One calibration from Python: four of its 27 parameters on their way to the truth.

Left, the first pass starts from nothing. The estimate should stay within 3 of the filter's own
sigmas of the truth (shaded); that band narrows where a turn of the table shows what no position
before it could. Right, the errors of the second pass over the same record, closer up. It begins
where the first ended: in the scale factor that is well outside 3 sigma, since a linear filter
neglects products of errors, and the second pass takes it back inside.

    python examples/calibrate_one_run.py [figure.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

from inscal import parameters, units
from inscal.estimator import Belief
from inscal.experiment import prepare, run_with_history
from inscal.motion import Site
from inscal.recursion import InitialStd
from inscal.schedule import Schedule, turns_of
from inscal.simulation import Truth, TruthModel
from inscal.state_model import NoiseModel

SHOWN = {  # with the units of the paper's tables
    "gyro_bias_y": "gyro bias y, °/h",
    "accel_k11": "accel. scale factor x, ppm",
    "accel_quadratic_x": "quadratic term x, 10⁻⁹ s/pulse",
    "lever_arm_y": "lever arm y, mm",
}

# the table: turns in degrees about body axes at 10 deg/s, one every 500 s
TURNS = """90Y 180Y 180Y 90Z 180Z 180Z 90X 180X 180X 90X 90X 90X
           90Z 90Z 90Z 90Y 90Y 90Y 180Z 180X 180Y 180Y 180X 180Z"""
turns = turns_of((float(turn[:-1]), turn[-1]) for turn in TURNS.split())
path = Schedule(("North", "East", "Down"), turns, 500.0, 10.0 * units.DEGREE)
site = Site(latitude=39.98 * units.DEGREE, height=50.0)

# the unit: its noise and that of the reference, its true errors, and how well they are known before
noise = NoiseModel(
    gyro=0.0005 * units.DEG_PER_SQRT_HOUR, accel=5.0 * units.MICRO_G, velocity=0.001, position=0.1
)
unit = parameters.si_units(units.quadratic_unit(pulses_per_m_per_s=1673.84))
errors = unit * parameters.vector(
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
prior = InitialStd(attitude, velocity=0.01, position=1.0, parameter=errors)

# the calibration: the gains, which no measurement changes, and one run of 25 positions
truth = Truth(TruthModel("fixed", errors), noise, prior)
belief = Belief(noise, prior, passes=2, update_interval=1.0)
experiment = prepare(7, path, site, truth, belief, dwell_step=1.0, turn_step=0.5)
outcome, history = run_with_history(experiment, 0)

# what came out, in paper units
gains = experiment.estimator
true, final, sigma = errors / unit, outcome.estimate[0] / unit, gains.predicted_std / unit
course = history.estimate[..., 0] / unit
hours = np.arange(1, experiment.motion.updates + 1) / 3600.0
off = np.abs([course[0, -1] - true, final - true]) / sigma

print("parameter             truth  estimate     sigma  off by, sigmas: pass 1  pass 2")
for name in SHOWN:
    i = parameters.NAMES.index(name)
    print(
        f"{name:18}{true[i]:9.3f}{final[i]:10.4f}{sigma[i]:10.4f}{off[0, i]:24.1f}{off[1, i]:8.1f}"
    )
print("largest of all 27" + 44 * " " + f"{off[0].max():10.1f}{off[1].max():8.1f}")

plt.rcParams |= {"axes.spines.top": False, "axes.spines.right": False, "font.size": 9.0}
figure, panels = plt.subplots(4, 2, figsize=(9.0, 9.2), sharex=True, layout="constrained")
for (left, right), name in zip(panels, SHOWN, strict=True):
    i = parameters.NAMES.index(name)
    for axes, number, color, zero in ((left, 0, "#E69F00", 0.0), (right, 1, "#0072B2", true[i])):
        band = 3.0 * gains.gains(number).parameter_std[:, i] / unit[i]
        middle = true[i] - zero
        axes.fill_between(hours, middle - band, middle + band, color=color, alpha=0.18, linewidth=0)
        axes.axhline(middle, color="black", linewidth=0.8, linestyle="--")
        axes.plot(hours, course[number, :, i] - zero, color=color, linewidth=1.2)
    for limit in (-3.0 * sigma[i], 3.0 * sigma[i]):
        right.axhline(limit, color="#777777", linewidth=0.8, linestyle=":")
    right.plot(0.0, course[0, -1, i] - true[i], "o", color="#E69F00", clip_on=False)
    right.plot(hours[-1], final[i] - true[i], "o", color="black", clip_on=False)
    left.set_ylim(-0.3 * true[i], 2.3 * true[i])
    right.set_ylim(-10.0 * sigma[i], 10.0 * sigma[i])
    left.set_title(SHOWN[name], loc="left", fontweight="bold")
    left.set_ylabel("estimate")
    right.set_ylabel("estimate − truth")
for axes in panels[-1]:
    axes.set_xlabel("time on the table, h")
    axes.set_xlim(0.0, hours[-1])
figure.align_ylabels()
figure.suptitle("One calibration: first pass from nothing (left), errors of the second (right)")
looks = {
    "first pass": {"color": "#E69F00"},
    "second pass": {"color": "#0072B2"},
    "truth": {"color": "black", "linewidth": 0.8, "linestyle": "--"},
    "±3 sigma at the time (shaded)": {"color": "#999999", "alpha": 0.35, "linewidth": 8.0},
    "±3 sigma of the result": {"color": "#777777", "linewidth": 0.8, "linestyle": ":"},
    "result": {"color": "black", "marker": "o", "linestyle": ""},
}
handles = [plt.Line2D([], [], label=text, **look) for text, look in looks.items()]
figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False)
figure.savefig(next((a for a in sys.argv if a.endswith(".png")), "calibrate_one_run.png"), dpi=120)
