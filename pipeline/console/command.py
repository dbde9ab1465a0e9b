"""What the program `inscal` does: a stage by its name, and what is there before any stage.

``inscal STAGE ...`` is ``python -m pipeline.STAGE ...``, and takes the same words.
"""

import ast
import importlib
import re
import shutil
import signal
import sys
from pathlib import Path
from typing import NoReturn

import inscal
from pipeline.console import conf, interrupts
from pipeline.console.help import help_text, is_asked

WORK: dict[str, tuple[str, ...]] = {
    "before any simulation": ("predict", "observe", "budget", "design", "frontier"),
    "campaigns": ("simulate", "summarize", "compare", "report", "figures"),
    "whether it can be trusted": ("consistency_power", "consistency", "disturbances", "estimators"),
    "recorded data": ("export", "calibrate", "noise", "navigate"),
    "any calibrator": ("judge",),
    "has accuracy got worse": ("regress_power", "regress", "bench"),
    "the paper": (
        *("paper_structure", "paper_effects", "paper_accuracy", "paper_ablation"),
        *("paper_laboratory", "paper_convergence", "paper"),
    ),
}
"""Stages in the order of work."""

_STAGES = Path(__file__).resolve().parents[1]
_INIT = Path(__file__).with_name("templates") / "init"
_OWN = ("gate.yaml", "study.yaml", "paper.yaml", "paper_study.yaml")  # this project's, not a user's
_FILES = {"dvc.yaml": "study.yaml", "README.md": "README.md", ".gitignore": "gitignore.txt"}
_OWN_PATH = "# A path of your own: the inherited one of 25 positions, to change.\n"
_FURTHER = {
    "init [FOLDER]": "copy the configuration, a study and its dvc.yaml to start from",
    "completion SHELL": "what bash, zsh or fish needs to complete these words",
    "--version": "the version",
}
_COMPLETION = {
    "bash": 'complete -o default -W "{words}" inscal',
    "zsh": 'compdef \'_arguments "1: :({words})" "*: :_files"\' inscal',
    "fish": 'complete -c inscal -n __fish_use_subcommand -a "{words}"',
}


def main() -> None:
    """Do what the command line says; exit code 2 and one line where it says nothing known."""
    first, rest = (sys.argv[1:2] or ["--help"])[0], sys.argv[2:]
    if first in _names() and not is_asked(rest):
        _run(first, rest)
        return
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # nothing is lost where `| head` has read enough
    if first in _names():
        conf.take(rest)
        print((help_text(_file(first)) or "").replace("python -m pipeline.", "inscal "))
    elif first in ("--help", "-h"):
        print(overview())
    elif first == "--version":
        print(inscal.__version__)
    elif first == "init" and len(rest) <= 1:
        _init(Path(rest[0] if rest else "."))
    elif first == "completion" and rest[:1] and rest[0] in _COMPLETION:
        words = [*_names(), "init", "completion", "--help", "--version"]
        print(_COMPLETION[rest[0]].format(words=" ".join(words)))
    else:
        _refuse(f"{first}: must be a stage, init, completion bash|zsh|fish; see inscal --help")


def _names() -> list[str]:
    """Stages that are there: the paper's come off."""
    return [name for stages in WORK.values() for name in stages if _file(name).exists()]


def _file(name: str) -> Path:
    place = _STAGES / name
    return place / "__main__.py" if place.is_dir() else place.with_suffix(".py")


def overview() -> str:
    """All stages in the order of work, a line each."""
    lines = ["usage: inscal STAGE [group=choice] [group.key=value] ...    inscal STAGE --help"]
    for heading, stages in WORK.items():
        there = [name for name in stages if _file(name).exists()]
        lines += ["", heading, *(f"  {name:<18}{_purpose(name)}" for name in there)] * bool(there)
    lines += ["", "and", *(f"  {name:<18}{about}" for name, about in _FURTHER.items())]
    places = ", then ".join(map(str, conf.folders()))
    return "\n".join([*lines, "", f"configuration: {places}"])


def _purpose(name: str) -> str:
    """First sentence of a stage's docstring, as far as a line goes."""
    doc = ast.get_docstring(ast.parse(_file(name).read_text(encoding="utf-8"))) or ""
    text = " ".join(doc.split("\n\n")[0].partition(": ")[2].split()).rstrip(".").replace("`", "")
    return text if len(text) <= _WIDTH else f"{text[: _WIDTH - 3].rsplit(' ', 1)[0]} ..."


_WIDTH = 79


def _run(name: str, arguments: list[str]) -> None:
    """Run a stage with these arguments."""
    interrupts.begin()
    sys.argv = [f"inscal {name}", *arguments]
    module = f"pipeline.{name}.__main__" if (_STAGES / name).is_dir() else f"pipeline.{name}"
    importlib.import_module(module).main()


def _init(folder: Path) -> None:
    """Fill a folder with what a study starts from; nothing that is there is replaced."""
    taken = [name for name in ("conf", "dvc.yaml") if (folder / name).exists()]
    if taken or (folder.exists() and not folder.is_dir()):
        _refuse(f"{folder}: has {' and '.join(taken) or 'no room, being a file'} already")
    try:
        shutil.copytree(conf.SHIPPED, folder / "conf", ignore=shutil.ignore_patterns(*_OWN))
        for name, file in _FILES.items():
            shutil.copy(_INIT / file, folder / name)
        usual = folder / "conf" / "schedule" / "position25.yaml"
        own = re.sub(r"^#.*\n", _OWN_PATH, usual.read_text(encoding="utf-8"), count=1)
        own = re.sub(r"^name: .*$", "name: mine", own, count=1, flags=re.M)
        usual.with_name("mine.yaml").write_text(own, encoding="utf-8")
    except OSError as error:
        _refuse(f"{error.filename or folder}: cannot be written ({error.strerror})")
    print(f"{folder}: conf, dvc.yaml and README.md to start from")


def _refuse(line: str) -> NoReturn:
    print(f"error: {line}", file=sys.stderr)
    raise SystemExit(2)
