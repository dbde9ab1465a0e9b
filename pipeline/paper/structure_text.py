"""The pages on the paper's path, its observability table and the unit of its quadratic terms."""

import numpy as np

from inscal.earth import EARTH_RATE
from inscal.observability import STATES
from inscal.parameters import INDEX, NAMES
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.paper import claims
from pipeline.paper.structure import (
    FROM_20,
    LAST_SIX,
    SEARCHED,
    Count,
    Row,
    Structure,
    agreeing,
)
from pipeline.paper.tables import CLASSIC_POSITIONS, TABLE_2_RANKS
from pipeline.study import verdict as verdicts
from pipeline.study.observability import CONVENTIONS, direction_text, tied_text
from pipeline.study.verdict import MET, NOT_MET, UNDECIDED, Verdict
from pipeline.words import markdown as md

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
    sections = (
        f"# {judge(structure).title}",
        f"Site at latitude {config.site.latitude_deg:g}°, turns at "
        f"{config.schedule.turn_rate_deg_per_s:g} °/s, {config.noise.name} noise where sigma is "
        "spoken of. Ranks are those of the stripped observability matrix of a piecewise constant "
        "system (Goshen-Meskin & Bar-Itzhack 1992), with 36 powers of A and without the gravity "
        "gradient, as in the paper. Positions are numbered from 0 where ranks are spoken of, as in "
        "the paper, and from 1 elsewhere.",
        judge(structure).table,
        _table_1(structure.rows),
        _table_2(structure),
        _support(config, structure),
        _sigma(structure),
    )
    return "\n\n".join(sections) + "\n"


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
        agree == total,
        f"{agree} of {total} rows agree",
    )


def head_verdict(structure: Structure) -> Verdict:
    """Judge whether the classic path is the head of the paper's."""
    return verdicts.judged(
        f"The classic {CLASSIC_POSITIONS} positions are the head of the {len(structure.rows)}",
        structure.classic_is_head,
        f"{CLASSIC_POSITIONS} postures and {CLASSIC_POSITIONS - 1} turns compared",
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
        min(final) == STATES,
        f"rank {md.ends(final)} with turns on gyros and lever arms, {md.ends(dwells)} without",
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
        bool(early) and min(early) >= CLASSIC_POSITIONS,
        found,
    )


def _both(count: Count):
    return count.by_default, count.unit_free


def _first_full(rank: np.ndarray) -> int | None:
    full = np.flatnonzero(rank == STATES)
    return int(full[0]) if len(full) else None


def _table_1(rows: list[Row]) -> str:
    lines = [
        (
            str(number),
            row.paper_turn,
            row.turn,
            row.paper_posture,
            row.posture,
            "yes" if row.agrees else "**no**",
        )
        for number, row in enumerate(rows, start=1)
    ]
    headings = ("#", "turn, paper", "ours", "X, Y, Z, paper", "computed", "agrees")
    return "\n\n".join(
        (
            "## Table 1: the path",
            "The postures are computed from the first one and the turns before. Rows 1 to "
            f"{CLASSIC_POSITIONS} are the classic path.",
            md.table(headings, lines, 6),
        )
    )


def _table_2(structure: Structure) -> str:
    rows: list[tuple[str, ...]] = [("the paper", sequence_text(TABLE_2_RANKS), "", "", "")]
    for name, count in structure.counts.items():
        rows.append(_count_row(name, count))
    by_matlab = structure.by_matlab
    rows.append(
        (
            f"{SEARCHED}, tolerance of MATLAB's rank",
            sequence_text(by_matlab.rank),
            str(agreeing(by_matlab)),
            "as above",
            "",
        )
    )
    neighbours = [_count_row(name, count) for name, count in structure.neighbours.items()]
    headings = ("convention", "ranks by default tolerance", "agree", "unit-free ranks", "agree")
    return "\n\n".join(
        (
            "## Table 2: the ranks",
            "The attitude in A is that of the dwell in every convention. "
            '"Turns on" means that the rate of the turn that ends a position stands in the columns '
            "of the gyros, or of the lever arms too. The searched convention puts averages over "
            "turn in (20 °/s), dwell (100 s) and turn out into A: of specific force, of the "
            "Earth's rate alone for the gyros, and from position 20 on of the whole rate for the "
            'lever arms; its quadratic terms act on pulse rates. "Agree" counts positions with '
            "the paper's rank.",
            md.table(headings, rows, 2),
            _tolerance_text(structure),
            "![Ranks by position](ranks.png)",
            "The searched convention with one choice changed:",
            md.table(headings, neighbours, 2),
        )
    )


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


def _tolerance_text(structure: Structure) -> str:
    unit_free = [count.unit_free.margins for count in structure.counts.values()]
    plain = [c.by_default.margins for n, c in structure.counts.items() if n != SEARCHED]
    found = structure.counts[SEARCHED].by_default
    low, high = found.tolerances_for(TABLE_2_RANKS)
    least, most = found.margins
    if low < high:
        window = (
            f"The paper's 25 ranks come out of it for tolerances from {low:.3f} to {high:.4f} of "
            f"the default one, which is {'inside' if low <= 1.0 < high else 'outside'}."
        )
    else:
        window = "There is no tolerance for which the paper's 25 ranks come out of it."
    return md.bullets(
        (
            "Unit-free singular values leave no doubt: those that count are at least "
            f"{min(m[0] for m in unit_free):.0f} times the tolerance, those that do not at most "
            f"{max(m[1] for m in unit_free):.0e} of it.",
            "By default tolerance the conventions that follow from an idea are clear too: at least "
            f"{min(m[0] for m in plain):.1f} times, at most {max(m[1] for m in plain):.0e}.",
            f"The searched one is not: the smallest value that counts is {least:.2f} of the "
            f"tolerance, the largest that does not {most:.4f}. {window} MATLAB's rank takes eps(s) "
            "instead of eps times s: between half of the default and all of it.",
        )
    )


def _support(config: Config, structure: Structure) -> str:
    dwell = structure.counts[_DWELLS].by_default.rank
    turning = structure.counts[_EVERYWHERE].by_default.rank
    sentences = [
        "It supports that dwells alone do not show everything and that turns do: without turns "
        f"the rank ends at {dwell[-1]}, with them at {turning[-1]}."
    ]
    if structure.rows[3].posture == structure.rows[1].posture and dwell[3] == dwell[2]:
        sentences.append(
            "Position 3 repeats the posture of position 1 and dwells leave the rank at "
            f"{dwell[3]} there, so the paper's {TABLE_2_RANKS[3]} already needs data of turns in A."
        )
    sentences += [_added_text(structure), *_searched_sentences(structure)]
    arm = Setup(config).prior.parameter[INDEX["lever_arm"]].max()
    earth = structure.counts[_EARTH].by_default.rank[-1]
    sentences.append(
        f"And a rank says nothing of how well: the Earth's rate alone makes it {earth}, by at most "
        f"{EARTH_RATE**2 * arm:.0e} m/s² of lever-arm force at the initial sigma. The sigmas below "
        "do."
    )
    return f"## What that table can support, and what not\n\n{' '.join(sentences)}"


def _searched_sentences(structure: Structure) -> list[str]:
    total, searched = len(TABLE_2_RANKS), structure.counts[SEARCHED]
    matched = [n for n, c in structure.neighbours.items() if c.agreeing[0] == total]
    other = (
        f"; with one choice changed all {total} come out by default tolerance for "
        f"{md.listed(matched)}"
        if matched
        else ""
    )
    return [
        f"The searched convention agrees in {searched.agreeing[0]} of {total} ranks by default "
        f"tolerance and in {searched.agreeing[1]} unit-free{other}.",
        "It was found by trying many, so that it agrees is no evidence that the paper's authors "
        "used it.",
    ]


def _added_text(structure: Structure) -> str:
    early, last_six, from_20 = (
        _first_full(structure.counts[name].by_default.rank)
        for name in (_EVERYWHERE, LAST_SIX, FROM_20)
    )
    if early is None or early >= CLASSIC_POSITIONS:
        return "It supports that the lever arms need the six added turns."
    return (
        "It does not support that the lever arms need the six added turns. That follows only if "
        "the lever arms are taken to be excited there and nowhere else: put in every turn they "
        f"make rank 36 at position {early}; put in the last six turns, at {last_six}; put in from "
        f"position 20, at {from_20}. The step of Table 2 repeats the assumption."
    )


def _sigma(structure: Structure) -> str:
    full, classic = structure.full, structure.classic
    ratio = classic.final_std / full.final_std
    lever = INDEX["lever_arm"]
    worst = int(np.argmax(ratio))
    head = full.share[CLASSIC_POSITIONS - 1, lever]
    lines = [
        f"After position {CLASSIC_POSITIONS} the lever arms are known to "
        f"{100 * head.max():.2f} % of their initial sigma or better, after the last one to "
        f"{100 * full.share[-1, lever].max():.2f} %: the added turns improve what was known.",
        f"Sigma of the 19-position path over that of the 25-position one: {ratio.min():.2f} to "
        f"{ratio.max():.2f}, the largest for {md.code(NAMES[worst])}.",
    ]
    return "\n\n".join(
        (
            "## Beyond rank: how far each sigma falls",
            "From the covariance recursion, which needs no convention: turns are integrated as "
            "they are.",
            "![Sigma by position](sigma_by_position.png)",
            md.bullets(lines),
            "Least known combinations of the 25 positions, weights in units of initial sigmas:",
            md.bullets(map(direction_text, full.directions)),
            "Tied pairs, which the path separates least:",
            md.bullets(map(tied_text, full.tied) if full.tied else ["none"]),
            "Numbers: `ranks.csv`, `sigma_by_position.csv`.",
        )
    )
