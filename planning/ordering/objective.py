"""What makes one order better than another: stable first, then few re-fixings, then low.

An order is compared by three numbers, the first that differs decides:

1. Unstable stages: sub-assemblies, standing with ``up`` up, whose centre of gravity is not above
   what they stand on, or of which an item would fall (nothing of the sub-assembly below it, and not
   deep enough to reach into the bed). They stand on what is near the lowest point; where that does
   not do, on what bears when they are pressed into the bed.
2. Re-fixings: steps in which the incoming item becomes the fixed one (posture against ``up``).
3. Height of the centre of gravity above the lowest point, mean over all stages.

A stage is the first item alone, and what is there after each step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cell.configuration.config import PlacementConfig
from cell.fixtures.soft_jig import JigParameters
from planning.feasibility.algorithm import choose_posture
from planning.feasibility.directions import opposite
from planning.feasibility.solids import Solid
from planning.fixture_analysis.footprint import (
    USUAL_DEPTH,
    Footprint,
    footprint,
    posture,
    standing_points,
)
from planning.fixture_analysis.imprint import Surface, press, samples_of
from planning.ordering.items import Items, as_set, members
from planning.ordering.search import Cost

# [m] Heights are summed as whole micrometres: sums do not depend on the order of summation.
HEIGHT_UNIT = 1e-6
ROUNDING = 1e-10  # [m] Keeps rounding errors from deciding heights half-way between two units.


@dataclass
class Objective:
    """Cost of adding an item to a set, with what has been computed before.

    Attributes:
        items: Contact and blocking.
        solids: By part name.
        parts: Per item the names of its parts.
        up: Axis of the product frame that points up on the jig.
        jig: Bag and beads.
        press_force: That a part is pressed on the jig with [N].
    """

    items: Items
    solids: Mapping[str, Solid]
    parts: Sequence[Sequence[str]]
    up: str
    jig: JigParameters = JigParameters()
    press_force: float = PlacementConfig().press_force
    _stages: dict[int, tuple[int, int]] = field(default_factory=dict)
    _outlines: dict[int, Footprint | None] = field(default_factory=dict)
    _bearing: dict[int, Footprint | None] = field(default_factory=dict)
    _surfaces: dict[str, Surface] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Sum up each item along ``up``."""
        self._R_JA = posture(self.up)
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
        """Say whether Algorithm 1 fixes the item instead of what is there."""
        against = opposite(self.up)
        directions = self.items.directions(item, rest)
        if against not in directions:
            return False
        return self.up not in directions or self._lower_turned_over(rest | 1 << item, directions)

    def _lower_turned_over(self, stage: int, directions: list[str]) -> bool:
        """Say whether Algorithm 1 prefers the direction against ``up`` by the height of the CoG."""
        numbers = list(members(stage))
        height = self._cog(numbers)[2]
        low = min(self._low[i] for i in numbers)
        top = max(self._top[i] for i in numbers)
        heights = {self.up: height - low, opposite(self.up): top - height}
        listed = {j: heights.get(j, 0.0) for j in directions}
        return choose_posture(listed, self.up)[0] == opposite(self.up)

    def stage(self, stage: int) -> tuple[int, int]:
        """Return whether a sub-assembly is unstable (0 or 1), and its CoG's height [um]."""
        if stage not in self._stages:
            numbers = list(members(stage))
            low = min(self._low[i] for i in numbers)
            cog = self._cog(numbers)
            unstable = self._loose(stage, low) or not self._stands(numbers, low, cog[:2])
            self._stages[stage] = int(unstable), round((cog[2] - low + ROUNDING) / HEIGHT_UNIT)
        return self._stages[stage]

    def _cog(self, numbers: list[int]) -> np.ndarray:
        return self._moment[numbers].sum(axis=0) / self._mass[numbers].sum()

    def _loose(self, stage: int, low: float) -> bool:
        """Say whether an item of a sub-assembly would fall."""
        below = self.items.hits[opposite(self.up)]
        return any(
            self._low[i] > low + USUAL_DEPTH and not below[i] & stage for i in members(stage)
        )

    def _stands(self, numbers: list[int], low: float, cog: np.ndarray) -> bool:
        """Say whether the centre of gravity (2,) is above what a sub-assembly stands on."""
        lowest = as_set(i for i in numbers if self._low[i] <= low + USUAL_DEPTH)
        if lowest not in self._outlines:
            points = standing_points([self._vertices[i] for i in members(lowest)])
            self._outlines[lowest] = footprint(points)
        outline = self._outlines[lowest]
        if outline is not None and outline.margin(cog) > 0.0:
            return True
        reaching = as_set(i for i in numbers if self._low[i] <= low + self.jig.bag.cap_height)
        if reaching not in self._bearing:
            self._bearing[reaching] = self._pressed(reaching)
        outline = self._bearing[reaching]
        return outline is not None and outline.margin(cog) > 0.0

    def _pressed(self, reaching: int) -> Footprint | None:
        """Return what bears, in the plane of the turned product, when a set is pressed in."""
        numbers = list(members(reaching))
        middle = self._cog(numbers)[:2]
        parts = [self._surface(name) for i in numbers for name in self.parts[i]]
        outline = press(parts, self._R_JA, middle, self.jig, self.press_force).contact
        return None if outline is None else outline.shifted(middle)

    def _surface(self, name: str) -> Surface:
        if name not in self._surfaces:
            self._surfaces[name] = samples_of(self.solids[name])
        return self._surfaces[name]
