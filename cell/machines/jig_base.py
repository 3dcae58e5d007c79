"""The base of the soft jig: bolted down, or standing free on the force plate as in push tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Cylinder, ProximityProperties, RoleAssign, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia, UnitInertia
from pydrake.systems.framework import Context

from cell.configuration.config import CellConfig
from cell.fixtures.jig_dimensions import BASE_DIAMETER, BASE_HEIGHT, BEAD_MASS
from cell.fixtures.soft_jig.parameters import BadJig, BagParameters
from cell.sleep import Sleep


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


def set_sliding_friction(
    plant: MultibodyPlant, scene_graph: SceneGraph, body: RigidBody, friction: float
) -> None:
    """Set the friction of a body's collision geometries, before the plant is finalized."""
    inspector = scene_graph.model_inspector()
    for geometry in plant.GetCollisionGeometriesForBody(body):
        properties = ProximityProperties(inspector.GetProximityProperties(geometry))
        material = CoulombFriction(friction, friction)
        properties.UpdateProperty("material", "coulomb_friction", material)
        source = plant.get_source_id()
        scene_graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
