"""Small assemblies, each drawn together with what follows from how it is drawn. Lengths in mm.

A draft states of every pair of its parts whether they touch and along which of the six directions
one leaves the other. Nothing here asks the planner: a peg in a blind hole leaves along +z because
the hole was cut from above.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from manifold3d import Manifold

SIX = ("+x", "-x", "+y", "-y", "+z", "-z")
SIDEWAYS = "+x -x +y -y"
UP_OR_ASIDE = "+z " + SIDEWAYS
OPPOSITE = {"+": "-", "-": "+"}

Pair = frozenset[str]
Vector = tuple[float, float, float]
Rng = np.random.Generator


def opposite(direction: str) -> str:
    """Return "-x" for "+x"."""
    return OPPOSITE[direction[0]] + direction[1]


@dataclass
class Draft:
    """Shapes in assembled pose, and the answers known from their construction.

    Attributes:
        kind: What is drawn.
        shapes: Parts by name [mm].
        touching: Pairs of parts without a gap.
        leaves: (moving, staying) -> directions along which the first leaves the second; both
            orders are stated. A pair that is missing is not known.
        feasible: Whether the parts can be put together at all, with everything that is declared.
        alone: Whether single parts along the six directions suffice, with nothing declared.
        threads: (bolt, nut) of every screw thread.
        overlaps: Depth at which pairs share volume, where deepest, other than in threads [mm].
        strays: Parts that belong to no other.
        gap: Largest clearance across which the product still hangs together [mm].
        slanted: Part -> direction in which it leaves the others, at an angle to all axes.
        together: Parts that leave the others as one, and only so.
        press, snap: Pairs that have to be declared for the product to be feasible.
    """

    kind: str
    shapes: dict[str, Manifold] = field(default_factory=dict)
    touching: set[Pair] = field(default_factory=set)
    leaves: dict[tuple[str, str], frozenset[str]] = field(default_factory=dict)
    feasible: bool = True
    alone: bool = True
    threads: set[tuple[str, str]] = field(default_factory=set)
    overlaps: dict[Pair, float] = field(default_factory=dict)
    strays: set[str] = field(default_factory=set)
    gap: float = 0.0
    slanted: dict[str, Vector] = field(default_factory=dict)
    together: tuple[frozenset[str], ...] = ()
    press: set[Pair] = field(default_factory=set)
    snap: set[Pair] = field(default_factory=set)

    def pair(self, moving: str, staying: str, leaves: str, *, touch: bool) -> None:
        """State along which directions a part leaves another, and whether they touch."""
        ways = frozenset(leaves.split())
        assert ways <= set(SIX), leaves
        self.leaves[moving, staying] = ways
        self.leaves[staying, moving] = frozenset(map(opposite, ways))
        if touch:
            self.touching.add(frozenset({moving, staying}))

    def side_by_side(self, names: Iterable[str], places: Mapping[str, tuple[float, float]]) -> None:
        """State that equal upright parts, far apart, hit each other only within a row or column."""
        for a, b in combinations(names, 2):
            blocked = set()
            for axis, letter in enumerate("xy"):
                ahead = places[b][axis] - places[a][axis]
                if places[a][1 - axis] == places[b][1 - axis] and ahead:
                    blocked.add(("+" if ahead > 0 else "-") + letter)
            self.pair(a, b, " ".join(j for j in SIX if j not in blocked), touch=False)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Manifold:
    """A box by its corners."""
    size = [b - a for a, b in zip(low, high, strict=True)]
    return Manifold.cube(size).translate(list(low))


def rod(radius: float, low: float, high: float, facets: int = 32) -> Manifold:
    """A cylinder about z."""
    return Manifold.cylinder(high - low, radius, radius, facets).translate([0, 0, low])


def cone(low_radius: float, high_radius: float, low: float, high: float, facets: int) -> Manifold:
    """A frustum about z."""
    return Manifold.cylinder(high - low, low_radius, high_radius, facets).translate([0, 0, low])


def square_rod(half: float, low: float, high: float) -> Manifold:
    """A square bar about z."""
    return box((-half, -half, low), (half, half, high))


def at(shape: Manifold, x: float, y: float, z: float = 0.0) -> Manifold:
    """A shape moved to a place."""
    return shape.translate([x, y, z])


def grid(rng: Rng, count: int, pitch: float) -> list[tuple[float, float]]:
    """Distinct places on a square grid, at random."""
    side = int(np.ceil(np.sqrt(count))) + 1
    chosen = rng.choice(side * side, count, replace=False)
    return [(pitch * float(n % side), pitch * float(n // side)) for n in chosen]


def around(
    places: Iterable[tuple[float, float]], margin: float
) -> tuple[float, float, float, float]:
    """Lower x and y, upper x and y of a plate that holds all places with a margin."""
    x, y = np.array(list(places)).T
    return (float(x.min()) - margin, float(y.min()) - margin,
            float(x.max()) + margin, float(y.max()) + margin)  # fmt: skip


def between(rng: Rng, low: float, high: float) -> float:
    """A number at random."""
    return float(rng.uniform(low, high))
