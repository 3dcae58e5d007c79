"""Your own fixture: one class, registered by one line, and the rest of the cell stays as it is.

A magnet plate: what stands on it is drawn down with 40 N while the current is on. What it remembers
lives in the Context, so that two Contexts of one diagram are independent.
"""

import numpy as np
import trimesh
from pydrake.common.value import Value
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    Convex,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import CoulombFriction, ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.analysis import Simulator

from cell import FIXTURES, CellConfig, Fixture, Product, build_cell

PLATE = np.array([0.12, 0.12, 0.04])  # [m]
MAGNET = 40.0  # [N]
NOBODY = -1.0


def force_on(body, p_BoBq_B, newton):
    """Return a force (3,) [N], in W, on a point of a body."""
    force = ExternallyAppliedSpatialForce()
    force.body_index, force.p_BoBq_B = body.index(), p_BoBq_B
    force.F_Bq_W = SpatialForce(np.zeros(3), newton)
    return force


class MagnetPlate(Fixture):
    """A steel plate with a magnet; its place and base are the soft jig's."""

    name = "magnet_plate"

    def __init__(self, plant, scene_graph, base, params, X_BJ=None):
        super().__init__(plant, base, X_BJ)
        touch = ProximityProperties()
        AddCompliantHydroelasticProperties(0.03, 1e9, touch)
        AddContactMaterial(friction=CoulombFriction(0.3, 0.3), properties=touch)
        X_BPlate = self.X_BJ @ RigidTransform([0.0, 0.0, PLATE[2] / 2])
        plant.RegisterVisualGeometry(base, X_BPlate, Box(*PLATE), "magnet", np.full(4, 0.5))
        plant.RegisterCollisionGeometry(base, X_BPlate, Box(*PLATE), "magnet", touch)
        self.DeclareDiscreteState([NOBODY, 0.0])  # Index of the body on it; current on.

    @property
    def entry_height(self):
        return PLATE[2]

    def obstacle(self):
        corners = trimesh.creation.box(PLATE).vertices + [0.0, 0.0, PLATE[2] / 2]
        return Convex(points=corners.T, label="magnet")

    def applied_forces(self, context):
        """Draw body and base towards each other."""
        index, on = context.get_discrete_state(0).value()
        if not on or index == NOBODY:
            return []
        body, down = self.plant.get_body(BodyIndex(int(index))), np.array([0, 0, -MAGNET])
        return [force_on(body, np.zeros(3), down), force_on(self.base, np.zeros(3), -down)]

    # What it does when it is told to; everything else is as it is for any fixture.

    def prepare(self, root):
        self.restore(root, {"state": [NOBODY, 0.0]})

    def receive(self, root, body, mesh=None):
        self.restore(root, {"state": [int(body.index()), 0.0]})

    def fix(self, root):
        self.restore(root, {"state": [self.save(root)["state"][0], 1.0]})

    def free(self, root):
        self.restore(root, {"state": [self.save(root)["state"][0], 0.0]})

    def fixed(self, root):
        return bool(self.save(root)["state"][1])

    def save(self, root):
        return {"state": self.GetMyContextFromRoot(root).get_discrete_state(0).value().copy()}

    def restore(self, root, state):
        self.GetMyMutableContextFromRoot(root).SetDiscreteState(0, state["state"])


FIXTURES["magnet_plate"] = MagnetPlate  # The one line.

SIZE = np.array([0.03, 0.03, 0.06])  # Of the box that stands on it [m].


def add_box(plant, scene_graph):
    """Add what is held."""
    inertia = SpatialInertia.SolidBoxWithMass(0.2, *SIZE)
    box = plant.AddRigidBody("box", plant.AddModelInstance("box"), inertia)
    touch = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, touch)
    AddContactMaterial(friction=CoulombFriction(0.3, 0.3), properties=touch)
    plant.RegisterCollisionGeometry(box, RigidTransform(), Box(*SIZE), "box", touch)


def slide(cell, current):
    """Return how far 3 N push the box aside in 0.2 s [m], at the height of its foot."""
    simulator = Simulator(cell.diagram)
    simulator.set_monitor(cell.monitor)
    simulator.Initialize()
    root, box = simulator.get_mutable_context(), cell.plant.GetBodyByName("box")
    context = cell.plant.GetMyMutableContextFromRoot(root)
    X_WB = cell.X_WJ @ RigidTransform([0.0, 0.0, cell.fixture.entry_height + SIZE[2] / 2])
    cell.plant.SetFreeBodyPose(context, box, X_WB)
    cell.fixture.prepare(root)
    cell.fixture.receive(root, box)
    if current:
        cell.fixture.fix(root)
    push = force_on(box, [0.0, 0.0, -0.4 * SIZE[2]], [3.0, 0.0, 0.0])
    cell.diagram.GetInputPort("external_forces").FixValue(root, Value([push]))
    simulator.AdvanceTo(0.2)
    moved = cell.plant.EvalBodyPoseInWorld(context, box).translation() - X_WB.translation()
    return moved[0]


config = CellConfig.load(overrides={"workcell.fixture": "magnet_plate"})
cell = build_cell(config, Product(), extend=add_box)
off, on = slide(cell, current=False), slide(cell, current=True)
print(f"current off: 3 N push the box {1e3 * off:.2f} mm aside")
print(f"current on:  3 N push the box {1e3 * on:.2f} mm aside")
assert off > 5e-3 and on < 0.5e-3
