"""The examples run from anywhere, leave the figure they promise, and show what they say."""

import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from campaigns import run_stage

from inscal.parameters import NAMES
from inscal.simulation import draw_truth
from pipeline import export
from pipeline.config.load import load
from pipeline.config.setup import Setup

REPOSITORY = Path(__file__).resolve().parent.parent


def run_example(name, folder, *arguments):
    """Standard output of an example run in `folder`, and the files it left."""
    path = [str(REPOSITORY), *filter(None, [os.environ.get("PYTHONPATH")])]
    ended = subprocess.run(
        [sys.executable, REPOSITORY / "examples" / name, *arguments],
        cwd=folder,
        env=os.environ | {"MPLBACKEND": "Agg", "PYTHONPATH": os.pathsep.join(path)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""
    return ended.stdout, [str(left.relative_to(folder)) for left in folder.iterdir()]


def assert_figure(path):
    image = plt.imread(path)  # fails unless it is a whole PNG
    assert min(image.shape[:2]) > 400
    assert 0.0 < image[..., :3].std()
    assert image[..., :3].mean() > 0.8  # light background


def test_the_second_pass_of_one_run_takes_all_errors_within_their_sigma(tmp_path):
    notebook = ["-f", "kernel-1.json"]  # what the command line of a notebook's kernel looks like
    text, left = run_example("calibrate_one_run.py", tmp_path, *notebook)
    assert left == ["calibrate_one_run.png"]
    assert_figure(tmp_path / left[0])
    rows = {line.split()[0]: [float(n) for n in line.split()[1:]] for line in text.split("\n")[1:5]}
    assert len(rows) == 4
    for truth, estimate, sigma, _, second in rows.values():
        assert 0.0 < sigma < 0.02 * truth
        assert abs(estimate - truth) < 5.0 * sigma
        assert second < 3.0
    first, second = rows["accel_k11"][3:]
    assert first > 3.0 > second
    largest = [float(n) for n in re.findall(r"\d+\.\d+", text.split("\n")[5])]
    assert largest[0] > largest[1]
    assert largest[1] < 4.0


def test_only_the_gyro_bias_needs_long_positions_and_the_prediction_holds(tmp_path):
    text, left = run_example("position_duration.py", tmp_path, "my figure.png")
    assert left == ["my figure.png"]
    assert_figure(tmp_path / left[0])
    shortest = {kind: int(t) for kind, t in re.findall(r"(\w+) +(\d+) s$", text, re.MULTILINE)}
    assert len(shortest) == 8
    assert max(shortest, key=shortest.__getitem__) == "gyro_bias"
    assert 500 < shortest["gyro_bias"] <= 1000
    share, nees = (float(n) for n in re.findall(r"(\d+\.\d)(?: %)?$", text, re.MULTILINE))
    assert share > 97.0
    assert nees == pytest.approx(27.0, abs=1.5)  # 2.9 standard deviations of the mean of 200


def test_least_squares_calibrates_exported_runs_with_honest_sigmas(tmp_path):
    ended = run_stage(export, "runs=0:2", "rate_hz=10", f"log={tmp_path / 'unit.parquet'}")
    assert ended.code == 0, ended.err
    logs = [str(path) for path in sorted(tmp_path.glob("*.parquet"))]
    text, _ = run_example("least_squares.py", tmp_path, *logs, "found.csv")
    assert text.count("gyro_bias_x") == 2
    table = pd.read_csv(tmp_path / "found.csv").set_index("run")
    setup = Setup(load(["campaign.runs=2"]))
    for run in (0, 1):
        truth = draw_truth(setup.truth, setup.config.campaign.seed, run) / setup.unit
        sigma = table.loc[run, [f"{name}_std" for name in NAMES]].to_numpy()
        deviation = (table.loc[run, list(NAMES)].to_numpy() - truth) / sigma
        assert np.abs(deviation).max() < 4.5
        assert 8.0 < np.sum(deviation**2) < 60.0


def test_every_example_is_tested():
    names = {path.name for path in (REPOSITORY / "examples").glob("*.py")}
    assert names == {"calibrate_one_run.py", "least_squares.py", "position_duration.py"}
