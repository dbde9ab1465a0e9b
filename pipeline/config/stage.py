"""The runner of a stage: its main function becomes a program on the command line."""

import functools
import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

import hydra
from omegaconf import DictConfig

from pipeline.config import arguments, files, need
from pipeline.config.load import COMPOSE_ERRORS, PRODUCT, VERSION_BASE, Program, typed
from pipeline.console import conf, interrupts, out
from pipeline.console.errors import ConfigError, DataError, FailedRunsError
from pipeline.console.help import help_text, is_asked
from pipeline.console.output import complain

_LONGEST_WORD, _SHOWN = 200, 80
_HYDRA = (
    # it writes nothing beside the stages' own files, and its multirun.yaml where git does not look
    *("hydra.run.dir=.", "hydra.output_subdir=null", "hydra.sweep.dir=results/runs"),
    *("hydra.sweep.subdir=.", "hydra/job_logging=none", "hydra/hydra_logging=none"),
)


def stage(
    main: Callable[[Any], None] | None = None,
    program: Program = PRODUCT,
    *,
    writes: Sequence[str] = (),
) -> Any:
    """Make a stage's main function a Hydra program, for ``python -m pipeline.<stage>``.

    The program ends with exit code 2 and one line on stderr after a `ConfigError` or `DataError`,
    or a fault of the machine such as a full disk, with exit code 1 after `FailedRunsError`, and as
    `pipeline.console.interrupts` says after a signal; any other exception is a defect and keeps its
    traceback. With ``--help`` it prints `pipeline.console.help` of the module.

    Parameters
    ----------
    main : callable, optional
        Takes the checked `Config`; without, a decorator is returned that takes it.
    program : Program
        What the stage reads.
    writes : sequence of str
        Endings of the files that `out` asks for, its own first, as of `pipeline.console.out.check`.

    Returns
    -------
    callable
        Takes nothing; reads the command line.
    """
    if main is None:
        return functools.partial(stage, program=program, writes=writes)
    defects: list[Exception] = []

    @functools.wraps(main)  # Hydra names the program after the module of the wrapped function
    def job(composed: DictConfig) -> None:
        try:
            config = typed(composed, sys.argv[1:], program)
            need.check(config)
            out.check(config.out, writes)
            main(config)
        except (ConfigError, DataError) as error:
            _stop(str(error))
        except FailedRunsError as error:
            _stop(str(error), code=1)
        except BrokenPipeError:
            _end_with_reader()
        except OSError as error:
            _stop(fault_line(error))
        except MemoryError:
            _stop("there is not enough memory")
        except Exception as error:
            defects.append(error)
            raise

    @functools.wraps(main)
    def run() -> None:
        found = help_text(Path(main.__code__.co_filename)) if is_asked(sys.argv[1:]) else None
        if found:
            print(found)
            return
        try:
            sys.argv[1:] = arguments.checked(conf.take(sys.argv[1:]))
            first, *others = conf.folders()
            for folder in (first, *others):
                files.check(folder)
        except ConfigError as error:
            _stop(str(error))
        os.environ["HYDRA_FULL_ERROR"] = "1"  # or Hydra prints errors itself and exits with 1
        program.register()
        sys.argv += [*_HYDRA, *(f"--config-dir={folder}" for folder in others)]
        if others:
            complain([f"configuration: {first}, then what is shipped"])
        hydra_program = hydra.main(str(first), program.name, version_base=VERSION_BASE)(job)
        try:
            with interrupts.raised(), interrupts.telling(interrupts.line):
                hydra_program()
                sys.stdout.flush()
        except BrokenPipeError:
            _end_with_reader()
        except COMPOSE_ERRORS as error:
            if error in defects:
                raise
            _stop(program.message(error, sys.argv[1:]))

    return run


def fault_line(error: OSError) -> str:
    """What a fault of the machine is: where, and what the system says."""
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}"


def _end_with_reader() -> NoReturn:
    """End as programs do whose output nobody reads any more, as in ``... | head``."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what is still buffered
    raise SystemExit(128 + signal.SIGPIPE)


def printable(line: str) -> str:
    """A line for a terminal: what would control it is written out, very long words are cut."""
    words = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line).split(" ")
    return " ".join(w if len(w) <= _LONGEST_WORD else f"{w[:_SHOWN]}...{w[-8:]}" for w in words)


def _stop(line: str, code: int = 2) -> NoReturn:
    print(f"error: {printable(line)}", file=sys.stderr)
    raise SystemExit(code)
