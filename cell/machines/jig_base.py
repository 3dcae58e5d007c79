"""The base of the soft jig: bolted down, or standing free on the force plate as in push tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    Cylinder,
    ProximityProperties,
    RoleAssign,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia
from pydrake.systems.framework import Context

from cell.configuration.config import CellConfig
from cell.fixtures.jig_dimensions import BASE_DIAMETER, BASE_HEIGHT, BEAD_MASS
from cell.fixtures.soft_jig.parameters import BadJig, BagParameters
from cell.sleep import Sleep

# Hunt-Crossley, of base and plate: a third of critical damping at the usual stiffness; air is
# squeezed out of the joint [A].
JOINT_DISSIPATION = 100.0  # [s/m]


@dataclass(frozen=True)
class JigBase:
    """The base in the plant; a free one has the mass and friction of the configuration.

    Attributes:
        config: Of the cell.
        plant: Plain Drake.
        body: The base; its frame is the jig frame J.
        plate: The force plate that it stands on.
        sleeper: Puts it to sleep.
    """

    config: CellConfig
    plant: MultibodyPlant
    body: RigidBody
    plate: RigidBody
    sleeper: Sleep

    @property
    def free(self) -> bool:
        """Whether it can slide."""
        return not self.config.workcell.jig_base_fixed

    def asleep(self, root: Context) -> bool:
        """Return whether it rests, locked and without contact to the force plate."""
        return self.free and self.body.is_locked(self.plant.GetMyContextFromRoot(root))

    def X_WJ(self, context: Context) -> RigidTransform:
        """Return its true pose (plant context)."""
        return self.plant.EvalBodyPoseInWorld(context, self.body)

    def reset(self, root: Context) -> None:
        """Give a free base its mass with the beads, in a new Context."""
        if self.free:
            context = self.plant.GetMyMutableContextFromRoot(root)
            self.body.SetSpatialInertiaInBodyFrame(context, _inertia(self.config))

    def set_down(self, root: Context, X_WJ: RigidTransform) -> None:
        """Put a free base somewhere, awake and at rest; a bolted one stays where it is."""
        if self.free:
            self.wake(root)
            context = self.plant.GetMyMutableContextFromRoot(root)
            self.plant.SetFreeBodyPose(context, self.body, X_WJ)
            self.plant.SetFreeBodySpatialVelocity(context, self.body, SpatialVelocity.Zero())

    def sleep(self, root: Context) -> None:
        """Let a free base rest where it is: nothing pushes it, so nothing is computed."""
        if self.free:
            self.sleeper.put_to_sleep(root, self.body, apart_from=[self.plate])

    def wake(self, root: Context) -> None:
        """Let it move again, from rest."""
        if self.free:
            self.sleeper.wake(root, self.body, apart_from=[self.plate])


def bead_mass(bag: BagParameters) -> float:
    """Return the mass of the beads in a bag [kg]; the paper's 450 g are those of its own [S]."""
    return BEAD_MASS * (bag.bead_volume / BagParameters().bead_volume)


def base_scale(bag: BagParameters) -> float:
    """Return how much wider than the paper's base one is that is made for a bag."""
    return bag.aperture_radius / BagParameters().aperture_radius


def _inertia(config: CellConfig) -> SpatialInertia:
    """Return base and beads about J: a disc below it and a ball of the same volume above.

    Raises:
        BadJig: The jig is not heavier than its beads.
    """
    bag, up = config.jig.bag, np.array([0.0, 0.0, 1.0])
    beads = bead_mass(bag)
    mass = config.push.jig_mass - beads
    if mass <= 0.0:
        raise BadJig(
            f"The jig weighs {config.push.jig_mass:g} kg (push.jig_mass), its beads alone "
            f"{beads:.3g} kg (jig.bag.bead_volume)."
        )
    width = base_scale(bag) * BASE_DIAMETER
    disc = SpatialInertia.SolidCylinderWithMass(mass, width / 2, BASE_HEIGHT, up)
    base = disc.Shift(0.5 * BASE_HEIGHT * up)
    radius = (0.75 * bag.volume / np.pi) ** (1 / 3)
    p_JB = np.array([0.0, 0.0, 0.4 * bag.cap_height])  # Centroid of the cap, nearly [D].
    unit = UnitInertia.SolidSphere(radius).ShiftFromCenterOfMass(-p_JB)
    base += SpatialInertia(beads, p_JB, unit)
    return base


def fit_to_bag(
    plant: MultibodyPlant, scene_graph: SceneGraph, base: RigidBody, bag: BagParameters
) -> None:
    """Make the base as wide as a bag of another size needs, before the plant is finalized.

    What touches the force plate is changed, not what is seen: pictures show the paper's base.
    """
    scale, inspector = base_scale(bag), scene_graph.model_inspector()
    if scale == 1.0:
        return
    for geometry in plant.GetCollisionGeometriesForBody(base):
        disc = inspector.GetShape(geometry)
        assert isinstance(disc, Cylinder)
        wider = Cylinder(scale * disc.radius(), disc.length())
        scene_graph.ChangeShape(plant.get_source_id(), geometry, wider)


def stand_on(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    plate: RigidBody,
    base: RigidBody,
    config: CellConfig,
) -> None:
    """Give the joint of a free base and the force plate its friction and its stiffness.

    The joint is soft, not the base: two dry faces that touch under a few hundred pascals meet at
    few of their high points. The compliance is in the plate's surface: but for a fallen part,
    nothing else touches it.
    A joint stiffer than the step resolves brakes a rocking base: the friction of a step is bounded
    by the normal force at its beginning, which is many times the true one when a corner lands.

    Args:
        plant: Not finalized yet.
        scene_graph: The plant's.
        plate: The force plate, of boxes.
        base: Of the jig, free.
        config: Of the cell; its `push` has the friction, and the stiffness [N/m] of the joint of a
            base of the paper's size, from which that per area follows.
    """
    inspector, push = scene_graph.model_inspector(), config.push
    material = CoulombFriction(push.base_friction, push.base_friction)
    for geometry in plant.GetCollisionGeometriesForBody(base):
        properties = ProximityProperties(inspector.GetProximityProperties(geometry))
        properties.UpdateProperty("material", "coulomb_friction", material)
        scene_graph.AssignRole(plant.get_source_id(), geometry, properties, RoleAssign.kReplace)
    gradient = push.base_stiffness / (np.pi * BASE_DIAMETER**2 / 4)
    for geometry in plant.GetCollisionGeometriesForBody(plate):
        box = inspector.GetShape(geometry)
        assert isinstance(box, Box)
        # Drake's pressure rises to the modulus from the face to the middle of a box.
        modulus = gradient * min(box.size()) / 2
        properties = ProximityProperties()
        AddCompliantHydroelasticProperties(max(box.size()), modulus, properties)
        AddContactMaterial(JOINT_DISSIPATION, None, material, properties)
        scene_graph.AssignRole(plant.get_source_id(), geometry, properties, RoleAssign.kReplace)
