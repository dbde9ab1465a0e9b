"""The rules of the house, read from the source: rooms, doors, the wing, dependencies of stages."""

import re
from pathlib import Path

import pytest
import structure
import yaml
from structure import ROOMS, ROOT, WING, dependencies, doors, imports, modules, room

from pipeline.console.help import read_by

# What no number of a stage depends on: it limits threads and answers --help.
_PACKAGE = "pipeline"


def stages_of_study() -> list[tuple[str, str, set[str]]]:
    """Name, module and dependencies in code of every stage of ``dvc.yaml``."""
    out = []
    for name, body in structure.stages().items():
        module = re.search(r"python -m (\S+)", body["cmd"])[1]
        code = {dep for dep in body["deps"] if dep.split("/")[0] in structure.PACKAGES}
        out.append((name, module if module in doors() else f"{module}.__main__", code))
    return out


def test_every_module_is_in_a_room_or_a_door():
    rooms = {room(module) for module in modules()} - {"inscal", "door"}
    assert rooms == {*ROOMS}
    for name in ROOMS:
        assert (ROOT / "pipeline" / name / "__init__.py").read_text().startswith('"""')


def test_imports_go_down():
    order = {name: place for place, name in enumerate(("inscal", *ROOMS, "door"))}
    wrong = [
        f"{module} ({room(module)}) imports {other} ({room(other)})"
        for module in modules()
        if module != _PACKAGE
        for other in imports(module) - {_PACKAGE}
        if order[room(other)] > order[room(module)]
    ]
    assert wrong == []


def test_no_circle():
    assert structure.circles() == []


def test_nobody_imports_a_door():
    taken = {module: imports(module) & {*doors()} for module in modules()}
    assert {module: found for module, found in taken.items() if found} == {}


def test_doors_are_short():
    long = {door: structure.lines([modules()[door]]) for door in doors()}
    assert {door: count for door, count in long.items() if count > 110} == {}


def test_files_can_be_read_in_one_go():
    paths = [*modules().values(), *(ROOT / "tests").rglob("*.py")]
    long = {str(path.relative_to(ROOT)): structure.lines([path]) for path in paths}
    assert {path: count for path, count in long.items() if count > 410} == {}


def test_the_product_takes_nothing_of_the_wing():
    product = [
        m for m in modules() if room(m) != WING and not Path(m).name.startswith("pipeline.paper")
    ]
    assert [m for m in product if any(room(other) == WING for other in imports(m))] == []


@pytest.mark.parametrize(
    ("door", "code"), [pytest.param(door, code, id=name) for name, door, code in stages_of_study()]
)
def test_a_stage_depends_on_all_that_it_imports(door, code):
    assert code == dependencies(door)


def test_stages_depend_on_the_configuration_that_they_read_by_name():
    """Of the groups that a stage says it reads, which is held to be all, the file chosen."""
    usual = {}
    for group in yaml.safe_load((ROOT / "conf" / "config.yaml").read_text())["defaults"]:
        usual |= group if isinstance(group, dict) else {}
    for stage, door, _ in stages_of_study():
        command = structure.stages()[stage]["cmd"]
        chosen = usual | dict(re.findall(r"(\w+)=(\S+)", command))
        said = read_by(modules()[door].read_text())
        read = {entry for entry in said if "." not in entry or f"{entry}=" not in command}
        groups = {entry.partition(".")[0] for entry in read} & usual.keys() - {"cluster"}
        if stage.endswith("summarize"):  # they name the usual store, and here it is named
            groups -= {"schedule", "noise"}
        named = structure.configuration_of(stage)
        assert {f"conf/{group}/{chosen[group]}.yaml" for group in groups} - named == set(), stage
        assert [path for path in named if not path.endswith(".yaml")] == [], stage


def test_stages_depend_on_the_results_that_they_read_by_name():
    """With a folder, results of a user's own would make them anew."""
    study = yaml.safe_load((ROOT / "conf" / "study.yaml").read_text())
    main, one_pass = study["roles"]["main"], study["roles"]["one_pass"]
    levels = study["levels"][study["campaigns"][main]["schedule"]]
    read = {
        "figures": {
            *(f"results/comparison/{name}.json" for name in study["drawn"]),
            *(f"results/runs/{name}" for name in (*levels, one_pass)),
        },
        "frontier": {f"results/summary/{name}.json" for name in study["frontier"]["marked"]},
        "report": {
            *(f"results/comparison/{name}.json" for name in study["comparisons"]),
            *(f"results/summary/{name}.json" for name in study["reported"]),
        },
    }
    assert {stage: structure.results_read(stage) for stage in read} == read


def test_structure_is_printed(capsys):
    structure.main()
    out = capsys.readouterr().out
    assert "circles: none" in out
    assert "doors imported: none" in out
    assert all(name in out for name in ROOMS)


def test_commands_of_the_study_are_as_its_lock_keeps_them():
    """Where a column is empty two spaces meet, the lock keeps one, and a stage never rests."""
    for stage, study, campaigns in (
        ("simulate", "study", "campaigns"),
        ("paper-simulate", "paper_study", "paper_campaigns"),
    ):
        rows = yaml.safe_load((ROOT / "conf" / f"{study}.yaml").read_text())[campaigns]
        for key, row in rows.items():
            values = {f"item.{name}": str(value) for name, value in row.items()} | {"key": key}
            command = re.sub(
                r"\$\{([\w.]+)\}", lambda m, v=values: v[m[1]], structure.stages()[stage]["cmd"]
            )
            assert command == " ".join(command.split()), key
