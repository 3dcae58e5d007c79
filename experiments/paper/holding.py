"""What a fixture bears: slow pulls on the part that a rig has placed, with the base bolted down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from cell.errors import RunFailure
from cell.forces import applied_force
from experiments.paper.rig.rig import Rig
from experiments.paper.rig.rig_simulation import RigSimulation
from planning.operations.measures import angle_between

RATE, MOST = 20.0, 40.0  # Of a force [N/s], [N]; faster ramps overstate holding by 1 to 2 N [M].
TURN_RATE, TURN_MOST = 0.5, 1.5  # Of a moment [N m/s], [N m].
AWAY, TURNED = 1e-3, np.deg2rad(2.0)  # At which the part no longer counts as held [m], [rad].

SIDEWAYS = tuple(f"force {way}" for way in ("+x", "-x", "+y", "-y"))  # In J.
LIFT = "force +z"
LOADS = (*SIDEWAYS, LIFT, "moment x", "moment y", "moment z")


@dataclass(frozen=True)
class Held:
    """What it takes to move a part.

    Attributes:
        load: Force [N] or moment [N m] at the end of the ramp.
        moved: Whether the part moved; else it bears more than that.
    """

    load: float
    moved: bool


def holding(simulation: RigSimulation, loads: Sequence[str] = LOADS) -> Mapping[str, Held]:
    """Return what the placed part bears at its mass centre, by direction: "force +x", "moment z".

    Each pull starts from the same state, a copy of the simulation's; the simulation is not changed.

    Args:
        simulation: Of a rig whose hand has let go and is away.
        loads: Those of `LOADS` that are wanted.
    """
    found = {}
    for load in loads:
        kind, way = load.split()
        axis = np.eye(3)["xyz".index(way[-1])] * (-1.0 if way[0] == "-" else 1.0)
        if kind == "force":
            found[load] = _pull(simulation, np.zeros(3), RATE * axis, MOST / RATE)
        else:
            found[load] = _pull(simulation, TURN_RATE * axis, np.zeros(3), TURN_MOST / TURN_RATE)
    return found


def _pull(
    simulation: RigSimulation, turning: np.ndarray, pushing: np.ndarray, seconds: float
) -> Held:
    """Return at which load the part moves, under a moment and a force that grow at rates (3,)."""
    rig, body = simulation.rig, simulation.rig.part.body
    simulator = Simulator(rig.diagram, simulation.root.Clone())
    simulator.set_monitor(rig.monitor)
    root = simulator.get_mutable_context()
    rig.jig_base.sleep(root)
    simulator.Initialize()
    forces = rig.diagram.GetSubsystemByName("forces")
    port, context = forces.GetInputPort("external"), forces.GetMyMutableContextFromRoot(root)
    p_com = rig.part.part.mesh.center_mass
    rate = float(np.linalg.norm(turning) + np.linalg.norm(pushing))
    start, begun = _pose(rig, root), root.get_time()
    time_step = rig.config.simulation.time_step
    for k in range(1, round(seconds / time_step) + 1):
        wrench = SpatialForce(k * time_step * turning, k * time_step * pushing)
        port.FixValue(context, Value([applied_force(body.index(), p_com, wrench)]))
        try:
            simulator.AdvanceTo(begun + k * time_step)
        except (RunFailure, RuntimeError):  # The bed tears, or the part is thrown off.
            return Held(rate * k * time_step, moved=True)
        now = _pose(rig, root)
        if np.linalg.norm(now @ p_com - start @ p_com) > AWAY or angle_between(start, now) > TURNED:
            return Held(rate * k * time_step, moved=True)
    return Held(rate * seconds, moved=False)


def _pose(rig: Rig, root: Context) -> RigidTransform:
    """Return X_JP."""
    context = rig.plant.GetMyContextFromRoot(root)
    return rig.jig_base.X_WJ(context).InvertAndCompose(rig.part.X_WP(context))
