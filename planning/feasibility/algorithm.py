"""Algorithm 1: which part is fixed on the soft jig, in which posture, for each incoming part.

Where the paper is open to interpretation, it is read as follows; ``READING`` states the same in
``plan.json``.

Direction: A_j(P_t, P_i) = 1 means that the incoming P_i leaves the target P_t along j
(``planning.feasibility.matrices``). The posture is that j: the direction in which the incoming part
lies relative to the target. It is not an orientation: the product stands on the jig with its own
``up`` axis up in every step, as in all four entries of the paper's table.

Fixed part: with j along ``up``, the incoming part comes from above; the target is at the bottom and
keeps its fixed part. With j against ``up``, the incoming part is at the bottom and becomes the
fixed part. With j across ``up``, nothing is added below the target, and its fixed part stays.

Several directions: the posture is the j for which the combined centre of gravity (CoG), with j
turned up, is lowest above the lowest point; on a tie, the first in the order +x ... -z. If any
direction lies along ``up``, only those are compared: the product description demands that ``up``
points up, and a product turned onto its side violates that.

Slanted directions (``planning.feasibility.slanted``; only where the six do not suffice for the
product) count as the axis nearest to them, midway as the one along ``up``. So the posture stays one
of the six: the jig holds the product with ``up`` up, never at an odd angle, and what comes at 36
degrees from ``up`` comes from above rather than from the side. The rule of the lowest CoG compares
these axes, turned up, and not the slanted directions themselves: a product turned up by 36 degrees
stands on an edge. Which part is fixed follows from the posture as before. The step states the
direction in which the part really leaves: the posture's own if that is open, else the slanted one
that is nearest to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from planning.feasibility.contact import surface_gap
from planning.feasibility.directions import (
    DIRECTIONS,
    axis_index,
    open_directions,
    opposite,
    unit_vector,
)
from planning.feasibility.interference import Blocker
from planning.feasibility.matrices import AssemblyMatrices, reachable_directions, touching
from planning.feasibility.slanted import Slanted, direction_label, nearest_axis
from planning.feasibility.solids import cog_height

READING = (
    "A_j = 1: the incoming part leaves the target along j (column reading of W_j). Posture: the "
    "direction in which the incoming part lies relative to the target, not an orientation: the "
    "product's up axis points up throughout. Posture along that axis: the target is at the bottom "
    "and its fixed part stays; against it: the incoming part is at the bottom and is fixed; across "
    "it: the target stays fixed. Two or more 1s: the direction (one along that axis if there is "
    "any) that, turned up, has the combined centre of gravity lowest. A slanted direction counts "
    "as the axis nearest to it, midway as the one along up; the product is never turned askew."
)

Vector = tuple[float, float, float]

SAME_HEIGHT = 1e-6  # [m] Centres of gravity this close are equal: below any drawing's tolerance.


@dataclass(frozen=True)
class FixingStep:
    """Which part is fixed, and in which posture, while one item of the order is added.

    Attributes:
        item: The incoming item of the order: a part or a group.
        target: Names of the parts it is added to, in matrix order.
        incoming: Names of the parts of the item, in matrix order.
        directions: A(P_t, P_i): per direction 1 if the incoming parts leave the target along it.
        posture: Direction in which the incoming part lies relative to the target.
        fixed_part: Item of the order that the jig holds.
        up: Axis of the product frame that points up on the jig.
        cog_height: Combined CoG of target and incoming parts above their lowest point [m].
        reason: Why this posture and this fixed part.
        leaves_along: (3,) unit vector in A along which the incoming parts leave the target: that of
            the posture, or a slanted one.
        slanted: Slanted directions along which they leave it, (3,) unit vectors.
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
    leaves_along: Vector
    slanted: tuple[Vector, ...] = ()


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


def configure_fixing(
    product: Product,
    order: tuple[str, ...],
    matrices: AssemblyMatrices,
    slanted: Sequence[Slanted] = (),
    tried: int = 0,
) -> tuple[tuple[FixingStep, ...], Stop | None]:
    """Run Algorithm 1 over an order; return its steps, and why it stopped if it did.

    Args:
        product: For its groups and its ``up``.
        order: Items in the order of assembly.
        matrices: Of the product's parts.
        slanted: Further directions.
        tried: Number of slanted directions that were tried where it stops, for the reason.
    """
    steps: list[FixingStep] = []
    up, fixed = product.up, order[0]
    for number, item in enumerate(order[1:], start=1):
        target, incoming = _expanded(product, order[:number]), _expanded(product, (item,))
        indices = matrices.indices(target), matrices.indices(incoming)
        directions = reachable_directions(matrices.contact, matrices.interference.free, *indices)
        angled = reachable_slanted(matrices, slanted, *indices)
        if not any(directions.values()) and not angled:
            return tuple(steps), _stop(item, target, incoming, matrices, tried)
        combined = target + incoming
        open_axes = open_postures(open_directions(directions), angled, up)
        heights = {j: cog_height(matrices.solids, combined, j) for j in open_axes}
        posture, why_posture = choose_posture(heights, up)
        fixed, why_fixed = choose_fixed_part(posture, up, fixed, item)
        way = leaving_way(posture, open_directions(directions), angled)
        steps.append(
            FixingStep(
                item=item,
                target=target,
                incoming=incoming,
                directions=directions,
                posture=posture,
                fixed_part=fixed,
                up=up,
                cog_height=cog_height(matrices.solids, combined, up),
                reason=f"{item} {why_posture}{_slant_text(way, posture)}; {why_fixed}.",
                leaves_along=way,
                slanted=angled,
            )
        )
    return tuple(steps), None


def reachable_slanted(
    matrices: AssemblyMatrices,
    slanted: Sequence[Slanted],
    target: Sequence[int],
    incoming: Sequence[int],
) -> tuple[Vector, ...]:
    """Return the slanted directions along which the incoming parts leave the target they touch."""
    if not slanted or not touching(matrices.contact, target, incoming):
        return ()
    pairs = np.ix_(incoming, target)
    return tuple(way.direction for way in slanted if way.free[pairs].all())


def open_postures(six: Iterable[str], slanted: Sequence[Vector], up: str) -> list[str]:
    """Return the postures that directions allow, in the paper's order.

    Args:
        six: Those of the six that are open.
        slanted: Slanted ones that are open; each counts as the axis nearest to it.
        up: Axis of the product frame that points up on the jig.
    """
    allowed = {*six, *(nearest_axis(way, up) for way in slanted)}
    return [j for j in DIRECTIONS if j in allowed]


def leaving_way(posture: str, six: Iterable[str], slanted: Sequence[Vector]) -> Vector:
    """Return the unit vector (3,) along which parts leave in a posture."""
    axis = unit_vector(posture)
    way = axis if posture in six else max(slanted, key=lambda way: float(np.dot(way, axis)))
    x, y, z = (float(value) for value in way)
    return x, y, z


def _slant_text(way: Vector, posture: str) -> str:
    angle = float(np.degrees(np.arccos(min(1.0, float(np.dot(way, unit_vector(posture)))))))
    if angle < 1e-3:
        return ""
    return (
        f", which is the axis nearest to {direction_label(way)}, the direction in which it really "
        f"leaves, {angle:.3g} degrees off"
    )


def choose_posture(heights: Mapping[str, float], up: str) -> tuple[str, str]:
    """Choose among the directions with a 1; return the posture and the reason.

    Args:
        heights: For each direction with a 1, height of the combined CoG with that direction
            turned up [m].
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
    """Return the part that is fixed in a posture, and the reason.

    Args:
        posture: Direction in which the incoming part lies relative to the target.
        up: Axis of the product frame that points up on the jig.
        fixed: Item of the target that the jig holds.
        incoming: The item that is added.
    """
    if posture == opposite(up):
        return incoming, f"{up} is up, so {incoming} is at the bottom and is fixed instead"
    if posture == up:
        return fixed, f"{up} is up, so it comes from above and {fixed} is at the bottom"
    return fixed, f"{up} is up, so it comes from the side and {fixed} stays fixed"


def _stop(
    item: str,
    target: tuple[str, ...],
    incoming: tuple[str, ...],
    matrices: AssemblyMatrices,
    tried: int,
) -> Stop:
    if not touching(matrices.contact, matrices.indices(target), matrices.indices(incoming)):
        solids = matrices.solids
        gaps = {n: min(surface_gap(solids[i], solids[n]) for i in incoming) for n in target}
        nearest = min(gaps, key=gaps.__getitem__)
        gap = f"{nearest} is {1e3 * gaps[nearest]:.3g} mm away"
        return Stop(item, target, incoming, f"{item} touches no part of the target; {gap}", ())
    blockers = tuple(
        blocker
        for j in DIRECTIONS
        for blocker in matrices.interference.blockers
        if blocker.direction == j and blocker.moving in incoming and blocker.staying in target
    )
    by = ", ".join(dict.fromkeys(blocker.staying for blocker in blockers))
    also = f", and in {tried} slanted ones from contacts" if tried else ""
    reason = f"{item} is blocked in all six directions by {by}{also}"
    return Stop(item, target, incoming, reason, blockers)


def _expanded(product: Product, items: tuple[str, ...]) -> tuple[str, ...]:
    """Return the parts of items of an order, in matrix order."""
    members = {part for item in items for part in product.members(item)}
    return tuple(name for name in product.parts if name in members)
