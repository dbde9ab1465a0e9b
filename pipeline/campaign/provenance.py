"""Where a campaign's runs were made: one entry a session, in a file beside the store.

Not inside it: a store's bytes say nothing of how and where it was made, so that a campaign made in
one go and one that was killed and resumed elsewhere are the same to the last bit.
"""

import json
import os
import platform
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pipeline.config.schema import Campaign, Cluster
from pipeline.console.errors import DataError
from pipeline.console.output import SIGNATURE, complain, is_as_signed, signed, write_json

NOT_RECORDED = "not recorded"

_PACKAGE = Path(__file__).resolve().parent
_WATCHED = ("inscal", "pipeline", "conf")  # what a run's numbers come from


def log_path(store: str | Path) -> Path:
    """File beside a store that tells where its runs were made."""
    path = Path(store)
    return path.with_name(f"{path.name}.log.json")


@contextmanager
def session(campaign: Campaign, cluster: Cluster, pending: Callable[[], int]) -> Iterator[None]:
    """Time what makes runs of a campaign, and add it to the campaign's log.

    However it ends: of an interrupted session the runs made are recorded as well. A campaign is
    none the worse without its log: where it cannot be written, a warning says so.

    Parameters
    ----------
    campaign : Campaign
    cluster : Cluster
    pending : callable
        Gives how many runs are still to be made; if that is all of them, the store is new, and an
        older one's log makes way.
    """
    before, started = pending(), time.monotonic()
    earlier = _earlier(campaign.store) if before < campaign.runs else []
    try:
        yield
    finally:
        try:
            made = before - pending()
        except DataError:  # the store was taken away, which was said already
            made = 0
        if made:
            entry = signed(_entry(time.monotonic() - started, made, cluster))
            try:
                write_json(log_path(campaign.store), [*earlier, entry])
            except DataError as error:
                complain([f"warning: {error}"])


def _entry(seconds: float, runs: int, cluster: Cluster) -> dict[str, Any]:
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "seconds": round(seconds, 3),
        "runs": runs,
        "workers": cluster.workers,
        "cluster": cluster.kind,
        **commit(),
        "cores": os.cpu_count(),
        "processor": _processor(),
    }


def sessions(store: str | Path) -> list[dict[str, Any]]:
    """Sessions of a campaign, oldest first; none if they are not recorded.

    Raises
    ------
    DataError
        If the file is not as it was written.
    """
    path = log_path(store)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return []
    except (OSError, ValueError):
        found = None
    # of before sessions had no digests
    if not isinstance(found, list) or not all(_is_whole(entry) for entry in found):
        raise DataError(
            f"{path}: is not as it was written; delete it to go on without knowing where the runs "
            "were made"
        )
    return found


def _is_whole(entry: Any) -> bool:
    if not isinstance(entry, dict) or not isinstance(entry.get("seconds"), int | float):
        return False
    return SIGNATURE not in entry or is_as_signed(entry)


def _earlier(store: str | Path) -> list[dict[str, Any]]:
    """As `sessions`; what is not as it was written makes way, and that is said."""
    try:
        return sessions(store)
    except DataError:
        complain([f"warning: {log_path(store)}: was not as it was written, and begins anew"])
        return []


def commit() -> dict[str, Any]:
    """Commit of this code, and whether code or configuration differ from it."""
    # another project's clone may contain the environment this is installed in
    if _git("ls-files", "--error-unmatch", "__init__.py") is None:
        return {"commit": NOT_RECORDED, "changed": None}
    found = _git("rev-parse", "HEAD")
    status = _git("status", "--porcelain", "--", *(f":/{name}" for name in _WATCHED))
    return {"commit": found or NOT_RECORDED, "changed": None if status is None else bool(status)}


def _git(*arguments: str) -> str | None:
    command = ["git", "-C", str(_PACKAGE), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
