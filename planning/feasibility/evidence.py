"""Evidence behind the matrices, for the reader of a plan: tolerance, threads, margins, remarks.

A decision is fragile if changing the tolerance by less than ``FRAGILE`` of it (0.025 mm of the
usual 0.05) flips it. The plan depends on it if A(P_t, P_i) of some step then differs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cell.products.product import Product
from planning.feasibility.algorithm import FixingStep, Stop
from planning.feasibility.blocking import FRAGILE
from planning.feasibility.cad_threads import CadThread
from planning.feasibility.directions import opposite
from planning.feasibility.freedom import Freedom, freedoms
from planning.feasibility.helical_threads import unthreaded
from planning.feasibility.matrices import AssemblyMatrices, reachable_directions

StepIndices = Sequence[tuple[list[int], list[int]]]
"""Matrix indices of target and incoming parts, for each step."""

BELOW_CAP = (
    1.0 - 1e-9
)  # Margins are capped at FRAGILE times the tolerance; those below are fragile.


@dataclass(frozen=True)
class FragileDecision:
    """A decision that a slightly different tolerance would flip.

    Attributes:
        part: Name of the moving part, or of one of two that touch.
        other: Name of the stationary part, or of the other.
        direction: "+x" ... "-z" of the motion; "contact" for an entry of C.
        value: The entry as it is, 0 or 1.
        margin: Lower bound of the change of tolerance at which it flips [m].
        decides: Whether A(P_t, P_i) of some step of the plan would change with it.
    """

    part: str
    other: str
    direction: str
    value: int
    margin: float
    decides: bool


@dataclass(frozen=True)
class ItemFreedom:
    """One way in which the parts of an item can move in the step in which it is added.

    Attributes:
        item: Of the order.
        freedom: Direction, travel, and the part that is hit.
    """

    item: str
    freedom: Freedom


@dataclass(frozen=True)
class Evidence:
    """What the matrices of a plan are based on.

    Attributes:
        tolerance: Largest gap that counts as contact and largest overlap that does not block [m].
        declared: Whether the product declares it; else it was derived.
        threads: Screw threads recognised in the meshes.
        fragile: Decisions with a small margin, those that the plan depends on first.
        remarks: What was assumed or repaired while the product was read.
        motions: Local freedom and slanted removal directions, if they were requested.
    """

    tolerance: float
    declared: bool
    threads: tuple[CadThread, ...]
    fragile: tuple[FragileDecision, ...]
    remarks: tuple[str, ...]
    motions: tuple[ItemFreedom, ...] = ()


def evidence_of(
    product: Product,
    matrices: AssemblyMatrices,
    steps: Sequence[FixingStep | Stop],
    *,
    slanted: bool,
) -> Evidence:
    """Collect the evidence behind a plan.

    Args:
        product: The planned product.
        matrices: Its matrices.
        steps: The plan's steps, including the one at which it stopped.
        slanted: Whether to search for local freedom and slanted removal directions as well.
    """
    indices = [(matrices.indices(step.target), matrices.indices(step.incoming)) for step in steps]
    found = [*_fragile_contacts(matrices, indices), *_fragile_motions(matrices, indices)]
    return Evidence(
        matrices.tolerance,
        product.contact_tolerance == matrices.tolerance,
        matrices.threads,
        tuple(sorted(found, key=lambda f: (not f.decides, f.margin))),
        (*product.remarks, *_doubts(product.items(), matrices)),
        tuple(_item_freedoms(matrices, steps)) if slanted else (),
    )


def _item_freedoms(
    matrices: AssemblyMatrices, steps: Sequence[FixingStep | Stop]
) -> Iterator[ItemFreedom]:
    solids = dict(matrices.solids)
    for thread in matrices.threads:
        bolt = matrices.solids[thread.bolt]
        solids[thread.nut] = unthreaded(solids[thread.nut], bolt, thread)
    for step in steps:
        incoming, target = ([solids[name] for name in ns] for ns in (step.incoming, step.target))
        axes = [thread.axis for thread in matrices.threads if thread.bolt in step.incoming]
        for freedom in freedoms(incoming, target, matrices.tolerance, axes):
            yield ItemFreedom(step.item, freedom)


def _doubts(items: Sequence[str], matrices: AssemblyMatrices) -> list[str]:
    """Return remarks on input that is valid but probably unintended."""
    names = list(matrices.solids)
    if len(items) == 1:
        kind = "part" if len(names) == 1 else "item"
        return [f"'{items[0]}' is the only {kind}: there is nothing to assemble"]
    touching = matrices.contact + matrices.contact.T
    alone = [name for name, row in zip(names, touching, strict=True) if not row.any()]
    touch = "touches" if len(alone) == 1 else "touch"
    return [f"{', '.join(alone)} {touch} no other part"] if alone else []


def _fragile_contacts(matrices: AssemblyMatrices, steps: StepIndices) -> list[FragileDecision]:
    names, limit = list(matrices.solids), BELOW_CAP * FRAGILE * matrices.tolerance
    found = []
    for i, k in np.argwhere(np.triu(matrices.contact_margin < limit, 1)):
        contact = matrices.contact.copy()
        contact[i, k] = 1 - contact[i, k]
        decides = _changes(matrices, steps, contact, matrices.interference.free)
        value, margin = int(matrices.contact[i, k]), float(matrices.contact_margin[i, k])
        found.append(FragileDecision(names[i], names[k], "contact", value, margin, decides))
    return found


def _fragile_motions(matrices: AssemblyMatrices, steps: StepIndices) -> list[FragileDecision]:
    names, limit = list(matrices.solids), BELOW_CAP * FRAGILE * matrices.tolerance
    leaving = matrices.interference
    found = []
    for j in ("+x", "+y", "+z"):
        for i, k in np.argwhere(leaving.margin[j] < limit):
            free = dict(leaving.free)
            for d, row, column in ((j, i, k), (opposite(j), k, i)):
                free[d] = free[d].copy()
                free[d][row, column] = 1 - free[d][row, column]
            decides = _changes(matrices, steps, matrices.contact, free)
            value, margin = int(leaving.free[j][i, k]), float(leaving.margin[j][i, k])
            found.append(FragileDecision(names[i], names[k], j, value, margin, decides))
    return found


def _changes(
    matrices: AssemblyMatrices,
    steps: StepIndices,
    contact: np.ndarray,
    free: Mapping[str, np.ndarray],
) -> bool:
    """Return whether other C and M_j give another A(P_t, P_i) in some step."""
    now = matrices.contact, matrices.interference.free
    return any(
        reachable_directions(contact, free, *indices) != reachable_directions(*now, *indices)
        for indices in steps
    )


def evidence_to_dict(evidence: Evidence) -> dict[str, Any]:
    """Return the evidence as plain lists, numbers and strings; lengths in metres."""
    data: dict[str, Any] = asdict(evidence)
    data["tolerance_m"] = data["tolerance"]
    del data["tolerance"]
    for thread in data["threads"]:
        for name in ("diameter", "height", "length"):
            thread[f"{name}_m"] = thread.pop(name)
        thread["pitch_m"] = thread.pop("pitch")
        thread["middle_m"] = list(thread.pop("p_AoT"))
        thread["axis"] = list(thread["axis"])
    for decision in data["fragile"]:
        decision["margin_m"] = decision.pop("margin")
    data["motions"] = [
        {
            "item": motion.item,
            "direction": list(motion.freedom.direction),
            "travel_m": None if motion.freedom.leaves else motion.freedom.travel,
            "hits": motion.freedom.hits,
        }
        for motion in evidence.motions
    ]
    return data | {key: list(data[key]) for key in ("threads", "fragile", "remarks")}


def evidence_from_dict(data: Mapping[str, Any]) -> Evidence:
    """Return the evidence that ``evidence_to_dict`` described."""
    threads = [
        CadThread(
            bolt=thread["bolt"],
            nut=thread["nut"],
            axis=tuple(thread["axis"]),
            p_AoT=tuple(thread["middle_m"]),
            diameter=thread["diameter_m"],
            height=thread["height_m"],
            length=thread["length_m"],
            pitch=thread["pitch_m"],
            starts=thread["starts"],
            both_ways=thread["both_ways"],
        )
        for thread in data["threads"]
    ]
    names = ("part", "other", "direction", "value", "decides")
    fragile = [
        FragileDecision(margin=decision["margin_m"], **{name: decision[name] for name in names})
        for decision in data["fragile"]
    ]
    motions = []
    for motion in data["motions"]:
        x, y, z = motion["direction"]
        travel = float("inf") if motion["travel_m"] is None else motion["travel_m"]
        motions.append(ItemFreedom(motion["item"], Freedom((x, y, z), travel, motion["hits"])))
    return Evidence(
        data["tolerance_m"],
        data["declared"],
        tuple(threads),
        tuple(fragile),
        tuple(data["remarks"]),
        tuple(motions),
    )


def evidence_text(evidence: Evidence) -> str:
    """Return the evidence in lines for a terminal."""
    source = "declared by the product" if evidence.declared else "by default"
    lines = [f"Tolerance {1e3 * evidence.tolerance:.3g} mm, {source}."]
    lines += [f"Note: {remark}" for remark in evidence.remarks]
    lines += [_thread_text(thread) for thread in evidence.threads]
    lines += [_fragile_text(decision) for decision in evidence.fragile if decision.decides]
    for motion in evidence.motions:
        along = f"{motion.item} along {_vector_text(motion.freedom.direction)}"
        travel = f"{1e3 * motion.freedom.travel:.3g} mm, then {motion.freedom.hits}"
        leaves = motion.freedom.leaves
        lines.append(f"Free: {along} to infinity." if leaves else f"Local: {along} by {travel}.")
    return "\n".join(lines)


def _thread_text(thread: CadThread) -> str:
    text = f"Fastener: {thread.bolt} in {thread.nut}, diameter {1e3 * thread.diameter:.3g} mm"
    if thread.pitch is not None:
        hand = "left-hand" if thread.pitch < 0.0 else "right-hand"
        starts = f" with {thread.starts} starts" if thread.starts > 1 else ""
        text += f", pitch {1e3 * abs(thread.pitch):.3g} mm {hand}{starts}"
    text += f", {1e3 * thread.length:.3g} mm engaged, axis {_vector_text(thread.axis)}"
    return text + ("." if thread.pitch is None else ", free along its axis by turning.")


def _vector_text(vector: Sequence[float]) -> str:
    x, y, z = (round(value, 6) + 0.0 for value in vector)  # Adding zero turns -0 into 0.
    return f"({x:.3g}, {y:.3g}, {z:.3g})"


def _fragile_text(decision: FragileDecision) -> str:
    if decision.direction == "contact":
        what = "touch" if decision.value else "do not touch"
        claim = f"{decision.part} and {decision.other} {what}"
    else:
        what = "leaves" if decision.value else "does not leave"
        claim = f"{decision.part} {what} {decision.other} along {decision.direction}"
    return f"Warning: the plan depends on {1e3 * decision.margin:.2g} mm of tolerance: {claim}."
