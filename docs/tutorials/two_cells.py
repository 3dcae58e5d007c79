"""Two cells in one diagram, stepped by one simulator: one bag is pumped out, the other one is not.

Each cell has its own plant, configuration and monitor; nothing is shared.
"""

import numpy as np
import trimesh
from pydrake.common.value import Value
from pydrake.geometry import AddRigidHydroelasticProperties, Box, ProximityProperties
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from cell import CellConfig, Product, add_cell

SIZE = np.array([0.03, 0.03, 0.06])  # Of the box in each cell [m].


def add_box(plant, scene_graph):
    """Add what is held: see the tutorial on your own diagram."""
    inertia = SpatialInertia.SolidBoxWithMass(0.2, *SIZE)
    box = plant.AddRigidBody("box", plant.AddModelInstance("box"), inertia)
    touch = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, touch)
    plant.RegisterCollisionGeometry(box, RigidTransform(), Box(*SIZE), "bed_box", touch)


builder = DiagramBuilder()
cells = {
    name: add_cell(builder, CellConfig.load(), Product("nothing", {}), name=name, extend=add_box)
    for name in ("pumped", "soft")
}
simulator = Simulator(builder.Build())


def monitor(root):
    """Call the monitor of every cell."""
    return [cell.monitor(root) for cell in cells.values()][-1]


simulator.set_monitor(monitor)
simulator.Initialize()
root = simulator.get_mutable_context()


def box_of(cell):
    """Return the box of a cell, and the Context of the cell's plant."""
    return cell.plant.GetBodyByName("box"), cell.plant.GetMyMutableContextFromRoot(root)


def height(cell):
    """Return the height of the box in its cell [m]."""
    box, context = box_of(cell)
    return cell.plant.EvalBodyPoseInWorld(context, box).translation()[2]


def pull(cell, newton):
    """Pull at the box of a cell."""
    force = ExternallyAppliedSpatialForce()
    force.body_index = box_of(cell)[0].index()
    force.F_Bq_W = SpatialForce(np.zeros(3), [0.0, 0.0, newton])
    port = cell.ports.inputs["external_forces"]
    port.FixValue(port.get_system().GetMyMutableContextFromRoot(root), Value([force]))


for cell in cells.values():
    box, context = box_of(cell)
    top = cell.fixture.entry_height + SIZE[2] / 2
    cell.plant.SetFreeBodyPose(context, box, cell.X_WJ @ RigidTransform([0.0, 0.0, top]))
    cell.fixture.receive(root, box, trimesh.creation.box(SIZE))
    pull(cell, -20.0)
simulator.AdvanceTo(0.5)
for cell in cells.values():
    pull(cell, 0.0)
cells["pumped"].fixture.fix(root)
simulator.AdvanceTo(1.4)
before = {name: height(cell) for name, cell in cells.items()}
for cell in cells.values():
    pull(cell, 5.0)
simulator.AdvanceTo(1.5)
risen = {name: height(cell) - before[name] for name, cell in cells.items()}
for name, cell in cells.items():
    pressure = cell.fixture.reading(root)["pressure"]
    print(f"{name:6s} {1e-3 * pressure:5.1f} kPa: 5 N lift the box by {1e3 * risen[name]:6.2f} mm")
assert risen["pumped"] < 0.1e-3 and risen["soft"] > 5e-3
