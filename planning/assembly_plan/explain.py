"""A fixing plan as text for a terminal: the steps, the matrices, and why things are blocked."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from rich.markup import escape
from rich.table import Table

from planning.assembly_plan.order_search import AssemblyLine
from planning.assembly_plan.planner import FixingPlan
from planning.feasibility.algorithm import READING
from planning.feasibility.directions import DIRECTIONS, open_directions
from planning.feasibility.evidence_format import point_text
from planning.feasibility.interference import Blocker
from planning.feasibility.order import subassembly_name
from planning.feasibility.slanted import direction_label
from planning.ordering.advice_format import precedence_text

MOST_LISTED = 20  # Overlaps; the file holds all.


def step_table(line: AssemblyLine) -> Table:
    """Return a table of the steps: incoming item, A by direction, posture, fixed part and CoG.

    Names are folded where the terminal is too narrow for them; 80 columns do.
    """
    title = f"{line.name}: {', '.join(line.order)}"
    if line.steps:
        title += f"; {line.steps[0].up} up"
    table = Table(title=escape(title), title_justify="left")
    table.add_column("", justify="right")
    table.add_column("incoming", overflow="fold")
    table.add_column(" ".join(DIRECTIONS), no_wrap=True)
    table.add_column("posture / fixed", overflow="fold")
    table.add_column(escape("CoG [mm]"), justify="right", no_wrap=True)
    for number, step in enumerate(line.steps, start=1):
        digits = "  ".join(f"{step.directions[j]:>1}" for j in DIRECTIONS)
        chosen = f"{step.posture} / {step.fixed_part}"
        if step.slanted:
            chosen += f", along {direction_label(step.leaves_along)}"
        height = f"{1e3 * step.cog_height:.1f}"
        table.add_row(str(number), escape(step.item), f" {digits}", escape(chosen), height)
    return table


def stop_text(plan: FixingPlan) -> str:
    """Return what is not planned and why, with the evidence for each direction; "" if all is."""
    lines = [f"Not planned: {item.name} {item.reason}." for item in plan.unplanned]
    if plan.likely_cause:
        lines.append(f"Likely cause: {plan.likely_cause}.")
    if plan.stop is None:
        return "\n".join(lines)
    stop, target = plan.stop, subassembly_name(plan.order[: len(plan.steps) + 1])
    lines.append(f"Infeasible: {stop.item} cannot be added to {target}: {stop.reason}.")
    lines += [f"  {blocker_text(blocker)}" for blocker in stop.blockers]
    if stop.blockers:
        pair = f"{stop.blockers[0].moving},{stop.blockers[0].staying}"
        lines.append(
            f"Parts count as rigid. What bends or stretches can be declared: --snap {pair} for a "
            "snap fit, --flexible PART for a belt or a gasket."
        )
    return "\n".join(lines)


def overlap_text(plan: FixingPlan) -> str:
    """Return the overlaps that are not declared, deepest first; "" if there are none."""
    if not plan.overlaps:
        return ""
    pairs = "pair overlaps" if len(plan.overlaps) == 1 else "pairs overlap"
    lines = [f"{len(plan.overlaps)} {pairs}, other than in a thread:"]
    lines += [
        f"  {one.part}, {one.other}: {1e3 * one.depth:.3g} mm deep at {point_text(one.p_AoD)}, "
        f"{1e9 * one.volume:.3g} mm3{', a press fit by its shape' if one.press_fit else ''}"
        for one in plan.overlaps[:MOST_LISTED]
    ]
    more = len(plan.overlaps) - MOST_LISTED
    lines += [f"  ... and {more} more in plan.json"] if more > 0 else []
    fit = next((one for one in plan.overlaps if one.press_fit), plan.overlaps[0])
    first = plan.overlaps[0]
    lines.append(
        "Correct poses or shapes, or declare what is meant: "
        f"--press {fit.part},{fit.other} for a press fit, "
        f"--accept {first.part},{first.other} to ignore it, --accept all to ignore all of them."
    )
    return "\n".join(lines)


def blocker_text(blocker: Blocker) -> str:
    """Return one blocked motion as a sentence; the point is in the product frame."""
    return (
        f"{blocker.direction}: {blocker.moving} hits {blocker.staying} at "
        f"{point_text(blocker.p_AoQ)} after {1e3 * blocker.travel:.2f} mm"
    )


def explanation(plan: FixingPlan) -> str:
    """Return the basis of the plan: matrices, A lists, reasons, and all blocked pairs."""
    part, direction = plan.parts.index, DIRECTIONS.index
    blockers = sorted(
        plan.blockers, key=lambda b: (part(b.moving), part(b.staying), direction(b.direction))
    )
    sections = [
        "Contact C:\n" + matrix_text(plan.parts, plan.contact),
        "Interference-free M_j: 1 = the row's part leaves the column's part along j",
        *(f"M_{j}:\n" + matrix_text(plan.parts, plan.free[j]) for j in DIRECTIONS),
        "Reachable W_j = (C + C^T) * M_j",
        *(f"W_{j}:\n" + matrix_text(plan.parts, plan.reachable[j]) for j in DIRECTIONS),
        *([precedence_text(plan.orders)] if plan.orders and plan.orders.ranked else []),
        "Steps:\n" + "\n".join(text for line in plan.lines for text in step_texts(line)),
        "Reading: " + READING,
        "Blocked, with a point of the stationary part, in the product frame:\n"
        + "\n".join("  " + blocker_text(blocker) for blocker in blockers),
    ]
    return "\n\n".join(sections)


def step_texts(line: AssemblyLine) -> list[str]:
    """Return each step's A list and reason."""
    return [
        f"  A({subassembly_name(line.order[: number + 1])}; {step.item}): "
        f"{', '.join([*open_directions(step.directions), *map(direction_label, step.slanted)])}. "
        f"{step.reason}"
        for number, step in enumerate(line.steps)
    ]


def matrix_text(names: Iterable[str], matrix: np.ndarray) -> str:
    """Return a 0/1 matrix with its row names; the columns are in the same order."""
    names = list(names)
    width = max(map(len, names))
    rows = zip(names, matrix, strict=True)
    return "\n".join(f"  {name:{width}}  {' '.join(map(str, row))}" for name, row in rows)
