"""The program `inscal`, as the package installs it: the way to the pipeline, which is not imported.

The pipeline is a package of its own, `pipeline`. In a clone it lies beside this one; a wheel has it
inside, where no other package of that name is in its way or hidden by it. Importing this module
makes it importable, which is all that a worker of somebody's scheduler needs:
``dask worker ADDRESS --preload inscal.command``.
"""

import sys
from pathlib import Path

_HERE = Path(__file__).resolve().parent
_NEEDED = "needs the libraries of campaigns: pip install 'inscal[campaigns]'"

_place = _HERE / "app" if (_HERE / "app").is_dir() else _HERE.parent
if str(_place) not in sys.path:
    sys.path.insert(0, str(_place))


def main() -> None:
    """Do what the command line says."""
    from pipeline.console import command

    try:
        command.main()
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in ("inscal", "pipeline"):
            raise
        print(f"error: {error.name} is not installed; this {_NEEDED}", file=sys.stderr)
        raise SystemExit(2) from None
