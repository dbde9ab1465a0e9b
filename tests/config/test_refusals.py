"""Configuration that cannot be used: refused with one line that names key, value and remedy."""

import pytest

from pipeline.config.load import load
from pipeline.console.errors import ConfigError

WHITE_NOISE = "noise.accel_white_noise_ug_per_sqrt_hz"
POSITION_NOISE = "noise.position_observation_m"
GYRO_BIAS = "truth.gyro_bias_deg_per_h"
ROTATIONS = "schedule.rotations"
SHORT_UPDATES = ["schedule.position_duration_s=18.4", "estimator.update_interval_s=0.4"]
POSTURE = "schedule.initial_posture"
ATTITUDE = "estimator.initial_std.attitude_deg"

# Overrides, and what the line must contain: key, value and what is allowed.
BAD = [
    # unknown options and keys
    (["noise=loud"], "noise = loud: must be one of mems, noisy, quiet, reference"),
    (["truth=gauss"], "truth = gauss: must be one of dispersed, paper, uniform"),
    (
        ["schedule=position26"],
        "schedule = position26: must be one of designed25, designed25_9000, designed25_quiet",
    ),
    (["cluster=cloud"], "cluster = cloud: must be one of processes, scheduler, slurm, threads"),
    (["noise.nam=x"], "noise.nam: unknown key; must be one of name, gyro_angle_random_walk"),
    (["+noise.extra=1"], "noise.extra: unknown key; must be one of name"),
    (["++estimator.initial_std.extra=1"], "estimator.initial_std.extra: unknown key"),
    (["run=1"], "run: unknown key; must be one of truth, noise"),
    (["+run=1"], "run: unknown key; must be one of truth, noise"),
    (["hydra.extra=1"], "hydra.extra: not supported; a stage decides this itself"),
    (["~noise.name"], "noise.name: "),
    (["~noise"], "noise.name: must be given"),
    (["noise=null"], "noise = null: must be one of mems, noisy, quiet, reference"),
    # syntax and interpolation
    (["noise"], "'noise': must be group=option or key=value"),
    (["noise=[quiet"], "noise = [quiet: must be one of mems, noisy, quiet, reference"),
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
    (
        ["site.latitude_deg=-89.995"],
        "site.latitude_deg = -89.995: must be a number from -89.99 to 89.99",
    ),
    (
        ["estimator.max_passes=1"],
        "estimator.max_passes = 1: must be null, or an integer from estimator.passes, which is 2",
    ),
    (["estimator.convergence_sigma=0"], "estimator.convergence_sigma = 0.0: must be a finite"),
    (["estimator.innovation_limit=1"], "estimator.innovation_limit = 1.0: must be a finite number"),
    (["campaign.max_failed_share=1.5"], "campaign.max_failed_share = 1.5: must be a number from 0"),
    (["site.latitude_deg=90"], "site.latitude_deg = 90.0: must be a number from -89.99 to 89.99"),
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
    ([f"{ROTATIONS}=[[30,X,0]]"], f"{ROTATIONS}[0] = [30, 'X', 0]: must be [angle_deg, axis, sec"),
    ([f"{ROTATIONS}=[[30,X,50,-1]]"], "[0] = [30, 'X', 50, -1]: must be [angle_deg, axis, seconds"),
    (
        [f"{ROTATIONS}=[[30,X,50,1,1]]"],
        "[0] = [30, 'X', 50, 1, 1]: must be [angle_deg, axis], such",
    ),
    (
        [f"{ROTATIONS}=[[90,X,9]]"],
        "[0] = [90, 'X', 9]: must be a turn shorter than its position, 9;",
    ),
    ([f"{ROTATIONS}=[[90,X,60.5]]"], f"{ROTATIONS}[0]: position of = 60.5: must be a multiple of"),
    ([f"{ROTATIONS}=[[90,X,60,100]]"], "simulation.turn_step_s = 0.5: must be at most 0.14, which"),
    (["schedule.last_position_duration_s=0"], "last_position_duration_s = 0.0: must be null, or a"),
    (["schedule.last_position_duration_s=1.5"], "last_position_duration_s = 1.5: must be a multi"),
    ([f"{ROTATIONS}=[[450,X]]"], f"{ROTATIONS}[0] = [450, 'X']: must be"),
    ([f"{ROTATIONS}=[[nan,X]]"], f"{ROTATIONS}[0] = [nan, 'X']: must be"),
    (["schedule.turn_rate_deg_per_s=0"], "schedule.turn_rate_deg_per_s = 0.0: must be"),
    (["schedule.turn_rate_deg_per_s=0.3"], f"{ROTATIONS}[1] = [180, 'Y']: must be a turn shorter"),
    (["schedule.turn_acceleration_deg_per_s2=0"], "_per_s2 = 0.0: must be null, or a finite"),
    (["schedule.turn_acceleration_deg_per_s2=-4"], "_per_s2 = -4.0: must be null, or a finite"),
    (["schedule.turn_acceleration_deg_per_s2=nan"], "_per_s2 = nan: must be null, or a finite"),
    (["schedule.turn_acceleration_deg_per_s2=x"], "turn_acceleration_deg_per_s2 = x: must be a nu"),
    # 18.4 s are enough for 180 degrees at 10 deg/s, and not with ramps
    (
        [*SHORT_UPDATES, "schedule.turn_acceleration_deg_per_s2=20"],
        f"{ROTATIONS}[1] = [180, 'Y']: must be a turn shorter than schedule.position_duration_s, "
        "18.4; it takes 18.5 s",
    ),
    (["schedule.position_duration_s=0"], "schedule.position_duration_s = 0.0: must be a finite"),
    (["schedule.position_duration_s=18"], f"{ROTATIONS}[1] = [180, 'Y']: must be a turn shorter"),
    (["schedule.position_duration_s=500.5"], "= 500.5: must be a multiple of estimator.update"),
    (["estimator.update_interval_s=600"], "must be a multiple of estimator.update_interval_s"),
    (["estimator.update_interval_s=1e-320"], "update_interval_s = 1e-320: must be 0, or of a size"),
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
