"""Progress on standard error: a live bar on a terminal, a plain line now and then elsewhere."""

import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from types import TracebackType
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

_LINE_INTERVAL_S = 10.0
_BAR_INTERVAL_S = 0.1
_PATIENCE_S = 2.0

T = TypeVar("T")


def track(items: Iterable[T], label: str, total: int | None = None) -> Iterator[T]:
    """Go through a loop and show how far it is; nothing of a loop that ends in two seconds.

    Parameters
    ----------
    items : iterable
    label : str
        What the loop does.
    total : int or None
        Number of items, where they do not know it themselves.

    Yields
    ------
    object
        The items.
    """
    if total is None:
        assert isinstance(items, Sized)
        total = len(items)
    counts = (MofNCompleteColumn(), TextColumn("left"), TimeRemainingColumn())
    start = shown = time.monotonic()
    with _live(label, total, *counts) as bar:
        for done, item in enumerate(items):
            now = time.monotonic()
            if bar is not None and now - shown > _BAR_INTERVAL_S:
                bar.update(bar.task_ids[0], completed=done)
                shown = now
            elif bar is None and now - shown > _LINE_INTERVAL_S:
                left = (total - done) / done * (now - start)
                print(f"{label}: {done} of {total}, {left:.0f} s left", file=sys.stderr)
                shown = now
            yield item


@contextmanager
def busy(label: str) -> Iterator[None]:
    """Show that something is done which cannot tell how far it is; nothing if it ends soon."""
    with _live(label, None, TimeElapsedColumn()):
        yield


def note(text: str) -> None:
    """Say to who sits at a terminal what will take a while."""
    if sys.stderr.isatty():
        print(text, file=sys.stderr)


@contextmanager
def _live(label: str, total: int | None, *columns: ProgressColumn) -> Iterator[Progress | None]:
    """Show a bar from two seconds on, and none when the block is left; None if no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    bar = Progress(
        *(TextColumn("{task.description}", markup=False), BarColumn(), *columns),
        console=Console(file=sys.stderr),
        transient=True,
    )
    bar.add_task(label, total=total)
    timer = threading.Timer(_PATIENCE_S, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield bar
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


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
        )
        self._task = self._bar.add_task(name, total=total, completed=done, rate=0.0)

    def __enter__(self) -> "CampaignProgress":
        if self._console.is_terminal:
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
        if self._console.is_terminal:
            self._bar.stop()
        if kind is not None and not issubclass(kind, Exception):
            return  # interrupted: who interrupts says what is kept
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
