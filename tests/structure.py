"""The house read from its source: files, rooms and imports, and what each stage depends on.

``python tests/structure.py`` prints it; `test_structure` holds it against the rules.
"""

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("inscal", "pipeline")
ROOMS = (
    *("words", "console", "config", "logs", "campaign", "study", "gate", "proof", "charts", "page"),
    "paper",
)
"""Rooms of ``pipeline/`` from the lowest up: a room imports those before it and the library."""

PROGRAM = "inscal.command"
"""What the package installs as a program: the one module of the library that finds the pipeline."""

WING = "paper"
"""The room that comes off: its doors and its page of claims belong to it."""


@cache
def modules() -> dict[str, Path]:
    """Modules by dotted name."""
    found = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    named = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in found}
    return {name.removesuffix(".__init__"): path for name, path in sorted(named.items())}


@cache
def imports(module: str) -> frozenset[str]:
    """Modules of the project that a module imports anywhere in its source."""
    out: set[str] = set()
    for node in ast.walk(ast.parse(modules()[module].read_text())):
        if isinstance(node, ast.Import):
            out |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names} & modules().keys()
            out |= inner if len(inner) == len(node.names) else {node.module} | inner
    return frozenset((out & modules().keys()) - {module})


def doors() -> list[str]:
    """Stages: modules directly in ``pipeline/``, and what ``python -m pipeline.paper`` runs."""
    direct = [name for name in modules() if name.startswith("pipeline.") and name.count(".") == 1]
    return [name for name in direct if modules()[name].name != "__init__.py"] + [
        name for name in modules() if name.endswith(".__main__")
    ]


def room(module: str) -> str:
    """Folder a module lives in: a room, ``inscal``, or ``door``."""
    parts = module.split(".")
    if parts[0] == "inscal":
        return "door" if module == PROGRAM else "inscal"
    return "door" if module in doors() or len(parts) == 1 else parts[1]


def reached(module: str) -> set[str]:
    """Modules that importing one brings in, itself included."""
    seen: set[str] = set()
    unseen = {module}
    while unseen:
        seen |= unseen
        unseen = set().union(*map(imports, unseen)) - seen
    return seen


@cache
def stages() -> dict[str, dict]:
    """Stages of ``dvc.yaml``, those of a `foreach` as what they do."""
    every = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["stages"]
    return {name: stage.get("do", stage) for name, stage in every.items()}


def configuration_of(stage: str) -> set[str]:
    """Files and folders of configuration that a stage of ``dvc.yaml`` depends on."""
    about = stages()[stage]
    named = {dep for dep in about["deps"] if dep.startswith("conf/")}
    return named.union(*about.get("params", ()))


def results_read(stage: str) -> set[str]:
    """Stores, summaries and comparisons that a stage of ``dvc.yaml`` depends on."""
    folders = tuple(f"results/{name}" for name in ("comparison", "runs", "summary"))
    return {dep for dep in stages()[stage]["deps"] if dep.startswith(folders)}


def dependencies(door: str) -> set[str]:
    """Folders that decide what a stage does, and the file of its door."""
    rooms = {room(module) for module in reached(door) - {door, "pipeline", "inscal"}}
    own = str(modules()[door].relative_to(ROOT))
    folders = {name if name == "inscal" else f"pipeline/{name}" for name in rooms}
    return folders if own.startswith(f"pipeline/{WING}/") else {*folders, own}


def circles() -> list[list[str]]:
    """Sets of modules that import each other in a circle."""
    found = []
    for module in modules():
        mates = sorted(m for m in reached(module) if module in reached(m))
        if len(mates) > 1 and mates[0] == module:
            found.append(mates)
    return found


@cache
def level(module: str) -> int:
    """Longest chain of imports below a module; circles must have been ruled out."""
    return 1 + max((level(other) for other in imports(module)), default=0)


def lines(paths: Iterable[Path]) -> int:
    """Lines of source files."""
    return sum(len(path.read_text().splitlines()) for path in paths)


def main() -> None:
    """Print the house."""
    for package in PACKAGES:
        own = {name: path for name, path in modules().items() if name.split(".")[0] == package}
        print(f"{package}: {len(own)} files, {lines(own.values())} lines")
    print(f"\n{'room':10}{'files':>7}{'lines':>7}{'deepest level':>15}")
    for name in ("inscal", *ROOMS, "door"):
        own = {module: path for module, path in modules().items() if room(module) == name}
        if own:
            deepest = max(map(level, own)) if not circles() else "?"
            print(f"{name:10}{len(own):7}{lines(own.values()):7}{deepest:>15}")
    taken = sorted(
        f"{module} takes from {other}"
        for module in modules()
        for other in imports(module) & {*doors()}
    )
    print(f"\ncircles: {circles() or 'none'}\ndoors imported: {taken or 'none'}")


if __name__ == "__main__":
    main()
