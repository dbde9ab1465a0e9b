"""JSON files that any parser reads: NaN is null in them, and NaN again when read back."""

import json
import math

import numpy as np
import pytest
from campaigns import ROOT

from pipeline.console.output import json_data, json_text, write_json

RESULTS = ROOT / "results"
COMMITTED = sorted(p for p in RESULTS.rglob("*.json") if RESULTS / "runs" not in p.parents)


def strict(text):
    def refuse(name):
        raise ValueError(f"{name} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_nan_is_null_in_text_and_nan_again_when_read():
    data = {"a": math.nan, "b": [1.5, np.float64("nan"), ("c", {"d": math.nan})], "e": True}
    text = json_text(data)
    assert strict(text) == {"a": None, "b": [1.5, None, ["c", {"d": None}]], "e": True}
    back = json_data(text)
    assert math.isnan(back["a"])
    assert math.isnan(back["b"][1])
    assert math.isnan(back["b"][2][1]["d"])
    assert back["e"] is True
    assert json_text(back) == text
    assert math.isnan(json_data("NaN"))  # files of earlier versions


def test_text_without_nan_is_what_it_always_was():
    data = {"a": [1, 2.5e-9, "µ"], "b": {"c": False}, "d": ("x", "y")}
    assert json_text(data) == json.dumps(data, indent=1) + "\n"
    assert json_text(data, indent=2) == json.dumps(data, indent=2) + "\n"


def test_infinities_are_texts_and_numbers_again_when_read():
    data = {"a": math.inf, "b": [-math.inf, 1e308]}
    assert strict(json_text(data)) == {"a": "Infinity", "b": ["-Infinity", 1e308]}
    assert json_data(json_text(data)) == data


def test_file_is_written_with_its_folder(tmp_path):
    write_json(tmp_path / "deep" / "a.json", [math.nan])
    assert (tmp_path / "deep" / "a.json").read_text() == "[\n null\n]\n"


@pytest.mark.parametrize("path", COMMITTED, ids=lambda path: str(path.relative_to(RESULTS)))
def test_results_are_strict_when_rewritten_and_else_unchanged(path):
    old = path.read_text()
    indent = 2 if path.parent.name == "predict" else 1
    new = json_text(json_data(old), indent=indent)
    strict(new)
    assert new == old.replace("NaN", "null")
