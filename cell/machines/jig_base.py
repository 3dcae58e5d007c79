"""The base of the soft jig: bolted down, or standing free on the force plate as in push tests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    FilterId,
    GeometrySet,
    ProximityProperties,
    RoleAssign,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import Joint, RigidBody, SpatialInertia, UnitInertia, WeldJoint
from pydrake.systems.framework import Context

from cell.configuration.config import CellConfig

BEAD_MASS = 0.45  # [kg] [S]; the model of the jig's base is without them.


@dataclass
class JigBase:
    """The base in the plant; a free one has the mass and friction of the configuration.

    Attributes:
        config: Of the cell.
        plant, scene_graph: Plain Drake.
        body: The base; its frame is the jig frame J.
        plate: The force plate that it stands on.
    """

    config: CellConfig
    plant: MultibodyPlant
    scene_graph: SceneGraph
    body: RigidBody
    plate: RigidBody
    _filter: FilterId | None = None

    @staticmethod
    def prepare(
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        weld: WeldJoint,
        body: RigidBody,
        config: CellConfig,
    ) -> JigBase:
        """Let a base that is not bolted down slide as configured; call before `Finalize`.

        Args:
            plant: Holds the work cell already.
            scene_graph: The plant's.
            weld: Under the force plate.
            body: The base.
            config: Says whether it is free.
        """
        plate = weld.child_body()
        if not config.workcell.jig_base_fixed:
            for sliding in (plate, body):
                _set_sliding(plant, scene_graph, sliding, config.push.base_friction)
        return JigBase(config, plant, scene_graph, body, plate)

    @property
    def free(self) -> bool:
        """Whether it can slide."""
        return not self.config.workcell.jig_base_fixed

    @property
    def asleep(self) -> bool:
        """Whether it rests, locked and without contact."""
        return self._filter is not None

    def X_WJ(self, context: Context) -> RigidTransform:
        """Return its true pose (plant context)."""
        return self.plant.EvalBodyPoseInWorld(context, self.body)

    def reset(self, root: Context, X_WJ: RigidTransform) -> None:
        """Set a free base down, awake and at rest, in a Context where nothing is known of it yet.

        Args:
            root: Context of the diagram.
            X_WJ: Where; a bolted base stays where it is.
        """
        self._show(root)
        if self.free:
            context = self.plant.GetMyMutableContextFromRoot(root)
            self._joint.Unlock(context)
            self.plant.SetFreeBodyPose(context, self.body, X_WJ)
            self.plant.SetFreeBodySpatialVelocity(context, self.body, SpatialVelocity.Zero())
            self.body.SetSpatialInertiaInBodyFrame(context, _inertia(self.config))

    def sleep(self, root: Context) -> None:
        """Let a free base rest where it is: nothing pushes it, so nothing is computed."""
        if not self.free or self.asleep:
            return
        context = self.plant.GetMyMutableContextFromRoot(root)
        self.plant.SetFreeBodySpatialVelocity(context, self.body, SpatialVelocity.Zero())
        self._joint.Lock(context)
        self._hide(root)

    def wake(self, root: Context) -> None:
        """Let it move again, from rest."""
        if self.asleep:
            self._show(root)
            self._joint.Unlock(self.plant.GetMyMutableContextFromRoot(root))

    @contextmanager
    def filters_lifted(self, root: Context) -> Iterator[None]:
        """Lift a sleeping base's filter: passing filters forbid lasting changes of geometry."""
        hidden = self.asleep
        if hidden:
            self._show(root)
        try:
            yield
        finally:
            if hidden:
                self._hide(root)

    def _hide(self, root: Context) -> None:
        geometries = self.plant.GetCollisionGeometriesForBody
        pair = GeometrySet(geometries(self.body)), GeometrySet(geometries(self.plate))
        apart = CollisionFilterDeclaration().ExcludeBetween(*pair)
        self._filter = self._filters(root).ApplyTransient(apart)

    def _show(self, root: Context) -> None:
        if self._filter is not None:
            self._filters(root).RemoveDeclaration(self._filter)
            self._filter = None

    def _filters(self, root: Context):
        context = self.scene_graph.GetMyMutableContextFromRoot(root)
        return self.scene_graph.collision_filter_manager(context)

    @property
    def _joint(self) -> Joint:
        (joint,) = [
            joint
            for joint in map(self.plant.get_joint, self.plant.GetJointIndices())
            if joint.child_body().index() == self.body.index()
        ]
        return joint


def _inertia(config: CellConfig) -> SpatialInertia:
    """Return base and beads about J: a disc below it and a ball of the same volume above."""
    diameter, height = 0.160, 0.025  # Of the base [S], [A].
    base = SpatialInertia.SolidCylinderWithMass(
        config.push.jig_mass - BEAD_MASS, diameter / 2, height, np.array([0.0, 0.0, 1.0])
    ).Shift(np.array([0.0, 0.0, height / 2]))
    bag = config.jig.bag
    radius = (0.75 * bag.volume / np.pi) ** (1 / 3)
    p_JB = np.array([0.0, 0.0, 0.4 * bag.cap_height])  # Centroid of the cap, nearly [D].
    unit = UnitInertia.SolidSphere(radius).ShiftFromCenterOfMass(-p_JB)
    base += SpatialInertia(BEAD_MASS, p_JB, unit)
    return base


def _set_sliding(
    plant: MultibodyPlant, scene_graph: SceneGraph, body: RigidBody, friction: float
) -> None:
    """Set the friction between base and force plate."""
    inspector = scene_graph.model_inspector()
    for geometry in plant.GetCollisionGeometriesForBody(body):
        properties = ProximityProperties(inspector.GetProximityProperties(geometry))
        material = CoulombFriction(friction, friction)
        properties.UpdateProperty("material", "coulomb_friction", material)
        source = plant.get_source_id()
        scene_graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
