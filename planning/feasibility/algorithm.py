"""Algorithm 1: which part is fixed on the soft jig, in which posture, for each incoming part.

Where the paper leaves room, it is read as follows; ``READING`` says the same in ``plan.json``.

Direction: A_j(P_t, P_i) = 1 means that the incoming P_i leaves the target P_t along j
(``planning.feasibility.reachability``). The posture is that j: the direction in which the incoming
part lies relative to the target. It is not an orientation: the product stands on the jig with its own
``up`` axis up in every step, as in all four entries of the paper's table.

Bottom part: j along ``up``: the incoming part comes from above, and the target is at the bottom,
fixed by the part that was fixed before. j against ``up``: the incoming part is at the bottom and
becomes the fixed one. j across ``up``: nothing comes to lie below the target, which stays fixed.

Two or more 1s: the posture is the one whose j, turned up, has the combined CoG lowest above its
lowest point; the first in the order +x ... -z if equal. The CoG is compared among the directions
along ``up``, if there are any: turned to lie on its side the product would not stand with ``up``
up, which its description demands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from planning.feasibility.contact import surface_gap
from planning.feasibility.directions import DIRECTIONS, axis_index, open_directions, opposite
from planning.feasibility.interference import Blocker, Interference
from planning.feasibility.reachability import reachable_directions, touching
from planning.feasibility.solids import Solid, cog_height

READING = (
    "A_j = 1: the incoming part leaves the target along j (column reading of W_j). Posture: the "
    "direction in which the incoming part lies relative to the target, not an orientation: the "
    "product's up axis points up throughout. Posture along that axis: the target is at the bottom "
    "and its fixed part stays; against it: the incoming part is at the bottom and is fixed; across "
    "it: the target stays fixed. Two or more 1s: the direction (one along that axis if there is "
    "any) that, turned up, has the combined centre of gravity lowest."
)

SAME_HEIGHT = 1e-6  # [m] Centres of gravity this close are equal: below any drawing's tolerance.


@dataclass(frozen=True)
class FixingStep:
    """What to hold, and how, while one item of the order is added.

    Attributes:
        item: The item of the order that comes in: a part or a group.
        target: Names of the parts it is added to, in matrix order.
        incoming: Names of the parts of the item, in matrix order.
        directions: A(P_t, P_i): per direction 1 if the incoming parts leave the target along it.
        posture: Direction in which the incoming part lies relative to the target.
        fixed_part: Item of the order that the jig holds.
        up: Axis of the product frame that points up on the jig.
        cog_height: Combined CoG of target and incoming parts above their lowest point [m].
        reason: How posture and fixed part follow.
    """

    item: str
    target: tuple[str, ...]
    incoming: tuple[str, ...]
    directions: Mapping[str, int]
    posture: str
    fixed_part: str
    up: str
    cog_height: float
    reason: str


@dataclass(frozen=True)
class Stop:
    """Why Algorithm 1 stopped: A(P_t, P_i) is all zeros.

    Attributes:
        item: The item of the order that cannot be added.
        target: Names of the parts assembled until then.
        incoming: Names of the parts of the item.
        reason: One sentence.
        blockers: What blocks each direction; empty where the parts do not touch.
    """

    item: str
    target: tuple[str, ...]
    incoming: tuple[str, ...]
    reason: str
    blockers: tuple[Blocker, ...]


@dataclass(frozen=True, eq=False)
class Geometry:
    """What the decisions rest on: parts in matrix order, C, and M_j."""

    solids: Mapping[str, Solid]
    contact: np.ndarray
    interference: Interference

    def indices(self, names: tuple[str, ...]) -> list[int]:
        """Return the matrix indices of parts."""
        order = list(self.solids)
        return [order.index(name) for name in names]


def configure_fixing(
    product: Product, order: tuple[str, ...], geometry: Geometry
) -> tuple[tuple[FixingStep, ...], Stop | None]:
    """Run Algorithm 1 over an order; return its steps, and why it stopped if it did."""
    steps: list[FixingStep] = []
    target, fixed = _expanded(product, (order[0],)), order[0]
    for number, item in enumerate(order[1:], start=1):
        incoming = _expanded(product, (item,))
        at = geometry.indices(target), geometry.indices(incoming)
        directions = reachable_directions(geometry.contact, geometry.interference.free, *at)
        if not any(directions.values()):
            return tuple(steps), _stop(item, target, incoming, geometry)
        step = _step(item, fixed, (target, incoming), directions, product.up, geometry.solids)
        steps.append(step)
        target, fixed = _expanded(product, order[: number + 1]), step.fixed_part
    return tuple(steps), None


def _step(
    item: str,
    fixed: str,
    target_and_incoming: tuple[tuple[str, ...], tuple[str, ...]],
    directions: Mapping[str, int],
    up: str,
    solids: Mapping[str, Solid],
) -> FixingStep:
    target, incoming = target_and_incoming
    combined = target + incoming
    heights = {j: cog_height(solids, combined, j) for j in open_directions(directions)}
    posture, why_posture = choose_posture(heights, up)
    fixed_part, why_fixed = choose_fixed_part(posture, up, fixed, item)
    return FixingStep(
        item,
        target,
        incoming,
        directions,
        posture,
        fixed_part,
        up,
        cog_height(solids, combined, up),
        f"{item} {why_posture}; {why_fixed}.",
    )


def choose_posture(heights: Mapping[str, float], up: str) -> tuple[str, str]:
    """Choose among the directions with a 1; return the posture and the reason.

    Args:
        heights: For each direction with a 1, the combined CoG's height with it turned up [m].
        up: Axis of the product frame that points up on the jig.
    """
    names = list(heights)
    if len(names) == 1:
        return names[0], f"can leave the target only along {names[0]}"
    upright = [j for j in names if axis_index(j) == axis_index(up)]
    candidates = upright or names
    lowest = min(heights[j] for j in candidates)
    posture = next(j for j in candidates if heights[j] <= lowest + SAME_HEIGHT)
    listed = ", ".join(f"{j} {1e3 * heights[j]:.1f} mm" for j in names)
    among = f" of {' and '.join(upright)}, along up," if upright and upright != names else ""
    return posture, (
        f"can leave the target along {', '.join(names)}; turned up, the centre of gravity is "
        f"at {listed}:{among} {posture} is taken{'' if len(candidates) == 1 else ' as the lowest'}"
    )


def choose_fixed_part(posture: str, up: str, fixed: str, incoming: str) -> tuple[str, str]:
    """Return the bottom part in a posture, and the reason.

    Args:
        posture: Direction in which the incoming part lies relative to the target.
        up: Axis of the product frame that points up on the jig.
        fixed: What the jig holds of the target.
        incoming: The item that comes in.
    """
    if posture == opposite(up):
        return incoming, f"{up} is up, so {incoming} is at the bottom and is fixed instead"
    if posture == up:
        return fixed, f"{up} is up, so it comes from above and {fixed} is at the bottom"
    return fixed, f"{up} is up, so it comes from the side and {fixed} stays fixed"


def _stop(
    item: str, target: tuple[str, ...], incoming: tuple[str, ...], geometry: Geometry
) -> Stop:
    if not touching(geometry.contact, geometry.indices(target), geometry.indices(incoming)):
        return Stop(item, target, incoming, _no_contact(item, target, incoming, geometry), ())
    blockers = tuple(
        blocker
        for j in DIRECTIONS
        for blocker in geometry.interference.blockers
        if blocker.direction == j and blocker.moving in incoming and blocker.staying in target
    )
    by = ", ".join(dict.fromkeys(blocker.staying for blocker in blockers))
    return Stop(
        item, target, incoming, f"{item} is blocked in all six directions by {by}", blockers
    )


def _no_contact(
    item: str, target: tuple[str, ...], incoming: tuple[str, ...], geometry: Geometry
) -> str:
    solids = geometry.solids
    gaps = {name: min(surface_gap(solids[i], solids[name]) for i in incoming) for name in target}
    nearest = min(gaps, key=gaps.__getitem__)
    return f"{item} touches no part of the target; {nearest} is {1e3 * gaps[nearest]:.3g} mm away"


def _expanded(product: Product, items: tuple[str, ...]) -> tuple[str, ...]:
    """Return the parts behind items of an order, in matrix order."""
    members = {part for item in items for part in product.members(item)}
    return tuple(name for name in product.parts if name in members)
