"""The numbers of the paper's structure: its Tables 1 and 2 recomputed, and the unit of D2."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import pandas as pd

from inscal import observability as obs
from inscal import units
from inscal.directions import AXES
from inscal.schedule import Schedule, postures
from pipeline.config.load import load
from pipeline.config.schema import Config
from pipeline.config.setup import Setup
from pipeline.paper.tables import TABLE_1_POSTURES, TABLE_1_ROTATIONS, TABLE_2_RANKS
from pipeline.study.observability import CONVENTIONS, Observability, observability_of, rank_counts

LEVER_FROM = 20
"""Number of the position from which on the paper's rank is 36."""

LAST_SIX = "the same, lever arms in the last six turns only"
FROM_20 = f"the same, lever arms from position {LEVER_FROM} only"
SEARCHED = "searched"

SEARCHED_DWELL_S, SEARCHED_TURN_RATE_DEG_PER_S = 100.0, 20.0
"""Of the convention that a search found."""

_LAST_SIX = 19  # number of the position whose turn is the first of the last six
_OTHER_DWELLS_S = (90.0, 95.0, 105.0, 110.0)


@dataclass(frozen=True)
class Row:
    """A row of Table 1, computed and printed.

    Attributes
    ----------
    turn, posture : str
        Computed from the configured schedule.
    paper_turn, paper_posture : str
    """

    turn: str
    posture: str
    paper_turn: str
    paper_posture: str

    @property
    def agrees(self) -> bool:
        """Whether both agree."""
        return (self.turn, self.posture) == (self.paper_turn, self.paper_posture)


def agreeing(ranks: obs.Ranks) -> int:
    """Count positions whose rank is the paper's."""
    return int((ranks.rank == TABLE_2_RANKS).sum())


@dataclass(frozen=True)
class Count:
    """Ranks by one convention: by default tolerance and unit-free."""

    by_default: obs.Ranks
    unit_free: obs.Ranks

    @property
    def agreeing(self) -> tuple[int, int]:
        """How many ranks are the paper's, by default tolerance and unit-free."""
        return agreeing(self.by_default), agreeing(self.unit_free)


@dataclass(frozen=True)
class Structure:
    """All that the pages are made of.

    Attributes
    ----------
    rows : list of Row
        Of Table 1.
    classic_is_head : bool
        Whether the classic path is the head of this one, turn by turn.
    counts : dict of str to Count
        By convention, the one a search found last.
    by_matlab : Ranks
        Of that one in SI by the tolerance of MATLAB's rank.
    neighbours : dict of str to Count
        That one with one choice changed.
    full, classic : Observability
        Of the paper's path and of the classic one.
    """

    rows: list[Row]
    classic_is_head: bool
    counts: Mapping[str, Count]
    by_matlab: obs.Ranks
    neighbours: Mapping[str, Count]
    full: Observability
    classic: Observability


def table_1(schedule: Schedule) -> list[Row]:
    """Set a schedule's turns and postures beside the paper's.

    Parameters
    ----------
    schedule : Schedule
        Of 25 positions.

    Returns
    -------
    list of Row
    """
    angles = [(turn.angle / units.DEGREE, AXES[turn.axis]) for turn in schedule.turns]
    return [
        Row(_turn_text(*turn), ", ".join(posture), _turn_text(*paper_turn), ", ".join(paper))
        for turn, posture, paper_turn, paper in zip(
            [*angles, (0.0, "")],
            postures(schedule),
            TABLE_1_ROTATIONS,
            TABLE_1_POSTURES,
            strict=True,
        )
    ]


def _turn_text(angle: float, axis: str) -> str:
    return f"{angle:+.0f} {axis}" if axis else "0"


def conventions(config: Config) -> dict[str, obs.Convention]:
    """Conventions of Table 2, those that follow from an idea first, the searched one last."""
    both = obs.Convention(gyro="turning", lever="turning")
    return CONVENTIONS | {
        LAST_SIX: replace(both, lever_from=_LAST_SIX),
        FROM_20: replace(both, lever_from=LEVER_FROM),
        SEARCHED: searched(config, SEARCHED_DWELL_S),
    }


def searched(config: Config, dwell_s: float) -> obs.Convention:
    """Averages over turn in, dwell and turn out, of the Earth's rate alone for the gyros."""
    return obs.Convention(
        lever="turning",
        lever_from=LEVER_FROM,
        window=obs.Window(dwell_s, SEARCHED_TURN_RATE_DEG_PER_S * units.DEGREE),
        quadratic_scale=config.sensor.accel_pulses_per_m_per_s,
    )


def _neighbours(config: Config) -> dict[str, tuple[Config, obs.Convention]]:
    found = searched(config, SEARCHED_DWELL_S)
    out = {f"dwell of {t:g} s": (config, searched(config, t)) for t in _OTHER_DWELLS_S}
    out["D2 on specific force (SI)"] = config, replace(found, quadratic_scale=1.0)
    for latitude in (30.0, 45.0):
        moved = replace(config, site=replace(config.site, latitude_deg=latitude))
        out[f"latitude {latitude:g}°"] = moved, found
    return out


def structure_of(config: Config) -> Structure:
    """Compute everything.

    Parameters
    ----------
    config : Config
        Of the 25-position path.

    Returns
    -------
    Structure
    """
    path = Setup(config).schedule
    classic = replace(config, schedule=load(["schedule=position19"]).schedule)
    head = Setup(classic).schedule
    count = len(head.turns)
    return Structure(
        rows=table_1(path),
        classic_is_head=head.turns == path.turns[:count]
        and postures(head) == postures(path)[: count + 1],
        counts={name: Count(*rank_counts(config, c)) for name, c in conventions(config).items()},
        by_matlab=obs.ranks(
            obs.system_matrices(path, Setup(config).site, searched(config, SEARCHED_DWELL_S)),
            "matlab",
        ),
        neighbours={n: Count(*rank_counts(*pair)) for n, pair in _neighbours(config).items()},
        full=observability_of(Setup(config)),
        classic=observability_of(Setup(classic)),
    )


def readings_of(config: Config) -> dict[tuple[str, str], Observability]:
    """Predict with D2 read on pulse rates and in SI, in the configured and in quiet noise.

    Parameters
    ----------
    config : Config

    Returns
    -------
    dict of (str, str) to Observability
        By reading and name of the noise.
    """
    quiet = load(["noise=quiet"]).noise
    return {
        (unit, noise.name): observability_of(
            Setup(replace(config, noise=noise, sensor=replace(config.sensor, quadratic_unit=unit)))
        )
        for unit in ("pulse", "si")
        for noise in (config.noise, quiet)
    }


def rank_table(structure: Structure) -> str:
    """CSV text: ranks by position, a column for each convention and way of counting."""
    columns = {}
    for name, count in (*structure.counts.items(), *structure.neighbours.items()):
        columns[name] = count.by_default.rank
        columns[f"{name}, unit-free"] = count.unit_free.rank
    columns[f"{SEARCHED}, MATLAB"] = structure.by_matlab.rank
    index = pd.RangeIndex(len(structure.rows), name="position_from_0")
    return pd.DataFrame(columns, index=index).to_csv()
