"""The soft jig in Drake: pressure, state machine, press forces and the swap of contact geometry.

While soft, the part is carried by the plastic bed (`cell.soft_jig.bed`) through external forces.
When the vacuum has nearly built up, the bed freezes: its contact geometry becomes a compliant
hydroelastic mesh that conforms to the part, and the external forces stop. Geometry is replaced in
the Context, between steps; nothing here needs a new diagram.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from enum import Enum
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import ProximityProperties, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context

from cell.soft_jig.bed import Bed
from cell.soft_jig.bed_geometry import BedGeometry
from cell.soft_jig.columns import TetMesh
from cell.soft_jig.contact_mesh import bed_mesh, imprint_mesh
from cell.soft_jig.drake_values import (
    applied_force,
    drake_proximity,
    force_row,
    inertia_in_jig,
    lean_of,
)
from cell.soft_jig.holding import Holding
from cell.soft_jig.parameters import FULL_VACUUM, JigParameters
from cell.soft_jig.pins import Pins
from cell.soft_jig.samples import SurfaceSamples
from cell.soft_jig.suction import Seal

Array = NDArray[np.float64]


class JigState(Enum):
    """What the bag is: blown up, soft with air let out, or frozen by the vacuum."""

    INFLATED = "inflated"
    SOFT = "soft"
    JAMMED = "jammed"


class SoftJig:
    """A bag of beads on a base body.

    Attributes:
        params: All numbers.
        bed: The surface and its constitutive model.
        state: Where the jig is in INFLATED -> SOFT -> JAMMED -> SOFT.
        pressure: Confining pressure in the bag [Pa].
        holding: What holds each body while jammed: seals, pins, yield.
        filters_lifted: Given the root context, lifts every passing collision filter for the time
            of a swap, which Drake demands; whoever sets such filters provides it.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        base_body: RigidBody,
        params: JigParameters,
        X_BJ: RigidTransform,
    ) -> None:
        self.params = params
        self.bed = Bed(params.bag, params.soil)
        self.state = JigState.INFLATED
        self.pressure = 0.0
        self.filters_lifted: Callable[[Context], AbstractContextManager[None]] = nullcontext
        self._pumping = False
        self._plant = plant
        self._base, self._X_BJ = base_body, X_BJ
        self._mesh = bed_mesh(self.bed, params.jammed)
        soft = self._properties()
        self._geometry = BedGeometry(
            plant, scene_graph, base_body, X_BJ, self.bed, (self._mesh, soft)
        )
        self._pressing: dict[str, tuple[RigidBody, SurfaceSamples]] = {}
        self._forces: list[ExternallyAppliedSpatialForce] = []
        self._since_drawn = 0.0
        self.holding = Holding(plant, scene_graph, self._geometry.contact_id, params)

    @staticmethod
    def add(
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        base_body: RigidBody,
        params: JigParameters | None = None,
        X_BJ: RigidTransform | None = None,
    ) -> SoftJig:
        """Put an inflated bag on a base body; call before the plant is finalized.

        Args:
            plant: Discrete plant with contact model hydroelastic_with_fallback.
            scene_graph: The plant's scene graph.
            base_body: The jig's base.
            params: All numbers; None takes the defaults.
            X_BJ: Pose of the jig frame J in the base body; None if they coincide.
        """
        params = JigParameters() if params is None else params
        X_BJ = RigidTransform() if X_BJ is None else X_BJ
        return SoftJig(plant, scene_graph, base_body, params, X_BJ)

    # Commands.

    def inflate(self, root_context: Context) -> None:
        """Blow the bag up: pressure off, every imprint gone. Also the way to start."""
        self.pressure = 0.0
        self._pumping = False
        self.state = JigState.INFLATED
        self.bed.vacuum = 0.0
        self.bed.inflate()
        self._show_bed(root_context)

    def soften(self, root_context: Context) -> None:
        """Let air in (or out, after inflating): the bag is soft and keeps its imprint."""
        self._pumping = False
        if self.state is JigState.JAMMED:
            context = self._plant.GetMyContextFromRoot(root_context)
            X_WJ = self.pose(context)
            for body, samples in self._pressing.values():
                self.bed.conform(self._motion_in_jig(context, X_WJ, body)[0], samples)
            self.bed.unjam()
            self.state = JigState.SOFT
            self._show_bed(root_context)
        self.state = JigState.SOFT

    def evacuate(self, root_context: Context) -> None:
        """Start the pump; `step` freezes the bed when the pressure is nearly there."""
        if self.state is JigState.INFLATED:
            self.soften(root_context)
        self._pumping = True

    def press_with(self, body: RigidBody, samples: SurfaceSamples) -> None:
        """Let the soft bed carry a body that has these surface samples (in the body frame).

        Raises:
            JigError: It has no geometry for the frozen bed, which would let it fall through.
        """
        self._geometry.check_can_hold(body)
        self._pressing[body.scoped_name().get_full()] = (body, samples)

    def release(self, body: RigidBody) -> None:
        """Forget a body given to `press_with`."""
        _, samples = self._pressing.pop(body.scoped_name().get_full(), (body, None))
        if samples is not None:
            self.bed.forget(samples.name)

    @property
    def pressing(self) -> tuple[RigidBody, ...]:
        """The bodies that the soft bed carries."""
        return tuple(body for body, _ in self._pressing.values())

    # Simulation.

    @property
    def contact_mesh(self) -> TetMesh:
        """Mesh of the bed's contact geometry, in J."""
        return self._mesh

    @property
    def applied_forces(self) -> list[ExternallyAppliedSpatialForce]:
        """Forces of the soft bed on the parts and on the base, for the plant's input port."""
        return self._forces

    def step(self, root_context: Context, dt: float) -> None:
        """Advance by one plant step: pressure, press forces, and freezing when it is time.

        Args:
            root_context: Context of the diagram, after the plant's step.
            dt: Step [s].
        """
        vacuum = self.params.vacuum
        target = vacuum.pressure if self._pumping else 0.0
        self.pressure += (target - self.pressure) * -np.expm1(-dt / vacuum.time_constant)
        self.bed.vacuum = self.pressure
        self._forces = []
        if self.state is JigState.JAMMED:
            self._hold(root_context, dt)
            return
        self._press(root_context, dt)
        if self._pumping and self.pressure >= vacuum.jam_fraction * vacuum.pressure:
            self._jam(root_context, dt)
        else:
            self._draw_if_due(root_context, dt)

    def _press(self, root_context: Context, dt: float) -> None:
        context = self._plant.GetMyContextFromRoot(root_context)
        X_WJ = self.pose(context)
        for body, samples in self._pressing.values():
            X_JP, V_JP = self._motion_in_jig(context, X_WJ, body)
            inertia = inertia_in_jig(context, body, X_JP)
            force, torque = self.bed.press(X_JP, V_JP, samples, dt, inertia)
            if force.any():
                self._forces += self._pair(context, X_WJ, body, force, torque)
        self.bed.settle(dt)

    def pose(self, context: Context) -> RigidTransform:
        """Return X_WJ, given the plant's context."""
        return self._plant.EvalBodyPoseInWorld(context, self._base) @ self._X_BJ

    def _motion_in_jig(
        self, context: Context, X_WJ: RigidTransform, body: RigidBody
    ) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        plant, R_JW = self._plant, X_WJ.rotation().inverse()
        X_WP = plant.EvalBodyPoseInWorld(context, body)
        X_JP = X_WJ.InvertAndCompose(X_WP)
        V_WP = plant.EvalBodySpatialVelocityInWorld(context, body)
        V_WB = plant.EvalBodySpatialVelocityInWorld(context, self._base)
        p_WB = plant.EvalBodyPoseInWorld(context, self._base).translation()
        V_WBp = V_WB.Shift(X_WP.translation() - p_WB)
        w_J = R_JW @ (V_WP.rotational() - V_WBp.rotational())
        v_J = R_JW @ (V_WP.translational() - V_WBp.translational())
        return (X_JP.rotation().matrix(), X_JP.translation()), (w_J, v_J)

    def _pair(
        self, context: Context, X_WJ: RigidTransform, body: RigidBody, force: Array, torque: Array
    ) -> list[ExternallyAppliedSpatialForce]:
        """Return the force on the part at its origin and the opposite one on the base."""
        R_WJ = X_WJ.rotation()
        F_W = SpatialForce(R_WJ @ torque, R_WJ @ force)
        p_WP = self._plant.EvalBodyPoseInWorld(context, body).translation()
        X_WB = self._plant.EvalBodyPoseInWorld(context, self._base)
        return [
            applied_force(body, np.zeros(3), F_W),
            applied_force(self._base, X_WB.inverse() @ p_WP, -F_W),
        ]

    def _hold(self, root_context: Context, dt: float) -> None:
        """Add to the elastic contact suction, pins, and what the beads cannot carry."""
        context = self._plant.GetMyContextFromRoot(root_context)
        X_WJ, holding = self.pose(context), self.holding
        bodies = {name: body for name, (body, _) in self._pressing.items()}
        for load in chain(
            holding.pulls(context, X_WJ, bodies, self.pressure),
            holding.pushes(context, X_WJ, bodies, self.bed.confinement),
            holding.reliefs(context, X_WJ, self.bed.confinement),
        ):
            self._forces += self._pair(context, X_WJ, *load)
        mesh = holding.return_mesh(self._mesh, dt)
        if mesh is not None:
            self._mesh = mesh
            self._install(root_context)

    # Freezing and drawing.

    def _jam(self, root_context: Context, dt: float) -> None:
        context = self._plant.GetMyContextFromRoot(root_context)
        X_WJ, holding = self.pose(context), self.holding
        for name, (body, samples) in self._pressing.items():
            X_JP, _ = self._motion_in_jig(context, X_WJ, body)
            lip = self.params.suction.lip
            holding.seals[name] = Seal.under(self.bed, samples.name, X_JP, lip)
        self.bed.jam(self.params.vacuum.contraction * self.params.vacuum.closing)
        self.state = JigState.JAMMED
        self._forces = []
        self._mesh = self._mesh_with_imprint(context, X_WJ)
        self._install(root_context)
        for name, (body, samples) in self._pressing.items():
            X_JP, _ = self._motion_in_jig(context, X_WJ, body)
            inertia = inertia_in_jig(context, body, X_JP)
            modulus = self._gradient()
            holding.pins[name] = Pins.inside(self._mesh, samples, X_JP, modulus, inertia, dt)

    def _mesh_with_imprint(self, context: Context, X_WJ: RigidTransform) -> TetMesh:
        hulls, lean = [], np.zeros(2)
        for body, _ in self._pressing.values():
            X_JP = X_WJ.InvertAndCompose(self._plant.EvalBodyPoseInWorld(context, body))
            hulls += self._geometry.hulls(body, X_JP)
            lean = lean_of(X_JP.rotation())
        jammed = self.params.jammed
        squeezed = replace(jammed, squeeze=jammed.squeeze * self.params.vacuum.closing)
        return imprint_mesh(self.bed, squeezed, hulls, lean)

    def _show_bed(self, root_context: Context) -> None:
        self._forces = []
        self.holding.let_go()
        self._mesh = bed_mesh(self.bed, self.params.jammed)
        self._install(root_context)

    def _install(self, root_context: Context) -> None:
        """Replace contact and visible geometry in the Context by the present mesh and surface."""
        self.holding.forget()
        properties, frozen = self._properties(), self.state is JigState.JAMMED
        with self.filters_lifted(root_context):
            self._geometry.replace(root_context, self._mesh, properties, self.pressing, frozen)
        self._draw(root_context)

    def _properties(self) -> ProximityProperties:
        return drake_proximity(self._mesh, self.params, self._gradient())

    def _gradient(self) -> float:
        """Return the contact pressure per depth [Pa/m]; frozen, for the pump's full vacuum."""
        jammed = self.params.jammed
        if self.state is not JigState.JAMMED:
            return jammed.soft_gradient
        rest = self.bed.confinement - self.bed.vacuum
        ratio = (self.params.vacuum.pressure + rest) / (FULL_VACUUM + rest)
        return jammed.pressure_gradient * float(np.sqrt(ratio))

    def _draw_if_due(self, root_context: Context, dt: float) -> None:
        self._since_drawn += dt
        if self._since_drawn >= self.params.visual_period:
            self._draw(root_context)

    def _draw(self, root_context: Context) -> None:
        self._since_drawn = 0.0
        self._geometry.draw(root_context, self.bed)

    # Saving.

    def save_state(self) -> dict[str, Any]:
        """Return everything that changes, except which bodies press (`press_with`)."""
        return {
            "bed": self.bed.state(),
            "state": self.state.value,
            "pressure": self.pressure,
            "pumping": self._pumping,
            "since_drawn": self._since_drawn,
            "holding": self.holding.state(),
            "vertices": self._mesh.vertices.copy(),
            "tetrahedra": self._mesh.tetrahedra.copy(),
            "forces": np.array([force_row(force) for force in self._forces]).reshape(-1, 10),
        }

    def restore_state(self, root_context: Context, state: dict[str, Any]) -> None:
        """Return to a saved state, also in another Context; continuing is bit-identical."""
        self.bed.restore(state["bed"])
        self.state = JigState(str(state["state"]))
        self.pressure = float(state["pressure"])
        self._pumping = bool(state["pumping"])
        self._mesh = TetMesh(state["vertices"].copy(), state["tetrahedra"].copy())
        self._install(root_context)
        self._since_drawn = float(state["since_drawn"])
        self.holding.restore(state["holding"])
        self._forces = [self._from_row(row) for row in state["forces"]]

    def _from_row(self, row: Array) -> ExternallyAppliedSpatialForce:
        body = self._plant.get_body(BodyIndex(int(row[0])))
        return applied_force(body, row[1:4], SpatialForce(row[4:7], row[7:10]))
