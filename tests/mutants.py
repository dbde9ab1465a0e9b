"""How many small wrongs in the library the gate and the tests notice, by hand:

    python tests/mutants.py --sample 200 --seed 1          # hours, if all of them
    python tests/mutants.py --module sensor --module earth
    python tests/mutants.py --again                         # what lived, against new tests
    python tests/mutants.py --report                        # the page again, with new reasons

A mutant is the library with one sign, operator, index, number, unit, name or interval changed
(`mutations`). Each is written into a temporary copy of the repository, which this program has made
itself, and never anywhere else. Against it go the tests of its module without machine code where
that is quicker, the gate, the module's tests, and at last tests of what builds on it; the first
that fails kills it. What lives on is listed in ``results/mutants.md`` beside why that does no harm,
where ``tests/mutant_survivors.yaml`` has a reason.

Results are kept as they come, in ``results/mutants.csv``; a sample can be stopped at any time,
since its order is random. Until then library and tests must stay as they are.
"""

import argparse
import csv
import hashlib
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import yaml
from mutations import Mutation, mutations
from scipy import stats

from inscal.kernel import RUN_MODULES

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "results" / "mutants.csv"
PAGE = ROOT / "results" / "mutants.md"
REASONS = ROOT / "tests" / "mutant_survivors.yaml"

MARK = ".inscal-mutants"
"""File that a copy to be written into has, and nothing else."""

ROOM = 512
"""Bytes of comment at the end of every module of the copy, which a mutation takes from or adds to:
numba takes machine code for stale if its source's size has changed."""

PLAIN = {"rotation", "sensor", "earth", "navigation"}
"""Modules whose tests are quick without machine code."""

FURTHER = {
    "regression": ["tests/gate/test_gate_statistics.py"],
    "campaign_checks": ["tests/gate/test_gate_statistics.py"],
    "parameters": ["tests/library/test_units.py", "tests/config/test_config.py"],
    "free_inertial": ["tests/library/test_effects.py"],
    "innovations": ["tests/library/test_convergence.py", "tests/proof/test_consistency.py"],
    "directions": ["tests/library/test_schedule.py"],
    "effects": ["tests/paper/test_paper_experiments.py"],
}
"""Tests of a module beside the file of its name."""

OFF_THE_GATE = {
    *("comparison_statistics", "effects", "free_inertial", "information", "innovations"),
    *("observability", "summary"),
}
"""Modules that the gate imports nothing of."""

FIELDS = ("module", "line", "kind", "old", "new", "killed_by", "seconds", "source")
LONGEST = 600
"""Seconds after which a mutant hangs, and is killed."""

ON_TOP = {
    "regression": ["tests/gate/test_verdicts.py", "tests/gate/test_cases.py"],
    "campaign_checks": ["tests/gate/test_verdicts.py", "tests/gate/test_cases.py"],
    "statistics": ["tests/gate/test_gate_statistics.py"],
}
"""Tests of what builds on a module, where they are not of the library."""

CORE = ("experiment", "estimator", "calibrator", "convergence", "simulation", "information")
"""Modules whose tests build on most of those that make runs."""

NEW = "a new test"
"""What kills a mutant that lived before."""


@dataclass(frozen=True)
class Copy:
    """A temporary copy of the repository."""

    root: Path

    @classmethod
    def make(cls) -> "Copy":
        """Copy what git knows of."""
        root = Path(tempfile.mkdtemp(prefix="inscal-mutants-")).resolve()
        names = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        ).stdout.split("\n")  # fmt: skip
        for name in filter(None, names):
            if (ROOT / name).is_file():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, root / name)
        (root / MARK).touch()
        copy = cls(root)
        for module in modules():
            copy.write(module, source_of(module))
        return copy

    def write(self, module: str, source: bytes) -> None:
        """Write a module's source, of a size and a time that are always the same."""
        path = (self.root / "inscal" / f"{module}.py").resolve()
        ours = path.is_relative_to(self.root) and (self.root / MARK).exists()
        if not ours or path.is_relative_to(ROOT) or self.root.is_relative_to(ROOT):
            raise RuntimeError(f"{path} is no file of a copy made here")
        size = (ROOT / "inscal" / f"{module}.py").stat().st_size + ROOM
        rest = size - len(source)
        path.write_bytes(source + b"#" * (rest - 1) + b"\n")
        os.utime(path, (1e9, 1e9))

    def run(self, *command: str, jit: bool = True) -> bool:
        """Whether a command of the copy's python ends well in time."""
        environment = os.environ | {
            "PYTHONPATH": str(self.root),
            "NUMBA_CACHE_DIR": str(self.root / "machine_code"),
            "NUMBA_DISABLE_JIT": "0" if jit else "1",
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        try:
            ended = subprocess.run(
                [sys.executable, *command],
                cwd=self.root, env=environment, capture_output=True, timeout=LONGEST,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return False
        return ended.returncode == 0

    def keep_machine_code(self) -> None:
        """Take the machine code of the unchanged library for that of the sources as they are."""
        digest = hashlib.sha256()  # names the folder, as in `inscal.kernel.cache_folder`
        for module in modules():
            digest.update((self.root / "inscal" / f"{module}.py").read_bytes())
        place = self.root / "machine_code" / f"kernels-{digest.hexdigest()[:16]}"
        shutil.copytree(self.root / "clean_code", place)

    def forget_machine_code(self) -> None:
        """Delete the machine code of mutants."""
        shutil.rmtree(self.root / "machine_code", ignore_errors=True)
        (self.root / "machine_code").mkdir()


def modules() -> list[str]:
    """Modules of the library."""
    return sorted(path.stem for path in (ROOT / "inscal").glob("*.py"))


def source_of(module: str) -> bytes:
    """Source of a module as it is."""
    return (ROOT / "inscal" / f"{module}.py").read_bytes()


def tests_of(module: str) -> list[str]:
    """Files of tests that are about a module."""
    own = f"tests/library/test_{module}.py"
    return ([own] if (ROOT / own).exists() else []) + FURTHER.get(module, [])


def tests_on_top(module: str) -> list[str]:
    """Files of tests that build on a module, beside its own."""
    files = {
        f"tests/library/{path.name}"
        for path in (ROOT / "tests" / "library").glob("test_*.py")
        if f"inscal.{module} " in path.read_text()
    }
    if module in RUN_MODULES:
        files |= {f"tests/library/test_{name}.py" for name in CORE}
    files -= {*tests_of(module), "tests/library/test_kernel.py"}
    return sorted(files) + ON_TOP.get(module, [])


def killer(copy: Copy, mutation: Mutation) -> str:
    """What kills a mutant; empty if nothing does."""
    copy.write(mutation.module, mutation.source)
    compiled = mutation.compiled or mutation.module == "kernel"
    if not compiled:
        copy.keep_machine_code()
    own = tests_of(mutation.module)
    test = ("-m", "pytest", "-n0", "-x", "-q", "-p", "no:cacheprovider")
    plain = compiled and mutation.module in PLAIN
    if plain and not copy.run(*test, *own, "-k", "not without_a_solution", jit=False):
        return "tests"
    steps = [("gate", ("-m", "pipeline.regress")), ("tests", (*test, *own))]
    if not compiled:
        steps.reverse()
    if mutation.module in OFF_THE_GATE:
        steps = [step for step in steps if step[0] != "gate"]
    if not own:
        steps = [step for step in steps if step[0] != "tests"]
    if tests_on_top(mutation.module):
        steps.append(("other tests", (*test, *tests_on_top(mutation.module))))
    for name, command in steps:
        if not copy.run(*command):
            return name
    return ""


def run(sample: list[Mutation], minutes: float, rows: list[dict[str, str]]) -> None:
    """Try mutants in turn until the time is over, and add what came of each to the rows."""
    copy, end = Copy.make(), time.monotonic() + 60 * minutes
    try:
        (copy.root / "machine_code").mkdir()
        tests = (
            "-m",
            "pytest",
            "-n0",
            "-q",
            "tests/library",
            "--ignore=tests/library/test_kernel.py",
        )
        for command in (("-m", "pipeline.regress"), tests):
            if not copy.run(*command):
                raise RuntimeError(f"the library as it is fails {' '.join(command)}")
        (kept,) = (copy.root / "machine_code").iterdir()
        shutil.copytree(kept, copy.root / "clean_code")
        for mutation in sample:
            if time.monotonic() > end:
                break
            begun = time.monotonic()
            by = killer(copy, mutation)
            copy.write(mutation.module, source_of(mutation.module))
            copy.forget_machine_code()
            done = row(mutation, by, time.monotonic() - begun)
            print(*done.values(), sep=" | ", flush=True)
            before = next((one for one in rows if same(one, mutation)), None)
            if before is None:
                rows.append(done)
            else:
                before["killed_by"] = NEW if by else ""
            write(rows)
    finally:
        shutil.rmtree(copy.root)


def same(one: dict[str, str], mutation: Mutation) -> bool:
    """Whether a row is of a mutation."""
    about = row(mutation, "", 0.0)
    return all(one[key] == about[key] for key in ("module", "line", "old", "new", "source"))


def row(mutation: Mutation, by: str, seconds: float) -> dict[str, str]:
    """Row of the table."""
    about = (mutation.module, mutation.line, mutation.kind, mutation.old, mutation.new)
    return dict(zip(FIELDS, map(str, (*about, by, round(seconds), mutation.text)), strict=True))


def write(rows: list[dict[str, str]]) -> None:
    """Write the table."""
    with TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def report() -> None:
    """Write the page from the table and the reasons."""
    rows = list(csv.DictReader(TABLE.open()))
    there = [m for name in modules() for m in mutations(name, source_of(name))]
    reasons = yaml.safe_load(REASONS.read_text()) if REASONS.exists() else {}
    killed = [one for one in rows if one["killed_by"]]
    lived = [one for one in rows if not one["killed_by"]]
    share = stats.binomtest(len(killed), len(rows)).proportion_ci(0.95, "exact")
    by = {name: sum(one["killed_by"] == name for one in rows) for name in ("tests", "gate", NEW)}
    lines = [
        "# Mutants",
        "",
        "Written by `python tests/mutants.py`: the library with one small wrong in it, and whether",
        "the gate or the tests notice. Tests of the changed module are run before the gate where",
        "the change needs no new machine code; the first that fails is counted.",
        "",
        f"Of {len(there)} mutants that there are, {len(rows)} drawn at random were tried;",
        f"**{len(killed)} were killed, {100 * len(killed) / len(rows):.1f} %** (95 %: "
        f"{100 * share.low:.1f} to {100 * share.high:.1f}): {by['tests']} by tests of the module,",
        f"{by['gate']} by the gate, {len(killed) - sum(by.values())} by tests of what builds on it",
        f"and {by[NEW]} by tests written after the others had let them live.",
        "",
        "| module | tried | killed |",
        "| --- | ---: | ---: |",
    ]
    for name in sorted({one["module"] for one in rows}):
        own = [one for one in rows if one["module"] == name]
        lines.append(f"| {name} | {len(own)} | {sum(bool(one['killed_by']) for one in own)} |")
    lines += ["", "## Survivors", "", "| mutant | in | why it lives |", "| --- | --- | --- |"]
    for one in lived:
        change = f"`{one['old']}` → `{one['new']}`"
        key = f"{one['module']}: {one['source']}: {one['old']} -> {one['new']}"
        why = reasons.get(key, "no reason known")
        source = one["source"].replace("|", "\\|")
        lines.append(f"| {one['module']}: {change} | `{source}` | {why} |")
    PAGE.write_text("\n".join(lines) + "\n")


def main() -> None:
    """Draw mutants, try them, and write table and page."""
    parser = argparse.ArgumentParser(description="Mutants of the library against gate and tests.")
    parser.add_argument("--module", action="append", help="only of these; all if not said")
    parser.add_argument("--sample", type=int, help="how many at random; all if not said")
    parser.add_argument("--seed", type=int, default=1, help="of the sample and its order")
    parser.add_argument("--minutes", type=float, default=1e6, help="begin no more after so many")
    parser.add_argument("--again", action="store_true", help="those that lived, and no others")
    parser.add_argument("--report", action="store_true", help="only write the page")
    options = parser.parse_args()
    if not options.report:
        chosen = options.module or modules()
        every = [m for name in chosen for m in mutations(name, source_of(name))]
        random.Random(options.seed).shuffle(every)
        sample, rows = every[: options.sample], []
        if options.again:
            rows = list(csv.DictReader(TABLE.open()))
            lived = [one for one in rows if not one["killed_by"]]
            sample = [m for m in every if any(same(one, m) for one in lived)]
        run(sample, options.minutes, rows)
    report()


if __name__ == "__main__":
    main()
