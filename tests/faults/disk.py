"""Campaigns and summaries on a disk that becomes full: one line, the old kept, and gone on with.

Usage: ``python tests/faults/disk.py [moments]``

The disk is a file system in memory of a namespace of its own (``unshare``, for which nobody need be
root), mounted on a folder that this program makes. Where the system allows none, nothing is tried
and that is said.
"""

import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaigns import SHORT, assert_same_store, make
from place import folder_of_its_own

SMALLEST_K, LARGEST_K = 8, 300
"""Sizes of the disk, from less than a store without runs to nearly a whole one, KiB."""
FEWEST, MOST = 5, 80
"""Numbers of files that it may have."""

_SCRIPT = """
set -u
mount -t tmpfs -o size=$SIZE,nr_inodes=$INODES tmpfs "$DISK" || exit 77
cd "$DISK"
"$@" 2> "$OUT/stderr"; code=$?
mount -o remount,size=64m,nr_inodes=10000 "$DISK" || exit 77
cp -r "$DISK/." "$OUT/full"
"$@" 2> "$OUT/again" || exit 78
cp -r "$DISK/." "$OUT/disk"
exit $code
"""


def on_a_disk(folder: Path, command: list[str], size_k: int, inodes: int = 10_000) -> int:
    """Run a command on a small disk, and again when it has grown; the first one's exit code."""
    disk, out = folder / "mount", folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    disk.mkdir(exist_ok=True)
    environment = {"SIZE": f"{size_k}k", "INODES": str(inodes), "DISK": str(disk), "OUT": str(out)}
    shell = ["unshare", "--map-root-user", "--user", "--mount", "bash", "-c", _SCRIPT, "disk"]
    done = subprocess.run(
        ["env", *(f"{k}={v}" for k, v in environment.items()), *shell, *command],
        stdout=subprocess.DEVNULL,
    )
    return done.returncode


def is_possible(folder: Path) -> bool:
    """Whether this system lets us mount."""
    return shutil.which("unshare") is not None and on_a_disk(folder, ["true"], 64) == 0


def told(folder: Path, code: int) -> str:
    """How a stage met the full disk: ``whole``, ``one line``, or what was wrong."""
    lines = (folder / "out" / "stderr").read_text().splitlines()
    errors = [line for line in lines if not line.startswith(("warning: ", "store:"))]
    if code == 0:
        return "whole"
    if code == 2 and len(errors) == 1 and errors[0].startswith("error: "):
        return "one line"
    return f"exit {code}: {' | '.join(errors[-3:])}"


def campaigns(folder: Path, moments: int) -> list[str]:
    """A campaign on disks of many sizes; how each was met."""
    good, out = make(folder / "good"), []
    for number in range(moments):
        share = number / max(moments - 1, 1)
        size = round(SMALLEST_K + share * (LARGEST_K - SMALLEST_K))
        inodes = round(FEWEST + share * (MOST - FEWEST))
        limits = (size, 10_000) if number % 4 else (65_536, inodes)
        command = [sys.executable, "-m", "pipeline.simulate", *SHORT, "campaign.store=store"]
        code = on_a_disk(folder, [*command, "campaign.batch=4"], *limits)
        met = told(folder, code)
        if met in ("one line", "whole"):
            try:
                assert_same_store(folder / "out" / "disk" / "store", good)
            except AssertionError as error:
                met = f"{met}, and then not the same: {error}"
        out.append(met)
        print(f"{limits[0]} KiB, {limits[1]} files: {met}", flush=True)
    return out


def summary(folder: Path) -> str:
    """A summary on a full disk: the one of before, by other bounds, must be what it was."""
    good, file = folder / "good", "results/summary/good.json"
    command = [sys.executable, "-m", "pipeline.summarize", f"campaign.store={good}"]
    before = folder / "before"
    before.mkdir(exist_ok=True)
    subprocess.run(
        [*command, "bounds.accel_bias_ug=20"], cwd=before, check=True, stdout=subprocess.DEVNULL
    )
    # room for the one that is there, and a page or two
    size_k = 4 * -(-(before / file).stat().st_size // 4096) + 8
    put = f"mkdir -p results/summary; [ -e {file} ] || cp {before / file} {file}"
    first = ["bash", "-c", f'{put}; exec "$@"', "summary"]
    code = on_a_disk(folder, [*first, *command], size_k)
    kept = (folder / "out" / "full" / file).read_bytes() == (before / file).read_bytes()
    met = told(folder, code)
    return met if kept and met == "one line" else f"{met}, the old one kept: {kept}"


def main(moments: int) -> int:
    """Try; the number of moments that were not met as they are to be."""
    folder = folder_of_its_own()
    try:
        if not is_possible(folder):
            print("skipped: this system allows no file system of one's own")
            return 0
        met = campaigns(folder, moments)
        print({what: met.count(what) for what in sorted(set(met))})
        about = summary(folder)
        print(f"summary: {about}")
        return sum(what not in ("whole", "one line") for what in met) + (about != "one line")
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    raise SystemExit(main(int((sys.argv[1:] or ["20"])[0])))
