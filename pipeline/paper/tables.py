"""The paper's Tables 1 and 2 as data."""

TABLE_1_ROTATIONS: tuple[tuple[float, str], ...] = (
    *((90, "Y"), (180, "Y"), (180, "Y"), (90, "Z"), (180, "Z"), (180, "Z"), (90, "X")),
    *((180, "X"), (180, "X"), (90, "X"), (90, "X"), (90, "X"), (90, "Z"), (90, "Z"), (90, "Z")),
    *((90, "Y"), (90, "Y"), (90, "Y"), (180, "Z"), (180, "X"), (180, "Y"), (180, "Y")),
    *((180, "X"), (180, "Z"), (0, "")),
)
"""Angle in degrees and body axis of the rotation after each dwell; after the last there is none."""

TABLE_1_POSTURES: tuple[tuple[str, str, str], ...] = (
    ("North", "East", "Down"),
    ("Up", "East", "North"),
    ("Down", "East", "South"),
    ("Up", "East", "North"),
    ("East", "Down", "North"),
    ("West", "Up", "North"),
    ("East", "Down", "North"),
    ("East", "North", "Up"),
    ("East", "South", "Down"),
    ("East", "North", "Up"),
    ("East", "Up", "South"),
    ("East", "South", "Down"),
    ("East", "Down", "North"),
    ("Down", "West", "North"),
    ("West", "Up", "North"),
    ("Up", "East", "North"),
    ("South", "East", "Up"),
    ("Down", "East", "South"),
    ("North", "East", "Down"),
    ("South", "West", "Down"),
    ("South", "East", "Up"),
    ("North", "East", "Down"),
    ("South", "East", "Up"),
    ("South", "West", "Down"),
    ("North", "East", "Down"),
)
"""Where the body axes x, y and z point in each dwell."""

TABLE_2_RANKS: tuple[int, ...] = (12, 18, 23, 26, 30, *(33,) * 15, *(36,) * 5)
"""Rank of the stripped observability matrix after positions 0 to 24."""

CLASSIC_POSITIONS = 19
"""Positions of the classic path that the paper extends."""
