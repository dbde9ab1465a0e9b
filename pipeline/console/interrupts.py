"""Ctrl-C and SIGTERM: a stage ends with one line, and never in the middle of a write.

The first signal raises `Interrupt` in the main thread, at once or at the end of what is `held`; a
second one ends the process there and then. Exit codes are the shell's, 128 and the signal's number:
130 after Ctrl-C.
"""

import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, NoReturn

SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""Signals that end a stage."""

_SAME_S = 0.3  # some senders signal a process and its group: one interrupt, not two
_SHOW_CURSOR = b"\x1b[?25h"


class Interrupt(KeyboardInterrupt):
    """A signal of `SIGNALS`; `code` is the exit code."""

    def __init__(self, code: int):
        super().__init__(code)
        self.code = code


@dataclass
class _State:
    since: float | None = None  # when the first signal came
    pending: int | None = None  # exit code of the one that is held
    held: int = 0
    written: list[str] = field(default_factory=list)


_state = _State()


def begin() -> None:
    """Take the signals while a stage is still importing, when nothing can be lost."""

    def end(number: int, _frame: object) -> None:
        if _state.since is None:
            print(line(), file=sys.stderr, flush=True)
        _end_at_once(128 + number)

    _install(end)


@contextmanager
def raised() -> Iterator[None]:
    """Raise `Interrupt` where a signal comes while the block lasts.

    From then to its end nothing is logged: what libraries have to say of it, in other threads too.
    """
    global _state
    _state = _State()
    before = _install(_interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if _state.since is not None:
            logging.disable(logging.NOTSET)


@contextmanager
def held() -> Iterator[None]:
    """Let the block come to its end before an `Interrupt` is raised."""
    _state.held += 1
    try:
        yield
    finally:
        _state.held -= 1
    if not _state.held and _state.pending is not None:
        code, _state.pending = _state.pending, None
        raise Interrupt(code)


@contextmanager
def kept_from_children() -> Iterator[None]:
    """Start processes that these signals do not reach, whoever sends them to the process group.

    A terminal interrupts worker processes as well; they would die of it, with tracebacks. They, and
    what restarts them, have the signal mask of the thread that the block starts.
    """
    resource_tracker.ensure_running()  # multiprocessing's own, which resets the mask when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def telling(what: Callable[[], str]) -> Iterator[None]:
    """Say `what` as soon as the block is interrupted, and turn the interrupt into `SystemExit`."""
    code = 0
    try:
        yield
    except KeyboardInterrupt as stop:
        code = stop.code if isinstance(stop, Interrupt) else 128 + signal.SIGINT
    if code:  # out of the block above, which keeps a progress bar in what was interrupted alive
        with held():
            print(what(), file=sys.stderr, flush=True)
        raise SystemExit(code)


def wrote(path: str | Path) -> None:
    """Remember a file for `line`."""
    _state.written.append(str(path))


def line() -> str:
    """What to say of an interrupt, for a stage with nothing more to say."""
    return f"interrupted: {', '.join(_state.written) or 'nothing'} written"


def _install(handler: Callable[[int, object], None]) -> dict[signal.Signals, Any]:
    """Install a handler where signals are not ignored, as behind nohup; return those before."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    before = {n: found for n, found in before.items() if found is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, handler)
    return before


def _interrupt(number: int, _frame: object) -> None:
    now = time.monotonic()
    if _state.since is not None:
        if now - _state.since > _SAME_S:
            _end_at_once(128 + number)
        return
    _state.since = now
    logging.disable()
    if _state.held:
        _state.pending = 128 + number
    else:
        raise Interrupt(128 + number)


def _end_at_once(code: int) -> NoReturn:
    if sys.stderr.isatty():
        os.write(2, _SHOW_CURSOR)  # that a progress bar hid
    os._exit(code)
