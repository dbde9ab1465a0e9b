"""Time against share of runs that keep all bounds: inherited paths, and designed ones."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from inscal.search import scaled
from pipeline.config.load import load, position_durations
from pipeline.config.schema import Config
from pipeline.study.design import Search
from pipeline.study.findings import read_summary
from pipeline.study.names import study
from pipeline.study.promise import Promise
from pipeline.words import markdown as md
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
DESIGNED = "designed"
_FEWEST = 8  # positions as long as the longest that would fill a path
_KEYS = ("joint_share", "joint_share_lower", "joint_share_upper", "runs_done")


def content(config: Config) -> dict[str, Any]:
    """Predict every path at every time, and search for one.

    Parameters
    ----------
    config : Config
        Whose `design` says how searches go; times, noise levels and paths are those of
        ``conf/study.yaml``.

    Returns
    -------
    dict
    """
    about = study()["frontier"]
    points = []
    for level, of_level in about["levels"].items():
        noise = load([f"noise={level}"]).noise
        for total in of_level["times_s"]:
            # as long as any position of a path that is stretched to that time
            longest = max(config.design.longest_position_s, float(total // _FEWEST))
            design = replace(config.design, total_time_s=float(total), longest_position_s=longest)
            made = replace(config, noise=noise, design=design)
            points += _points(made, about, of_level["start_from"])
    return {
        "inherited": about["inherited"],
        "seconds": about["seconds"],
        "seed": config.design.seed,
        "points": points,
        "marked": [_marked(name) for name in about["marked"]],
    }


def _points(config: Config, about: Mapping[str, Any], start: str) -> list[dict[str, Any]]:
    """Predictions at one noise and one time."""
    search, total = Search(config), config.design.total_time_s
    updates = round(total / search.interval)
    out = []
    for name in about["inherited"]:
        moves, durations = search.known(name)
        promise = search.judge(moves, scaled(durations, updates, search.tick))
        out.append(_point(config, name, promise))
    found = search.run("joint_share", about["seconds"], total, lambda _: None, search.known(start))
    limit = {"limit": found.limit}
    return [row | limit for row in (*out, _point(config, DESIGNED, found.path))]


def _point(config: Config, path: str, promise: Promise) -> dict[str, Any]:
    return {
        "noise": config.noise.name,
        "path": path,
        "total_time_s": promise.total,
        "joint_share": promise.share,
        "worst_sigma_over_bound": promise.worst,
    }


def _marked(name: str) -> dict[str, Any]:
    """What a campaign has found, beside what is predicted."""
    row = study()["campaigns"][name]
    found = read_summary(name)
    schedule = load([f"schedule={row['schedule']}"]).schedule
    inherited = study()["frontier"]["inherited"]
    return {
        "campaign": name,
        "schedule": row["schedule"],
        "noise": row["noise"],
        "path": next((one for one in inherited if row["schedule"].startswith(one)), DESIGNED),
        "total_time_s": sum(position_durations(asdict(schedule))),
        **{key: found[key] for key in _KEYS},
    }


def table(found: Mapping[str, Any], noise: str, key: str, form: str) -> list[tuple[str, ...]]:
    """Rows of one noise level: time, and a cell for each path."""
    rows: dict[float, dict[str, Any]] = {}
    for point in found["points"]:
        if point["noise"] == noise:
            rows.setdefault(point["total_time_s"], {})[point["path"]] = point
    paths = [*found["inherited"], DESIGNED]
    return [
        (f"{time:g}", *(format(of[path][key], form) for path in paths))
        for time, of in sorted(rows.items())
    ]


def page(found: Mapping[str, Any]) -> str:
    """Write the page of what was found.

    Parameters
    ----------
    found : mapping
        Of `content`.

    Returns
    -------
    str
    """
    levels = list(dict.fromkeys(point["noise"] for point in found["points"]))
    return render(
        _TEMPLATES,
        "frontier.md.jinja",
        inherited=found["inherited"],
        designed=DESIGNED,
        seconds=found["seconds"],
        seed=found["seed"],
        levels=[
            {
                "noise": noise,
                "share": table(found, noise, "joint_share", ".2%"),
                "worst": table(found, noise, "worst_sigma_over_bound", ".3f"),
            }
            for noise in levels
        ],
        marked=[_cells(row) for row in found["marked"]],
        saved=_saved(found, levels),
    )


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    share = md.share(*(row[key] for key in _KEYS[:3]))
    return (
        md.code(row["schedule"]),
        row["noise"],
        f"{row['total_time_s']:g}",
        str(row["runs_done"]),
        share,
    )


def _saved(found: Mapping[str, Any], levels: Sequence[str]) -> list[dict[str, Any]]:
    """By noise level: the longest time of the last inherited path, and a designed one's as good."""
    out = []
    for noise in levels:
        own = [point for point in found["points"] if point["noise"] == noise]
        last = found["inherited"][-1]
        for point in (p for p in own if p["path"] == last):
            as_good = [
                p["total_time_s"]
                for p in own
                if p["path"] == DESIGNED and p["joint_share"] >= point["joint_share"]
            ]
            if as_good and min(as_good) < point["total_time_s"]:
                out.append({"noise": noise, **point, "designed_s": min(as_good)})
    return out
