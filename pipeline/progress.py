"""Progress of a campaign: a live bar on a terminal, plain lines elsewhere."""

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

_LINE_INTERVAL_S = 10.0


class CampaignProgress:
    """Shows runs done, runs per second and time left; a context manager.

    Parameters
    ----------
    total : int
        Runs of the campaign.
    done : int
        Runs done before, when resuming.
    name : str
    """

    def __init__(self, total: int, done: int, name: str):
        self._console = Console(file=sys.stderr)
        self._name, self._total, self._before, self._done = name, total, done, done
        self._start = self._last_line = time.monotonic()
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("runs  {task.fields[rate]:.0f} runs/s  left"),
            TimeRemainingColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(name, total=total, completed=done, rate=0.0)

    def __enter__(self) -> "CampaignProgress":
        self._bar.start()
        if self._before:
            self.say(f"resuming after {self._before} of {self._total} runs")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._bar.stop()
        elapsed = time.monotonic() - self._start
        self.say(f"{self._done} of {self._total} runs, {elapsed:.1f} s, {self._rate():.0f} runs/s")

    def _rate(self) -> float:
        return (self._done - self._before) / max(time.monotonic() - self._start, 1e-9)

    def say(self, text: str) -> None:
        """Print a line, above the bar if there is one."""
        self._console.print(f"{self._name}: {text}", highlight=False, markup=False, soft_wrap=True)

    def advance(self, runs: int) -> None:
        """Count finished runs."""
        self._done += runs
        self._bar.update(self._task, completed=self._done, rate=self._rate())
        now = time.monotonic()
        if not self._console.is_terminal and now - self._last_line > _LINE_INTERVAL_S:
            self._last_line = now
            left = (self._total - self._done) / max(self._rate(), 1e-9)
            self.say(
                f"{self._done} of {self._total} runs, {self._rate():.0f} runs/s, {left:.0f} s left"
            )
