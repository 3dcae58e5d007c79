"""What the cell does after each step of its plant: the one line that a caller's program needs.

    simulator.set_monitor(cell.monitor)

Drake's own systems cannot replace geometry or switch constraints; a monitor can. It is called by
the `Simulator` after every step with the Context that was stepped, advances the fixture and the
threads there once per step of the plant, and remembers in that Context how far it has come. A cell
that is stepped without it fails with an error that says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from pydrake.systems.framework import Context, EventStatus, LeafSystem

from cell.errors import InputError


class Stepper(Protocol):
    """Something that is advanced after each step of the plant."""

    def step(self, root: Context, dt: float) -> None:
        """Advance by one step of `dt` [s] in a Context of the diagram."""


class StepCounter(LeafSystem):
    """Remembers in the Context how many plant steps the monitor has seen, -1 before the first call.

    Args:
        time_step: Of the plant [s].
    """

    def __init__(self, time_step: float) -> None:
        super().__init__()
        self.time_step = time_step
        self.DeclareDiscreteState([-1.0])
        self.DeclarePerStepPublishEvent(self._check)

    def steps_at(self, context: Context) -> int:
        """Return the number of whole plant steps up to a Context's time."""
        return int(context.get_time() / self.time_step + 1e-6)

    def seen(self, root: Context) -> int:
        """Return how many steps the monitor has seen."""
        return int(self.GetMyContextFromRoot(root).get_discrete_state(0).value()[0])

    def set_seen(self, root: Context, steps: int) -> None:
        """Remember how many steps the monitor has seen."""
        self.GetMyMutableContextFromRoot(root).SetDiscreteState(0, [float(steps)])

    def _check(self, context: Context) -> None:
        if self.steps_at(context) > int(context.get_discrete_state(0).value()[0]) + 1:
            raise InputError(
                "The cell is stepped without its monitor: neither fixture nor threads would work. "
                "Call simulator.set_monitor(cell.monitor) before the first step."
            )


class Monitor:
    """Advances steppers after each step of the plant.

    Args:
        counter: In the same diagram.
        reset: Puts a new Context into its initial state.
        steppers: In the order in which they are advanced.
    """

    def __init__(
        self, counter: StepCounter, reset: Callable[[Context], None], steppers: Sequence[Stepper]
    ) -> None:
        self.counter, self._reset, self._steppers = counter, reset, tuple(steppers)

    def __call__(self, root: Context) -> EventStatus:
        """Advance, if the plant has been stepped since the last call."""
        counter = self.counter
        self.initialize(root)
        if counter.steps_at(root) <= counter.seen(root):
            return EventStatus.DidNothing()
        counter.set_seen(root, counter.steps_at(root))
        for stepper in self._steppers:
            stepper.step(root, counter.time_step)
        return EventStatus.Succeeded()

    def initialize(self, root: Context) -> None:
        """Put a Context into its initial state, unless that was done before.

        `Simulator.Initialize` does it through the monitor; call it yourself before the first
        command to a Context that has no simulator yet.
        """
        if self.counter.seen(root) < 0:
            self._reset(root)
            self.counter.set_seen(root, self.counter.steps_at(root))
