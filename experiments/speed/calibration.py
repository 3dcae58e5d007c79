"""A fixed workload of the same kind as the cell's, to compare machines: the calibration kernel.

Compliant boxes stand on each other on a rigid floor, stepped by Drake with hydroelastic contact;
between the steps NumPy works on a height field and on small systems of equations. It is the same
work in every iteration and must never change: stored ratios are in units of it.
"""

from __future__ import annotations

import time

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

SIDE = 0.04  # Of a box [m].
BOXES = 6
TIME_STEP = 1e-3  # [s]
STEPS = 10  # In an iteration.
SETTLING = 100  # Steps before the first iteration.
FIELD = 128  # Points along a side of the height field.
REPEATS = 5  # The least disturbed counts.


class Kernel:
    """The calibration kernel, ready to be timed."""

    def __init__(self) -> None:
        builder = DiagramBuilder()
        self._plant, _ = AddMultibodyPlant(
            MultibodyPlantConfig(
                time_step=TIME_STEP,
                contact_model="hydroelastic_with_fallback",
                discrete_contact_approximation="lagged",
            ),
            builder,
        )
        floor = _contact(compliant=False)
        box = Box(SIDE, SIDE, SIDE)
        world = self._plant.world_body()
        below = RigidTransform([0.0, 0.0, -0.05])
        self._plant.RegisterCollisionGeometry(world, below, Box(1.0, 1.0, 0.1), "floor", floor)
        for k in range(BOXES):
            inertia = SpatialInertia.SolidBoxWithMass(0.1, SIDE, SIDE, SIDE)
            body = self._plant.AddRigidBody(f"box_{k}", inertia)
            soft = _contact(compliant=True)
            self._plant.RegisterCollisionGeometry(body, RigidTransform(), box, f"box_{k}", soft)
            # Two stacks, each box shifted against the one below it.
            place = [0.1 * (k % 2), 0.005 * (k // 2), SIDE * (0.5 + k // 2)]
            self._plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform(place))
        self._plant.Finalize()
        self._simulator = Simulator(builder.Build())
        root = self._simulator.get_mutable_context()
        self._context = self._plant.GetMyMutableContextFromRoot(root)
        self._simulator.AdvanceTo(SETTLING * TIME_STEP)
        self._state = self._plant.GetPositionsAndVelocities(self._context).copy()
        rng = np.random.default_rng(0)
        self._heights = rng.normal(size=(FIELD, FIELD))
        self._matrices = rng.normal(size=(STEPS, 12, 12)) + 12.0 * np.eye(12)

    def time(self) -> float:
        """Return the CPU time of one iteration [s], the least of a few."""
        return min(self._once() for _ in range(REPEATS))

    def _once(self) -> float:
        start = time.process_time()
        self._simulator.get_mutable_context().SetTime(0.0)
        self._plant.SetPositionsAndVelocities(self._context, self._state)
        self._simulator.Initialize()
        for k in range(STEPS):
            self._simulator.AdvanceTo((k + 1) * TIME_STEP)
            for matrix in self._matrices:
                np.linalg.solve(matrix, matrix[0])
            x, y = np.gradient(self._heights)
            steep = np.hypot(x, y) > 1.0
            np.where(steep, self._heights, np.clip(self._heights, -1.0, 1.0)).sum()
        return time.process_time() - start


def _contact(*, compliant: bool) -> ProximityProperties:
    properties = ProximityProperties()
    friction = CoulombFriction(0.5, 0.5)
    AddContactMaterial(dissipation=1.0, friction=friction, properties=properties)
    if compliant:
        AddCompliantHydroelasticProperties(SIDE / 4, 1e6, properties)
    else:
        AddRigidHydroelasticProperties(0.1, properties)
    return properties
