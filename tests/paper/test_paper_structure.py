"""The paper's path, ranks, unit of D2 and states left out: numbers and the verdicts from them."""

from dataclasses import replace

import numpy as np
import pytest
from campaigns import run_stage
from conftest import paper_schedule
from structure import results_read

from inscal import observability as obs
from inscal.parameters import INDEX, NAMES
from inscal.schedule import Turn
from pipeline import paper_structure
from pipeline.campaign import store
from pipeline.campaign.driver import simulate_campaign
from pipeline.config.load import load
from pipeline.config.setup import Setup
from pipeline.paper import ablation
from pipeline.paper import ablation_text as paper_ablation_text
from pipeline.paper import quadratic_text as paper_quadratic_text
from pipeline.paper import structure_text as text
from pipeline.paper.structure import (
    SEARCHED,
    Count,
    readings_of,
    structure_of,
    table_1,
)
from pipeline.paper.tables import TABLE_2_RANKS

PATH = ("schedule.position_duration_s=60", "truth=paper", "campaign.runs=40")


@pytest.fixture(scope="module")
def structure():
    return structure_of(load([]))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Small campaigns of every filter on the paper's errors, judged."""
    full = tmp_path_factory.mktemp("ablation") / "full"
    for end, estimator in (("", "two_pass"), *((f"-{m}", m) for m in ablation.MODELS)):
        overrides = (f"estimator={estimator}", f"campaign.store={full}{end}")
        simulate_campaign(load([*PATH, *overrides]))
    return full, ablation.ablation_of(load([*PATH]), full)


def fake_ranks(sequence):
    return obs.Ranks(np.where(np.arange(36) < np.array(sequence)[:, None], 10.0, 0.0))


def test_all_postures_and_turns_are_the_papers(structure):
    assert len(structure.rows) == 25
    assert all(row.agrees for row in structure.rows)
    assert text.path_verdict(structure).found == "25 of 25 rows agree"
    assert text.path_verdict(structure).word == "met"
    assert text.head_verdict(structure).word == "met"


def test_another_path_does_not_agree(structure):
    schedule = paper_schedule()
    turned = Turn(-schedule.turns[6].angle, schedule.turns[6].axis)
    changed = replace(schedule, turns=(*schedule.turns[:6], turned, *schedule.turns[7:]))
    rows = table_1(changed)
    assert [row.agrees for row in rows[:7]] == [True] * 6 + [False]
    assert not rows[7].agrees
    assert text.path_verdict(replace(structure, rows=rows)).word == "not met"


def test_table_2_cannot_be_judged_for_no_convention_gives_it_by_both_counts(structure):
    verdict = text.table_verdict(structure)
    assert "at most 21 of 25" in verdict.found
    assert verdict.word.startswith("cannot be judged, because")
    assert structure.counts[SEARCHED].agreeing == (24, 23)
    exact = fake_ranks(TABLE_2_RANKS)
    better = replace(structure, counts={**structure.counts, "new": Count(exact, exact)})
    assert text.table_verdict(better).word == "met"


def test_dwell_of_the_searched_convention_decides_its_agreement(structure):
    agreeing = {name: count.agreeing[0] for name, count in structure.neighbours.items()}
    assert agreeing["dwell of 95 s"] == 25
    assert agreeing["dwell of 105 s"] == 24
    assert agreeing["D2 on specific force (SI)"] == 23


def test_added_turns_are_not_needed_for_rank_unless_numbers_say_so(structure):
    verdict = text.added_turns_verdict(structure)
    assert "from position 7 on" in verdict.found
    assert verdict.word == "not met"
    late = fake_ranks([33] * 20 + [36] * 5)
    counts = {**structure.counts, "turns on gyros and lever arms": Count(late, late)}
    assert text.added_turns_verdict(replace(structure, counts=counts)).word == "met"
    assert text.complete_verdict(structure).word == "met"


def test_sequences_are_written_with_repetitions():
    assert text.sequence_text(TABLE_2_RANKS) == "12 18 23 26 30 33×15 36×5"


def test_bound_of_quadratic_terms_is_out_of_reach_in_si():
    config = load([])
    bound, readings = Setup(config).bound, readings_of(config)
    verdicts = {
        key: paper_quadratic_text.bound_verdict(course, bound).word
        for key, course in readings.items()
    }
    assert verdicts["pulse", "reference"] == verdicts["pulse", "quiet"] == "met"
    assert verdicts["si", "reference"] == verdicts["si", "quiet"] == "not met"
    quadratic = INDEX["accel_quadratic"]
    np.testing.assert_allclose(
        readings["pulse", "reference"].final_std[quadratic], [0.0188, 0.0186, 0.0229], rtol=0.01
    )
    assert readings["si", "reference"].final_std[quadratic].min() > 20.0


def test_stage_writes_its_pages_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(paper_structure)
    assert (ended.code, ended.err) == (0, "")
    written = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    names = (
        "claims/observability.json",
        "claims/quadratic_unit.json",
        "observability.md",
        "quadratic_unit.md",
        "ranks.csv",
        "ranks.png",
    )
    names += ("sigma_by_position.csv", "sigma_by_position.png")
    assert written == [f"results/paper/{name}" for name in names]
    page = (tmp_path / "results/paper/observability.md").read_text()
    assert "dwells leave the rank at 23 there" in page
    assert (
        "rank 36 at position 7; put in the last six turns, at 19; put in from position 20" in page
    )


def test_stage_depends_on_the_stores_that_it_reads():
    ends = ("", *(f"-{end}" for end in ablation.MODELS))
    stores = {f"results/runs/{full}{end}" for full in ablation.TRUTHS.values() for end in ends}
    assert results_read("paper-ablation") == stores


def test_leaving_out_states_costs_accuracy(small):
    _, found = small
    assert all(reduced.worse.any() for reduced in found.reduced.values())
    bias = NAMES.index("accel_bias_z")
    cost = {end: reduced.cost.lower[bias] for end, reduced in found.reduced.items()}
    assert cost["states33_lever_arm"] > 20 * cost["states33_quadratic"] > 20
    assert cost["states30"] > 20 * cost["states33_quadratic"]
    verdicts = [paper_ablation_text.verdict("a claim", r).word for r in found.reduced.values()]
    assert all(verdict.startswith("met") for verdict in verdicts)


def test_what_is_not_modelled_is_estimated_as_zero(small):
    full, found = small
    campaign = store.read(f"{full}-states33_quadratic")
    arms = NAMES[INDEX["lever_arm"]]
    np.testing.assert_allclose(
        campaign["error"].sel(parameter=list(arms)), -campaign["truth"].sel(parameter=list(arms))
    )
    reduced = found.reduced["states33_quadratic"]
    assert reduced.modelled.sum() == 24
    assert not reduced.worse[INDEX["lever_arm"]].any()


def test_only_the_full_filter_has_a_nees_of_its_size(small):
    _, found = small
    assert float(found.full.nees_mean) < 40
    assert all(float(r.summary.nees_mean) > 50 for r in found.reduced.values())


def test_page_judges_every_filter_on_every_truth(small):
    _, found = small
    page = paper_ablation_text.ablation_text(load([*PATH]), {"one truth": found})
    claims = [line for line in page.splitlines() if line.startswith("| with one truth")]
    assert len(claims) == 3
    assert all("significantly worse" in line for line in claims)
    frame = ablation.table({"one truth": found}).splitlines()
    assert len(frame) == 1 + 4 * 27


def test_verdict_follows_the_intervals(small):
    _, found = small
    reduced = found.reduced["states30"]
    inverted = reduced.comparison.assign(
        {key: 1 / reduced.comparison[key] for key in ("ratio",)}
        | {
            "simultaneous_lower": 1 / reduced.comparison["simultaneous_upper"],
            "simultaneous_upper": 1 / reduced.comparison["simultaneous_lower"],
        }
    )
    other = replace(reduced, comparison=inverted, heaviest=0.0)
    assert paper_ablation_text.verdict("a claim", other).word == "not met"


def test_one_run_that_decides_the_rmse_hands_judgement_to_medians(small):
    _, found = small
    reduced = replace(found.reduced["states30"], heaviest=0.9)
    assert reduced.cost is reduced.median


def test_median_ratio_covers_and_is_exact_for_proportional_errors():
    rng = np.random.default_rng(3)
    error = rng.normal(size=(200, 27))
    exact = ablation.median_ratio(2 * error, error, rng)
    np.testing.assert_allclose(exact.ratio, 2.0)
    np.testing.assert_allclose(exact.lower, 2.0)
    np.testing.assert_allclose(exact.upper, 2.0)
    other = ablation.median_ratio(rng.normal(size=(200, 27)), error, rng)
    assert (other.lower < 1.0).all()
    assert (other.upper > 1.0).all()
