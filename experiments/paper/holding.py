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

from cell.bodies import full_name
from cell.errors import RunFailure
from cell.fixtures.soft_jig import SoftJig
from cell.forces import applied_force
from cell.vectors import cross
from experiments.paper.rig.rig import Rig
from experiments.paper.rig.rig_simulation import RigSimulation
from planning.fixture_analysis.holding_map import ANGLE, WAY, Bearing, depth_over_area

RATE, MOST = 20.0, 40.0  # Of a force [N/s], [N]; faster ramps overstate holding by 1 to 2 N [M].
TURN_RATE, TURN_MOST = 0.5, 1.5  # Of a moment [N m/s], [N m].
AVERAGED = 5e-3  # Time over which an acceleration is taken, twice [s] [A].

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

    Args:
        simulation: Of a rig whose hand has let go and is away.
        loads: Those of `LOADS` that are wanted.
    """
    found = {}
    for load in loads:
        kind, way = load.split()
        axis = np.eye(3)["xyz".index(way[-1])] * (-1.0 if way[0] == "-" else 1.0)
        unit = (np.zeros(3), axis) if kind == "force" else (axis, np.zeros(3))
        bearing = pull(simulation, np.concatenate(unit))
        found[load] = Held(bearing.load, bearing.moved)
    return found


def pull(simulation: RigSimulation, direction: np.ndarray) -> Bearing:
    """Load a placed part with a slow ramp until it moves; the simulation is not changed.

    Each pull starts from the same state, a copy of the simulation's. What is borne is the load less
    what accelerates the part: a part of 70 g that nothing holds takes half a newton more at this
    ramp before it has moved by 1 mm.

    Args:
        simulation: Of a rig whose hand has let go and is away.
        direction: (6,) unit moment or unit force at the mass centre, in J.
    """
    rig, body = simulation.rig, simulation.rig.part.body
    simulator = Simulator(rig.diagram, simulation.root.Clone())
    simulator.set_monitor(rig.monitor)
    root = simulator.get_mutable_context()
    rig.jig_base.sleep(root)
    simulator.Initialize()
    forces = rig.diagram.GetSubsystemByName("forces")
    port, context = forces.GetInputPort("external"), forces.GetMyMutableContextFromRoot(root)
    p_PG = rig.part.part.mesh.center_mass
    rate, most = (TURN_RATE, TURN_MOST) if direction[:3].any() else (RATE, MOST)
    watch, begun = _Watch(rig, root), root.get_time()
    time_step = rig.config.simulation.time_step
    rows = [np.zeros(9)]
    for k in range(1, round(most / rate / time_step) + 1):
        load = rate * k * time_step
        wrench = SpatialForce(load * direction[:3], load * direction[3:])
        port.FixValue(context, Value([applied_force(body.index(), p_PG, wrench)]))
        try:
            simulator.AdvanceTo(begun + k * time_step)
        except (RunFailure, RuntimeError):  # The bed tears, or the part is thrown off.
            rows.append(np.array([load, np.pi, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
            break
        rows.append(np.array([load, *watch.motion(p_PG), *watch.bed()]))
        if np.linalg.norm(rows[-1][4:7]) > WAY or np.linalg.norm(rows[-1][1:4]) > ANGLE:
            break
    table = np.array(rows)
    borne = watch.borne(table[:, 0], table[:, 1:7], direction, time_step)
    return Bearing.of(borne, table[:, 1:7], watch.height(p_PG), table[:, 7], table[:, 8])


class _Watch:
    """What has become of a part and its fixture since a pull began."""

    def __init__(self, rig: Rig, root: Context) -> None:
        self._rig, self._root, self._start = rig, root, _pose(rig, root)
        self._name = full_name(rig.part.body)
        self._sealed = self._suction()
        if isinstance(rig.fixture, SoftJig):
            mesh = rig.fixture.memory(root).mesh
            self._vertices, self._faces = mesh.vertices.copy(), mesh.boundary()
            a, b, c = self._vertices[self._faces].transpose(1, 0, 2)
            self._areas = np.linalg.norm(cross(b - a, c - a), axis=1) / 2

    def borne(
        self, loads: np.ndarray, motion: np.ndarray, direction: np.ndarray, time_step: float
    ) -> np.ndarray:
        """Return the most that the fixture has borne of a ramp, up to each step (k,).

        Args:
            loads: (k,) applied, in multiples of the direction.
            motion: (k, 6) rotation and translation of the part.
            direction: (6,) of the load.
            time_step: Between the rows [s].
        """
        part = self._rig.part.part
        R = self._start.rotation().matrix()
        turning = R @ (part.mesh.moment_inertia * part.mass / part.mesh.volume) @ R.T
        inertia = (
            direction[:3] @ turning @ direction[:3] + part.mass * direction[3:] @ direction[3:]
        )
        way, steps = motion @ direction, round(AVERAGED / time_step)
        if len(way) <= 2 * steps:
            return loads
        second = way[2 * steps :] - 2 * way[steps:-steps] + way[: -2 * steps]
        borne = loads.copy()
        borne[steps:-steps] -= inertia * second / (steps * time_step) ** 2
        borne[-steps:] = borne[-steps - 1]
        return np.maximum.accumulate(np.clip(borne, 0.0, loads))

    def height(self, p_PG: np.ndarray) -> float:
        """Return the height of the mass centre over the lowest point of the part [m]."""
        up = self._start.rotation().matrix()[2]
        return float(up @ p_PG - (self._rig.part.part.mesh.vertices @ up).min())

    def motion(self, p_PG: np.ndarray) -> np.ndarray:
        """Return rotation [rad] and translation [m] of the mass centre (6,), in J."""
        now = _pose(self._rig, self._root)
        turn = (now.rotation() @ self._start.rotation().inverse()).ToAngleAxis()
        return np.concatenate([turn.angle() * turn.axis(), now @ p_PG - self._start @ p_PG])

    def bed(self) -> tuple[float, float]:
        """Return how far the bed has given way for good [m], and the share of suction lost.

        The first by area, as the holding map has it; nothing of a fixture that does not yield.
        """
        fixture = self._rig.fixture
        if not isinstance(fixture, SoftJig):
            return 0.0, 0.0
        moves = np.linalg.norm(fixture.memory(self._root).mesh.vertices - self._vertices, axis=1)
        depths = moves[self._faces].mean(axis=1)
        way = float(depth_over_area(depths[None], self._areas)[0])
        return way, 1.0 - self._suction() / self._sealed if self._sealed else 0.0

    def _suction(self) -> float:
        """Return the area that is still sealed [m2]."""
        fixture = self._rig.fixture
        if not isinstance(fixture, SoftJig):
            return 0.0
        seal = fixture.memory(self._root).holding.seals.get(self._name)
        return float(seal.intact @ seal.areas) if seal else 0.0


def _pose(rig: Rig, root: Context) -> RigidTransform:
    """Return X_JP."""
    context = rig.plant.GetMyContextFromRoot(root)
    return rig.jig_base.X_WJ(context).InvertAndCompose(rig.part.X_WP(context))
