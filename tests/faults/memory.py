"""Campaigns one after another in one process: memory must not grow.

Usage: ``python tests/faults/memory.py [minutes]``

Works in a folder of its own that it makes.
"""

import os
import shutil
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaigns import make
from place import folder_of_its_own

_WARM = 10
_ALLOWED_MB = 2.0  # a campaign, of what is not yet given back


def resident_mb() -> float:
    """Memory of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def growth(minutes: float) -> tuple[int, float, float]:
    """Campaigns made after the first ones; memory then, and how much more at the end, MB."""
    folder, end, count, first = folder_of_its_own(), time.monotonic() + 60 * minutes, 0, 0.0
    try:
        while count <= 2 * _WARM or time.monotonic() < end:
            shutil.rmtree(make(folder / "campaign", f"campaign.seed={count}"))
            count += 1
            if count == _WARM:
                first = resident_mb()
    finally:
        shutil.rmtree(folder)
    return count - _WARM, first, resident_mb() - first


if __name__ == "__main__":
    campaigns, first, more = growth(float((sys.argv[1:] or ["20"])[0]))
    print(f"{campaigns} campaigns: {first:.0f} MB, and {more:+.1f} MB at the end")
    raise SystemExit(more > _ALLOWED_MB * campaigns)
