"""The HTML page without a browser: what is in it, where its numbers come from, what it refuses."""

import json
import re
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
from altair.utils.schemapi import SchemaBase
from campaigns import error_lines, make, run_stage, set_status, short
from omegaconf.errors import OmegaConfBaseException

from inscal.parameters import KINDS, NAMES
from pipeline import report
from pipeline.campaign import provenance, store
from pipeline.campaign.driver import simulate_campaign
from pipeline.campaign.judged import summary_of
from pipeline.config.load import load
from pipeline.console.errors import DataError
from pipeline.gate import baseline, history
from pipeline.page import compose as page
from pipeline.page import data as page_data
from pipeline.page import verdict as page_verdict
from pipeline.study import campaign as campaigns
from pipeline.study import names
from pipeline.study.verdict import UNDECIDED

SECTIONS = [
    *("verdict", "distributions", "sigma", "nees", "schedules", "convergence", "observability"),
    *("noise", "paper", "history", "provenance"),
]
LARGEST_BYTES = 5e6


class Seen(HTMLParser):
    """Attributes of all tags, and the text of the cells of the first sortable table."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.rows, self.in_cell, self.table = [], [], False, False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.tags.append((tag, attributes))
        self.table |= attributes.get("id") == "parameters"
        if self.table and tag == "tr":
            self.rows.append([])
        if self.table and tag in ("td", "th"):
            self.in_cell = True
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        self.in_cell &= tag not in ("td", "th")
        self.table &= tag != "table"

    def handle_data(self, data):
        if self.in_cell:
            self.rows[-1][-1] += data

    def all(self, name):
        return [attributes[name] for _, attributes in self.tags if name in attributes]


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    """Two campaigns that differ in their noise, and one that is half done."""
    folder = tmp_path_factory.mktemp("runs")
    make(folder / "quiet", "noise=quiet")
    make(folder / "noisy", "noise=noisy")
    half = make(folder / "half", "noise=quiet", "campaign.seed=7")
    set_status(half, slice(12, None), store.NOT_RUN)
    return folder


@pytest.fixture(scope="module")
def text(stores):
    paths = [str(stores / "quiet"), str(stores / "noisy")]
    return page.html(page.campaigns(load([]), paths))


@pytest.fixture(scope="module")
def seen(text):
    return Seen(text)


@pytest.fixture(autouse=True)
def unchecked(text, monkeypatch):
    """Leave out Altair's checks of every chart, a third of the time: those of `text` had them."""
    monkeypatch.setattr(SchemaBase, "validate", lambda *_, **__: None)


def test_page_is_one_small_file_that_loads_nothing(text, seen):
    assert len(text.encode()) < LARGEST_BYTES
    loads = [value for name in ("src", "srcset", "data", "action") for value in seen.all(name)]
    links = [a["href"] for tag, a in seen.tags if "href" in a]
    assert loads == []
    assert [link for link in links if not link.startswith("#")] == ["data:,"]
    styles = "".join(re.findall(r"<style>(.*?)</style>", text, re.S))
    assert re.findall(r"@import|url\((?!data:)", styles) == []
    assert seen.all("content")[-1].startswith("default-src 'none'")


def test_sections_are_in_order_and_linked(seen):
    ids = [attributes["id"] for tag, attributes in seen.tags if tag == "section"]
    assert ids == SECTIONS
    assert [a["href"] for tag, a in seen.tags if tag == "a"] == [f"#{name}" for name in SECTIONS]


def test_headings_of_tables_have_a_scope(seen):
    assert {a.get("scope") for tag, a in seen.tags if tag == "th"} == {"col", "row"}


def test_every_chart_is_there_once_and_has_a_sentence(text, seen):
    data = json.loads(re.search(r'id="report-data">(.*?)</script>', text, re.S)[1])
    shown = seen.all("data-chart")
    assert len(shown) == len(set(shown)) > 27
    in_panels = [
        name for panel in data["panels"].values() for names in panel["charts"] for name in names
    ]
    assert {*shown, *in_panels} == set(data["charts"])
    for caption in re.findall(r"<figcaption>(.+?)</figcaption>", text):
        assert caption.endswith(".")
    assert list(data["panels"]) == list(NAMES)
    for panel in data["panels"].values():
        assert [bool(names) for names in panel["charts"]] == [True] * 3
        assert all(sentence.endswith(".") for sentence in panel["sentences"])


def test_numbers_are_those_of_the_summary(stores, seen, text):
    summary = summary_of(load([]), stores / "quiet")
    rows = {row[0].strip(): row for row in seen.rows[1:]}
    assert set(rows) == set(NAMES)
    for name, row in rows.items():
        expected = summary.sel(parameter=name)
        assert float(row[4]) == pytest.approx(float(expected.bound), rel=1e-5)
        assert float(row[5]) == pytest.approx(float(expected.rmse), rel=5e-3)
        assert float(row[6]) == pytest.approx(float(expected.predicted_std), rel=5e-3)
        assert row[7].startswith(f"{float(expected.rmse_over_predicted):.3f} (")
        share = (expected.share_within_bound, expected.share_within_bound_lower)
        assert row[8].startswith("{:.1f} % ({:.1f} to ".format(*(100 * float(s) for s in share)))
    joint = f"{100 * float(summary.joint_share):.1f} %"
    assert joint in re.search(r'class="headline">(.*?)<', text)[1]


@pytest.mark.parametrize(
    ("runs", "ratio", "word"),
    [
        (500, 1.11, "honest"),
        (500, 1.13, "too small"),
        (500, 0.87, "too large"),
        (3, 1.13, UNDECIDED),
        (3, 9.0, "too small"),
    ],
)
def test_sigma_verdict_is_what_so_many_runs_can_say(runs, ratio, word):
    table = {name: {"predicted_std": 2.0, "rmse_over_predicted": 1.0} for name in NAMES}
    summary = {"runs_done": runs, "parameters": table}
    table["accel_k11"]["rmse_over_predicted"] = ratio
    assert page_verdict.sigma_verdict(summary, "accel_k11") == word
    table["accel_k11"]["predicted_std"] = 0.0
    assert page_verdict.sigma_verdict(summary, "accel_k11") == "not estimated"


def test_same_campaigns_give_the_same_bytes(stores, text):
    paths = [str(stores / "quiet"), str(stores / "noisy")]
    assert page.html(page.campaigns(load([]), paths)) == text


def test_second_campaign_is_compared_if_it_is_a_pair(stores, text):
    assert "noisy against quiet" in text
    other = page.html(page.campaigns(load([]), [str(stores / "quiet"), str(stores / "half")]))
    assert re.search(r"Left out: .*seeds .* differ", other)


def test_half_finished_campaign_says_so_and_how_to_go_on(stores):
    shown = page.campaigns(load([]), [str(stores / "half")])
    (note,) = shown.notes
    path = stores / "half"
    assert note.startswith("half: 12 of 30 runs done; the rest: python -m pipeline.simulate ")
    made = campaigns.read(load([]), path)
    overrides = page_data.command(made.configuration, path).split(" ")[3:]
    again = load([override.strip("'") for override in overrides])
    assert store.fingerprint(again) == store.fingerprint(
        short(path, "noise=quiet", "campaign.seed=7")
    )
    assert 'class="note"><strong>Note</strong> half: 12 of 30' in page.html(shown)


def test_campaign_that_was_precise_enough_is_not_called_unfinished(tmp_path):
    path = make(tmp_path / "precise", "campaign.runs=300", "campaign.precision=0.2")
    (note,) = page.campaigns(load([]), [str(path)]).notes
    assert "stopped on purpose after 200 of at most 300 runs" in note


def test_campaign_with_a_smaller_filter_is_shown(tmp_path):
    path = make(tmp_path / "small", "estimator=states30")
    shown = page.html(page.campaigns(load([]), [str(path)]))
    assert "not estimated" in shown
    assert ">nan" not in shown.lower()


def test_campaign_of_another_version_has_no_courses(stores, monkeypatch):
    def refuse(runs):
        raise OmegaConfBaseException("Key 'old' not in 'Config'")

    monkeypatch.setattr(page_data, "config_of", refuse)
    shown = page.campaigns(load([]), [str(stores / "quiet")])
    left_out = {section.name for section in shown.sections if "of another" in section.left_out}
    assert left_out == {"convergence", "observability", "history"}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("campaigns=[]", "campaigns = []: must be a list of one or more paths, each once"),
        ("campaigns=x", "campaigns = x: must be a list"),
        (
            "campaigns=[a,a]",
            "campaigns = ['a', 'a']: must be a list of one or more paths, each once",
        ),
        ("campaigns=['']", "campaigns = ['']: must be a list of one or more paths, each once"),
        (
            "campaigns=[nowhere]",
            "campaign store nowhere: not found; make it with pipeline.simulate",
        ),
    ],
)
def test_bad_campaigns_end_in_one_line(tmp_path, monkeypatch, given, expected):
    monkeypatch.chdir(tmp_path)
    ended = run_stage(report, given)
    assert (ended.code, ended.out) == (2, "")
    assert error_lines(ended.err) == [f"error: {expected}"]
    assert [*tmp_path.iterdir()] == []


def test_page_of_too_few_runs_or_to_another_kind_of_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = make(tmp_path / "one")
    set_status(path, slice(1, None), store.NOT_RUN)
    left = sorted(tmp_path.iterdir())
    few = run_stage(report, f"campaigns=[{path}]")
    assert few.code == 2
    assert error_lines(few.err) == [
        f"error: campaign store {path}: 1 of 30 runs done; a report needs two"
    ]
    kind = run_stage(report, f"campaigns=[{path}]", "out=page.md")
    assert error_lines(kind.err) == [
        "error: out = 'page.md': must be a file whose name ends with .html"
    ]
    assert sorted(tmp_path.iterdir()) == left


def test_page_goes_beside_the_first_store_or_where_out_says(stores, tmp_path):
    ended = run_stage(report, f"campaigns=[{stores / 'quiet'}]")
    assert (ended.code, ended.out) == (0, f"{stores / 'quiet.html'}\n")
    wanted = tmp_path / "deep" / "x.html"
    assert run_stage(report, f"campaigns=[{stores / 'quiet'}]", f"out={wanted}").code == 0
    assert wanted.read_bytes() == (stores / "quiet.html").read_bytes()


def test_stores_of_one_name_are_told_apart(tmp_path):
    paths = [make(tmp_path / folder / "x", "campaign.runs=4") for folder in ("a", "b")]
    names = [c.name for c in page_data.read_campaigns(load([]), paths)]
    assert names == [str(path) for path in paths]


def test_report_of_the_study_needs_its_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match=r"not found; make it with pipeline\.simulate"):
        page.study(load([]))


def test_campaigns_do_not_depend_on_which_are_reported(tmp_path):
    usual = load([])
    assert store.fingerprint(load(["campaigns=[x]"])) == store.fingerprint(usual)


def test_sessions_of_a_campaign_are_logged_beside_its_store(tmp_path):
    path = make(tmp_path / "runs")
    (entry,) = provenance.sessions(path)
    assert entry["runs"] == 30
    assert entry["seconds"] > 0.0
    set_status(path, slice(20, None), store.NOT_RUN)
    simulate_campaign(short(path))
    assert [entry["runs"] for entry in provenance.sessions(path)] == [30, 10]
    simulate_campaign(short(path))  # nothing left to make
    assert len(provenance.sessions(path)) == 2
    simulate_campaign(short(path, "noise=quiet", "campaign.replace=true"))
    assert [entry["runs"] for entry in provenance.sessions(path)] == [30]
    shown = page.html(page.campaigns(load([]), [str(path)]))
    assert entry["processor"] in shown.replace("&#34;", '"')


def test_log_that_cannot_be_written_is_a_warning(tmp_path, capsys):
    provenance.log_path(tmp_path / "runs").mkdir()
    make(tmp_path / "runs")
    assert "log.json: cannot be written" in capsys.readouterr().err
    with pytest.raises(DataError, match="is not as it was written"):
        provenance.sessions(tmp_path / "runs")


def test_an_edited_log_is_told_and_begins_anew(tmp_path, capsys):
    path = make(tmp_path / "runs")
    log = provenance.log_path(path)
    log.write_text(log.read_text().replace('"runs": 30', '"runs": 31'))
    with pytest.raises(DataError, match="is not as it was written"):
        page.campaigns(load([]), [str(path)])
    set_status(path, slice(20, 30), store.NOT_RUN)
    make(path)
    assert "begins anew" in capsys.readouterr().err
    assert [entry["runs"] for entry in provenance.sessions(path)] == [10]


def test_commit_is_that_of_this_code_alone(tmp_path, monkeypatch):
    copy = tmp_path / "elsewhere" / "__init__.py"
    copy.parent.mkdir()
    copy.touch()
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    monkeypatch.setattr(provenance, "_PACKAGE", copy.parent)
    assert provenance.commit() == {"commit": provenance.NOT_RECORDED, "changed": None}
    monkeypatch.setenv("PATH", "")
    assert provenance.commit()["commit"] == provenance.NOT_RECORDED


def test_history_grows_and_reads_back(tmp_path):
    rng = np.random.default_rng(1)
    error, sigma = rng.standard_normal((40, len(NAMES))), np.ones(len(NAMES))
    settings = baseline.configuration_of(load([]))
    for number in range(2):
        row = history.row_of(
            error * (1 + number), sigma, np.full(40, 27.0), settings, date="d", reason="a, 'b'"
        )
        history.append(tmp_path, row)
    first, second = history.read(tmp_path)
    assert (first.reason, first.runs, first.nees_mean) == ("a, 'b'", 40, 27.0)
    assert set(first.ratio) == set(KINDS)
    for kind in KINDS:
        assert second.ratio[kind] == pytest.approx(2 * first.ratio[kind], rel=1e-5)
        assert first.ratio[kind] == pytest.approx(1.0, abs=0.3)
    assert first.configuration == history.digest(settings)
    (tmp_path / history.FILE).write_text("no,history\n1,2\n")
    with pytest.raises(DataError, match=r"history\.csv: cannot be read"):
        history.read(tmp_path)


def test_correlations_are_those_of_the_errors(stores):
    made = campaigns.read(load([]), stores / "quiet")
    rows = page_data.correlations(made, None)
    expected = np.corrcoef(made.error, rowvar=False)
    assert rows[3][0]["other"] == NAMES[np.argsort(-np.abs(expected[3]))[1]]
    for row in rows[3]:
        assert row["errors"] == pytest.approx(expected[3, NAMES.index(row["other"])], abs=1e-3)
        assert row["filter"] is None


def test_course_is_that_of_the_stored_run(stores):
    made = campaigns.read(load([]), stores / "quiet")
    course = page_data.course_of(made, short(stores / "quiet", "noise=quiet"))
    assert course.as_stored
    assert course.error[-1, -1] == pytest.approx(made.error[0], abs=1e-6)
    assert course.sigma[-1, -1] == pytest.approx(made.predicted_std)
    assert course.time_s[-1] == 160.0
    other = page_data.course_of(made, short(stores / "quiet", "noise=noisy"))
    assert not other.as_stored


def test_importing_the_package_does_not_import_the_page():
    code = "import sys, pipeline.simulate; print('altair' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_study_names_every_campaign_it_needs():
    assert {names.MAIN, names.ONE_PASS} <= set(names.CAMPAIGNS)
    assert {f"position25-{noise}" for noise in ("quiet", "reference", "noisy")} <= set(
        names.CAMPAIGNS
    )
