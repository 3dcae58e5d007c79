"""Your own experiment: how hard the frozen bag holds a part, over the vacuum.

A box is pressed into the bag with 20 N; the pump draws a vacuum; then it is pulled up, harder and
harder, until it comes off. A campaign runs a trial for each vacuum and keeps it in a file.
"""

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import AddRigidHydroelasticProperties, Box, ProximityProperties
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator

from cell import Product, build_cell
from experiments import Outcome, grid, run_campaign, trials

SIZE = np.array([0.03, 0.03, 0.06])  # Of the box [m].
WEIGHT = 0.2 * 9.81  # [N]
RATE = 60.0  # Growth of the pull [N/s].
OFF = 2e-3  # A box that has risen this far is off [m].


def add_box(plant, scene_graph):
    """Add what is held: see the tutorial on your own diagram."""
    inertia = SpatialInertia.SolidBoxWithMass(WEIGHT / 9.81, *SIZE)
    box = plant.AddRigidBody("box", plant.AddModelInstance("box"), inertia)
    touch = ProximityProperties()
    AddRigidHydroelasticProperties(0.01, touch)
    plant.RegisterCollisionGeometry(box, RigidTransform(), Box(*SIZE), "bed_box", touch)


class Trial:
    """One box on one bag.

    Args:
        cell: With the box in it.
    """

    def __init__(self, cell):
        self.cell, self.box = cell, cell.plant.GetBodyByName("box")
        self.simulator = Simulator(cell.diagram)
        self.simulator.set_monitor(cell.monitor)
        self.simulator.Initialize()
        self.root = self.simulator.get_mutable_context()
        self.context = cell.plant.GetMyMutableContextFromRoot(self.root)
        top = cell.fixture.entry_height + SIZE[2] / 2
        X_WB = cell.X_WJ @ RigidTransform([0.0, 0.0, top])
        cell.plant.SetFreeBodyPose(self.context, self.box, X_WB)
        cell.fixture.receive(self.root, self.box)

    def height(self):
        """Return the height of the box in the world [m]."""
        return self.cell.plant.EvalBodyPoseInWorld(self.context, self.box).translation()[2]

    def run(self, seconds, pull):
        """Go on for some time with a vertical force on the box [N]."""
        force = ExternallyAppliedSpatialForce()
        force.body_index = self.box.index()
        force.F_Bq_W = SpatialForce(np.zeros(3), [0.0, 0.0, pull])
        port = self.cell.diagram.GetInputPort("external_forces")
        port.FixValue(self.root, Value([force]))
        self.simulator.AdvanceTo(self.root.get_time() + seconds)

    def holding_force(self, press):
        """Return the pull at which the box comes off, less its weight [N].

        Args:
            press: Force that presses it in, for half a second [N].
        """
        self.run(0.5, -press)
        self.cell.fixture.fix(self.root)
        self.run(0.9, 0.0)
        assert self.cell.fixture.fixed(self.root)
        held, pull = self.height(), WEIGHT
        while self.height() < held + OFF:
            pull += RATE * 0.01
            self.run(0.01, pull)
        return pull - WEIGHT


def hold(task, *, press=20.0):
    """Measure the holding force of one bag: one trial of a campaign."""
    cell = build_cell(task.config, Product(), extend=add_box)
    return Outcome(True, {"holding_N": Trial(cell).holding_force(press)})


if __name__ == "__main__":  # Worker processes import this file, too.
    points = grid({"jig.vacuum.pressure": [15e3, 45e3, 90e3]})
    rows = run_campaign(trials(hold, points), "holding", workers=1)
    for row in rows:
        vacuum, force = row.varied["jig.vacuum.pressure"], row.measured["holding_N"]
        print(f"vacuum {1e-3 * vacuum:4.0f} kPa: the bag holds {force:5.1f} N")
    assert np.all(np.diff([row.measured["holding_N"] for row in rows]) > 0)
