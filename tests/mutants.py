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
from collections.abc import Iterator
from contextlib import contextmanager
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
    "disturbance": ["tests/library/test_disturbed.py", "tests/library/test_unit_effects.py"],
    "path": ["tests/library/test_unit_effects.py"],
    "budget": ["tests/test_budget_stage.py"],
}
"""Tests of a module beside the file of its name."""

OFF_THE_GATE = {
    *("budget", "chance", "comparison_statistics", "effects", "free_inertial", "information"),
    *("innovations", "observability", "summary"),
}
"""Modules that the gate imports nothing of."""

FIELDS = ("sample", "module", "line", "kind", "old", "new", "killed_by", "seconds", "source")
LONGEST = 600
"""Seconds after which a mutant hangs, and is killed."""

ON_TOP = {
    "regression": ["tests/gate/test_verdicts.py", "tests/gate/test_cases.py"],
    "campaign_checks": ["tests/gate/test_verdicts.py", "tests/gate/test_cases.py"],
    "statistics": ["tests/gate/test_gate_statistics.py"],
    "chance": ["tests/proof/test_power.py"],
}
"""Tests of what builds on a module, where they are not of the library."""

CORE = ("experiment", "estimator", "calibrator", "convergence", "simulation", "information")
"""Modules whose tests build on most of those that make runs."""

KERNEL_TESTS = "tests/library/test_kernel.py"
"""Tests of how machine code is kept, which is done otherwise here."""

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
    files -= {*tests_of(module), KERNEL_TESTS}
    return sorted(files) + ON_TOP.get(module, [])


def killer(copy: Copy, mutation: Mutation, tests_alone: bool = False) -> str:
    """What kills a mutant, or of the tests of its module alone; empty if nothing does."""
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
    if tests_alone:
        steps = [step for step in steps if step[0] == "tests"]
    elif tests_on_top(mutation.module):
        steps.append(("other tests", (*test, *tests_on_top(mutation.module))))
    for name, command in steps:
        if not copy.run(*command):
            return name
    return ""


@contextmanager
def tried_copy() -> Iterator[Copy]:
    """Copy of the library as it is, with its machine code, that gate and tests have passed."""
    copy = Copy.make()
    try:
        copy.forget_machine_code()
        tests = ("-m", "pytest", "-n0", "-q", "tests/library")
        for command in (("-m", "pipeline.regress"), (*tests, f"--ignore={KERNEL_TESTS}")):
            if not copy.run(*command):
                raise RuntimeError(f"the library as it is fails {' '.join(command)}")
        (kept,) = (copy.root / "machine_code").iterdir()
        shutil.copytree(kept, copy.root / "clean_code")
        yield copy
    finally:
        shutil.rmtree(copy.root)


def tried(copy: Copy, mutation: Mutation, *, tests_alone: bool = False) -> tuple[str, float]:
    """What kills a mutant, and after how many seconds; the copy is then as before."""
    begun = time.monotonic()
    by = killer(copy, mutation, tests_alone)
    copy.write(mutation.module, source_of(mutation.module))
    copy.forget_machine_code()
    return by, time.monotonic() - begun


def run(sample: list[Mutation], seed: int, minutes: float) -> None:
    """Try mutants in turn until the time is over, and add what came of each to the table."""
    rows = [one for one in read() if one["sample"] != str(seed)]
    end = time.monotonic() + 60 * minutes
    with tried_copy() as copy:
        for mutation in sample:
            if time.monotonic() > end:
                break
            rows.append(row(mutation, seed, *tried(copy, mutation)))
            write(rows)
            print(*rows[-1].values(), sep=" | ", flush=True)


def again(every: list[Mutation]) -> None:
    """Try what lived against the tests of its module as they are now.

    Where a line holds the same change twice, both have to die.
    """
    rows = read()
    with tried_copy() as copy:
        for one in rows:
            own = [mutation for mutation in every if same(one, mutation)]
            if one["killed_by"] or not own:
                continue
            if all(tried(copy, mutation, tests_alone=True)[0] for mutation in own):
                one["killed_by"] = NEW
            write(rows)
            print(*one.values(), sep=" | ", flush=True)


def same(one: dict[str, str], mutation: Mutation) -> bool:
    """Whether a row is of a mutation."""
    about = row(mutation, 0, "", 0.0)
    return all(one[key] == about[key] for key in ("module", "kind", "old", "new", "source"))


def row(mutation: Mutation, seed: int, by: str, seconds: float) -> dict[str, str]:
    """Row of the table."""
    about = (seed, mutation.module, mutation.line, mutation.kind, mutation.old, mutation.new)
    return dict(zip(FIELDS, map(str, (*about, by, round(seconds), mutation.text)), strict=True))


def read() -> list[dict[str, str]]:
    """Read the table; nothing if there is none."""
    return list(csv.DictReader(TABLE.open())) if TABLE.exists() else []


def write(rows: list[dict[str, str]]) -> None:
    """Write the table."""
    with TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def report() -> None:
    """Write the page from the table and the reasons."""
    rows = read()
    reasons = yaml.safe_load(REASONS.read_text()) if REASONS.exists() else {}
    there = sum(len(mutations(name, source_of(name))) for name in modules())
    lines = [
        "# Mutants",
        "",
        "Written by `python tests/mutants.py`: the library with one small wrong in it, and whether",
        f"gate or tests notice. The generator makes {there} mutants; samples of them were drawn at",
        "random. Tests of the changed module come before the gate where the change needs no new",
        "machine code, and the first that fails is counted. After a sample, tests were written for",
        "what had lived: the last column counts them, and only a later sample says what they are",
        "worth beyond.",
        "",
        "| sample | mutants | killed | share (95 %) | by tests of the module | by the gate "
        "| by tests on top | with tests written after it |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name in sorted({one["sample"] for one in rows}):
        own = [one["killed_by"] for one in rows if one["sample"] == name]
        counts = [own.count(by) for by in ("tests", "gate", "other tests")]
        cells = [name, str(len(own)), str(sum(counts)), share(sum(counts), len(own))]
        cells += [*map(str, counts), share(len(own) - own.count(""), len(own))]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "| module | tried | killed |", "| --- | ---: | ---: |"]
    for name in sorted({one["module"] for one in rows}):
        own = [one["killed_by"] for one in rows if one["module"] == name]
        lines.append(f"| {name} | {len(own)} | {len(own) - own.count('')} |")
    lines += ["", "## Survivors", "", "| mutant | in | why it lives |", "| --- | --- | --- |"]
    for one in rows:
        if not one["killed_by"]:
            key = f"{one['module']}: {one['source']}: {one['old']} -> {one['new']}"
            source = one["source"].replace("|", "\\|")
            change = f"{one['module']}: `{one['old']}` → `{one['new']}`"
            lines.append(f"| {change} | `{source}` | {reasons.get(key, 'no reason known')} |")
    PAGE.write_text("\n".join(lines) + "\n")


def share(hits: int, trials: int) -> str:
    """Share in percent and its exact interval."""
    ends = stats.binomtest(hits, trials).proportion_ci(0.95, "exact")
    return f"{100 * hits / trials:.1f} % ({100 * ends.low:.1f} to {100 * ends.high:.1f})"


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
        if options.again:
            again(every)
        else:
            run(every[: options.sample], options.seed, options.minutes)
    report()


if __name__ == "__main__":
    main()
