"""When press fits catch, slip and stick: rules applied after every step.

A shaft whose tip has come into the mouth of its hole is caught, and stuck there. What is stuck
slips once it is pushed, or pulled, with more than its friction; what slides sticks as soon as it
does not move on, and comes free where it is pulled out of the mouth.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem

from cell.products.product import Product
from cell.workpieces.parts import Parts
from cell.workpieces.press_fit import INSTANCE, FitState, Grip, PressFit, add_press_fit


class PressFits(LeafSystem):
    """All press fits of a product in one diagram: what each does lives in its Context.

    Output port ``friction``: the force (n,) of each on its follower, out of the hole [N].

    Args:
        fits: In the order of the product's joints.
    """

    def __init__(self, fits: Sequence[PressFit]) -> None:
        super().__init__()
        self._fits = tuple(fits)
        self._index = self.DeclareDiscreteState(np.array([Grip().row() for _ in fits]).reshape(-1))
        known = {self.discrete_state_ticket(self._index)}
        self.DeclareVectorOutputPort("friction", len(self._fits), self._calc, known)

    def connect(self, builder: DiagramBuilder, plant: MultibodyPlant) -> None:
        """Connect the friction to the finalized plant, if there is any."""
        if self._fits:
            instance = plant.GetModelInstanceByName(INSTANCE)
            builder.Connect(self.get_output_port(), plant.get_actuation_input_port(instance))

    def __len__(self) -> int:
        return len(self._fits)

    def __iter__(self) -> Iterator[PressFit]:
        return iter(self._fits)

    def grips(self, root: Context) -> list[Grip]:
        """Return what is remembered of every fit."""
        return [Grip.of(row) for row in self._rows(root)]

    def _rows(self, root: Context) -> np.ndarray:
        """Return what is remembered as rows (n, 2)."""
        state = self.GetMyContextFromRoot(root).get_discrete_state(self._index)
        return state.value().reshape(-1, 2).copy()

    # Simulation.

    def install(self, root: Context) -> None:
        """Bring the ties of a new Context in line with what is remembered: Drake has all closed."""
        self.restore(root, self.save(root))

    def set(self, root: Context, number: int, grip: Grip) -> None:
        """Put one fit into a state; positions are left as they are."""
        fit = self._fits[number]
        fit.apply(fit.plant.GetMyMutableContextFromRoot(root), grip.state)
        self._remember(root, number, grip)

    def step(self, root: Context, dt: float) -> None:
        """Apply the rules, after a step of the plant."""
        for number, (fit, grip) in enumerate(zip(self._fits, self.grips(root), strict=True)):
            context = fit.plant.GetMyMutableContextFromRoot(root)
            if fit.asleep(context):
                continue
            state = self._next_state(fit, grip.state, context)
            out = {FitState.IN: 1.0, FitState.OUT: -1.0}.get(state, 0.0)
            now = Grip(state, out * fit.friction_at(fit.depth(context)) if out else 0.0)
            if state is not grip.state:
                if grip.state is FitState.FREE:
                    fit.place_follower(context)
                self.set(root, number, now)
            elif now != grip:
                self._remember(root, number, now)

    def _next_state(self, fit: PressFit, state: FitState, context: Context) -> FitState:
        """Return the state of a fit after a step, given the plant's Context."""
        if state is FitState.FREE:
            return FitState.STUCK if fit.meets(context) else state
        if state is FitState.STUCK:
            push, most = fit.push(context), fit.friction_at(fit.depth(context))
            if abs(push) <= most:
                return state
            return FitState.IN if push > 0.0 else FitState.OUT
        if state is FitState.IN:
            return state if fit.speed(context) < 0.0 else FitState.STUCK
        if fit.depth(context) <= 0.0:
            return FitState.FREE
        return state if fit.speed(context) > 0.0 else FitState.STUCK

    def _remember(self, root: Context, number: int, grip: Grip) -> None:
        rows = self._rows(root)
        rows[number] = grip.row()
        self.GetMyMutableContextFromRoot(root).SetDiscreteState(self._index, rows.reshape(-1))

    def _calc(self, context: Context, output: BasicVector) -> None:
        rows = context.get_discrete_state(self._index).value().reshape(-1, 2)
        output.SetFromVector(rows[:, 1])

    # Saving.

    def save(self, root: Context) -> dict[str, np.ndarray]:
        """Return a row (2,) per fit, by its number."""
        return {str(number): row for number, row in enumerate(self._rows(root))}

    def restore(self, root: Context, rows: Mapping[str, np.ndarray]) -> None:
        """Undo `save`; the positions are restored with the plant's."""
        for number, row in rows.items():
            self.set(root, int(number), Grip.of(row))


def add_press_fits(plant: MultibodyPlant, product: Product, parts: Parts) -> PressFits:
    """Add the follower and the open tie of every press fit of the product; none adds nothing.

    Args:
        plant: Not finalized yet.
        product: Its joints; the axis of a hole is the product's vertical.
        parts: In the plant.
    """
    fits = []
    if product.presses:
        plant.set_gravity_enabled(plant.AddModelInstance(INSTANCE), False)
    for number, press in enumerate(product.presses):
        shaft, hole = product.parts[press.shaft], product.parts[press.hole]
        out = product.up_axis if product.enters_from_above(press) else -product.up_axis
        ends = (parts[press.shaft].body, shaft.X_AP), (parts[press.hole].body, hole.X_AP)
        fits.append(add_press_fit(plant, f"press_fit_{number}", press, *ends, out))
    return PressFits(fits)
