"""The general rule: which body the jig should hold in which posture, scored and explained.

Algorithm 1 asks what can reach what, and for a low centre of gravity. A user wants to know more: so
beside it every step's candidates are looked at one by one. The body on the jig is the target or the
incoming item, and each of the six axes of the product may point up. A candidate that fails a test
is rejected with the reason; the others are scored from 0 to 1 by ``CRITERIA`` and ranked by the
mean. Equal weights: no source says otherwise, and the table shows them all.
"""

from __future__ import annotations

from collections.abc import Sequence

from cell.products.product import Product
from planning.assembly_plan.planner import FixingPlan
from planning.feasibility.algorithm import FixingStep
from planning.feasibility.directions import DIRECTIONS, open_directions, opposite
from planning.feasibility.order import together
from planning.fixture_analysis.candidate import Candidate, Choice, Setup
from planning.fixture_analysis.examine import Examiner, Trial


def general_rule(product: Product, fixing: FixingPlan, setup: Setup) -> tuple[Choice, ...]:
    """Weigh the candidates of every step of a plan.

    Args:
        product: With grasps, fits and fasteners as far as they are known.
        fixing: Its plan, made now and not read from a file: the order, what Algorithm 1 chose, and
            the geometry.
        setup: The cell.
    """
    assert fixing.geometry is not None
    examiner = Examiner(product, fixing.geometry, setup)
    return tuple(
        _choice(examiner, step, fixing.order[: number + 1])
        for number, step in enumerate(fixing.steps)
    )


def _choice(examiner: Examiner, step: FixingStep, there: tuple[str, ...]) -> Choice:
    """Weigh the candidates of one step, before which some items of the order are there."""
    bare, assembled = len(there) == 1, together(there)
    leaving = open_directions(step.directions)
    arriving = [opposite(j) for j in leaving]
    trials = [
        Trial(
            name,
            body,
            moved,
            directions,
            up,
            not bare and name == assembled and up == step.up,
            bare,
        )
        for name, body, moved, directions in (
            (assembled, step.target, step.incoming, leaving),
            (step.item, step.incoming, step.target, arriving),
        )
        for up in DIRECTIONS
    ]
    examined = [examiner.examine(trial) for trial in trials]
    ranked = sorted(examined, key=lambda c: (bool(c.rejected), -c.score))
    body = step.incoming if step.posture == opposite(step.up) else step.target
    paper = next(k for k, c in enumerate(ranked) if c.body == body and c.up == step.up)
    return Choice(step.item, tuple(ranked), paper, _verdict(ranked, paper))


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
