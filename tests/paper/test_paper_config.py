"""What the paper's other experiments add to the configuration, and what is refused there."""

import re
from dataclasses import fields

import pytest
from campaigns import SHORT

from pipeline.campaign import store
from pipeline.config.load import config_of, load, resolved
from pipeline.console.errors import ConfigError
from pipeline.paper.config import PROGRAM, Effects, Laboratory


def test_the_papers_groups_come_on_top_of_the_products():
    product, paper = resolved(load(["noise=quiet"])), resolved(load(["noise=quiet"], PROGRAM))
    assert {key: paper[key] for key in product} == product
    assert paper.keys() - product.keys() == {"effects", "laboratory"}
    assert paper["effects"]["swing_axis"] == "Z"
    assert paper["laboratory"]["residual_passes"] == [2, 20]


def test_a_store_made_with_them_has_the_products_configuration():
    assert config_of(resolved(load(["noise=quiet"], PROGRAM))) == load(["noise=quiet"])


@pytest.mark.parametrize("override", ["effects.lever_arm_mm=1", "laboratory.runs=7"])
def test_they_leave_the_fingerprint_of_a_store_as_it_is(override):
    assert store.fingerprint(load([*SHORT, override], PROGRAM)) == store.fingerprint(load(SHORT))


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("effects.extra=1", "effects.extra: unknown key; must be one of quadratic_1e_9"),
        ("laboratory.extra=1", "laboratory.extra: unknown key; must be one of coarse_gyro"),
        ("effects.swing_axis=W", "effects.swing_axis = 'W': must be one of X, Y, Z"),
        ("effects.duration_s=0", "effects.duration_s = 0.0: must be a finite number > 0"),
        ("laboratory.runs=0", "laboratory.runs = 0: must be an integer >= 1"),
        ("laboratory.residual_passes=[]", "laboratory.residual_passes = []: must be"),
        ("noise=loud", "noise = loud: must be one of mems, noisy, quiet, reference"),
        ("run=1", "run: unknown key; must be one of truth, noise"),
    ],
)
def test_refusal_is_one_line_with_key_value_and_what_is_allowed(override, said):
    with pytest.raises(ConfigError) as caught:
        load([override], PROGRAM)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("schema", [Effects, Laboratory])
def test_every_key_has_a_meaning(schema):
    described = {
        name
        for names in re.findall(r"^ *(\w+(?:, \w+)*) : ", schema.__doc__, re.M)
        for name in names.split(", ")
    }
    assert described == {field.name for field in fields(schema)}


def test_the_product_knows_nothing_of_them():
    with pytest.raises(ConfigError, match="laboratory: unknown key; must be one of truth, noise"):
        load(["laboratory.runs=7"])
