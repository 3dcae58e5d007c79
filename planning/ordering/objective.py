"""What makes one order better than another: stable first, then few re-fixings, then low.

Orders are compared by three numbers, in this order of priority:

1. Unstable stages: sub-assemblies, standing with ``up`` up, whose centre of gravity is outside
   their footprint, or of which an item would fall (no part of the sub-assembly is below it, and it
   is too high to reach into the bed). The footprint is that of the points near the lowest one; if
   the centre of gravity is outside of it, that of the imprint in the bed.
2. Re-fixings: steps in which the incoming item becomes the fixed one (posture against ``up``).
3. Height of the centre of gravity above the lowest point, mean over all stages.

A stage is the first item alone, and what is assembled after each step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cell.vectors import rotation_with_up
from planning.feasibility.algorithm import choose_posture, open_postures
from planning.feasibility.directions import DIRECTIONS, opposite
from planning.feasibility.slanted import Slanted
from planning.feasibility.solids import Solid
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.footprint import (
    USUAL_DEPTH,
    Footprint,
    footprint,
    standing_points,
)
from planning.fixture_analysis.imprint import PartSurface, press, samples_of
from planning.ordering.items import Items, as_set, members
from planning.ordering.search import Cost

# [m] Heights are summed as whole micrometres: sums do not depend on the order of summation.
HEIGHT_UNIT = 1e-6
# [M] Imprints computed at most where slanted directions are in use, 50 ms each: all stages of a
# product drawn at an angle stand on an edge. Beyond them, what has no footprint counts as unstable.
MOST_IMPRINTS = 40
ROUNDING = 1e-10  # [m] Keeps rounding errors from deciding heights half-way between two units.


@dataclass
class Objective:
    """Cost of adding an item to a set, with a cache of what has been computed.

    Attributes:
        items: Contact and blocking.
        solids: By part name.
        parts: Per item the names of its parts.
        up: Axis of the product frame that points up on the jig.
        setup: For the jig, and the force with which a part is pressed into it.
        slanted: Slanted directions, which the items know by their labels.
    """

    items: Items
    solids: Mapping[str, Solid]
    parts: Sequence[Sequence[str]]
    up: str
    setup: FixtureSetup
    slanted: Sequence[Slanted] = ()
    _stages: dict[int, tuple[int, int]] = field(default_factory=dict)
    _outlines: dict[int, Footprint | None] = field(default_factory=dict)
    _bearing: dict[int, Footprint | None] = field(default_factory=dict)
    _surfaces: dict[str, PartSurface] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Compute extent, mass and moment of each item along ``up``."""
        self._R_JA = rotation_with_up(self.up).matrix()
        groups = [[self.solids[name] for name in names] for names in self.parts]
        self._vertices = [np.concatenate([s.vertices @ self._R_JA.T for s in g]) for g in groups]
        self._low = [float(vertices[:, 2].min()) for vertices in self._vertices]
        self._top = [float(vertices[:, 2].max()) for vertices in self._vertices]
        self._mass = np.array([sum(s.mass for s in group) for group in groups])
        moments = [sum(s.mass * (self._R_JA @ s.p_AoG) for s in group) for group in groups]
        self._moment = np.array(moments)

    def cost(self, rest: int, item: int) -> Cost:
        """Return (unstable stages, re-fixings, CoG height) of the step that adds an item."""
        unstable, height = self.stage(rest | 1 << item)
        return unstable, int(bool(rest) and self.refixes(rest, item)), height

    def refixes(self, rest: int, item: int) -> bool:
        """Return whether Algorithm 1 fixes the item instead of the set it is added to."""
        against = opposite(self.up)
        ways = self.items.directions(item, rest)
        slanted = [way.direction for way in self.slanted if way.label in ways]
        directions = open_postures((j for j in ways if j in DIRECTIONS), slanted, self.up)
        if against not in directions:
            return False
        if self.up not in directions:
            return True
        # Both directions along ``up`` are open: the height of the CoG decides.
        numbers = list(members(rest | 1 << item))
        height = self._cog(numbers)[2]
        low, top = min(self._low[i] for i in numbers), max(self._top[i] for i in numbers)
        heights = {self.up: height - low, against: top - height}
        return choose_posture({j: heights.get(j, 0.0) for j in directions}, self.up)[0] == against

    def stage(self, stage: int) -> tuple[int, int]:
        """Return whether a sub-assembly is unstable (0 or 1), and its CoG's height [um]."""
        if stage not in self._stages:
            numbers = list(members(stage))
            low = min(self._low[i] for i in numbers)
            cog = self._cog(numbers)
            below = self.items.hits[opposite(self.up)]
            falls = any(self._low[i] > low + USUAL_DEPTH and not below[i] & stage for i in numbers)
            unstable = falls or not self._stands(numbers, low, cog[:2])
            self._stages[stage] = int(unstable), round((cog[2] - low + ROUNDING) / HEIGHT_UNIT)
        return self._stages[stage]

    def _cog(self, numbers: list[int]) -> np.ndarray:
        return self._moment[numbers].sum(axis=0) / self._mass[numbers].sum()

    def _stands(self, numbers: list[int], low: float, cog: np.ndarray) -> bool:
        """Return whether the centre of gravity (2,) is inside a sub-assembly's footprint."""
        lowest = as_set(i for i in numbers if self._low[i] <= low + USUAL_DEPTH)
        if lowest not in self._outlines:
            points = standing_points([self._vertices[i] for i in members(lowest)])
            self._outlines[lowest] = footprint(points)
        outline = self._outlines[lowest]
        if outline is not None and outline.margin(cog) > 0.0:
            return True
        cap_height = self.setup.jig.bag.cap_height
        reaching = as_set(i for i in numbers if self._low[i] <= low + cap_height)
        if reaching not in self._bearing:
            if self.slanted and len(self._bearing) >= MOST_IMPRINTS:
                return False
            self._bearing[reaching] = self._bearing_outline(reaching)
        outline = self._bearing[reaching]
        return outline is not None and outline.margin(cog) > 0.0

    def _bearing_outline(self, reaching: int) -> Footprint | None:
        """Press a set into the bed; return what bears, in the plane of the turned product."""
        numbers = list(members(reaching))
        middle = self._cog(numbers)[:2]
        names = [name for i in numbers for name in self.parts[i]]
        for name in names:
            if name not in self._surfaces:
                self._surfaces[name] = samples_of(self.solids[name])
        surfaces = [self._surfaces[name] for name in names]
        imprint = press(surfaces, self._R_JA, middle, self.setup.jig, self.setup.press_force)
        return None if imprint.contact is None else imprint.contact.shifted(middle)
