"""What the matrices rest on, for the reader of a plan: tolerance, threads, margins, remarks.

A decision is fragile if another tolerance, nearer than ``FRAGILE`` of it (0.025 mm of the usual
0.05), would turn it over. The plan hangs on it if A(P_t, P_i) of some step would then differ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cell.products.product import Product
from planning.feasibility.algorithm import FixingStep, Stop
from planning.feasibility.blocking import FRAGILE
from planning.feasibility.directions import opposite
from planning.feasibility.freedom import Freedom, freedoms
from planning.feasibility.matrices import Matrices
from planning.feasibility.reachability import reachable_directions
from planning.feasibility.threads import Thread

Places = Sequence[tuple[list[int], list[int]]]
"""Matrix indices of target and incoming parts, for each step."""

ALMOST = 1.0 - 1e-9  # A margin is fragile when it is less than the largest that is looked for.


@dataclass(frozen=True)
class Fragile:
    """A decision that a slightly different tolerance would turn over.

    Attributes:
        part: Name of the part that moves, or of one of two that touch.
        other: Name of the part that stays, or of the other.
        direction: "+x" ... "-z" of the motion; "contact" for an entry of C.
        value: The entry as it is, 0 or 1.
        margin: By how much the tolerance can change before it flips, at least [m].
        decides: Whether A(P_t, P_i) of some step of the plan would change with it.
    """

    part: str
    other: str
    direction: str
    value: int
    margin: float
    decides: bool


@dataclass(frozen=True)
class Motion:
    """How the parts of an item can move in the step in which it is added.

    Attributes:
        item: Of the order.
        freedom: Direction, travel, and what they hit.
    """

    item: str
    freedom: Freedom


@dataclass(frozen=True)
class Evidence:
    """What the matrices of a plan rest on.

    Attributes:
        tolerance: Gap that still touches, and overlap that does not block [m].
        declared: Whether the product declares it, or it was derived.
        threads: Screw threads recognised from the meshes.
        fragile: Decisions with a small margin, those that the plan hangs on first.
        remarks: What was assumed or repaired while the product was read.
        motions: Local freedom and slanted ways out, where they were asked for.
    """

    tolerance: float
    declared: bool
    threads: tuple[Thread, ...]
    fragile: tuple[Fragile, ...]
    remarks: tuple[str, ...]
    motions: tuple[Motion, ...] = ()


def evidence_of(
    product: Product, matrices: Matrices, steps: Sequence[FixingStep | Stop], *, slanted: bool
) -> Evidence:
    """Return what a plan's matrices rest on.

    Args:
        product: What is planned.
        matrices: Its matrices.
        steps: The plan's steps, the one at which it stopped among them.
        slanted: Whether to look for local freedom and slanted ways out as well.
    """
    names = list(matrices.solids)
    places = [
        ([names.index(part) for part in step.target], [names.index(part) for part in step.incoming])
        for step in steps
    ]
    found = [*_fragile_contacts(matrices, places), *_fragile_motions(matrices, places)]
    return Evidence(
        matrices.tolerance,
        product.contact_tolerance == matrices.tolerance,
        matrices.threads,
        tuple(sorted(found, key=lambda f: (not f.decides, f.margin))),
        (*product.remarks, *_doubts(product.items(), matrices)),
        tuple(_motions(matrices, steps)) if slanted else (),
    )


def _motions(matrices: Matrices, steps: Sequence[FixingStep | Stop]) -> Iterator[Motion]:
    solids = dict(matrices.solids)
    for thread in matrices.threads:
        solids[thread.nut] = solids[thread.nut].without(matrices.solids[thread.bolt])
    for step in steps:
        incoming, target = ([solids[name] for name in ns] for ns in (step.incoming, step.target))
        axes = [thread.axis for thread in matrices.threads if thread.bolt in step.incoming]
        for freedom in freedoms(incoming, target, matrices.tolerance, axes):
            yield Motion(step.item, freedom)


def _doubts(items: Sequence[str], matrices: Matrices) -> list[str]:
    """Return what a careful person would ask about."""
    names = list(matrices.solids)
    if len(items) == 1:
        kind = "part" if len(names) == 1 else "item"
        return [f"'{items[0]}' is the only {kind}: there is nothing to assemble"]
    touching = matrices.contact + matrices.contact.T
    alone = [name for name, row in zip(names, touching, strict=True) if not row.any()]
    touch = "touches" if len(alone) == 1 else "touch"
    return [f"{', '.join(alone)} {touch} no other part"] if alone else []


def _fragile_contacts(matrices: Matrices, places: Places) -> list[Fragile]:
    names, limit = list(matrices.solids), ALMOST * FRAGILE * matrices.tolerance
    found = []
    for i, k in np.argwhere(np.triu(matrices.contact_margin < limit, 1)):
        contact = matrices.contact.copy()
        contact[i, k] = 1 - contact[i, k]
        decides = _changes(matrices, places, contact, matrices.leaving.free)
        value, margin = int(matrices.contact[i, k]), float(matrices.contact_margin[i, k])
        found.append(Fragile(names[i], names[k], "contact", value, margin, decides))
    return found


def _fragile_motions(matrices: Matrices, places: Places) -> list[Fragile]:
    names, limit = list(matrices.solids), ALMOST * FRAGILE * matrices.tolerance
    found = []
    for j in ("+x", "+y", "+z"):
        for i, k in np.argwhere(matrices.leaving.margin[j] < limit):
            free = dict(matrices.leaving.free)
            for d, row, column in ((j, i, k), (opposite(j), k, i)):
                free[d] = free[d].copy()
                free[d][row, column] = 1 - free[d][row, column]
            decides = _changes(matrices, places, matrices.contact, free)
            value = int(matrices.leaving.free[j][i, k])
            margin = float(matrices.leaving.margin[j][i, k])
            found.append(Fragile(names[i], names[k], j, value, margin, decides))
    return found


def _changes(
    matrices: Matrices, places: Places, contact: np.ndarray, free: Mapping[str, np.ndarray]
) -> bool:
    """Say whether other matrices give another A(P_t, P_i) in some step."""
    now = matrices.contact, matrices.leaving.free
    return any(
        reachable_directions(contact, free, *place) != reachable_directions(*now, *place)
        for place in places
    )


def evidence_to_dict(evidence: Evidence) -> dict[str, Any]:
    """Return the evidence as plain lists, numbers and strings; lengths in metres."""
    data: dict[str, Any] = asdict(evidence)
    data["tolerance_m"] = data["tolerance"]
    del data["tolerance"]
    for thread in data["threads"]:
        for name in ("diameter", "height", "length"):
            thread[f"{name}_m"] = thread.pop(name)
        thread["middle_m"] = list(thread.pop("p_AoT"))
        thread["axis"] = list(thread["axis"])
    for decision in data["fragile"]:
        decision["margin_m"] = decision.pop("margin")
    data["motions"] = [_motion_to_dict(motion) for motion in evidence.motions]
    return data | {key: list(data[key]) for key in ("threads", "fragile", "remarks")}


def _motion_to_dict(motion: Motion) -> dict[str, Any]:
    freedom = motion.freedom
    return {
        "item": motion.item,
        "direction": list(freedom.direction),
        "travel_m": None if freedom.leaves else freedom.travel,
        "hits": freedom.hits,
    }


def evidence_from_dict(data: Mapping[str, Any]) -> Evidence:
    """Return the evidence that ``evidence_to_dict`` described."""
    return Evidence(
        data["tolerance_m"],
        data["declared"],
        tuple(_thread_from_dict(thread) for thread in data["threads"]),
        tuple(_fragile_from_dict(decision) for decision in data["fragile"]),
        tuple(data["remarks"]),
        tuple(_motion_from_dict(motion) for motion in data["motions"]),
    )


def _motion_from_dict(data: Mapping[str, Any]) -> Motion:
    x, y, z = data["direction"]
    travel = float("inf") if data["travel_m"] is None else data["travel_m"]
    return Motion(data["item"], Freedom((x, y, z), travel, data["hits"]))


def _thread_from_dict(data: Mapping[str, Any]) -> Thread:
    lengths = {name: data[f"{name}_m"] for name in ("diameter", "height", "length")}
    axis, middle = tuple(data["axis"]), tuple(data["middle_m"])
    return Thread(data["bolt"], data["nut"], axis, middle, **lengths)


def _fragile_from_dict(data: Mapping[str, Any]) -> Fragile:
    fields = {name: data[name] for name in ("part", "other", "direction", "value", "decides")}
    return Fragile(margin=data["margin_m"], **fields)


def evidence_text(evidence: Evidence) -> str:
    """Return the evidence in lines for a terminal."""
    source = "declared by the product" if evidence.declared else "by default"
    lines = [f"Tolerance {1e3 * evidence.tolerance:.3g} mm, {source}."]
    lines += [f"Note: {remark}" for remark in evidence.remarks]
    lines += [_thread_text(thread) for thread in evidence.threads]
    lines += [_fragile_text(decision) for decision in evidence.fragile if decision.decides]
    lines += [_motion_text(motion) for motion in evidence.motions]
    return "\n".join(lines)


def _vector_text(vector: Sequence[float]) -> str:
    x, y, z = (round(value, 6) + 0.0 for value in vector)  # Adding zero turns -0 into 0.
    return f"({x:.3g}, {y:.3g}, {z:.3g})"


def _motion_text(motion: Motion) -> str:
    along = f"{motion.item} along {_vector_text(motion.freedom.direction)}"
    if motion.freedom.leaves:
        return f"Free: {along} to infinity."
    return f"Local: {along} by {1e3 * motion.freedom.travel:.3g} mm, then {motion.freedom.hits}."


def _thread_text(thread: Thread) -> str:
    return (
        f"Fastener: {thread.bolt} in {thread.nut}, diameter {1e3 * thread.diameter:.3g} mm, "
        f"{1e3 * thread.length:.3g} mm engaged, axis {_vector_text(thread.axis)}."
    )


def _fragile_text(decision: Fragile) -> str:
    if decision.direction == "contact":
        what = "touch" if decision.value else "do not touch"
        claim = f"{decision.part} and {decision.other} {what}"
    else:
        what = "leaves" if decision.value else "does not leave"
        claim = f"{decision.part} {what} {decision.other} along {decision.direction}"
    return f"Warning: the plan hangs on {1e3 * decision.margin:.2g} mm of tolerance: {claim}."
