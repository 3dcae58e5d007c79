"""The six directions j of the paper, +x ... -z, along the axes of the product frame A."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

DIRECTIONS = ("+x", "-x", "+y", "-y", "+z", "-z")


def opposite(direction: str) -> str:
    """Return the reversed direction: "+x" gives "-x"."""
    return ("-" if direction[0] == "+" else "+") + direction[1]


def axis_index(direction: str) -> int:
    """Return 0, 1 or 2 for a direction along x, y or z."""
    return "xyz".index(direction[1])


def unit_vector(direction: str) -> np.ndarray:
    """Return the direction as a (3,) unit vector in A."""
    vector = np.zeros(3)
    vector[axis_index(direction)] = 1.0 if direction[0] == "+" else -1.0
    return vector


def open_directions(directions: Mapping[str, int]) -> list[str]:
    """Return those with a 1, in the paper's order."""
    return [j for j in DIRECTIONS if directions[j]]
