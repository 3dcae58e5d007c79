"""The stage of a trial, part, jig and hand of either kind, and the observer that records it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from cell.configuration.config import CellConfig
from cell.fixtures.base import Fixture
from cell.fixtures.soft_jig import SurfaceSamples
from cell.machines.gripper import Gripper
from cell.machines.jig_base import JigBase
from cell.machines.sensors import WrenchSensor
from cell.simulation.log import Log
from cell.simulation.phase import PhaseFailed
from cell.workpieces.parts import LoosePart

# A part this far below the top of the jig's base, or this far from its axis, has fallen off [m].
DROPPED_BELOW, DROPPED_BESIDE = 0.02, 0.12
RECORD_PERIOD = 2e-3  # [s] A force plate samples at 500 Hz or more [A].


@dataclass(frozen=True)
class Stage:
    """Handles to the bodies and sensors of a trial.

    Attributes:
        config: Of the cell.
        plant, scene_graph: Drake's.
        jig_base: The base, free on the force plate.
        fixture: On the base.
        part: The part to place.
        gripper: The jaws; the frame "tip" of the model is T, between the tip pads.
        wrist: Wrench between the hand and its carrier.
        force_plate: Wrench under the force plate.
    """

    config: CellConfig
    plant: MultibodyPlant
    scene_graph: SceneGraph
    jig_base: JigBase
    fixture: Fixture
    part: LoosePart
    gripper: Gripper
    wrist: WrenchSensor
    force_plate: WrenchSensor

    @cached_property
    def surface(self) -> np.ndarray:
        """Points (n, 3) of the part's surface, in its frame [m]: only a push asks for them."""
        return SurfaceSamples.of(self.part.part.name, self.part.part.mesh).points


class Observer:
    """Observes and records a stage during a trial.

    Args:
        stage: To observe.
        root: Context of the diagram.

    Attributes:
        stage, root: As given.
        context: Context of the plant.
        recording: Whether a row is added to the log every `RECORD_PERIOD`.
        log: Poses, and wrenches relative to the latest `tare`.
        latest: (12,) latest of these wrenches, of wrist and force plate [N m, N].
    """

    def __init__(self, stage: Stage, root: Context) -> None:
        self.stage, self.root = stage, root
        self.context = stage.plant.GetMyMutableContextFromRoot(root)
        self.recording = False
        self.log = Log()
        self.latest = np.zeros(12)
        self._tare = np.zeros(12)
        step = stage.config.simulation.time_step
        self._record_every = max(1, round(RECORD_PERIOD / step))

    @property
    def X_WJ(self) -> RigidTransform:
        """True pose of the jig."""
        return self.stage.jig_base.X_WJ(self.context)

    @property
    def X_WP(self) -> RigidTransform:
        """True pose of the part."""
        return self.stage.part.X_WP(self.context)

    @property
    def X_JP(self) -> RigidTransform:
        """Pose of the part relative to the jig."""
        return self.X_WJ.InvertAndCompose(self.X_WP)

    @property
    def speed(self) -> float:
        """Speed of the part's origin in W [m/s]."""
        return float(np.linalg.norm(self.stage.part.velocity(self.context)[3:]))

    def begin(self, phase: str, time: float) -> None:
        """Start a phase; the log and failures name it."""
        self.log.phases.append((phase, time))

    def tare(self) -> None:
        """Zero both wrench sensors at their present readings."""
        self._tare = self._readings()

    def tare_hand(self) -> None:
        """Zero the wrist sensor at its present reading."""
        self._tare[:6] = self._readings()[:6]

    def step(self, steps: int, time: float) -> None:
        """Record the step if a record is due.

        Args:
            steps: Number of the step.
            time: [s].

        Raises:
            PhaseFailed: The part fell off, or the state is not finite.
        """
        if self.recording and steps % self._record_every == 0:
            self._record(time, self._readings() - self._tare)

    def failure(self, evidence: str) -> PhaseFailed:
        """Return the failure of the present phase."""
        return PhaseFailed(self.log.phases[-1][0] if self.log.phases else "start", evidence)

    def _readings(self) -> np.ndarray:
        sensors = (self.stage.wrist, self.stage.force_plate)
        return np.concatenate([sensor.read(self.context) for sensor in sensors])

    def _record(self, time: float, wrenches: np.ndarray) -> None:
        self.latest = wrenches
        X_WJ, X_WP = self.X_WJ, self.X_WP
        p_JP = X_WJ.inverse() @ X_WP.translation()
        if not np.isfinite(p_JP).all():
            raise self.failure("the state is not finite")
        self.log.append(
            time=time,
            X_WJ=X_WJ.GetAsMatrix34(),
            X_WP=X_WP.GetAsMatrix34(),
            hand_wrench=wrenches[:6],
            force_plate=wrenches[6:],
        )
        if p_JP[2] < -DROPPED_BELOW or np.hypot(p_JP[0], p_JP[1]) > DROPPED_BESIDE:
            raise self.failure(f"'{self.stage.part.part.name}' fell off the jig")
