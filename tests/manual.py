"""Pages of the manual as steps to be taken, and how each of them is.

Files are written where a page says, commands and Python blocks are run in one copy of the
repository, and their exit codes checked. `RULES` says how each command is run.
"""

import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import yaml
from campaigns import ROOT, fake_slurm

import inscal

README = "README.md"
_FOUND = (path.relative_to(ROOT) for path in (ROOT / "docs").rglob("*.md"))
PAGES = [README, *sorted(str(path) for path in _FOUND if "_build" not in path.parts)]
TOGETHER = [README, "docs/how-to/ci.md"]
"""Pages that write the same files, so that one has to wait for the other."""

CLUSTER = "docs/how-to/cluster.md"
SMALL = 40
"""Runs of campaigns that a page makes larger than a test can."""
LARGEST = 200
TIMEOUT_S = 300

PROSE = re.compile(r"math|\{(toctree|eval-rst|config-reference|stage-reference)\}")
"""Languages of blocks with nothing to run."""


# what a page asks for


@dataclass
class Step:
    page: str
    line: int
    kind: str  # command, python or file
    text: str
    path: str = ""
    code: int = 0
    shown: list[str] = field(default_factory=list)

    def __str__(self):
        return f"{self.page}:{self.line}: {self.text}"


def blocks(page: str) -> Iterator[tuple[int, str, str, list[str]]]:
    """Line, language, text before, and lines of every fenced block of a page."""
    lines = (ROOT / page).read_text().splitlines()
    number = 0
    while number < len(lines):
        fence = re.match(r"(`{3,})(.*)", lines[number])
        if fence:
            end = lines.index(fence[1], number + 1)
            before = next((text for text in reversed(lines[:number]) if text.strip()), "")
            yield number + 1, fence[2].strip(), before, lines[number + 1 : end]
            number = end
        number += 1


def commands(lines: list[str]) -> list[tuple[str, int]]:
    """Commands of a shell block and their exit codes; a comment may say another than 0."""
    out = []
    for line in "\n".join(lines).replace("\\\n", " ").splitlines():
        comment = re.search(r"(^|\s)#.*$", line)
        command = " ".join(line[: comment.start()].split()) if comment else line
        if not command.strip():
            continue
        marked = re.search(r"exits with (\d+)", comment[0]) if comment else None
        out.append((re.sub(r"\s+", " ", command).strip(), int(marked[1]) if marked else 0))
    return out


def steps(page: str) -> list[Step]:
    """All that a page asks for, in its order."""
    out: list[Step] = []
    for line, language, before, text in blocks(page):
        if language == "sh":
            out += [Step(page, line, "command", c, code=code) for c, code in commands(text)]
        elif language == "python":
            out.append(Step(page, line, "python", "\n".join(text)))
        elif language == "yaml":
            named = re.fullmatch(r"`([\w./-]+)`:", before.strip())
            assert named, f"{page}:{line}: a line `path`: must say where the block goes"
            out.append(Step(page, line, "file", "\n".join(text) + "\n", path=named[1]))
            if named[1].startswith(".github/workflows/"):
                jobs = yaml.safe_load("\n".join(text))["jobs"].values()
                runs = [step["run"] for job in jobs for step in job["steps"] if "run" in step]
                assert runs
                out += [Step(page, line, "command", run) for run in runs]
        elif language == "text":
            assert out, f"{page}:{line}: output of what?"
            assert out[-1].kind != "file", f"{page}:{line}: output of what?"
            out[-1].shown += text
        else:
            assert PROSE.fullmatch(language), f"{page}:{line}: what is done with {language!r}?"
    return out


STEPS = {page: steps(page) for page in PAGES}


# where and how it is done


class Copy:
    """A copy of the repository, what runs in it, and what came out."""

    def __init__(self, folder: Path):
        self.root = folder / "inscal"
        self.folder = folder
        self.tools = folder / "tools"
        self.started: dict[str, subprocess.Popen] = {}
        self.address = ""
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        names = subprocess.run(listed, cwd=ROOT, capture_output=True, check=True, text=True).stdout
        for name in filter(None, names.split("\0")):
            if (ROOT / name).is_file():
                target = self.root / name
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, target)
        # dvc looks for one
        subprocess.run(["git", "init", "--quiet"], cwd=self.root, check=True)
        fake_slurm(self.tools)
        (folder / "tmp").mkdir()
        path = [str(Path(sys.executable).parent), str(self.tools), os.environ["PATH"]]
        self.env = {
            **{k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"},
            "PATH": os.pathsep.join(path),
            "PYTHONPATH": str(self.root),
            "TMPDIR": str(folder / "tmp"),
            "COLUMNS": "100",
        }

    def bash(self, command: str, code: int = 0) -> str:
        """Run a command line, and return what it printed."""
        ended = subprocess.run(
            ["bash", "-c", command],
            cwd=self.root,
            env=self.env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=TIMEOUT_S if not slow() else None,
        )
        assert ended.returncode == code, (
            f"{command}\nended with {ended.returncode}, not {code}:\n{ended.stdout[-4000:]}"
        )
        return ended.stdout

    def start(self, command: str) -> None:
        """Start a command that keeps running."""
        with open(self.folder / f"log.{len(self.started)}", "w") as log:
            self.started[command] = subprocess.Popen(
                ["bash", "-c", f"exec {self.local(command)}"],
                cwd=self.root,
                env=self.env,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def local(self, command: str) -> str:
        """Put this machine in the place of the documented one."""
        own = command.replace("tcp://10.0.0.5:8786", self.address)
        return re.sub(r"10\.0\.0\.[56]", "127.0.0.1", own)

    def start_dask(self) -> None:
        """Start a scheduler and a worker by the very lines of the page on clusters."""
        port = free_port()
        self.address = f"tcp://127.0.0.1:{port}"
        for step in STEPS[CLUSTER]:
            if step.text.startswith("dask scheduler"):
                self.start(f"{step.text} --port {port}")
            elif step.text.startswith("dask worker"):
                self.start(step.text)
        assert len(self.started) == 2

    def stop(self) -> None:
        for process in self.started.values():
            os.killpg(process.pid, signal.SIGTERM)
        for process in self.started.values():
            process.wait(30)


def free_port() -> int:
    """Port of this machine that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def slow() -> bool:
    """Whether commands that take minutes are run in full."""
    return os.environ.get("INSCAL_SLOW") == "1"


# how each command is run


def as_written(copy: Copy, step: Step) -> str:
    return copy.bash(step.text, step.code)


def small(copy: Copy, step: Step) -> str:
    """With fewer runs: the page's line, word for word, and one more override."""
    return copy.bash(f"{step.text} campaign.runs={SMALL}", step.code)


def on_scheduler(copy: Copy, step: Step) -> str:
    """On a scheduler of this machine."""
    return copy.bash(f"{copy.local(step.text)} campaign.runs={SMALL}", step.code)


def on_slurm(copy: Copy, step: Step) -> str:
    """On a SLURM of this machine, with one small job."""
    less = f"campaign.runs={SMALL} cluster.workers=1 cluster.cores=1 cluster.memory=2GB"
    own = step.text.replace("tcp://10.0.0.5:8786", f"tcp://127.0.0.1:{free_port()}")
    return copy.bash(f"{own} {less}", step.code)


def kept_running(copy: Copy, step: Step) -> str:
    """Started before the first page, for all pages: see that it still runs."""
    process = next(p for command, p in copy.started.items() if command.startswith(step.text))
    end = time.monotonic() + 2.0
    while time.monotonic() < end:
        assert process.poll() is None, f"{step}: ended"
        time.sleep(0.2)
    return ""


def install(copy: Copy, step: Step) -> str:
    """Compare with the line that CI runs in a fresh clone; run what follows the installation.

    CI takes from the README, word for word, the line that ends in pytest.
    """
    tested = re.findall(r"^python3 -m venv .* pytest$", (ROOT / README).read_text(), re.M)
    ci = (ROOT / ".ci/run").read_text()
    assert "grep -m1 '^python3 -m venv .* pytest$' README.md" in ci
    installing, *after = re.split(r" && (?=dvc|pytest)", step.text)
    extra = re.search(r"'\.\[(\w+)\]'$", installing)
    assert extra
    assert installing == tested[0].removesuffix(" && pytest").replace("[dev]", f"[{extra[1]}]")
    check_extras(extra[1])
    if after == ["dvc repro"]:
        # its own stores alone: other pages have theirs beside them
        stores = [copy.root / name for name in re.findall(r"results/runs/\S+", lock())]
        if slow():
            out = copy.bash("dvc repro")
        else:
            # a dry run makes no store, and wants to see those it would have made
            for store in stores:
                store.mkdir(parents=True, exist_ok=True)
            out = copy.bash("dvc repro --dry")
        for store in stores:
            shutil.rmtree(store, ignore_errors=True)
        # of all that it makes, pages use this campaign
        copy.bash(f"python -m pipeline.simulate campaign.runs={SMALL}")
        return out
    assert after in ([], ["pytest"])
    assert not after or "\npytest\n" in ci
    return ""


def lock() -> str:
    return (ROOT / "dvc.lock").read_text()


def pip(copy: Copy, step: Step) -> str:
    """See that what is to be installed exists, and run what follows."""
    if wheel := re.fullmatch(r"pip install 'inscal-(\S+)-py3-none-any\.whl\[(\w+)\]'", step.text):
        assert wheel[1] == inscal.__version__  # tests/test_wheel.py installs it
        check_extras(wheel[2])
        return ""
    line = re.fullmatch(r"pip install -c (\S+) -e (\.|'\.\[(\w+)\]')( && (.+))?", step.text)
    assert line
    assert (copy.root / line[1]).is_file()
    check_extras(line[3])
    return copy.bash(line[5], step.code) if line[5] else ""


def check_extras(extra: str | None) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert extra is None or extra in project["optional-dependencies"]


def own_program(copy: Copy, step: Step) -> str:
    """In the place of a calibrator that the page has no name for: estimates that it made before."""
    *_, table = shlex.split(step.text)
    (copy.root / table).write_bytes((copy.root / "results/logs/guarded.csv").read_bytes())
    return ""


def step_summary(copy: Copy, step: Step) -> str:
    """With the file that a host of workflows gives."""
    return copy.bash(f"export GITHUB_STEP_SUMMARY=/dev/null; {step.text}", step.code)


@dataclass(frozen=True)
class Rule:
    matches: Callable[[str], object]
    run: Callable[[Copy, Step], str]


def stage(name: str) -> Callable[[str], object]:
    return re.compile(rf"python -m pipeline\.({name})( .*)?").fullmatch


def simulates(command: str, *, least: int, most: int, cluster: str = "threads") -> bool:
    """Whether a command is a campaign of so many runs on such a cluster."""
    if not stage("simulate")(command):
        return False
    words = dict(w.split("=", 1) for w in shlex.split(command) if "=" in w)
    kind = words.get("cluster", "threads").replace("processes", "threads")
    runs = 1 if "only_run" in words else int(words.get("campaign.runs", 500))
    return least <= runs <= most and kind == cluster


RULES: dict[str, Rule] = {
    "installation, as CI": Rule(lambda c: c.startswith("python3 -m venv "), install),
    "installation": Rule(lambda c: c.startswith("pip install "), pip),
    "kept running": Rule(re.compile(r"dask (scheduler|worker) .*").fullmatch, kept_running),
    "on a local scheduler": Rule(
        lambda c: simulates(c, least=0, most=10**9, cluster="scheduler"), on_scheduler
    ),
    "on a local SLURM": Rule(
        lambda c: simulates(c, least=0, most=10**9, cluster="slurm"), on_slurm
    ),
    "campaign as written": Rule(lambda c: simulates(c, least=0, most=LARGEST), as_written),
    "campaign, fewer runs": Rule(lambda c: simulates(c, least=LARGEST + 1, most=10**9), small),
    "stage as written": Rule(
        stage(
            "predict|design|export|calibrate|noise|navigate|judge|budget|observe|summarize|compare|consistency|regress|report"
        ),
        as_written,
    ),
    "the program": Rule(lambda c: c.startswith("inscal "), as_written),
    "summary of a step": Rule(lambda c: c.endswith('>> "$GITHUB_STEP_SUMMARY"'), step_summary),
    "a user's own program": Rule(lambda c: c.startswith("my_calibrator "), own_program),
    "example as written": Rule(re.compile(r"python examples/\w+\.py( .*)?").fullmatch, as_written),
}
"""How a command is run: exactly one of these must know it."""


def rules_of(command: str) -> list[str]:
    return [name for name, rule in RULES.items() if rule.matches(command)]


def work_through(copy: Copy, page: str) -> list[tuple[Step, str]]:
    """Do all that a page asks for."""
    out = []
    for step in STEPS[page]:
        if step.kind == "file":
            path = copy.root / step.path
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(step.text)
            out.append((step, ""))
        elif step.kind == "python":
            script = copy.folder / f"{page.replace('/', '-')}-{step.line}.py"
            script.write_text(step.text)
            out.append((step, copy.bash(f"python {shlex.quote(str(script))}")))
        else:
            (rule,) = rules_of(step.text)
            out.append((step, RULES[rule].run(copy, step)))
    return out
