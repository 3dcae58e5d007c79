"""The general rule: which body the jig should hold in which posture, scored and explained.

Algorithm 1 considers what can reach what, and a low centre of gravity. Other properties matter as
well, so every step's candidates are evaluated in addition, one by one. The body on the jig is the
target or the incoming item, and each of the six axes of the product may point up. A candidate that
fails a test is rejected with the reason; the others are scored from 0 to 1 by ``CRITERIA`` and
ranked by the mean. The weights are equal, since no source justifies others; the table shows every
score.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np

from cell.fixtures import FixtureError
from cell.products.product import Product
from planning.feasibility.algorithm import FixingStep
from planning.feasibility.directions import DIRECTIONS, open_directions, opposite
from planning.feasibility.matrices import AssemblyMatrices
from planning.feasibility.order import subassembly_name
from planning.fixture_analysis.candidate import (
    CRITERIA,
    Candidate,
    Choice,
    FixtureSetup,
    Proposal,
)
from planning.fixture_analysis.evaluator import Evaluator


def general_rule(
    product: Product,
    order: tuple[str, ...],
    steps: Sequence[FixingStep],
    matrices: AssemblyMatrices,
    setup: FixtureSetup,
) -> tuple[Choice, ...]:
    """Evaluate and rank the candidates of every step of a plan.

    Args:
        product: With grasps, fits and screws as far as they are known.
        order: Items in the order of assembly.
        steps: What Algorithm 1 chose for this order.
        matrices: Of the product.
        setup: The cell's jig, forces and gripper.
    """
    evaluator = Evaluator(product, matrices, setup)
    return tuple(_ranked(evaluator, step, order[: number + 1]) for number, step in enumerate(steps))


def _ranked(evaluator: Evaluator, step: FixingStep, assembled: tuple[str, ...]) -> Choice:
    """Rank the candidates of one step, given the items assembled before it."""
    empty, target_name = len(assembled) == 1, subassembly_name(assembled)
    leaving = open_directions(step.directions)
    arriving = [opposite(j) for j in leaving]
    slanted = [np.array(way) for way in step.slanted]
    proposals = [
        Proposal(
            name,
            body,
            moved,
            directions,
            up,
            held=not empty and name == target_name and up == step.up,
            empty=empty,
            slanted=[tuple(sign * way) for way in slanted],
        )
        for name, body, moved, directions, sign in (
            (target_name, step.target, step.incoming, leaving, 1.0),
            (step.item, step.incoming, step.target, arriving, -1.0),
        )
        for up in DIRECTIONS
    ]
    body = step.incoming if step.posture == opposite(step.up) else step.target
    ranked = _judged(evaluator, proposals, (body, step.up))
    paper = next(k for k, c in enumerate(ranked) if c.body == body and c.up == step.up)
    chosen = ranked[paper]
    judged = evaluator.judged.get((chosen.body, chosen.moved, chosen.up))
    return Choice(step.item, tuple(ranked), paper, _verdict(ranked, paper), judged)


def _judged(
    evaluator: Evaluator, proposals: Sequence[Proposal], chosen: tuple[tuple[str, ...], str]
) -> list[Candidate]:
    """Return the candidates ranked, the best and Algorithm 1's choice judged by the holding map.

    On fixtures that are made for a part the map has judged all of them. On the soft jig the formula
    ranks them first. What it puts first is judged by the map, which takes a
    hundred times as long, until one that was judged stays first. Parts without a model, which no
    cell can hold, stay with the formula.

    Args:
        evaluator: Of the plan.
        proposals: All candidates of a step.
        chosen: Body and posture of Algorithm 1's choice.
    """
    found = {number: evaluator.evaluate(proposal) for number, proposal in enumerate(proposals)}
    if evaluator.setup.custom is not None:
        return sorted(found.values(), key=lambda one: (bool(one.rejected), -one.score))
    models = {name for name, part in evaluator.product.parts.items() if part.model is not None}
    formula = {
        number
        for number, candidate in found.items()
        if "bears_across_N" in candidate.figures and set(candidate.body) <= models
    }

    def order(number: int) -> tuple[bool, float]:
        return bool(found[number].rejected), -found[number].score

    first = [k for k in formula if (proposals[k].body, proposals[k].up) == chosen]
    while first:
        number = first.pop()
        formula.discard(number)
        with suppress(FixtureError):  # What no jig can hold stays with the formula.
            found[number] = evaluator.evaluate(proposals[number], mapped=True)
        best = min(found, key=order)
        first += [best] if best in formula and not first else []
    return [found[number] for number in sorted(found, key=order)]


def _verdict(ranked: Sequence[Candidate], paper: int) -> str:
    chosen, best = ranked[paper], ranked[0]
    if best.rejected:
        return f"No candidate passes; Algorithm 1 takes {chosen.label}: {chosen.rejected}."
    if paper == 0:
        return f"Both rules take {best.label} (score {best.score:.2f})."
    if chosen.rejected:
        why = f"which the general rule rejects: {chosen.rejected}"
    else:
        gains = {name: best.scores[name] - chosen.scores[name] for name in best.scores}
        most = max(gains, key=gains.__getitem__)
        why = (
            f"score {chosen.score:.2f}; the difference is largest in {most} "
            f"({best.scores[most]:.2f} against {chosen.scores[most]:.2f})"
        )
    return (
        f"The rules disagree: the general rule prefers {best.label} (score {best.score:.2f}), "
        f"Algorithm 1 takes {chosen.label}, {why}."
    )


def choices_to_list(choices: Sequence[Choice]) -> list[dict[str, Any]]:
    """Return plain lists, numbers and strings, one entry per step; SI units in the names."""
    return [
        {
            "item": choice.item,
            "agrees": choice.agrees,
            "verdict": choice.verdict,
            "algorithm_1": choice.paper,
            "candidates": [_to_dict(candidate) for candidate in choice.candidates],
        }
        for choice in choices
    ]


def _to_dict(candidate: Candidate) -> dict[str, Any]:
    data: dict[str, Any] = asdict(candidate)
    for key in ("body", "moved", "notes"):
        data[key] = list(data[key])
    for key in ("figures", "scores"):
        data[key] = {name: float(value) for name, value in data[key].items()}
    return data | {"score": candidate.score}


def choices_text(choices: Sequence[Choice]) -> str:
    """Return every candidate with its score or the reason against it, for a terminal."""
    meaning = "; ".join(f"{name}: {text}" for name, text in CRITERIA.items())
    lines = [f"  Scores from 0 to 1: {meaning}."]
    for choice in choices:
        lines.append(f"  {choice.item}: {choice.verdict}")
        for candidate in choice.candidates:
            if candidate.rejected:
                lines.append(f"    {candidate.label}: no, {candidate.rejected}")
                continue
            scores = ", ".join(f"{name} {value:.2f}" for name, value in candidate.scores.items())
            notes = "".join(f"; {note}" for note in candidate.notes)
            lines.append(f"    {candidate.label}: {candidate.score:.2f} ({scores}){notes}")
    return "\n".join(lines)
