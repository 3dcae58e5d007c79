"""Evidence behind the matrices, for the reader of a plan: tolerances, overlaps, margins, remarks.

A decision is fragile if changing the tolerance by less than ``FRAGILE`` of it (0.025 mm of the
usual 0.05) flips it. The plan depends on it if A(P_t, P_i) of some step then differs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cell.products.product import Product
from planning.feasibility.algorithm import FixingStep, Stop
from planning.feasibility.blocking import FRAGILE
from planning.feasibility.cad_threads import CadThread
from planning.feasibility.directions import opposite
from planning.feasibility.fitting import fitted_solids
from planning.feasibility.freedom import Freedom, freedoms
from planning.feasibility.matrices import AssemblyMatrices, reachable_directions
from planning.feasibility.overlaps import Overlap
from planning.feasibility.tolerance import Tolerances
from planning.feasibility.undercut import Undercut

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
        tolerances: Largest gap that counts as contact, and largest overlap that does not block.
        threads: Screw threads recognised in the meshes.
        overlaps: Other overlaps, with what explains them, deepest first.
        undercuts: What declared snap fits and flexible parts bend over.
        fragile: Decisions with a small margin, those that the plan depends on first.
        remarks: What was assumed or repaired while the product was read.
        motions: Local freedom and slanted removal directions, if they were requested.
    """

    tolerances: Tolerances
    threads: tuple[CadThread, ...]
    overlaps: tuple[Overlap, ...]
    undercuts: tuple[Undercut, ...]
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
        matrices.tolerances,
        matrices.threads,
        tuple(sorted(matrices.overlaps.others, key=lambda one: -one.depth)),
        matrices.undercuts,
        tuple(sorted(found, key=lambda f: (not f.decides, f.margin))),
        (*product.notes, *_idle(product, matrices), *_doubts(product.items(), matrices)),
        tuple(_item_freedoms(matrices, steps)) if slanted else (),
    )


def _item_freedoms(
    matrices: AssemblyMatrices, steps: Sequence[FixingStep | Stop]
) -> Iterator[ItemFreedom]:
    solids, _ = fitted_solids(matrices.solids, matrices.overlaps, matrices.tolerances)
    for step in steps:
        incoming, target = ([solids[name] for name in ns] for ns in (step.incoming, step.target))
        axes = [thread.axis for thread in matrices.threads if thread.bolt in step.incoming]
        for freedom in freedoms(incoming, target, matrices.tolerance, axes):
            yield ItemFreedom(step.item, freedom)


def _idle(product: Product, matrices: AssemblyMatrices) -> Iterator[str]:
    """Yield remarks on what was declared without effect."""
    overlapping = {frozenset((one.part, one.other)) for one in matrices.overlaps.others}
    bent = {frozenset((one.part, one.other)) for one in matrices.undercuts}
    declared = product.declared
    for kind, pairs, known, why in (
        ("accept", declared.accept, overlapping, "they do not overlap"),
        ("press", declared.press, overlapping, "they do not overlap"),
        (
            "snap",
            declared.snap,
            bent,
            "one leaves the other without bending, or would have to bend by more than a tenth of "
            "its size along each axis",
        ),
    ):
        for pair in sorted(sorted(pair) for pair in pairs - known):
            yield f"declared without effect: {kind} {','.join(pair)}, since {why}"
    for part in sorted(declared.flexible - {one.part for one in matrices.undercuts}):
        yield (
            f"declared without effect: flexible {part}, since it leaves without bending, or would "
            "have to stretch by more than a tenth of its size along each axis"
        )


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
    names = list(matrices.solids)
    limit = BELOW_CAP * FRAGILE * matrices.tolerances.contacts(names)
    found = []
    for i, k in np.argwhere(np.triu(matrices.contact_margin < limit, 1)):
        contact = matrices.contact.copy()
        contact[i, k] = 1 - contact[i, k]
        decides = _changes(matrices, steps, contact, matrices.interference.free)
        value, margin = int(matrices.contact[i, k]), float(matrices.contact_margin[i, k])
        found.append(FragileDecision(names[i], names[k], "contact", value, margin, decides))
    return found


def _fragile_motions(matrices: AssemblyMatrices, steps: StepIndices) -> list[FragileDecision]:
    names, leaving = list(matrices.solids), matrices.interference
    limit = BELOW_CAP * FRAGILE * matrices.tolerances.overlaps(names)
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
