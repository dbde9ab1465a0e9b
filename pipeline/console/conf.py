"""Where the configuration is: a folder that is asked for, ``conf`` of the working folder, ours.

Each is looked into in this order, file by file, so that a folder of one's own need hold no more
than what is one's own: its files stand beside those that are shipped, or in the place of one that
has the same name.
"""

from collections.abc import Sequence
from pathlib import Path

from pipeline.console.errors import ConfigError

SHIPPED = Path(__file__).resolve().parents[2] / "conf"
"""The folder of the configuration that comes with the pipeline."""

SWITCHES = ("--config-dir", "-cd")
"""How a folder is asked for on the command line."""


_asked: Path | None = None


def folders() -> list[Path]:
    """Folders of configuration files, what is found in the first goes before all others."""
    own = _asked or Path("conf")
    places = [own.resolve()] if own.is_dir() else []
    return [*places, SHIPPED] if SHIPPED not in places else places


def take(arguments: Sequence[str]) -> list[str]:
    """Take the folder that a command line asks for, if it does, and return the other arguments.

    Raises
    ------
    ConfigError
        If it is none.
    """
    global _asked
    _asked, rest = None, list(arguments)
    for place, word in enumerate(rest[:-1]):
        if word in SWITCHES:
            _asked = Path(rest[place + 1])
            if not _asked.is_dir():
                raise ConfigError(f"{word} {_asked}: must be a folder")
            return [*rest[:place], *rest[place + 2 :]]
    return rest


def find(name: str) -> Path:
    """File of a name such as ``noise/quiet.yaml``; the shipped one where there is none."""
    found = (folder / name for folder in folders() if (folder / name).exists())
    return next(found, SHIPPED / name)


def every(pattern: str) -> list[Path]:
    """Files of a pattern such as ``noise/*.yaml``, by name; each name once."""
    found: dict[str, Path] = {}
    for folder in folders():
        for file in folder.glob(pattern):
            found.setdefault(file.relative_to(folder).as_posix(), file)
    return [found[name] for name in sorted(found)]


def is_group(name: str) -> bool:
    """Whether there are choices of this name."""
    return any((folder / name).is_dir() for folder in folders())
