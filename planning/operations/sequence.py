"""From a fixing plan to the steps that carry it out.

Nothing here knows a product or an operation. The fixture holds the part that the plan says; when
the plan names another one, what stands on the fixture is set aside as a whole, and brought back to
the new one. The registry decides which operation takes a step.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from cell.products.product import Product
from planning.assembly_plan.planner import FixingPlan
from planning.feasibility.algorithm import FixingStep
from planning.feasibility.slanted import direction_label
from planning.operations.operation import NoOperation, Role, Scene, Step
from planning.operations.registry import OPERATIONS


def steps(product: Product, plan: FixingPlan) -> list[Step]:
    """Return the steps that carry out a feasible plan, in order.

    Raises:
        NoOperation: No operation makes a joint that is asked for, or fixes what is to be fixed.
    """
    if plan.subassemblies:
        names = ", ".join(built.name for built in plan.subassemblies)
        raise NoOperation(f"The plan builds {names} first; no operation builds a sub-assembly.")
    for planned in plan.steps:
        if not any(planned.directions.values()):
            way = direction_label(planned.leaves_along)
            raise NoOperation(
                f"{planned.item} is added along {way}; no operation comes at an angle."
            )
        if planned.posture[-1:] != product.up[-1]:
            raise NoOperation(
                f"{planned.item} leaves along {planned.posture}, and up is {product.up}: no "
                "operation comes from the side."
            )
    sequence = _Sequence(Scene(product))
    for planned in plan.steps:
        sequence.add(planned)
    return sequence.steps


@dataclass
class _Sequence:
    """The steps so far, and what stands on the fixture after them."""

    scene: Scene
    steps: list[Step] = field(default_factory=list)

    def add(self, planned: FixingStep) -> None:
        """Add the steps for one item of the plan."""
        standing = self.scene.standing
        if not standing:
            # Nothing is assembled yet: whatever is not fixed is brought.
            self._fix(planned.fixed_part)
            both = (*planned.target, *planned.incoming)
            self._bring(tuple(name for name in both if name != planned.fixed_part))
        elif planned.fixed_part != standing[0]:
            if not self._take(Role.REMOVE, standing[:1], standing[1:]):
                raise NoOperation(f"No operation takes '{standing[0]}' off the fixture.")
            self._fix(planned.fixed_part)
            self._bring(standing[:1], standing[1:])
        else:
            self._bring(planned.incoming)
        while self._take(Role.FINISH):
            pass

    def _fix(self, part: str) -> None:
        if not self._take(Role.FIX, (part,)):
            raise NoOperation(
                f"No operation fixes '{part}': the fixture can hold a part, not a group."
            )

    def _bring(self, parts: tuple[str, ...], riders: tuple[str, ...] = ()) -> None:
        """Bring parts in one step, or in one step each."""
        if self._take(Role.BRING, parts, riders):
            return
        for part in parts:
            if not self._take(Role.BRING, (part,), riders):
                kinds = {o.joint.__name__.lower(): o.name for o in OPERATIONS.values() if o.joint}
                known = ", ".join(f"{joint} by {name}" for joint, name in kinds.items())
                raise NoOperation(
                    f"No operation brings '{part}' to {', '.join(self.scene.standing)}: the "
                    f"product has no joint between them that an operation makes ({known})."
                )

    def _take(self, role: Role, parts: tuple[str, ...] = (), riders: tuple[str, ...] = ()) -> bool:
        """Take the step that the first operation of a role offers; return whether one does."""
        for operation in OPERATIONS.values():
            if operation.role is role:
                step = operation.plan(self.scene, parts, riders)
                if step is not None:
                    self.steps.append(step)
                    self.scene = self.scene.after(step)
                    return True
        return False
