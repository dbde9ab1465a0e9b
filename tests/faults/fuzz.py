"""Thousands of configurations that nobody meant, on command lines and in files.

Usage: ``python tests/faults/fuzz.py [inputs] [seed]``

Works in a folder of its own that it makes, with a copy of ``conf`` to break. Whatever is refused
must end with exit code 2 and one line that names the key, or the file, and nothing written; what is
accepted goes no further than its configuration.
"""

import ast
import itertools
import os
import random
import shutil
import string
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaigns import run_stage
from place import folder_of_its_own

from pipeline.config.load import PRODUCT, Program, load, resolved
from pipeline.config.stage import stage
from pipeline.console.conf import SHIPPED
from pipeline.paper.config import PROGRAM

NUMBERS = (
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "9" * 30,
    "-0.0",
    "0x10",
    "1_0",
)
ODD = (
    *(
        "[]",
        "[[1]]",
        "[1,[2]]",
        "{}",
        "{a:1}",
        "null",
        "''",
        "' '",
        "a,b",
        "???",
        "${oops}",
        "true",
    ),
    *("${oc.decode:'[1'}", "${oc.env:HOME}", "${noise}", "x" * 10_000, "[" * 60 + "]" * 60, "010"),
    *(
        "a\x1b[31mb",
        "a\nb",
        "\u202eb",
        "'a\\nb'",
        "\x00",
        "<b>",
        "s3://b/x",
        "/dev/null/x",
        "=",
        "~/[",
    ),
)
SWITCHES = (
    *(
        "--cfg",
        "--cfg=all",
        "-p noise",
        "--info",
        "--info all",
        "--version",
        "--hydra-help",
        "--run",
    ),
    *(
        "--resolve",
        "--config-name nope",
        "--config-path /nope",
        "--config-dir /nope",
        "--shell-completion",
    ),
    *("--experimental-rerun x", "hydra.run.dir=x", "hydra/launcher=x", "+hydra.x=1", "--cfg hydra"),
)
BREAKS = (
    "tab",
    "bom",
    "crlf",
    "twice",
    "not_utf8",
    "cut",
    "lines",
    "value",
    "bomb",
    "cycle",
    "deep",
)


def nothing(_config: object) -> None:
    """Stand in for a stage: everything before it is tried."""


def keys_of(program: Program) -> list[str]:
    """Keys of a configuration, groups and numbers."""
    out, waiting = [], [("", resolved(load([], program)))]
    while waiting:
        prefix, about = waiting.pop()
        for name, value in about.items():
            out.append(f"{prefix}{name}")
            if isinstance(value, dict):
                waiting.append((f"{prefix}{name}.", value))
    return sorted(out)


def override(keys: list[str], rng: random.Random) -> tuple[list[str], str]:
    """Arguments, and what the line must name."""
    kind = rng.random()
    if kind < 0.1:
        words = rng.choice(SWITCHES).split(" ")
        return words, words[0].partition("=")[0].lstrip("+")
    key = rng.choice(keys)
    if kind < 0.2:
        place = rng.randrange(len(key))
        key = key[:place] + rng.choice(string.printable[:94]) + key[place:]
        return [f"{key}=1"], ""
    value = rng.choice(NUMBERS if kind < 0.6 else ODD)
    return [f"{rng.choice(['', '', '', '+', '++'])}{key}={value}"], key.rpartition(".")[2]


def break_file(folder: Path, rng: random.Random) -> str:
    """Break one configuration file of a copy; its name."""
    file = rng.choice(sorted(folder.rglob("*.yaml")))
    content, how = file.read_bytes(), rng.choice(BREAKS)
    lines = content.split(b"\n")
    place = rng.randrange(len(lines))
    if how == "tab":
        lines[place] = b"\t" + lines[place]
    if how == "twice":
        lines.insert(place, lines[place])
    if how == "lines":
        rng.shuffle(lines)
    if how == "value":
        odd = rng.choice(
            [*NUMBERS, *ODD, "no", "010", "1:30", "2020-01-01", "*a", "&a 1", "!!python/x"]
        )
        lines[place] = lines[place].partition(b":")[0] + b": " + odd.encode()
    if how == "bomb":
        names = "abcdefghijkl"
        lines += [b"a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
        lines += [
            f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]".encode()
            for old, new in itertools.pairwise(names)
        ]
    if how == "cycle":
        lines.insert(0, f"defaults: [{file.stem}, _self_]".encode())
    if how == "deep":
        lines.append(b"deep: " + b"[" * 3000 + b"]" * 3000)
    content = b"\n".join(lines)
    if how == "bom":
        content = b"\xef\xbb\xbf" + content
    if how == "crlf":
        content = content.replace(b"\n", b"\r\n")
    if how == "not_utf8":
        content = content[: len(content) // 2] + b"\xff\xfe" + content[len(content) // 2 :]
    if how == "cut":
        content = content[: rng.randrange(len(content) + 1)]
    file.write_bytes(content)
    return f"{how} {file.relative_to(folder)}"


def met(program: Program, arguments: list[str], named: str) -> str:
    """How arguments are met: ``accepted``, ``refused``, or what was wrong."""
    before = {*os.listdir()}
    try:
        ended = run_stage(_Stage(program), *arguments)
    except BaseException as error:
        return f"traceback: {type(error).__name__}: {str(error)[:80]}"
    lines = [
        one for one in ended.err.splitlines() if not one.startswith(("configuration:", "warning:"))
    ]
    if {*os.listdir()} != before:
        return f"wrote {sorted({*os.listdir()} - before)}"
    if ended.code == 0:
        return "accepted"
    if ended.code != 2 or len(lines) != 1 or not lines[0].isprintable():
        return f"exit {ended.code}, {len(lines)} lines: {' | '.join(lines)[:200]}"
    if len(lines[0]) > 1200:
        return f"a line of {len(lines[0])} letters: {lines[0][:100]}"
    if named and named not in lines[0]:
        return f"{named!r} is not named: {lines[0][:200]}"
    return "refused"


class _Stage:
    """A module with a stage that does nothing."""

    __name__ = "fuzz"

    def __init__(self, program: Program):
        self.main = stage(nothing, program, writes=(".json",))


def survey(inputs: int, seed: int) -> Counter[str]:
    """Try so many; how they were met, and the wrong ones printed."""
    folder, rng, found = folder_of_its_own(), random.Random(seed), Counter[str]()
    here = Path.cwd()
    programs = [(program, keys_of(program)) for program in (PRODUCT, PROGRAM)]
    try:
        os.chdir(folder)
        for number in range(inputs):
            program, keys = rng.choice(programs)
            arguments, named, told = [], "", ""
            if number % 4 == 0:
                shutil.rmtree(folder / "conf", ignore_errors=True)
                shutil.copytree(SHIPPED, folder / "conf")
                told = break_file(folder / "conf", rng)
            else:
                shutil.rmtree(folder / "conf", ignore_errors=True)
                arguments, named = override(keys, rng)
            how = met(program, arguments, named)
            found[how if how in ("accepted", "refused") else "wrong"] += 1
            if how not in ("accepted", "refused"):
                print(f"{told or ascii(arguments)[:120]}: {how}", flush=True)
    finally:
        os.chdir(here)
        shutil.rmtree(folder)
    return found


if __name__ == "__main__":
    inputs, seed = [
        ast.literal_eval(word) for word in [*sys.argv[1:], *["2000", "1"][len(sys.argv) - 1 :]]
    ]
    result = survey(inputs, seed)
    print(dict(result))
    raise SystemExit(result["wrong"])
