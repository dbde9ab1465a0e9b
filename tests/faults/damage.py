"""Damages a campaign store in every way, and looks whether anything of it goes unseen.

Usage: ``python tests/faults/damage.py [flips] [others] [heals]``

Works in a folder of its own that it makes. Every damaged copy must be refused in one line, and what
`pipeline.simulate` mends must be the same to the last bit.
"""

import random
import shutil
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaigns import SHORT, make, run_stage
from place import copy_of, folder_of_its_own

from pipeline import simulate
from pipeline.campaign import store
from pipeline.console.errors import DataError

OTHER = ("noise=quiet",)


def flip(bad: Path, rng: random.Random) -> str:
    """Flip one bit of one file."""
    file = rng.choice(sorted(f for f in bad.rglob("*") if f.is_file()))
    content = bytearray(file.read_bytes())
    place = rng.randrange(8 * len(content))
    content[place // 8] ^= 1 << place % 8
    file.write_bytes(content)
    return f"bit {place} of {file.relative_to(bad)}"


def others(good: Path, other: Path) -> dict[str, Callable[[Path], object]]:
    """Larger damages by name."""
    out: dict[str, Callable[[Path], object]] = {}
    names = sorted(f.relative_to(good).as_posix() for f in good.rglob("*") if f.is_file())
    for name in names:
        if name.endswith("/c/3/0") or name.endswith("/c/3") or name.endswith("zarr.json"):
            out[f"{name} is gone"] = lambda bad, n=name: (bad / n).unlink()
            out[f"{name} is cut short"] = lambda bad, n=name: (bad / n).write_bytes(
                (good / n).read_bytes()[:-3]
            )
            out[f"{name} is empty"] = lambda bad, n=name: (bad / n).write_bytes(b"")
            if (other / name).is_file() and (other / name).read_bytes() != (
                good / name
            ).read_bytes():
                out[f"{name} is another campaign's"] = lambda bad, n=name: shutil.copy(
                    other / n, bad / n
                )
    for name in ("truth", "error", "status", "nees"):
        out[f"{name} is gone"] = lambda bad, n=name: shutil.rmtree(bad / n)
    out["a chunk in another's place"] = lambda bad: shutil.copy(
        bad / "error/c/1/0", bad / "error/c/2/0"
    )
    out["a file too many"] = lambda bad: (bad / "truth" / "c" / "99").write_bytes(b"x")
    return out


def seen(bad: Path) -> str:
    """How a damaged store is met."""
    try:
        store.read(bad)
    except DataError as error:
        return "refused" if "\n" not in str(error) else f"{error!r}"
    except Exception as error:
        return f"traceback: {type(error).__name__}: {error}"
    return "unseen"


def healed(bad: Path, good: Path) -> bool:
    """Whether making the campaign again makes it whole, to the last bit."""
    ended = run_stage(simulate, *SHORT, f"campaign.store={bad}")
    if ended.code != 0:
        return False
    return contents(bad) == contents(good)


def contents(path: Path) -> dict[str, bytes]:
    """Files but for the root, which names its path."""
    return {
        f.relative_to(path).as_posix(): f.read_bytes()
        for f in path.rglob("*")
        if f.is_file() and f.name != "zarr.json"
    }


def survey(flips: int, most_others: int, heals: int) -> Counter[str]:
    """Damage, look, mend; counts by what was met."""
    folder, rng, found = folder_of_its_own(), random.Random(1), Counter[str]()
    try:
        good, other = make(folder / "good"), make(folder / "other", *OTHER)
        damages: list[tuple[str, Callable[[Path], object]]] = [
            (f"flip {n}", lambda bad: flip(bad, rng)) for n in range(flips)
        ]
        larger = list(others(good, other).items())
        rng.shuffle(larger)
        damages += larger[:most_others]
        mend = {*rng.sample(range(len(damages)), min(heals, len(damages)))}
        for number, (name, damage) in enumerate(damages):
            bad = copy_of(good)
            damage(bad)
            met = seen(bad)
            found[met] += 1
            if met != "refused":
                print(f"{name}: {met}")
            if number in mend:
                whole = healed(bad, good)
                found["mended" if whole else "not mended"] += 1
                if not whole:
                    print(f"{name}: not mended")
    finally:
        shutil.rmtree(folder)
    return found


if __name__ == "__main__":
    counts = [int(word) for word in sys.argv[1:]] or [500, 60, 100]
    result = survey(*counts)
    print(dict(result))
    raise SystemExit(set(result) - {"refused", "mended"} != set())
