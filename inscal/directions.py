"""Named directions and axes. Imports nothing: checking a configuration needs them, and no scipy."""

DIRECTIONS: dict[str, tuple[int, int, int]] = {
    "North": (1, 0, 0),
    "South": (-1, 0, 0),
    "East": (0, 1, 0),
    "West": (0, -1, 0),
    "Down": (0, 0, 1),
    "Up": (0, 0, -1),
}
"""Unit vectors in the North-East-Down frame."""

AXES = "XYZ"
"""Body axes."""
