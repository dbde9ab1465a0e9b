import numpy as np
import pytest
from conftest import paper_schedule, paper_truth
from scipy import stats

from inscal import parameters
from inscal.kernel import LANES
from inscal.motion import Site, build_motion
from inscal.recursion import InitialStd
from inscal.sensor import compensate
from inscal.simulation import PURPOSES, TruthModel, Workspace, draw_truth, generator, simulate
from inscal.state_model import NoiseModel

SITE = Site(np.deg2rad(39.98), 50.0)
NOISE = NoiseModel(1.5e-7, 5e-5, 1e-3, 0.1)
SIZE = paper_truth() * parameters.si_units(1673.84e-9)
STD = InitialStd(np.deg2rad([0.1, 0.1, 0.5]), 0.01, 1.0, SIZE)


@pytest.fixture(scope="module")
def motion():
    schedule = paper_schedule(3, position_duration=100.0)
    return build_motion(schedule, SITE, update_interval=1.0, dwell_step=1.0, turn_step=0.1)


def record_of(motion, truth, runs=range(LANES), noise=NOISE):
    lanes = np.broadcast_to(truth[:, None], (27, LANES))
    return simulate(
        lanes, motion, noise, STD, seed=9, runs=list(runs), workspace=Workspace.of(motion)
    )


def test_streams_depend_on_seed_run_and_purpose_only():
    draws = {
        (seed, run, purpose): tuple(generator(seed, run, purpose).standard_normal(3))
        for seed in (1, 2)
        for run in (0, 1, 256, 2**16, 10**6, 2**32, 2**32 + 1)
        for purpose in PURPOSES
    }
    assert len(set(draws.values())) == len(draws)
    assert draws[1, 10**6, "truth"] == tuple(generator(1, 10**6, "truth").standard_normal(3))


def test_sensor_noise_is_white_with_the_configured_density(motion):
    truth = SIZE.copy()
    record = record_of(motion, truth)
    p = np.broadcast_to(truth[:, None], (27, LANES)).copy()
    noise = np.empty((motion.steps, 6, LANES))
    for s in range(motion.steps):
        for j in range(LANES):
            increments = record.sensors[s, :, j]
            dt = motion.duration[s]
            angle, velocity = compensate(p, j, tuple(increments[:3]), tuple(increments[3:]), dt)
            noise[s, :3, j] = (motion.angle[s] - angle) / (NOISE.gyro * np.sqrt(dt))
            noise[s, 3:, j] = (motion.velocity[s] - velocity) / (NOISE.accel * np.sqrt(dt))
    flat = noise.transpose(1, 0, 2).reshape(6, -1)
    count = flat.shape[1]
    assert np.abs(flat.mean(axis=1)).max() < 5 / np.sqrt(count)
    assert np.abs(flat.var(axis=1) - 1).max() < 5 * np.sqrt(2 / count)
    correlation = np.corrcoef(flat) - np.eye(6)
    assert np.abs(correlation).max() < 5 / np.sqrt(count)
    lag = (noise[1:] * noise[:-1]).mean()
    assert abs(lag) < 5 / np.sqrt(noise.size)
    assert stats.kstest(flat.ravel()[::7], "norm").pvalue > 1e-4


def test_observations_and_initial_errors_have_the_configured_spread(motion):
    records = [record_of(motion, SIZE, range(first, first + LANES)) for first in range(0, 320, 16)]
    z = np.concatenate([r.observations for r in records], axis=2)
    assert np.abs(z.std(axis=(0, 2)) / np.repeat([1e-3, 0.1], 3) - 1).max() < 0.02
    velocity = np.concatenate([r.velocity for r in records], axis=1)
    position = np.concatenate([r.position for r in records], axis=1)
    attitude = np.concatenate([r.attitude for r in records], axis=2)
    assert np.abs(velocity.std(axis=1) / 0.01 - 1).max() < 0.2
    assert np.abs(position.std(axis=1) / 1.0 - 1).max() < 0.2
    # C_hat = (I - [phi x]) C
    turned = np.einsum("ijr,kj->ikr", attitude, motion.initial_attitude)
    phi = -np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
    assert np.abs(phi.std(axis=1) / STD.attitude - 1).max() < 0.2


def test_a_runs_record_does_not_depend_on_its_lane(motion):
    forward = record_of(motion, SIZE, range(LANES))
    # buffers are views of one workspace: keep a copy
    sensors, observations = forward.sensors.copy(), forward.observations.copy()
    backward = record_of(motion, SIZE, range(LANES - 1, -1, -1))
    assert (sensors == backward.sensors[..., ::-1]).all()
    assert (observations == backward.observations[..., ::-1]).all()
    assert (forward.attitude == backward.attitude[..., ::-1]).all()


def test_noise_is_shared_between_noise_levels(motion):
    zero = np.zeros(27)
    one, two = (
        record_of(motion, zero, noise=NoiseModel(f * 1e-7, f * 1e-5, f * 1e-3, f * 0.1))
        for f in (1.0, 2.0)
    )
    a = one.sensors - np.concatenate([motion.angle, motion.velocity], axis=1)[..., None]
    b = two.sensors - np.concatenate([motion.angle, motion.velocity], axis=1)[..., None]
    np.testing.assert_allclose(b, 2 * a, atol=1e-14)
    np.testing.assert_allclose(two.observations, 2 * one.observations, rtol=1e-15)


def test_truth_depends_on_seed_and_run():
    for distribution in ("normal", "uniform"):
        model = TruthModel(distribution, SIZE)
        keys = [(1, 0), (1, 1), (1, 256), (1, 2**32), (2, 0)]
        drawn = {key: tuple(draw_truth(model, *key)) for key in keys}
        assert len(set(drawn.values())) == len(keys)
        assert drawn[1, 256] == tuple(draw_truth(model, 1, 256))


@pytest.mark.parametrize("distribution", ["fixed", "normal", "uniform"])
def test_root_mean_square_is_that_of_the_draws(distribution):
    model = TruthModel(distribution, -SIZE if distribution == "fixed" else SIZE)
    drawn = np.array([draw_truth(model, 1, run) for run in range(4000)])
    np.testing.assert_allclose(np.sqrt(np.square(drawn).mean(axis=0)), model.rms, rtol=0.06)


def test_a_record_depends_on_seed_and_run(motion):
    """Runs that are equal modulo a power of two are others, in all that is drawn."""
    runs = [0, 256, 2**16, 2**32, *range(1, LANES - 3)]
    lanes = np.broadcast_to(SIZE[:, None], (27, LANES))
    records = [
        simulate(lanes, motion, NOISE, STD, seed=seed, runs=runs, workspace=Workspace.of(motion))
        for seed in (9, 10)
    ]
    for name in ("sensors", "observations", "attitude", "velocity", "position"):
        both = np.concatenate([getattr(record, name) for record in records], axis=-1)
        flat = both.reshape(-1, 2 * LANES)
        assert len({column.tobytes() for column in flat.T}) == 2 * LANES, name


@pytest.mark.parametrize("step", [0.1, 1.0, 4.0])
def test_sensor_noise_grows_with_the_root_of_any_step(step):
    schedule = paper_schedule(1, position_duration=800.0)
    motion = build_motion(schedule, SITE, update_interval=8.0, dwell_step=step, turn_step=0.1)
    record = record_of(motion, np.zeros(27))
    true = np.concatenate([motion.angle, motion.velocity], axis=1)[..., None]
    spread = (record.sensors - true).std(axis=(0, 2)) / np.sqrt(step)
    expected = np.repeat([NOISE.gyro, NOISE.accel], 3)
    within = 5 / np.sqrt(2 * motion.steps * LANES)
    assert motion.steps == round(800.0 / step)
    assert np.abs(spread / expected - 1).max() < within


def test_truth_distributions():
    runs = 4000
    normal = np.array([draw_truth(TruthModel("normal", SIZE), 1, r) for r in range(runs)]) / SIZE
    uniform = np.array([draw_truth(TruthModel("uniform", SIZE), 1, r) for r in range(runs)]) / SIZE
    assert np.abs(normal.mean(axis=0)).max() < 5 / np.sqrt(runs)
    assert np.abs(normal.var(axis=0) - 1).max() < 5 * np.sqrt(2 / runs)
    assert np.abs(uniform).max() < 1
    assert np.abs(uniform.mean(axis=0)).max() < 5 / np.sqrt(3 * runs)
    assert np.abs(uniform.var(axis=0) - 1 / 3).max() < 0.03
    assert (draw_truth(TruthModel("fixed", SIZE), 1, 5) == SIZE).all()
    with pytest.raises(ValueError, match="fixed, normal or uniform"):
        draw_truth(TruthModel("cauchy", SIZE), 1, 0)
