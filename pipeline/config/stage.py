"""The runner of a stage: its main function becomes a program on the command line."""

import functools
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import hydra
from omegaconf import DictConfig

from pipeline.config.load import COMPOSE_ERRORS, PRODUCT, VERSION_BASE, Program, typed
from pipeline.console import interrupts
from pipeline.console.errors import ConfigError, DataError, FailedRunsError
from pipeline.console.help import CONF, help_text, is_asked


def stage(main: Callable[[Any], None], program: Program = PRODUCT) -> Callable[[], None]:
    """Make a stage's main function a Hydra program, for ``python -m pipeline.<stage>``.

    The program ends with exit code 2 and one line on stderr after a `ConfigError` or `DataError`,
    or a fault of the machine such as a full disk, with exit code 1 after `FailedRunsError`, and as
    `pipeline.console.interrupts` says after a signal; any other exception is a defect and keeps its
    traceback. With ``--help`` it prints `pipeline.console.help` of the module.

    Parameters
    ----------
    main : callable
        Takes the checked `Config`.
    program : Program
        What the stage reads.

    Returns
    -------
    callable
        Takes nothing; reads the command line.
    """
    defects: list[Exception] = []

    @functools.wraps(main)  # Hydra names the program after the module of the wrapped function
    def job(composed: DictConfig) -> None:
        try:
            main(typed(composed, sys.argv[1:], program))
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
        os.environ["HYDRA_FULL_ERROR"] = "1"  # or Hydra prints errors itself and exits with 1
        program.register()
        hydra_program = hydra.main(str(CONF), program.name, version_base=VERSION_BASE)(job)
        try:
            with interrupts.raised(), interrupts.telling(interrupts.line):
                hydra_program()
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


def _stop(line: str, code: int = 2) -> NoReturn:
    print(f"error: {line}", file=sys.stderr)
    raise SystemExit(code)
