"""From a fixing plan to operations: which of them, on which parts, in which order.

Nothing here knows a product. The jig holds the part that the plan says; when the plan names another
one, what stands on the jig is set aside as a whole, and brought back to the new one. Bolts whose
thread is not there yet are put loose into the holes of the part that they will clamp; they ride
along with it and are tightened as soon as their thread is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from cell.errors import CellError
from cell.products.product import Fit, Product
from planning.assembly_plan.planner import FixingPlan
from planning.feasibility.algorithm import FixingStep


class NoOperation(CellError):
    """A step of a plan that none of the operations can carry out."""


@dataclass(frozen=True)
class Operation:
    """One step of the assembly.

    Attributes:
        name: For example "insert plate".
        kind: "pick_place", "set_aside", "insert_shaft", "place_bolts", "place_loose_bolts" or
            "tighten_bolts".
        parts: What it moves.
        fit: Of "insert_shaft": which shaft, which hole.
        riders: Parts that lie loose on what it moves, and come along.
    """

    name: str
    kind: str
    parts: tuple[str, ...]
    fit: Fit | None = None
    riders: tuple[str, ...] = ()


def operations(product: Product, plan: FixingPlan) -> list[Operation]:
    """Return the operations that carry out a feasible plan, in order.

    Raises:
        NoOperation: A step that is neither a fit nor fastening, or something other than a part
            that is to be fixed on the jig.
    """
    schedule = _Schedule(product)
    for step in plan.steps:
        schedule.add(step)
    return schedule.result


def fixed_after(product: Product, fixed: tuple[str, ...], operation: Operation) -> tuple[str, ...]:
    """Return what the jig holds, bolts apart, after an operation; ``fixed``: before it."""
    if operation.kind == "pick_place":
        return operation.parts
    if operation.kind == "set_aside":
        return ()
    if operation.kind == "insert_shaft":
        riders = [name for name in operation.riders if name not in product.fasteners]
        return (*fixed, *operation.parts, *riders)
    return fixed


@dataclass
class _Schedule:
    """The operations so far, and what the jig holds after them.

    Attributes:
        product: Fits and fasteners.
        result: The operations.
        on_jig: What stands on the jig, the part that it holds first.
        loose: Bolts that are not tightened yet.
    """

    product: Product
    result: list[Operation] = field(default_factory=list)
    on_jig: tuple[str, ...] = ()
    loose: tuple[str, ...] = ()

    def add(self, step: FixingStep) -> None:
        """Add the operations of one step of the plan."""
        if not self.on_jig:
            # Nothing is assembled yet: whatever is not fixed is brought.
            self._fix(step.fixed_part)
            both = (*step.target, *step.incoming)
            self._bring(tuple(name for name in both if name != step.fixed_part))
        elif step.fixed_part != self.on_jig[0]:
            moved, riders = self.on_jig[0], self.on_jig[1:]
            self.result.append(Operation(f"set aside {moved}", "set_aside", (moved,), None, riders))
            self._fix(step.fixed_part)
            self._insert(moved, riders)
        else:
            self._bring(step.incoming)
        self._tighten()

    def _fix(self, part: str) -> None:
        if part not in self.product.parts:
            raise NoOperation(f"The plan fixes '{part}': the jig can hold a part, not a group.")
        self.result.append(Operation(f"place {part}", "pick_place", (part,)))
        self.on_jig = (part,)

    def _bring(self, incoming: tuple[str, ...]) -> None:
        if all(name in self.product.fasteners for name in incoming):
            self._place_bolts(incoming)
        else:
            for name in incoming:
                self._insert(name)

    def _insert(self, part: str, riders: tuple[str, ...] = ()) -> None:
        fits = self.product.fits
        found = [fit for fit in fits if fit.hole == part and fit.shaft in self.on_jig]
        if not found:
            raise NoOperation(
                f"No operation brings '{part}' to {', '.join(self.on_jig)}: it is neither a "
                f"fastener nor the hole of a fit. "
                f"Fits: {', '.join(fit.hole for fit in fits) or 'none'}."
            )
        name = f"insert {part}"
        self.result.append(Operation(name, "insert_shaft", (part,), found[0], riders))
        self.on_jig += (part, *riders)

    def _place_bolts(self, bolts: tuple[str, ...]) -> None:
        fasteners = [self.product.fasteners[bolt] for bolt in bolts]
        for fastener in fasteners:
            if fastener.clamps not in self.on_jig:
                raise NoOperation(
                    f"No operation brings '{fastener.part}' to {', '.join(self.on_jig)}: what it "
                    f"clamps, '{fastener.clamps}', is not there yet."
                )
        threads = all(fastener.into in self.on_jig for fastener in fasteners)
        kind = "place_bolts" if threads else "place_loose_bolts"
        self.result.append(Operation("place bolts", kind, bolts))
        self.on_jig += bolts
        self.loose += bolts

    def _tighten(self) -> None:
        fasteners = self.product.fasteners
        ready = tuple(bolt for bolt in self.loose if fasteners[bolt].into in self.on_jig)
        if ready:
            self.result.append(Operation("tighten bolts", "tighten_bolts", ready))
            self.loose = tuple(bolt for bolt in self.loose if bolt not in ready)
