import copy
import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import paper_bounds
from test_assumptions import FOUND as ASSUMED

from inscal.parameters import COUNT, NAMES, UNITS
from inscal.summary import compare, summarize
from pipeline import figures
from pipeline.campaign.judged import as_json
from pipeline.charts import campaigns as plots
from pipeline.charts import style as figure_style
from pipeline.config.load import load, resolved
from pipeline.console.errors import DataError
from pipeline.console.output import json_data, json_text, signed
from pipeline.study import findings, honesty, names, report
from pipeline.study.campaign import Campaign, read
from pipeline.study.findings import Results
from pipeline.study.names import MAIN, ONE_PASS, PAPER_TRUTH
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED

BOUND = xr.DataArray(paper_bounds(), {"parameter": list(NAMES)})
SIGMA = paper_bounds() / 5.0
RUNS = 500
CONFIGURATION = resolved(load([]))


def campaign(seed=1, scale=1.0):
    """Campaign of normal errors, `scale` times as large as predicted."""
    error = scale * SIGMA * np.random.default_rng(seed).standard_normal((RUNS, COUNT))
    truth = np.ones((RUNS, COUNT))
    return xr.Dataset(
        {
            "truth": (("run", "parameter"), truth),
            "estimate": (("run", "parameter"), truth + error),
            "error": (("run", "parameter"), truth + error - truth),
            "predicted_std": ("parameter", SIGMA.copy()),
            "nees": ("run", np.square(error / SIGMA).sum(axis=1)),
            "status": ("run", np.ones(RUNS, np.int8)),
        },
        {
            "run": np.arange(RUNS),
            "parameter": np.array(NAMES, dtype=object),
            "unit": ("parameter", np.array(UNITS, dtype=object)),
        },
        {"configuration": CONFIGURATION, "seed": 1, "fingerprint": "none"},
    )


def summary_of(dataset, noise="reference"):
    summary = summarize(dataset, BOUND)
    noise = CONFIGURATION["noise"] | {"name": noise}
    return summary.assign_attrs(
        campaign=MAIN, schedule="position25", noise=noise, seed=1, passes_taken={"2": RUNS}
    )


def comparison_of(scale_a, durations=(9500.0, 12500.0)):
    # RMSEs of independent draws of a ratio of about `scale_a`
    result = compare(campaign(2, scale_a), campaign(1), resamples=100, seed=1)
    result = result.assign_attrs(a="position19-reference", b=MAIN, duration_s=list(durations))
    return json_data(as_json(result))


@pytest.fixture(scope="module")
def prototype():
    """Results in which all is well, but for the single pass."""
    honest = json_data(as_json(summary_of(campaign())))
    summaries = {name: copy.deepcopy(honest) for name in names.CAMPAIGNS}
    summaries[ONE_PASS] = json_data(as_json(summary_of(campaign(scale=2.0))))
    for summary in summaries.values():
        for row in summary["parameters"].values():
            row["rmse_over_predicted"] = 1.0 if summary is not summaries[ONE_PASS] else 2.0
    comparisons = {
        "equal_position_time": comparison_of(3.0),
        "equal_total_time": comparison_of(3.0, (12502.0, 12500.0)),
    }
    comparisons |= {n: comparison_of(3.0) for n in names.COMPARISONS if n not in comparisons}
    return Results(summaries, comparisons, CONFIGURATION)


@pytest.fixture
def results(prototype):
    return copy.deepcopy(prototype)


def section(text, heading):
    return text.split(f"## {heading}\n")[1].split("\n## ")[0]


def verdicts(results):
    return [check.met for check in findings.checks(results.summaries)]


def test_report_is_the_same_text_each_time_and_links_every_figure(results):
    text = report.report_text(results)
    assert text == report.report_text(copy.deepcopy(results))
    assert "nan" not in text
    campaign_ = Campaign(Path("made"), "made", campaign(), summary_of(campaign()))
    drawn = draw_everything(campaign_, results.comparisons)
    assert set(re.findall(r"\(figures/(.*?)\)", text)) == {f"{name}.png" for name in drawn}


def test_all_requirements_met(results):
    assert verdicts(results) == [True, True, True]
    text = report.report_text(results)
    assert "Requirements of the filter met: 3 of 3" in text
    assert "not met" not in section(text, "Requirements")


@pytest.mark.parametrize(("ratio", "met"), [(0.86, False), (0.9, True), (1.1, True), (1.14, False)])
def test_one_sigma_is_refuted_beyond_what_chance_does(results, ratio, met):
    results.summaries[MAIN]["parameters"]["accel_k22"]["rmse_over_predicted"] = ratio
    assert verdicts(results) == [True, met, True]
    assert ("(`accel_k22`)" in section(report.report_text(results), "Requirements")) == (not met)


@pytest.mark.parametrize(("mean", "met"), [(25.9, False), (26.2, True), (28.0, False)])
def test_nees_requirement(results, mean, met):
    results.summaries[MAIN]["nees_mean"] = mean
    assert verdicts(results) == [met, True, True]
    assert ("**not met**" in report.report_text(results)) == (not met)


def test_few_runs_refute_but_do_not_confirm(results):
    main = results.summaries[MAIN]
    main["runs_done"] = 3
    assert [check.word for check in honesty.checks(MAIN, main)] == [UNDECIDED, UNDECIDED]
    assert honesty.honesty(main) == UNDECIDED
    main["parameters"]["accel_k22"]["rmse_over_predicted"] = 9.0
    assert honesty.honesty(main) == "dishonest (overconfident)"


@pytest.mark.parametrize(
    ("interval", "word"),
    [((0.98, 0.989), NOT_MET), ((0.985, 0.995), UNDECIDED), ((0.99, 1.0), MET)],
)
def test_all_bounds_at_once_are_judged_by_the_whole_interval(results, interval, word):
    ends = dict(zip(("joint_share_lower", "joint_share_upper"), interval, strict=True))
    for name in (PAPER_TRUTH, "position25-noisy"):
        results.summaries[name] |= ends
    assert findings.checks(results.summaries)[-1].word.startswith(word)
    short = section(report.report_text(results), "In short")
    assert f"- The paper's bounds, `position25-noisy`: {word};" in short
    assert "- The paper's bounds, `position25-quiet`: met;" in short


@pytest.mark.parametrize(
    ("mean", "verdict"),
    [(20.0, "dishonest (too cautious)"), (27.0, "honest"), (40.0, "dishonest (overconfident)")],
)
def test_honesty_follows_the_mean_nees(results, mean, verdict):
    results.summaries["position19-noisy"]["nees_mean"] = mean
    text = report.report_text(results)
    row = next(r for r in text.splitlines() if r.startswith("| `position19-noisy`"))
    assert f"| {verdict} |" in row
    assert (f"{verdict} in `position19-noisy`" in text) == (verdict != "honest")


def test_honesty_follows_the_sigma_of_each_parameter(results):
    table = results.summaries["position19-noisy"]
    table["parameters"]["lever_arm_x"]["rmse_over_predicted"] = 0.8
    assert honesty.honesty(table) == "dishonest (too cautious)"
    table["parameters"]["lever_arm_y"]["rmse_over_predicted"] = 1.3
    assert honesty.honesty(table) == "dishonest (overconfident)"
    assert honesty.refuted(table) == {"lever_arm_y": "too small", "lever_arm_x": "too large"}


def test_bounds_are_missed_where_the_whole_interval_is_below_99_percent(results):
    table = results.summaries["position25-noisy"]["parameters"]
    shares = {"x": (0.4, 0.36, 0.44), "y": (0.99, 0.99, 0.99), "z": (0.99, 0.98, 1.0)}
    for name, ends in shares.items():
        keys = (f"share_within_bound{end}" for end in ("", "_lower", "_upper"))
        table[f"lever_arm_{name}"] |= dict(zip(keys, ends, strict=True))
    missed = section(report.report_text(results), "Which bounds are missed")
    row = next(r for r in missed.splitlines() if r.startswith("| `lever_arm_x`"))
    assert row == "| `lever_arm_x` | · | · | 60.0 | · | · | · |"
    assert "lever_arm_y" not in missed
    assert "| `lever_arm_z` | · | · | 1.0? | · | · | · |" in missed


def test_single_pass_is_called_what_its_numbers_are(results):
    text = section(report.report_text(results), "One pass against two")
    assert "One pass is dishonest (overconfident)" in text
    assert f"for {COUNT} of {COUNT} parameters" in text
    results.summaries[ONE_PASS] = results.summaries[MAIN]
    text = section(report.report_text(results), "One pass against two")
    assert "One pass is honest" in text
    assert "| parameter |" not in text


def test_schedule_verdict_follows_the_simultaneous_intervals(results):
    comparison = results.comparisons["equal_position_time"]
    verdict = findings.contest_verdict(findings.contest(comparison))
    assert verdict.startswith(
        f"{comparison['b']} has the smaller errors; {comparison['a']} saves 24 % of the"
    )
    assert "significantly worse in 27 parameters and better in 0" in verdict
    comparison["parameters"]["accel_k11"] |= {"simultaneous_lower": 0.7, "simultaneous_upper": 0.9}
    mixed = findings.contest(comparison)
    assert (len(mixed.worse), mixed.better) == (26, ("accel_k11",))
    assert "on balance, not throughout" in findings.contest_verdict(mixed)
    for row in comparison["parameters"].values():
        row |= {"ratio": 0.8, "simultaneous_lower": 0.7, "simultaneous_upper": 0.9}
    assert findings.contest_verdict(findings.contest(comparison)).startswith(
        f"{comparison['a']} has the smaller errors"
    )
    for row in comparison["parameters"].values():
        row["simultaneous_upper"] = 1.1
    assert findings.contest_verdict(findings.contest(comparison)).startswith("neither is better")
    joint = {"joint_share_a": 0.97, "joint_share_b": 0.99, "joint_difference": -0.02}
    limits = {"joint_difference_lower": -0.03, "joint_difference_upper": -0.01, "runs_judged": 500}
    judged = findings.contest(comparison | joint | limits)
    assert findings.contest_verdict(judged).startswith(
        f"{judged.b} keeps all bounds more often than {judged.a}: 99.0 % against 97.0 % of 500"
    )
    limits["joint_difference_upper"] = 0.01
    judged = findings.contest(comparison | joint | limits)
    assert findings.contest_verdict(judged).startswith("these 500 runs do not tell")


def test_same_time_is_called_so(results):
    result = findings.contest(results.comparisons["equal_total_time"])
    assert findings.time_text(result) == "both take the same time"
    slower = dataclasses.replace(result, time_saved_percent=-10.0)
    assert findings.time_text(slower) == f"{result.a} costs 10 % of the time"


def draw_everything(drawn, comparisons):
    return {
        "errors_against_bounds": plots.errors_against_bounds({"quiet": drawn, "noisy": drawn}),
        "error_distributions": plots.error_distributions(drawn),
        "predicted_against_empirical": plots.predicted_against_empirical({1: drawn, 2: drawn}),
        "nees": plots.nees({1: drawn, 2: drawn}),
        "schedule_comparison": plots.schedule_comparison(comparisons, "noise"),
    }


def test_every_figure_is_written_and_its_bytes_repeat(tmp_path, results):
    data = campaign()
    # a parameter the filter does not model must not stop a figure
    data["predicted_std"][3] = 0.0
    drawn = Campaign(Path("made"), "made", data, summary_of(data))
    for name, figure in draw_everything(drawn, results.comparisons).items():
        path = tmp_path / "new" / f"{name}.png"
        figure_style.save(figure, path)
        assert path.read_bytes().startswith(b"\x89PNG")
    again = tmp_path / "again.png"
    figure_style.save(plots.nees({1: drawn, 2: drawn}), again)
    assert again.read_bytes() == (tmp_path / "new" / "nees.png").read_bytes()


def test_missing_inputs_are_named_in_one_line(tmp_path, monkeypatch, results):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match=r"position25-quiet\.json: not found; make it with"):
        findings.collect()
    with pytest.raises(DataError, match="position25-quiet: not found; make it with"):
        figures.draw_all(load([]))
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    with pytest.raises(DataError, match="cannot be read"):
        findings.read_json(broken, "compare")


def test_report_reads_what_the_stages_write(tmp_path, monkeypatch, results):
    monkeypatch.chdir(tmp_path)
    for folder, files in (("summary", results.summaries), ("comparison", results.comparisons)):
        (tmp_path / "results" / folder).mkdir(parents=True)
        for name, content in files.items():
            (tmp_path / "results" / folder / f"{name}.json").write_text(json_text(signed(content)))
    campaign().to_zarr(tmp_path / "results" / "runs" / MAIN, consolidated=False, zarr_format=3)
    assert report.report_text(findings.collect()) == report.report_text(results)


@pytest.mark.parametrize("found", [ASSUMED, None])
def test_the_report_says_what_it_assumes_near_its_top(results, found):
    text = report.report_text(dataclasses.replace(results, disturbances=found))
    assert text.index("## In short") < text.index("## What this assumes")
    assert text.index("## What this assumes") < text.index("## What was simulated")
    assert ("| the site is known |" in text) == (found is not None)
    assert ("make results/disturbances.json" in text) == (found is None)


def test_store_is_loaded_with_its_runs_done(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = campaign()
    data["status"][:10] = 2
    data["error"][:10] = np.nan
    data.to_zarr(tmp_path / "results" / "runs" / "some", consolidated=False, zarr_format=3)
    loaded = read(load([]), tmp_path / "results" / "runs" / "some")
    assert loaded.error.shape == (RUNS - 10, COUNT)
    assert np.isfinite(loaded.error).all()
    assert loaded.passes == 2
