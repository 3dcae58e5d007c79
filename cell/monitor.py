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

from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from cell.errors import InputError


class Stepper(Protocol):
    """Something that is advanced after each step of the plant."""

    def step(self, root: Context, dt: float) -> None:
        """Advance by one step of `dt` [s] in a Context of the diagram."""


class StepCounter(LeafSystem):
    """Remembers in the Context how many plant steps the monitor has seen, and whether it ever came.

    `Simulator.Initialize` lets the count begin anew at the Context's time, whatever that is.

    Args:
        time_step: Of the plant [s].
    """

    def __init__(self, time_step: float) -> None:
        super().__init__()
        self.time_step = time_step
        self._seen = self.DeclareDiscreteState([0.0])
        self._ready = self.DeclareDiscreteState([0.0])  # 1 after the monitor's first call.
        self.DeclareInitializationDiscreteUpdateEvent(self._begin)
        self.DeclarePerStepPublishEvent(self._check)

    def steps_at(self, context: Context) -> int:
        """Return the number of plant steps up to a Context's time; the first one begins at 0 s."""
        return int(max(context.get_time(), 0.0) / self.time_step + 1e-6)

    def seen(self, root: Context) -> int:
        """Return how many steps the monitor has seen."""
        return self._seen_in(self.GetMyContextFromRoot(root))

    def set_seen(self, root: Context, steps: int) -> None:
        """Remember how many steps the monitor has seen."""
        self.GetMyMutableContextFromRoot(root).SetDiscreteState(self._seen, [float(steps)])

    def ready(self, root: Context) -> bool:
        """Return whether the monitor has put this Context into its initial state."""
        return self._ready_in(self.GetMyContextFromRoot(root))

    def set_ready(self, root: Context) -> None:
        """Remember that it has."""
        self.GetMyMutableContextFromRoot(root).SetDiscreteState(self._ready, [1.0])

    def _seen_in(self, context: Context) -> int:
        return int(context.get_discrete_state(self._seen).value()[0])

    def _ready_in(self, context: Context) -> bool:
        return bool(context.get_discrete_state(self._ready).value()[0])

    def _begin(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._seen, [float(self.steps_at(context))])

    def _check(self, context: Context) -> None:
        behind = self.steps_at(context) - self._seen_in(context)
        if behind > (1 if self._ready_in(context) else 0):
            raise InputError(
                "The cell is stepped without its monitor: neither fixture nor threads would work. "
                "Call simulator.set_monitor(cell.monitor) before simulator.Initialize() and the "
                "first step."
            )


def join_monitors(
    *monitors: Callable[[Context], EventStatus | None],
) -> Callable[[Context], EventStatus]:
    """Return one monitor that calls several, of cells or of the caller's own, in this order.

    It returns the most severe status of theirs; one that returns None did nothing.
    """

    def monitor(root: Context) -> EventStatus:
        worst = EventStatus.DidNothing()
        for each in monitors:
            status = each(root)
            if status is not None and status.severity().value > worst.severity().value:
                worst = status
        return worst

    return monitor


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

        Raises:
            InputError: The Context is not one of the diagram with this monitor's cell.
        """
        try:
            ready = self.counter.ready(root)
        except RuntimeError as error:
            raise InputError(
                "This monitor's cell is not in the diagram that is stepped: take the monitor of a "
                "cell that is."
            ) from error
        if not ready:
            self._reset(root)
            self.counter.set_ready(root)
            self.counter.set_seen(root, self.counter.steps_at(root))
