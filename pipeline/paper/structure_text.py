"""The page on the paper's path and its observability table."""

from typing import Any

import numpy as np

from inscal.earth import EARTH_RATE
from inscal.observability import STATES, Ranks
from inscal.parameters import INDEX, NAMES
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.paper import claims
from pipeline.paper.claims import TEMPLATES
from pipeline.paper.structure import (
    FROM_20,
    LAST_SIX,
    LEVER_FROM,
    SEARCHED,
    SEARCHED_DWELL_S,
    SEARCHED_TURN_RATE_DEG_PER_S,
    Count,
    Structure,
    agreeing,
)
from pipeline.paper.tables import CLASSIC_POSITIONS, TABLE_2_RANKS
from pipeline.study import verdict as verdicts
from pipeline.study.observability import CONVENTIONS, direction_text, tied_text
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED, Verdict
from pipeline.words import markdown as md
from pipeline.words.render import render

_EVERYWHERE = "turns on gyros and lever arms"
_DWELLS, _EARTH = list(CONVENTIONS)[:2]


def observability_text(config: Config, structure: Structure) -> str:
    """Compose the page on Tables 1 and 2.

    Parameters
    ----------
    config : Config
    structure : Structure

    Returns
    -------
    str
        Markdown.
    """
    return render(
        TEMPLATES,
        "observability.md.jinja",
        claims=judge(structure),
        latitude=config.site.latitude_deg,
        turn_rate=config.schedule.turn_rate_deg_per_s,
        noise=config.noise.name,
        states=STATES,
        classic=CLASSIC_POSITIONS,
        total=len(TABLE_2_RANKS),
        **_tables(structure),
        tolerance=_tolerance(structure),
        **_support(config, structure),
        **_sigma(structure),
    )


def judge(structure: Structure) -> claims.Page:
    """Verdicts on both tables."""
    found = (
        path_verdict(structure),
        head_verdict(structure),
        table_verdict(structure),
        complete_verdict(structure),
        added_turns_verdict(structure),
    )
    headings = ("claim of the paper", "ours", "verdict")
    return claims.page_of(
        "The paper's path and what it makes observable", found, headings, bold=(NOT_MET,)
    )


def path_verdict(structure: Structure) -> Verdict:
    """Judge Table 1."""
    agree, total = sum(row.agrees for row in structure.rows), len(structure.rows)
    return verdicts.judged(
        "Table 1: each posture follows from the one above",
        f"{agree} of {total} rows agree",
        agree == total,
    )


def head_verdict(structure: Structure) -> Verdict:
    """Judge whether the classic path is the head of the paper's."""
    return verdicts.judged(
        f"The classic {CLASSIC_POSITIONS} positions are the head of the {len(structure.rows)}",
        f"{CLASSIC_POSITIONS} postures and {CLASSIC_POSITIONS - 1} turns compared",
        structure.classic_is_head,
    )


def table_verdict(structure: Structure) -> Verdict:
    """Judge Table 2: met if a convention gives it by both counts, else it cannot be judged."""
    total, best = len(TABLE_2_RANKS), max(structure.counts.values(), key=lambda c: c.agreeing)
    plain = max(c.agreeing[0] for name, c in structure.counts.items() if name != SEARCHED)
    found = (
        f"at most {plain} of {total} by conventions that follow from an idea, "
        f"{structure.counts[SEARCHED].agreeing[0]} by a searched one, "
        f"{agreeing(structure.by_matlab)} by that one with the tolerance of MATLAB's rank"
    )
    reason = (
        "because the paper does not say what a turn puts into A, and no convention tried gives "
        "all its ranks by both ways of counting"
    )
    word = MET if best.agreeing == (total, total) else f"{UNDECIDED}, {reason}"
    return Verdict(f"Table 2: the {total} ranks", found, word)


def complete_verdict(structure: Structure) -> Verdict:
    """Judge whether all states become observable once turns act on the lever arms."""
    final = [int(r.rank[-1]) for r in _both(structure.counts[_EVERYWHERE])]
    dwells = [int(r.rank[-1]) for r in _both(structure.counts[_DWELLS])]
    return verdicts.judged(
        f"{len(structure.rows)} positions make all {STATES} states observable",
        f"rank {md.ends(final)} with turns on gyros and lever arms, {md.ends(dwells)} without",
        min(final) == STATES,
    )


def added_turns_verdict(structure: Structure) -> Verdict:
    """Judge whether the classic path falls short of full rank."""
    reached = [_first_full(ranks.rank) for ranks in _both(structure.counts[_EVERYWHERE])]
    early = [position for position in reached if position is not None]
    found = (
        f"rank {STATES} from position {md.ends(early)} on if every turn acts on the lever arms"
        if early
        else f"rank {STATES} is not reached at all"
    )
    return verdicts.judged(
        f"It takes the six added turns for rank {STATES}",
        found,
        bool(early) and min(early) >= CLASSIC_POSITIONS,
    )


def _both(count: Count):
    return count.by_default, count.unit_free


def _first_full(rank: np.ndarray) -> int | None:
    full = np.flatnonzero(rank == STATES)
    return int(full[0]) if len(full) else None


def _tables(structure: Structure) -> dict[str, Any]:
    path = [
        (
            str(number),
            row.paper_turn,
            row.turn,
            row.paper_posture,
            row.posture,
            "yes" if row.agrees else "**no**",
        )
        for number, row in enumerate(structure.rows, start=1)
    ]
    by_matlab = structure.by_matlab
    ranks: list[tuple[str, ...]] = [
        ("the paper", sequence_text(TABLE_2_RANKS), "", "", ""),
        *(_count_row(name, count) for name, count in structure.counts.items()),
        (
            f"{SEARCHED}, tolerance of MATLAB's rank",
            sequence_text(by_matlab.rank),
            str(agreeing(by_matlab)),
            "as above",
            "",
        ),
    ]
    neighbours = [_count_row(name, count) for name, count in structure.neighbours.items()]
    return {"path": path, "ranks": ranks, "neighbours": neighbours}


def _count_row(name: str, count: Count) -> tuple[str, ...]:
    by_default, unit_free = count.agreeing
    return (
        name,
        sequence_text(count.by_default.rank),
        str(by_default),
        sequence_text(count.unit_free.rank),
        str(unit_free),
    )


def sequence_text(sequence: np.ndarray | tuple[int, ...]) -> str:
    """Write ranks by position, repetitions counted, such as ``12 18 33×15``."""
    out: list[list[int]] = []
    for value in map(int, sequence):
        if out and out[-1][0] == value:
            out[-1][1] += 1
        else:
            out.append([value, 1])
    return " ".join(f"{value}×{times}" if times > 1 else str(value) for value, times in out)


def _tolerance(structure: Structure) -> dict[str, Any]:
    """Smallest value that counts and largest that does not, in tolerances."""
    found = structure.counts[SEARCHED].by_default
    return {
        "unit_free": _margins([count.unit_free for count in structure.counts.values()]),
        "plain": _margins([c.by_default for n, c in structure.counts.items() if n != SEARCHED]),
        "searched": found.margins,
        "window": found.tolerances_for(TABLE_2_RANKS),
    }


def _margins(ranks: list[Ranks]) -> tuple[float, float]:
    margins = [own.margins for own in ranks]
    return min(m[0] for m in margins), max(m[1] for m in margins)


def _support(config: Config, structure: Structure) -> dict[str, Any]:
    counts, rows = structure.counts, structure.rows
    dwells = counts[_DWELLS].by_default.rank
    repeats = rows[3].posture == rows[1].posture and dwells[3] == dwells[2]
    early, last_six, late = (
        _first_full(counts[name].by_default.rank) for name in (_EVERYWHERE, LAST_SIX, FROM_20)
    )
    arm = Setup(config).prior.parameter[INDEX["lever_arm"]].max()
    return {
        "last_rank": {
            "dwells": dwells[-1],
            "turning": counts[_EVERYWHERE].by_default.rank[-1],
            "earth": counts[_EARTH].by_default.rank[-1],
        },
        "repeated": dwells[3] if repeats else None,
        "paper_rank_there": TABLE_2_RANKS[3],
        "needs_added_turns": early is None or early >= CLASSIC_POSITIONS,
        "full_from": {"everywhere": early, "last_six": last_six, "late": late},
        "searched": {
            "turn_rate": SEARCHED_TURN_RATE_DEG_PER_S,
            "dwell": SEARCHED_DWELL_S,
            "lever_from": LEVER_FROM,
            "agreeing": counts[SEARCHED].agreeing,
        },
        "matched": [
            name
            for name, count in structure.neighbours.items()
            if count.agreeing[0] == len(TABLE_2_RANKS)
        ],
        "earth_force": EARTH_RATE**2 * arm,
    }


def _sigma(structure: Structure) -> dict[str, Any]:
    full, classic = structure.full, structure.classic
    ratio, lever = classic.final_std / full.final_std, INDEX["lever_arm"]
    return {
        "lever_arms": {
            "classic": full.share[CLASSIC_POSITIONS - 1, lever].max(),
            "full": full.share[-1, lever].max(),
        },
        "ratio": ratio,
        "worst": NAMES[int(np.argmax(ratio))],
        "directions": [*map(direction_text, full.directions)],
        "tied": [*map(tied_text, full.tied)] or ["none"],
    }
