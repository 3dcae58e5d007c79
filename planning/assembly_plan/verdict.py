"""The verdict on a plan: feasible, feasible by geometry only, or infeasible, in a sentence.

Geometry and jig are two questions. A plan whose parts all come together may still have no step
with a posture that the jig can hold: it cannot be carried out, and must not look as if it could.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from planning.assembly_plan.planner import FixingPlan
from planning.fixture_analysis.candidate import Choice


@dataclass(frozen=True)
class Verdict:
    """What a plan is worth.

    Attributes:
        feasible: Whether all items are in the order and can be added: exit code 0.
        held: Whether the general rule accepts a posture in at least one step, or there is no step.
        text: One sentence.
    """

    feasible: bool
    held: bool
    text: str

    @property
    def good(self) -> bool:
        """Whether the plan is feasible, and the jig can hold something of it."""
        return self.feasible and self.held


def verdict_of(plan: FixingPlan, choices: Sequence[Choice]) -> Verdict:
    """Return the verdict on a plan.

    Args:
        plan: The plan.
        choices: The general rule's ranking of the candidates of each step, with those of
            sub-assemblies.
    """
    held = not choices or any(choice.best for choice in choices)
    if not plan.feasible:
        return Verdict(False, held, "infeasible: " + _why_not(plan))
    if not held:
        text = "feasible by geometry, but no step has a posture that this jig can hold: "
        return Verdict(True, False, text + _why_not_held(choices))
    unheld = [choice.item for choice in choices if not choice.best]
    if unheld:
        return Verdict(
            True, True, f"feasible; no posture that this jig can hold for {', '.join(unheld)}"
        )
    return Verdict(True, True, "feasible")


def _why_not(plan: FixingPlan) -> str:
    reasons = [f"{item.name} {item.reason}" for item in plan.unplanned]
    reasons += [plan.stop.reason] if plan.stop else []
    reasons += [plan.likely_cause] if plan.likely_cause else []
    return "; ".join(reasons)


def _why_not_held(choices: Sequence[Choice]) -> str:
    """Return the reason that rejects the postures of Algorithm 1, most often given first."""
    reasons = Counter(choice.candidates[choice.paper].rejected for choice in choices)
    return reasons.most_common(1)[0][0]
