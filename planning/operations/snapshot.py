"""True states of a running cell, as plain values that verdicts are computed from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform

from cell.builder import Cell
from cell.simulation.simulation import Simulation

# Names of the collision pieces, in the models, that the hand has to keep clear of.
SHAFTS = ("shaft", "boss")


@dataclass(frozen=True)
class Wrench:
    """What the surroundings exert on a sensor, in W, about the sensor's origin S.

    Attributes:
        torque: (3,) [N m].
        force: (3,) [N].
        p_WS: (3,) [m].
    """

    torque: np.ndarray
    force: np.ndarray
    p_WS: np.ndarray

    def about(self, p_WQ: np.ndarray) -> np.ndarray:
        """Return the torque (3,) about another point Q [N m]."""
        return self.torque + np.cross(self.p_WS - p_WQ, self.force)


@dataclass(frozen=True)
class Snapshot:
    """The truth at one moment; operations never see it, verdicts do.

    Attributes:
        time: [s].
        X_WJ: Pose of the fixture.
        X_WP: Pose of each part.
        V_WP: (6,) velocity of each part in W, angular first [rad/s, m/s].
        X_HF: Pose of each bolt F in its thread frame H.
        turns: Of each bolt since its thread caught.
        clamp: Force that each thread carries [N].
        spindle_torque: Of the driver [N m].
        wrenches: By arm name at the wrists, and at the "force_plate".
        hand_clearance: Shortest distance from the gripper to the fixed shaft or boss of each fit,
            by the name of the part that carries it [m].
    """

    time: float
    X_WJ: RigidTransform
    X_WP: Mapping[str, RigidTransform]
    V_WP: Mapping[str, np.ndarray]
    X_HF: Mapping[str, RigidTransform]
    turns: Mapping[str, float]
    clamp: Mapping[str, float]
    spindle_torque: float
    wrenches: Mapping[str, Wrench]
    hand_clearance: Mapping[str, float]

    def X_JP(self, part: str) -> RigidTransform:
        """Return the pose of a part in the fixture's frame J."""
        return self.X_WJ.InvertAndCompose(self.X_WP[part])


def take_snapshot(simulation: Simulation) -> Snapshot:
    """Return the true state of a running cell."""
    cell, root, context = simulation.cell, simulation.root, simulation.context
    sensors = {name: arm.wrist for name, arm in cell.arms.items()}
    wrenches = {}
    for name, sensor in {**sensors, "force_plate": cell.force_plate}.items():
        reading = sensor.read(context)
        p_WS = sensor.weld.frame_on_child().CalcPoseInWorld(context).translation()
        wrenches[name] = Wrench(reading[:3], reading[3:], p_WS)
    query = cell.scene_graph.get_query_output_port().Eval(
        cell.scene_graph.GetMyContextFromRoot(root)
    )
    return Snapshot(
        time=simulation.time,
        X_WJ=cell.fixture.pose(context),
        X_WP={part.part.name: part.X_WP(context) for part in cell.parts},
        V_WP={part.part.name: part.velocity(context) for part in cell.parts},
        X_HF={bolt: cell.threads[bolt].X_HF(context) for bolt in cell.threads},
        turns={bolt: float(cell.threads.turns(root, bolt)) for bolt in cell.threads},
        clamp={bolt: cell.threads[bolt].clamp_force(context) for bolt in cell.threads},
        spindle_torque=cell.screwdriver.read(context).torque,
        wrenches=wrenches,
        hand_clearance={fit.shaft: _distance(cell, query, fit.shaft) for fit in cell.product.fits},
    )


def _distance(cell: Cell, query: QueryObject, part: str) -> float:
    """Return the shortest distance between the gripper and the shafts of a part [m]."""
    plant, inspector = cell.plant, cell.scene_graph.model_inspector()
    shafts = [
        geometry
        for geometry in plant.GetCollisionGeometriesForBody(cell.parts[part].body)
        if inspector.GetName(geometry).split("::")[-1] in SHAFTS
    ]
    hand = [
        geometry
        for body in plant.GetBodyIndices(cell.holder.tool_instance)
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(body))
    ]
    pairs = [(a, b) for a in hand for b in shafts]
    distances = [query.ComputeSignedDistancePairClosestPoints(a, b).distance for a, b in pairs]
    return min(distances, default=np.inf)
