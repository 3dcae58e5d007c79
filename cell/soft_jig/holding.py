"""What holds a part in the frozen bed besides elastic contact: suction, pins, yielding beads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import ContactSurface, GeometryId, SceneGraph, SceneGraphInspector
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from cell.soft_jig.columns import TetMesh
from cell.soft_jig.parameters import JigParameters
from cell.soft_jig.pins import Pins
from cell.soft_jig.suction import Seal
from cell.soft_jig.yielding import Patch, Strength, returned

Array = NDArray[np.float64]
Load = tuple[RigidBody, Array, Array]

# The pressure may grow faster with depth than its nominal gradient where the mesh is slanted.
GRADIENT_MARGIN = 1.5


class Holding:
    """Loads on the bodies in a frozen bed, and the bed's plastic return.

    Attributes:
        seals: What seals under each held body, by its name.
        pins: What each held body has among the beads, by its name.
        since_return: Time since the surface was last moved [s].
    """

    def __init__(
        self, plant: MultibodyPlant, scene_graph: SceneGraph, bed: GeometryId, params: JigParameters
    ) -> None:
        self.params = params
        self.seals: dict[str, Seal] = {}
        self.pins: dict[str, Pins] = {}
        self.since_return = np.inf
        self._plant, self._scene_graph, self._bed = plant, scene_graph, bed
        self._seen: dict[str, tuple[RigidTransform, float, float]] = {}
        self._patches: list[Patch] = []

    def let_go(self) -> None:
        """Forget every body and what has yielded."""
        self.seals.clear()
        self.pins.clear()
        self.since_return = np.inf
        self._patches = []

    def forget(self) -> None:
        """Look at every contact anew: the surface has changed."""
        self._seen.clear()

    def pulls(
        self, context: Context, X_WJ: RigidTransform, bodies: dict[str, RigidBody], vacuum: float
    ) -> Iterator[Load]:
        """Yield each body with the force (3,) [N] and torque (3,) [N m] of suction on it, in J.

        Args:
            context: Of the plant.
            X_WJ: Pose of the jig.
            bodies: The held bodies by name.
            vacuum: Pressure of the pump [Pa].
        """
        pressure = self.params.suction.pressure(vacuum)
        for name, body in bodies.items():
            seal = self.seals.get(name)
            if seal is None or pressure == 0.0 or not seal.intact.any():
                continue
            X_JP = X_WJ.InvertAndCompose(self._plant.EvalBodyPoseInWorld(context, body))
            motion = (X_JP.rotation().matrix(), X_JP.translation())
            yield body, *seal.pull(motion, pressure, self.params.suction)

    def pushes(
        self,
        context: Context,
        X_WJ: RigidTransform,
        bodies: dict[str, RigidBody],
        confinement: float,
    ) -> Iterator[Load]:
        """Yield each body with what the beads push on its pins, as `pulls`.

        Args:
            context: Of the plant.
            X_WJ: Pose of the jig.
            bodies: The held bodies by name.
            confinement: Pressure that holds the beads together [Pa].
        """
        strength = Strength.of(self.params.soil, self.params.jammed.strength * confinement)
        for name, body in bodies.items():
            pins = self.pins.get(name)
            if pins is not None and len(pins.areas):
                X_JP = X_WJ.InvertAndCompose(self._plant.EvalBodyPoseInWorld(context, body))
                motion = (X_JP.rotation().matrix(), X_JP.translation())
                yield body, *pins.push(motion, strength)

    def reliefs(self, context: Context, X_WJ: RigidTransform, confinement: float) -> Iterator[Load]:
        """Yield each body that the beads cannot carry with what they give way by, as `pulls`."""
        jammed, self._patches = self.params.jammed, []
        if not np.isfinite(jammed.strength):
            return
        strength = Strength.of(self.params.soil, jammed.strength * confinement)
        X_JW = X_WJ.inverse()
        for body, surface in self._contacts(context):
            name = body.scoped_name().get_full()
            X_JP = X_JW @ self._plant.EvalBodyPoseInWorld(context, body)
            if not self._may_yield(name, X_JP):
                continue
            patch = Patch.of(surface, self._bed, X_JW, strength)
            self._look(name, X_JP, patch, strength)
            if patch.margin < 0:
                self._patches.append(patch)
                yield body, *patch.relief(X_JP.translation())

    def return_mesh(self, mesh: TetMesh, dt: float) -> TetMesh | None:
        """Return the bed's mesh moved for good where it gives way by a depth that matters.

        Call once per step of `dt` [s], after `reliefs`.
        """
        jammed = self.params.jammed
        self.since_return += dt
        deepest = max((float(patch.excess_depth.max()) for patch in self._patches), default=0.0)
        if deepest < jammed.return_depth or self.since_return < jammed.return_period - dt / 2:
            return None
        self.since_return = 0.0
        return returned(mesh, self._patches, jammed.return_depth / 2)

    def _contacts(self, context: Context) -> Iterator[tuple[RigidBody, ContactSurface]]:
        """Yield what touched the bed in the plant's latest step."""
        inspector: SceneGraphInspector = self._scene_graph.model_inspector()
        results = self._plant.get_contact_results_output_port().Eval(context)
        for i in range(results.num_hydroelastic_contacts()):
            surface = results.hydroelastic_contact_info(i).contact_surface()
            first, second = surface.id_M(), surface.id_N()
            if self._bed in (first, second):
                other = second if first == self._bed else first
                yield self._plant.GetBodyFromFrameId(inspector.GetFrameId(other)), surface

    def _may_yield(self, name: str, X_JP: RigidTransform) -> bool:
        """Say whether a body has moved far enough since its last look to press too hard."""
        if name not in self._seen:
            return True
        X_JP0, reach, margin = self._seen[name]
        turn = np.sqrt(max(3.0 - np.sum(X_JP0.rotation().matrix() * X_JP.rotation().matrix()), 0.0))
        way = np.linalg.norm(X_JP.translation() - X_JP0.translation()) + turn * reach
        return bool(GRADIENT_MARGIN * self.params.jammed.pressure_gradient * way >= margin)

    def _look(self, name: str, X_JP: RigidTransform, patch: Patch, strength: Strength) -> None:
        """Remember the pose and how much was missing to the limit."""
        reach = np.linalg.norm(patch.points - X_JP.translation(), axis=1).max(initial=0.0)
        self._seen[name] = (X_JP, float(reach), min(patch.margin, strength.lateral))

    # Saving.

    def state(self) -> dict[str, Any]:
        """Return everything that changes the course of a run."""
        seals = {name: seal.arrays() for name, seal in self.seals.items()}
        pins = {name: pins.arrays() for name, pins in self.pins.items()}
        return {"since_return": self.since_return, "seals": seals, "pins": pins}

    def restore(self, state: dict[str, Any]) -> None:
        """Return to a saved state."""
        self.forget()
        self.since_return = float(state["since_return"])
        seals = state.get("seals", {})
        self.seals = {name: Seal.from_arrays(arrays) for name, arrays in seals.items()}
        pins = state.get("pins", {})
        self.pins = {name: Pins.from_arrays(arrays) for name, arrays in pins.items()}
