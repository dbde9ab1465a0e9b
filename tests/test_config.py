"""Configuration: what loads, what is refused and with which line, and how a stage ends."""

import json
import os
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hydra.core.global_hydra import GlobalHydra

from inscal import parameters
from pipeline.config.load import load, resolved
from pipeline.config.schema import KIND_KEYS, KindValues
from pipeline.console.errors import ConfigError
from pipeline.console.help import CONF

GROUPS = sorted(path.name for path in CONF.iterdir() if path.is_dir())
OPTIONS = [
    f"{group}={path.stem}" for group in GROUPS for path in sorted((CONF / group).glob("*.yaml"))
]

# Postures of the paper's Table 1: where x, y, z point at each position, as initials.
_TABLE_1 = (
    "NED UEN DES UEN EDN WUN EDN ENU ESD ENU EUS ESD EDN DWN WUN UEN SEU DES "
    "NED SWD SEU NED SEU SWD NED"
)
POSTURES = _TABLE_1.split()
OPPOSITE = dict(zip("NSEWDU", "SNWEUD", strict=True))

WHITE_NOISE = "noise.accel_white_noise_ug_per_sqrt_hz"
POSITION_NOISE = "noise.position_observation_m"
GYRO_BIAS = "truth.gyro_bias_deg_per_h"
ROTATIONS = "schedule.rotations"
POSTURE = "schedule.initial_posture"
ATTITUDE = "estimator.initial_std.attitude_deg"

# Overrides, and what the line must contain: key, value and what is allowed.
BAD = [
    # unknown options and keys
    (["noise=loud"], "noise = loud: must be one of noisy, quiet, reference"),
    (["truth=gauss"], "truth = gauss: must be one of dispersed, paper, uniform"),
    (
        ["schedule=position26"],
        "schedule = position26: must be one of position19, position19_equal_time, position25",
    ),
    (["cluster=cloud"], "cluster = cloud: must be one of processes, scheduler, slurm, threads"),
    (["noise.nam=x"], "noise.nam: unknown key; must be one of name, gyro_angle_random_walk"),
    (["+noise.extra=1"], "noise.extra: unknown key; must be one of name"),
    (["++estimator.initial_std.extra=1"], "estimator.initial_std.extra: unknown key"),
    (["run=1"], "run: unknown key; must be one of truth, noise"),
    (["+run=1"], "run: unknown key; must be one of truth, noise"),
    (["hydra.extra=1"], "hydra.extra: Key 'extra' not in"),
    (["~noise.name"], "noise.name: "),
    (["~noise"], "noise.name: must be given"),
    (["noise=null"], "(given: noise=null)"),
    # syntax and interpolation
    (["noise"], "'noise': must be group=option or key=value"),
    (["noise=[quiet"], "'noise=[quiet': must be group=option or key=value"),
    ([f"{POSITION_NOISE}=${{oops}}"], f"{POSITION_NOISE}: Interpolation key 'oops' not found"),
    ([f"{POSITION_NOISE}=???"], f"{POSITION_NOISE}: must be given"),
    ([f"{POSITION_NOISE}=1,2"], f"'{POSITION_NOISE}=1,2'"),
    # types
    ([f"{WHITE_NOISE}=abc"], f"{WHITE_NOISE} = abc: must be a number"),
    ([f"{WHITE_NOISE}=true"], f"{WHITE_NOISE} = true: must be a number"),
    ([f"{WHITE_NOISE}=[1,2]"], f"{WHITE_NOISE} = [1,2]: must be a number"),
    ([f"{WHITE_NOISE}="], f"{WHITE_NOISE} = '': must be a number"),
    ([f"{WHITE_NOISE}=null"], f"{WHITE_NOISE} = null: must not be null"),
    ([f"{WHITE_NOISE}=1{'0' * 400}"], f"{WHITE_NOISE}: int too large"),
    (["campaign.runs=2.5"], "campaign.runs = 2.5: must be an integer"),
    (["campaign.seed=x"], "campaign.seed = x: must be an integer"),
    (["truth.distribution=[normal]"], "truth.distribution = [normal]: must be text"),
    ([f"{ROTATIONS}=90"], f"{ROTATIONS} = 90: must be a list"),
    ([f"{ROTATIONS}=null"], f"{ROTATIONS} = null: must not be null"),
    # numbers
    ([f"{WHITE_NOISE}=-5"], f"{WHITE_NOISE} = -5.0: must be a finite number >= 0"),
    ([f"{WHITE_NOISE}=nan"], f"{WHITE_NOISE} = nan: must be a finite number >= 0"),
    ([f"{WHITE_NOISE}=inf"], f"{WHITE_NOISE} = inf: must be a finite number >= 0"),
    (["noise.gyro_angle_random_walk_deg_per_sqrt_h=-1"], "deg_per_sqrt_h = -1.0: must be"),
    ([f"{POSITION_NOISE}=0"], f"{POSITION_NOISE} = 0.0: must be a finite number > 0"),
    (["noise.velocity_observation_m_per_s=0"], "velocity_observation_m_per_s = 0.0: must be"),
    (["noise.name=a/b"], "noise.name = 'a/b': must be letters"),
    (["schedule.name=''"], "schedule.name = '': must be letters"),
    (["site.latitude_deg=89"], "site.latitude_deg = 89.0: must be a number between -89 and 89"),
    (["site.latitude_deg=nan"], "site.latitude_deg = nan: must be"),
    (["site.height_m=10001"], "site.height_m = 10001.0: must be a number from -500 to 10000"),
    (["site.height_m=-501"], "site.height_m = -501.0: must be"),
    (["simulation.dwell_step_s=0"], "simulation.dwell_step_s = 0.0: must be a finite number > 0"),
    (["simulation.turn_step_s=-0.1"], "simulation.turn_step_s = -0.1: must be"),
    (["simulation.turn_step_s=1.41"], "simulation.turn_step_s = 1.41: must be at most 1.4"),
    (["campaign.precision=0"], "campaign.precision = 0.0: must be a number between 0 and 1"),
    (["campaign.precision=nan"], "campaign.precision = nan: must be"),
    (["estimator.passes=0"], "estimator.passes = 0: must be an integer from 1 to 10"),
    (["estimator.passes=11"], "estimator.passes = 11: must be an integer from 1 to 10"),
    (["estimator.update_interval_s=0"], "estimator.update_interval_s = 0.0: must be"),
    (["sensor.quadratic_unit=pulses"], "sensor.quadratic_unit = 'pulses': must be one of pulse"),
    (["sensor.accel_pulses_per_m_per_s=0"], "sensor.accel_pulses_per_m_per_s = 0.0: must be"),
    (["campaign.runs=0"], "campaign.runs = 0: must be an integer >= 1"),
    (["campaign.batch=0"], "campaign.batch = 0: must be an integer >= 1"),
    (["campaign.seed=-1"], "campaign.seed = -1: must be an integer >= 0"),
    (["campaign.store=''"], "campaign.store = '': must be a path, not empty"),
    (["b=''"], "b = '': must be a path, not empty"),
    (["only_run=-1"], "only_run = -1: must be an integer >= 0"),
    (["only_run=20", "campaign.runs=20"], "only_run = 20: must be less than campaign.runs"),
    (["out=/"], "out = '/': must be the path of a file"),
    (["a=''"], "a = '': must be a path, not empty"),
    (["accept=' '"], "accept = ' ': must be the reason in words, not empty"),
    # values of parameter kinds
    (["truth.distribution=cauchy"], "truth.distribution = 'cauchy': must be one of fixed, normal"),
    ([f"{GYRO_BIAS}=x"], f"{GYRO_BIAS} = 'x': must be a finite number >= 0, or a list of 3"),
    ([f"{GYRO_BIAS}=true"], f"{GYRO_BIAS} = True: must be"),
    ([f"{GYRO_BIAS}=null"], f"{GYRO_BIAS} = null: must be"),
    ([f"{GYRO_BIAS}={{x:1}}"], f"{GYRO_BIAS} = {{'x': 1}}: must be"),
    ([f"{GYRO_BIAS}=[1,2]"], f"{GYRO_BIAS} = [1, 2]: must be a finite number >= 0, or a list of 3"),
    ([f"{GYRO_BIAS}=[]"], f"{GYRO_BIAS} = []: must be"),
    ([f"{GYRO_BIAS}=[1,2,nan]"], f"{GYRO_BIAS} = [1, 2, nan]: must be"),
    ([f"{GYRO_BIAS}=[1,2,[3]]"], f"{GYRO_BIAS} = [1, 2, [3]]: must be"),
    ([f"{GYRO_BIAS}=1{'0' * 400}"], f"{GYRO_BIAS} = 1000"),
    ([f"{GYRO_BIAS}=-1"], f"{GYRO_BIAS} = -1: must be a finite number >= 0"),
    (["truth=paper", f"{GYRO_BIAS}=-inf"], f"{GYRO_BIAS} = -inf: must be a finite number, or"),
    (["truth.accel_installation_arcsec=[1,2,3]"], "= [1, 2, 3]: must be a finite number >= 0, or"),
    (["estimator.initial_std.lever_arm_mm=0"], "estimator.initial_std.lever_arm_mm = 0: must be"),
    (["bounds.lever_arm_mm=[1,2,0]"], "bounds.lever_arm_mm = [1, 2, 0]: must be a finite"),
    ([f"{ATTITUDE}=[1,2]"], f"{ATTITUDE} = [1.0, 2.0]: must be a list of 3 finite numbers > 0"),
    ([f"{ATTITUDE}=[1,2,0]"], f"{ATTITUDE} = [1.0, 2.0, 0.0]: must be a list of 3"),
    (["estimator.initial_std.velocity_m_per_s=0"], "initial_std.velocity_m_per_s = 0.0: must be"),
    (["estimator.initial_std.position_m=-1"], "initial_std.position_m = -1.0: must be"),
    (["estimator.states=[]"], "estimator.states = []: must be one or more of gyro_bias"),
    (["estimator.states=[gyro_k,gyro_k]"], "estimator.states = ['gyro_k', 'gyro_k']: must be"),
    (["estimator.states=[gyro_scale]"], "estimator.states = ['gyro_scale']: must be one or more"),
    (["estimator.states=[[gyro_k]]"], "estimator.states = [['gyro_k']]: must be one or more"),
    # schedule
    ([f"{ROTATIONS}=[]"], f"{ROTATIONS} = []: must be at least one [angle_deg, axis]; this is an"),
    ([f"{ROTATIONS}=[90,X]"], f"{ROTATIONS}[0] = 90: must be [angle_deg, axis]"),
    ([f"{ROTATIONS}=[[90,X],[90]]"], f"{ROTATIONS}[1] = [90]: must be [angle_deg, axis]"),
    ([f"{ROTATIONS}=[[90,W]]"], f"{ROTATIONS}[0] = [90, 'W']: must be [angle_deg, axis] with X, Y"),
    ([f"{ROTATIONS}=[[90,[X]]]"], f"{ROTATIONS}[0] = [90, ['X']]: must be"),
    ([f"{ROTATIONS}=[[0,X]]"], f"{ROTATIONS}[0] = [0, 'X']: must be [angle_deg, axis] with an"),
    ([f"{ROTATIONS}=[[45,X]]"], f"{ROTATIONS}[0] = [45, 'X']: must be"),
    ([f"{ROTATIONS}=[[450,X]]"], f"{ROTATIONS}[0] = [450, 'X']: must be"),
    ([f"{ROTATIONS}=[[nan,X]]"], f"{ROTATIONS}[0] = [nan, 'X']: must be"),
    (["schedule.turn_rate_deg_per_s=0"], "schedule.turn_rate_deg_per_s = 0.0: must be"),
    (["schedule.turn_rate_deg_per_s=0.3"], f"{ROTATIONS}[1] = [180, 'Y']: must be a turn shorter"),
    (["schedule.position_duration_s=0"], "schedule.position_duration_s = 0.0: must be a finite"),
    (["schedule.position_duration_s=18"], f"{ROTATIONS}[1] = [180, 'Y']: must be a turn shorter"),
    (["schedule.position_duration_s=500.5"], "= 500.5: must be a multiple of estimator.update"),
    (["estimator.update_interval_s=600"], "must be a multiple of estimator.update_interval_s"),
    (["estimator.update_interval_s=1e-320"], "must be a multiple of estimator.update_interval_s"),
    ([f"{POSTURE}=[North,East]"], f"{POSTURE} = ['North', 'East']: must be 3 of North, South"),
    ([f"{POSTURE}=[North,East,down]"], f"{POSTURE} = ['North', 'East', 'down']: must be 3 of"),
    ([f"{POSTURE}=[North,East,Up]"], "at right angles and right-handed"),
    ([f"{POSTURE}=[North,North,Down]"], "at right angles and right-handed"),
    # cluster
    (["cluster.kind=ssh"], "cluster.kind = 'ssh': must be one of threads, processes"),
    (["cluster.workers=0"], "cluster.workers = 0: must be an integer >= 1"),
    (["cluster.workers=null"], "cluster.workers = null: must be given with cluster.kind threads"),
    (
        ["cluster.address=tcp://h:1"],
        "cluster.address = 'tcp://h:1': must be null with cluster.kind",
    ),
    (["cluster=scheduler", "cluster.address=null"], "cluster.address = null: must be given"),
    (["cluster=scheduler", "cluster.address=h"], "cluster.address = 'h': must be an address such"),
    (["cluster=scheduler", "cluster.address=tcp://h:65536"], "= 'tcp://h:65536': must be"),
    (["cluster=slurm", "cluster.queue=null"], "cluster.queue = null: must be given with"),
    (["cluster=slurm", "cluster.queue='a b'"], "cluster.queue = 'a b': must be letters"),
    (["cluster=slurm", "cluster.account='a b'"], "cluster.account = 'a b': must be letters"),
    (["cluster=slurm", "cluster.cores=0"], "cluster.cores = 0: must be an integer >= 1"),
    (["cluster=slurm", "cluster.memory=8"], "cluster.memory = '8': must be an amount such as 8GB"),
    (["cluster=slurm", "cluster.walltime=2h"], "cluster.walltime = '2h': must be a time such"),
]


@pytest.mark.parametrize(("overrides", "said"), BAD, ids=lambda value: str(value)[:60])
def test_refusal_is_one_line_with_key_value_and_what_is_allowed(overrides, said):
    with pytest.raises(ConfigError) as caught:
        load(overrides)
    line = str(caught.value)
    assert said in line
    assert "\n" not in line


def test_defaults():
    config = load()
    assert config.truth.distribution == "normal"
    assert config.noise.name == "reference"
    assert config.schedule.name == "position25"
    assert config.estimator.passes == 2
    assert config.estimator.states == list(parameters.GROUPS)
    assert config.cluster.kind == "threads"
    assert config.campaign.store == "results/runs/position25-reference"
    assert [config.only_run, config.out, config.a, config.b, config.accept] == [None] * 5


@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_composes(option):
    group, _, choice = option.partition("=")
    config = resolved(load([option]))
    assert isinstance(config[group], dict)
    # Options that carry their own name carry the right one.
    assert config[group].get("name", choice) == choice
    if group == "cluster":
        assert config[group]["kind"] == choice


def test_noise_options():
    numbers = {
        name: list(resolved(load([f"noise={name}"]))["noise"].values())[1:]
        for name in ("reference", "quiet", "noisy")
    }
    assert numbers == {
        "reference": [0.0005, 5.0, 0.001, 0.1],
        "quiet": [0.0002, 2.0, 0.001, 0.05],
        "noisy": [0.001, 50.0, 0.1, 10.0],
    }


def test_store_follows_schedule_and_noise():
    config = load(["schedule=position19", "noise=quiet"])
    assert config.campaign.store == "results/runs/position19-quiet"


def test_one_pass_inherits_the_rest():
    two, one = (resolved(load([f"estimator={name}"])) for name in ("two_pass", "one_pass"))
    assert one["estimator"].pop("passes") == 1
    assert two["estimator"].pop("passes") == 2
    assert one == two


PAPER_TRUTH = {
    "gyro_bias": 0.05,
    "accel_bias": 200.0,
    "gyro_scale_factor": 500.0,
    "gyro_installation": 206.26,
    "accel_scale_factor": 500.0,
    "accel_installation": 206.26,
    "accel_quadratic": 30.0,
    "lever_arm": (10.0, 20.0, 30.0),
}
PAPER_BOUNDS = {
    "gyro_bias": 0.001,
    "accel_bias": 9.0,
    "gyro_scale_factor": 3.0,
    "gyro_installation": 1.0,
    "accel_scale_factor": 2.0,
    "accel_installation": 3.0,
    "accel_quadratic": 0.4,
    "lever_arm": 3.0,
}
"""The paper's Table 3, in its units."""


@pytest.mark.parametrize(
    ("option", "distribution"),
    [("paper", "fixed"), ("dispersed", "normal"), ("uniform", "uniform")],
)
def test_truth_has_the_papers_numbers(option, distribution):
    truth = load([f"truth={option}"]).truth
    assert truth.distribution == distribution
    np.testing.assert_array_equal(
        parameters.vector(truth.by_kind()), parameters.vector(PAPER_TRUTH)
    )


def test_bounds_are_the_papers():
    bounds = parameters.vector(load().bounds.by_kind())
    np.testing.assert_array_equal(bounds, parameters.vector(PAPER_BOUNDS))


def test_initial_std_is_the_papers_truth_but_for_the_lever_arm():
    expected = parameters.vector(PAPER_TRUTH)
    expected[parameters.INDEX["lever_arm"]] = 50.0
    std = parameters.vector(load().estimator.initial_std.by_kind())
    np.testing.assert_array_equal(std, expected)


def test_keys_of_kinds_are_the_fields_of_the_schema():
    assert list(KIND_KEYS) == list(parameters.KINDS)
    assert list(KIND_KEYS.values()) == [field.name for field in fields(KindValues)]


def turned(posture, angle, axis):
    """Posture after a right-handed quarter-turn sequence about a body axis."""
    x, y, z = posture
    for _ in range(round(angle / 90)):
        if axis == "X":
            y, z = z, OPPOSITE[y]
        elif axis == "Y":
            z, x = x, OPPOSITE[z]
        else:
            x, y = y, OPPOSITE[x]
    return x + y + z


def test_position25_visits_the_postures_of_table_1():
    schedule = load().schedule
    postures = ["".join(name[0] for name in schedule.initial_posture)]
    for angle, axis in schedule.rotations:
        postures.append(turned(postures[-1], angle, axis))
    assert len(schedule.rotations) == 24
    assert postures == POSTURES


def test_position19_is_the_head_of_position25():
    long, short = (load([f"schedule={name}"]).schedule for name in ("position25", "position19"))
    assert len(short.rotations) == 18
    assert short.rotations == long.rotations[:18]
    assert short.initial_posture == long.initial_posture


def test_lists_may_change_their_length():
    config = load([f"{GYRO_BIAS}=[0.1,0.2,0.3]", "truth.lever_arm_mm=5", f"{ROTATIONS}=[[-90,Y]]"])
    assert config.truth.gyro_bias_deg_per_h == [0.1, 0.2, 0.3]
    assert config.truth.lever_arm_mm == 5.0
    assert config.schedule.rotations == [[-90.0, "Y"]]


def test_fixed_truth_may_be_negative():
    truth = load(["truth=paper", f"{GYRO_BIAS}=-0.05"]).truth
    assert truth.gyro_bias_deg_per_h == -0.05


def test_noise_free_sensors_are_allowed():
    noise = load([f"{WHITE_NOISE}=0", "noise.gyro_angle_random_walk_deg_per_sqrt_h=0"]).noise
    assert noise.accel_white_noise_ug_per_sqrt_hz == 0.0
    assert noise.gyro_angle_random_walk_deg_per_sqrt_h == 0.0


def test_decimal_seconds_divide_a_position():
    assert not (20.7 / 0.1).is_integer()  # in binary; in decimals it is 207
    load(["schedule.position_duration_s=20.7", "estimator.update_interval_s=0.1"])


def test_posture_may_be_any_right_handed_one():
    assert load([f"{POSTURE}=[Up,East,North]"]).schedule.initial_posture == ["Up", "East", "North"]


def test_resolved_is_plain_and_does_not_tell_10_from_10_point_0():
    integers = resolved(load(["truth.lever_arm_mm=[10,20,30]", f"{ROTATIONS}=[[90,X]]"]))
    decimals = resolved(load(["truth.lever_arm_mm=[10.0,20.0,30.0]", f"{ROTATIONS}=[[90.0,X]]"]))
    assert json.dumps(integers) == json.dumps(decimals)
    assert json.loads(json.dumps(integers)) == integers


def test_load_leaves_no_hydra_behind():
    load()
    with pytest.raises(ConfigError):
        load(["noise=loud"])
    assert not GlobalHydra.instance().is_initialized()


STAGE = '''"""Stage `small`: what `stage` makes of a function.

Usage: ``python -m small_stage [noise=...]``

Reads: noise out.
"""

from pipeline.config.load import load
from pipeline.config.stage import stage
from pipeline.console.errors import DataError

@stage
def main(config):
    if config.out == "data":
        raise DataError("results: no store")
    if config.out == "interrupt":
        raise KeyboardInterrupt
    if config.out == "defect":
        raise ValueError("a defect")
    print(config.noise.name, load(["noise=noisy"]).noise.name)

if __name__ == "__main__":
    main()
'''


@pytest.fixture
def run_stage(tmp_path):
    """Run a small stage in an empty directory; return its result and what it left there."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "small_stage.py").write_text(STAGE)
    cwd = tmp_path / "cwd"
    cwd.mkdir()
    roots = [str(tmp_path / "modules"), str(Path(__file__).resolve().parent.parent)]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(roots)}

    def run(*arguments):
        command = [sys.executable, "-m", "small_stage", *arguments]
        result = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
        return result, sorted(path.name for path in cwd.iterdir())

    return run


def test_stage_runs_and_leaves_nothing(run_stage):
    result, left = run_stage("noise=quiet")
    assert (result.returncode, result.stdout, result.stderr) == (0, "quiet noisy\n", "")
    assert left == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["campaign.runs=0"], "campaign.runs = 0: must be an integer >= 1"),
        (["noise=loud"], "noise = loud: must be one of noisy, quiet, reference"),
        (["noise.extra=1"], "noise.extra: unknown key; must be one of name"),
        (["noise"], "'noise': must be group=option or key=value"),
        (["noise=null"], "(given: noise=null)"),
        (["out=data"], "results: no store"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_stage_refuses_in_one_line(run_stage, arguments, said):
    result, left = run_stage(*arguments)
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert left == []


def test_stage_interrupted(run_stage):
    result, left = run_stage("out=interrupt")
    assert (result.returncode, result.stdout) == (130, "")
    assert result.stderr == "interrupted: nothing written\n"
    assert left == []


def test_stage_keeps_the_traceback_of_a_defect(run_stage):
    result, _ = run_stage("out=defect")
    assert result.returncode == 1
    assert "Traceback" in result.stderr
    assert "ValueError: a defect" in result.stderr


def test_stage_keeps_hydras_own_options(run_stage):
    shown, left = run_stage("--cfg", "job", "noise=quiet")
    assert shown.returncode == 0
    assert "name: quiet" in shown.stdout
    assert left == []
    helped, left = run_stage("--help")
    assert helped.stdout.splitlines()[:6] == [
        "small_stage: what stage makes of a function.",
        "",
        "usage: python -m small_stage [noise=...]",
        "",
        "reads of the configuration, the default first:",
        "  noise=reference|noisy|quiet",
    ]
    assert left == []
    swept, left = run_stage("-m", "noise=quiet,noisy")
    assert swept.stdout == "quiet noisy\nnoisy noisy\n"
    assert left == ["results"]


def test_configuration_does_not_import_the_heavy_libraries():
    code = "import sys, pipeline.config.load; print({'numba', 'dask', 'xarray', 'scipy'} & {*sys.modules})"
    root = Path(__file__).resolve().parent.parent
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True
    )
    assert result.stdout == "set()\n"
