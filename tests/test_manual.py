"""The manual is true: its commands run, its outputs are real, its pages build without a warning.

Every page of ``docs/`` and the README is worked through from top to bottom, as `manual` does it:
what it asks for is done, and each line of output that the page shows is looked for in what came
out. A command that no rule knows is a failure.
"""

import re
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pytest
import yaml
from campaigns import ROOT
from manual import (
    PAGES,
    README,
    SMALL,
    STEPS,
    TOGETHER,
    Copy,
    Step,
    commands,
    rules_of,
    work_through,
)


@pytest.fixture(scope="module")
def copy(tmp_path_factory) -> Iterator[Copy]:
    made = Copy(tmp_path_factory.mktemp("manual"))
    try:
        yield made
    finally:
        made.stop()


@pytest.fixture(scope="module")
def pages(request, copy) -> Iterator[dict[str, Future]]:
    """All pages that tests were chosen for, two at a time; the kernels are compiled before."""
    names = {item.name for item in request.session.items}
    chosen = [page for page in PAGES if f"{test_page_does_what_it_says.__name__}[{page}]" in names]
    if README not in chosen and test_the_manual_is_built_whole.__name__ in names:
        chosen.append(README)
    copy.bash(f"python -m pipeline.simulate campaign.runs={SMALL} campaign.store=results/runs/warm")
    copy.start_dask()
    done: dict[str, Future] = {page: Future() for page in PAGES}

    def work(group: list[str]) -> None:
        for page in group:
            try:
                done[page].set_result(work_through(copy, page))
            except BaseException as error:
                done[page].set_exception(error)

    groups = [[page for page in chosen if page in TOGETHER]]
    groups += [[page] for page in chosen if page not in TOGETHER]
    groups.sort(key=lambda group: -sum(len(STEPS[page]) for page in group))
    with ThreadPoolExecutor(2) as lanes:
        for group in groups:
            lanes.submit(work, group)
        yield done


# the tests


def test_every_command_is_run_in_one_known_way():
    found = {str(s): rules_of(s.text) for page in PAGES for s in STEPS[page] if s.kind == "command"}
    assert {step: rules for step, rules in found.items() if len(rules) != 1} == {}
    assert len(found) > 30
    assert {rule for rules in found.values() for rule in rules} >= {
        *("installation, as CI", "kept running", "on a local scheduler", "on a local SLURM"),
        *("campaign as written", "campaign, fewer runs", "stage as written"),
    }


@pytest.mark.parametrize("command", ["rm -rf /", "python -m pipeline.nothing", "dvc repro", "ls"])
def test_an_unknown_command_is_a_failure(command):
    assert rules_of(command) == []


def test_commands_and_codes_are_read_from_a_block():
    block = ["a  b=1 \\", "   c=2", "", "# nothing", "d 'e f' # exits with 2", "g#h  # i"]
    assert commands(block) == [("a b=1 c=2", 0), ("d 'e f'", 2), ("g#h", 0)]


@pytest.mark.parametrize("page", PAGES)
def test_page_does_what_it_says(pages, page):
    done = pages[page].result()
    assert [step for step, _ in done] == STEPS[page]
    for step, printed in done:
        check_shown(step, printed)


def test_outputs_are_shown_and_looked_for():
    shown = [step for page in PAGES for step in STEPS[page] if step.shown]
    assert len(shown) >= 6
    (first, *_) = shown
    with pytest.raises(AssertionError, match="was not printed"):
        check_shown(first, "something else")


def check_shown(step: Step, printed: str) -> None:
    """Look for every shown line in what was printed, in its order."""
    lines = iter([words(line) for line in printed.splitlines()])
    for line in step.shown:
        wanted = words(line)
        if wanted and wanted != ["…"]:
            assert wanted in lines, f"{step}\nshows a line that was not printed there: {line}"


def words(line: str) -> list[str]:
    """Words of a line without the frames of tables, and without how fast it was."""
    if "runs/s" in line:
        line = re.sub(r"[\d.]+(?= (s|runs/s))", "~", line)
    return re.sub(r"[\u2500-\u257f]", " ", line).split()


def test_the_manual_is_built_whole(pages, copy):
    pages[README].result()  # which builds it, every warning an error; nothing may need a network
    built = copy.root / "docs" / "_build"
    for page in PAGES[1:]:
        assert (built / page.removeprefix("docs/")).with_suffix(".html").is_file()
    for module in (ROOT / "inscal").glob("*.py"):
        if module.stem != "__init__":
            assert (built / "reference" / "api" / f"inscal.{module.stem}.html").is_file(), module
    for file in built.rglob("*.html"):
        fetched = r"<(?:script|img|link|iframe)\b[^>]*?(?:src|href)=\"(?:https?:)?//[^\"]*"
        assert re.findall(fetched, file.read_text()) == [], file
    for file in built.rglob("*.css"):
        assert not re.search(r"@import|url\(\s*['\"]?(https?:)?//", file.read_text()), file
    method = (built / "method.html").read_text()
    assert method.count('<math xmlns="http://www.w3.org/1998/Math/MathML"') > 50
    assert not re.search(r"<script[^>]*mathjax", method, re.I)
    assert "<mi>&</mi>" not in method  # what the converter does not understand


def test_links_lead_somewhere():
    for page in PAGES:
        text = re.sub(r"```.*?```", "", (ROOT / page).read_text(), flags=re.S)
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
            if not target.startswith("https://"):
                assert (ROOT / page).parent.joinpath(target).exists(), f"{page}: {target}"


@pytest.fixture
def extension(monkeypatch):
    pytest.importorskip("sphinx")
    pytest.importorskip("latex2mathml")
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import manual_extension

    return manual_extension


def test_every_key_of_the_configuration_has_a_meaning(extension):
    keys = {key.name: key for key in extension.top_keys()}
    for group, schema, choice, choices in extension.groups():
        assert choice in choices
        keys |= {key.name: key for key in extension.keys_of(group, schema, choice)}
    keys |= {key.name: key for _, _, own in extension.wing_groups() for key in own}
    assert [name for name, key in keys.items() if not key.meaning] == []
    wing = yaml.safe_load((ROOT / "conf/paper.yaml").read_text())
    assert flat(wing["effects"], "effects") | flat(wing["laboratory"], "laboratory") <= set(keys)
    for path in (ROOT / "conf").glob("*/*.yaml"):
        assert flat(yaml.safe_load(path.read_text()), path.parent.name) <= set(keys), path
    for name, key in keys.items():
        if re.search(r"_(s|deg|mm|m|ug|ppm|hz|arcsec|per_h|per_s|1e_9)$", name):
            assert key.unit, name
    text = extension.configuration_text()
    assert all(f"`{name}`" in text for name in keys)
    assert keys["noise.gyro_angle_random_walk_deg_per_sqrt_h"].unit == "deg/√h"
    assert keys["schedule.position_duration_s"].default == "`500.0`"
    assert (keys["effects.swing_axis"].default, keys["effects.swing_axis"].unit) == ("`Z`", "")
    assert keys["effects.vibration_rate_hz"].unit == "Hz"


def flat(tree: dict, prefix: str) -> set[str]:
    out: set[str] = set()
    for key, value in tree.items():
        if key != "defaults":
            name = f"{prefix}.{key}"
            out |= flat(value, name) if isinstance(value, dict) else {name}
    return out


def test_every_stage_is_in_its_table(extension):
    listed = {name for name, _, _ in extension.stages()}
    programs = {
        path.parent.name if path.stem == "__main__" else path.stem
        for path in (ROOT / "pipeline").rglob("*.py")
        if 'if __name__ == "__main__":' in path.read_text()
    }
    assert listed == programs
    for name, summary, usage in extension.stages():
        assert usage.startswith(f"python -m pipeline.{name}")
        assert summary
