"""Stage `judge`: tables of estimates of any program."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml
from campaigns import SHORT, make, run_stage

from inscal.frames import ACCELEROMETER_FRAME, ARMS, in_accelerometer_frame
from inscal.parameters import NAMES
from pipeline import judge
from pipeline.campaign import judged, store
from pipeline.config.load import load
from pipeline.console.output import json_data
from pipeline.logs.calibration import unit_of


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    path = tmp_path_factory.mktemp("others") / "own"
    make(path, *SHORT)
    return path


@pytest.fixture(scope="module")
def own(place):
    return store.read(place)


def table_of(own, **changes):
    estimate = own["estimate"].transpose("run", "parameter").to_numpy()
    table = pd.DataFrame(estimate, columns=list(NAMES))
    table.insert(0, "run", own["run"].to_numpy())
    for name, std in zip(NAMES, own["predicted_std"].to_numpy(), strict=True):
        table[f"{name}_std"] = std
    return table.assign(**changes)


def judge_table(folder, place, table, *overrides, name="table.csv"):
    path = folder / name
    if name.endswith(".parquet"):
        table.to_parquet(path, index=False)
    else:
        table.to_csv(path, index=False, float_format="%.17g")
    out = folder / "found.json"
    return run_stage(
        judge, f"estimates={path}", f"campaign.store={place}", f"out={out}", *overrides
    ), out


@pytest.mark.parametrize("name", ["table.csv", "table.parquet"])
def test_our_own_estimates_are_judged_as_we_do(tmp_path, place, own, name):
    ended, out = judge_table(tmp_path, place, table_of(own), name=name)
    assert ended.code == 0, ended.err
    found = json_data(out.read_text())
    expected = json_data(judged.as_json(judged.summary_of(load(list(SHORT)), place)))
    for parameter in NAMES:
        row = found["summary"]["parameters"][parameter]
        for key, value in expected["parameters"][parameter].items():
            near = (
                pytest.approx(value, rel=1e-9, abs=1e-12, nan_ok=True) if key != "unit" else value
            )
            assert row[key] == near, key
        assert found["comparison"]["parameters"][parameter]["ratio"] == pytest.approx(1.0)
    assert found["summary"]["joint_share"] == expected["joint_share"]
    assert found["comparison"]["joint_difference"] == 0.0
    assert "RMSE over ours" in out.with_suffix(".md").read_text()


def test_worse_estimates_and_missing_runs_are_told(tmp_path, place, own):
    table = table_of(own)
    truth = own["truth"].transpose("run", "parameter").to_numpy()
    table[list(NAMES)] = truth + 3.0 * (table[list(NAMES)].to_numpy() - truth)
    table = table.iloc[2:]
    table.loc[table.index[0], "gyro_bias_x"] = np.nan
    ended, out = judge_table(tmp_path, place, table)
    assert ended.code == 0, ended.err
    found = json.loads(out.read_text())
    assert found["summary"]["runs_failed"] == 3
    assert found["comparison"]["parameters"]["accel_k11"]["ratio"] == pytest.approx(3.0)
    assert found["summary"]["parameters"]["accel_k11"]["rmse_over_predicted"] > 2.0


def test_few_parameters_of_other_names_and_units_without_sigma(tmp_path, place, own):
    table = table_of(own)[["run", "gyro_bias_x", "accel_k11"]]
    table = pd.DataFrame(
        {"run": table["run"], "bx": -3.6 * table["gyro_bias_x"], "k": table["accel_k11"]}
    )
    about = {"bx": {"parameter": "gyro_bias_x", "factor": -1 / 3.6}, "k": "accel_k11"}
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(about))
    ended, out = judge_table(tmp_path, place, table, f"mapping={tmp_path / 'mapping.yaml'}")
    assert ended.code == 0, ended.err
    found = json.loads(out.read_text())
    assert (found["parameters"], found["with_sigma"]) == (["gyro_bias_x", "accel_k11"], [])
    assert found["comparison"]["parameters"]["gyro_bias_x"]["ratio"] == pytest.approx(1.0)
    page = out.with_suffix(".md").read_text()
    assert "Without a sigma: `gyro_bias_x`, `accel_k11`" in page
    assert "Not estimated: `gyro_bias_y`" in page


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.drop(columns="run"), "no column run"),
        (lambda t: t.assign(run=t["run"] + 1000), "run = 1000: no run"),
        (lambda t: t.assign(run=0), "run = 0: is there twice"),
        (lambda t: t.iloc[:0], "no estimates"),
        (lambda t: t[["run"]], "no estimates"),
        (lambda t: t.assign(colour=1.0), "column colour: no parameter"),
        (lambda t: t.assign(gyro_bias_x="x"), "row 1: gyro_bias_x = 'x'"),
        (lambda t: t.assign(gyro_bias_x_std=0.0), "gyro_bias_x_std: must be above zero"),
        (lambda t: t.assign(gyro_bias_x=np.nan), "no run"),
    ],
)
def test_bad_tables_are_refused_in_one_line(tmp_path, place, own, change, said):
    ended, out = judge_table(tmp_path, place, change(table_of(own)))
    assert (ended.code, out.exists()) == (2, False)
    assert said in ended.err
    assert len(ended.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[1]", "must be a readable YAML file, column"),
        ("x: {parameter: gyro}", "must be one of the 27"),
        ("x: {parameter: accel_k11, factor: 0}", "factor = 0"),
        ("x: {name: accel_k11}", "no other key"),
        ("a: [", "readable YAML"),
    ],
)
def test_bad_mappings_are_refused(tmp_path, place, own, text, said):
    (tmp_path / "m.yaml").write_text(text)
    ended, _ = judge_table(tmp_path, place, table_of(own), f"mapping={tmp_path / 'm.yaml'}")
    assert ended.code == 2
    assert said in ended.err


def test_a_file_that_is_no_table_is_said_to_be_none(tmp_path, place):
    for name in ("nothing.csv", "binary.parquet"):
        path = tmp_path / name
        if name.startswith("binary"):
            path.write_bytes(b"\0\1")
        ended = run_stage(judge, f"estimates={path}", f"campaign.store={place}")
        assert ended.code == 2
        assert len(ended.err.strip().splitlines()) == 1


def in_their_frame(own):
    """The same estimates by a program whose body axes are those of the accelerometers."""
    printed = {name: 1.0 if "quadratic" in name else unit_of(name)[1] for name in NAMES}
    rows = []
    for row in table_of(own)[list(NAMES)].to_dict("records"):
        values = {name: value * printed[name] for name, value in row.items()}
        for end in ARMS:
            values.setdefault(f"lever_arm_{end}", 0.0)
        found = in_accelerometer_frame(values)
        rows.append(
            {
                name: found[name] / (1.0 if "quadratic" in name else unit_of(name)[1])
                for name in ACCELEROMETER_FRAME
            }
        )
    table = pd.DataFrame(rows)
    table.insert(0, "run", own["run"].to_numpy())
    return table


def test_another_frame_is_turned_back(tmp_path, place, own):
    table = in_their_frame(own)
    for name in ACCELEROMETER_FRAME:
        table[f"{name}_std"] = 0.1
    (tmp_path / "m.yaml").write_text("frame: accelerometer\n")
    ended, out = judge_table(tmp_path, place, table, f"mapping={tmp_path / 'm.yaml'}")
    assert ended.code == 0, ended.err
    found = json.loads(out.read_text())
    assert found["with_sigma"] == list(NAMES)
    for name in NAMES:
        pair = found["comparison"]["parameters"][name]
        assert pair["ratio"] == pytest.approx(1.0, rel=1e-6), name
        sigma = found["summary"]["parameters"][name]["predicted_std"]
        assert 0.05 < sigma < 0.3, name  # turned, and added up where two are one
    ended, _ = judge_table(
        tmp_path, place, table.drop(columns="gyro_k12"), f"mapping={tmp_path / 'm.yaml'}"
    )
    assert ended.code == 2
    assert "no column gyro_k12" in ended.err
    (tmp_path / "m.yaml").write_text("frame: mars\n")
    ended, _ = judge_table(tmp_path, place, table, f"mapping={tmp_path / 'm.yaml'}")
    assert "must be one of gyro, accelerometer" in ended.err
