"""Statistical proof for inertial calibration: physics, filter and statistics of one experiment.

**Frames.** Navigation frame n is North, East, Down at the body's place; body frame b has the axes
x, y, z of the gyro triad. A body-to-NED matrix C turns components in b into components in n.
Navigation errors are navigated minus true, parameters true minus estimated.

**Units.** SI throughout: rad, rad/s, m/s, m/s^2, m, s. `inscal.units` holds the size of every paper
unit, `inscal.parameters` that of each parameter.

**Types.** Arrays of doubles, shapes in the docstrings. Parameters are 27-vectors in the order of
`inscal.parameters.NAMES`; runs lie side by side in the last axis while they are simulated, and are
rows once they are results. What belongs together is a frozen dataclass: `Schedule` and `Site` make
a `Motion`; `Truth` is what runs meet, `Belief` what the filter takes for true, `Estimator` what
comes of it; `Experiment` is all that runs share, `Outcome` what they leave.

Importing this package imports nothing. A calibration, twenty times::

    import numpy as np
    from inscal import estimator, experiment, motion, parameters, recursion, schedule, simulation
    from inscal import state_model

    turns = schedule.turns_of([(90, "Y"), (180, "Y"), (90, "X"), (90, "Z"), (180, "X")])
    path = schedule.Schedule(("North", "East", "Down"), turns, 100.0, turn_rate=0.17)
    size = 1e-4 * np.ones(parameters.COUNT)  # SI: rad/s, m/s^2, 1, rad, s^2/m, m
    known = recursion.InitialStd(np.full(3, 2e-3), velocity=0.01, position=1.0, parameter=size)
    noise = state_model.NoiseModel(gyro=1.5e-7, accel=5e-5, velocity=1e-3, position=0.1)
    truth = simulation.Truth(simulation.TruthModel("normal", size), noise, known)
    belief = estimator.Belief(noise, known, passes=2, update_interval=1.0)
    shared = experiment.prepare(
        1, path, motion.Site(0.7, 50.0), truth, belief, dwell_step=1.0, turn_step=0.5
    )
    outcome = experiment.run(shared, range(20))  # truth, estimate (20, 27); nees, failed (20,)
"""

__version__ = "0.1.0"
"""Version of the package, which the wheel takes from here."""
