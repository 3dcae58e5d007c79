"""The hand on the carriage of the rig in a trial, which starts with the part above the jig."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform

from cell.configuration.config import CellConfig
from cell.products.product import Grasp, Product
from cell.simulation.phase import PhaseFailed
from cell.simulation.state import State
from experiments.paper.larger_part import larger
from experiments.paper.postures import Posture
from experiments.paper.rest import Rest
from experiments.paper.rig.rig import HandPose, Rig, build_push_rig
from experiments.paper.rig.rig_simulation import RigSimulation
from experiments.paper.rig.stage import Observer
from experiments.paper.trial import (
    HOVER,
    READY_TIME,
    TrialDisturbance,
    gripped,
    held,
    planned_pose,
)
from experiments.speed.meter import Meter
from planning.operations.grasping import CLEAR, CLEARANCE, tip_opening
from planning.operations.pick_place.phases import DEEPEST
from planning.operations.push.phases import ABOVE, BEHIND, BEHIND_ABOVE, PushLine

GRIP_TIME, RELEASE_TIME = 0.25, 0.15  # Of the jaws, to close and to open [s] [A].
PRESS_SPEED = 0.01  # [m/s] [A]; the bed has no rate effect at 10 to 80 mm/s [M].
JAM_TIME = 1.5  # The pump is at 90 kPa after this at the latest [s] [D].
HOLD_TIME = 0.2  # From the freezing of the bag to the release [s] [A].
RETREAT = 0.08  # Of the hand after the release [m].
TRAVEL_SPEED = 0.3  # Of the hand in free air [m/s] [A].


def tip_pose(rig: Rig, X_WP: RigidTransform, grasp: Grasp) -> HandPose:
    """Return the hand pose with the jaw at a grasp of the part."""
    hand = rig.gripper.instance
    X_TipMount = rig.plant.GetFrameByName("tip", hand).GetFixedPoseInBodyFrame().inverse()
    X_TipJaw = X_TipMount @ rig.plant.GetFrameByName(grasp.jaw, hand).GetFixedPoseInBodyFrame()
    return HandPose.of(X_WP @ grasp.X_PJaw @ X_TipJaw.inverse())


@dataclass(frozen=True)
class RigBench:
    """A built rig for the trials of one posture.

    Attributes:
        rig: Built for the part of the posture.
        posture: In which the part is placed.
    """

    rig: Rig
    posture: Posture

    @staticmethod
    def build(
        config: CellConfig, product: Product, posture: Posture, growth: float = 0.0
    ) -> RigBench:
        """Build the rig for the part of a posture, with a fixture that takes it in this posture.

        Args:
            config: Of the cell.
            product: With the part.
            posture: In which it is placed.
            growth: By which the part is larger than a fixture that is made for it knows [m].
        """
        config, product = held(config, posture), gripped(product, posture)
        surface = larger(product.parts[posture.part].mesh, growth) if growth else None
        return RigBench(build_push_rig(config, product, posture.part, surface), posture)

    def begin(self, disturbance: TrialDisturbance) -> RigHand:
        """Set up a trial: the part on a stand over the jig, the open hand around it."""
        X_WJ = self.rig.config.workcell.X_WJ
        height = self.rig.fixture.entry_height + HOVER
        X_WP = planned_pose(self.rig.part.part, self.posture, X_WJ, height)
        simulation = RigSimulation(
            self.rig,
            disturbance.displaced(X_WJ),
            X_WP @ disturbance.X_PDrawn,
            tip_pose(self.rig, X_WP, self.posture.grasp),
        )
        return RigHand(simulation, self.posture.grasp, X_WJ.InvertAndCompose(X_WP))


@dataclass(frozen=True)
class RigHand:
    """The rig's hand in one trial: see `experiments.paper.trial.Hand`.

    Attributes:
        simulation: Of the rig.
        grasp: Of the part.
        planned: Nominal X_JP over the jig.
    """

    simulation: RigSimulation
    grasp: Grasp
    planned: RigidTransform

    @property
    def observer(self) -> Observer:
        """Observer of part and jig."""
        return self.simulation.observer

    @property
    def meter(self) -> Meter:
        """CPU time spent stepping, by class of what goes on."""
        return self.simulation.meter

    def save(self) -> State:
        """Return time, positions and velocities of all bodies; the trial's seed gives the rest."""
        plant, context = self.simulation.rig.plant, self.simulation.observer.context
        return {
            "time": np.array(self.simulation.time),
            "q": plant.GetPositions(context),
            "v": plant.GetVelocities(context),
        }

    def press(self) -> None:
        """Grip the part, press it in and freeze the bag.

        The robot waits for a steady force between press and evacuation; here evacuation starts at
        once.
        """
        simulation, force = self.simulation, self.simulation.rig.config.placement.press_force
        simulation.begin("grip")
        simulation.wait(READY_TIME)
        simulation.observer.tare()
        simulation.observer.recording = True
        simulation.jaws(tip_opening(simulation.rig.gripper.model, self.grasp), self.grasp.force)
        simulation.wait(GRIP_TIME)
        simulation.rig.let_part_go(simulation.root)
        simulation.wait(0.1)
        simulation.begin("press")
        simulation.press_with_part()
        if not simulation.lower(PRESS_SPEED, HOVER + DEEPEST, force):
            raise PhaseFailed("press", f"no resistance within {DEEPEST * 1e3:g} mm")
        simulation.begin("jam")
        simulation.fix()
        for _ in range(round(JAM_TIME / simulation.time_step)):
            simulation.step()
            if simulation.fixed:
                break
        simulation.wait(HOLD_TIME)
        if not simulation.fixed:
            raise PhaseFailed("jam", f"the fixture does not hold after {JAM_TIME:g} s")

    def let_go(self) -> None:
        """Open the jaws and retreat along the approach direction."""
        simulation = self.simulation
        simulation.begin("release")
        simulation.jaws(tip_opening(simulation.rig.gripper.model, self.grasp) + CLEARANCE)
        simulation.wait(RELEASE_TIME)
        start = simulation.pose
        for distance, speed in ((CLEAR, 0.08), (RETREAT, TRAVEL_SPEED)):
            back = start.p_WT - distance * start.R_WT.matrix()[:, 2]
            simulation.move(replace(start, p_WT=back), speed)

    def approach(self, line: PushLine) -> None:
        """Approach from above and behind."""
        simulation = self.simulation
        simulation.begin("approach")
        simulation.jaws(0.0)
        simulation.lower_palm()
        simulation.sleep()
        start, up = HandPose.of(line.X_WT), np.array([0.0, 0.0, 1.0])
        high = start.p_WT + ABOVE * up - BEHIND_ABOVE * line.direction
        simulation.move(replace(start, p_WT=high), 2 * TRAVEL_SPEED)
        back = start.p_WT - BEHIND * line.direction
        simulation.move(replace(start, p_WT=back), TRAVEL_SPEED)
        simulation.move(start, TRAVEL_SPEED / 3)
        simulation.wake()

    def push(self, line: PushLine) -> None:
        """Push along the line."""
        self.simulation.begin("push")
        goal = HandPose.of(line.at(line.stroke.way))
        self.simulation.push(goal, line.stroke.speed, line.stroke.acceleration)

    def wait(self, phase: str, seconds: float) -> None:
        """Hold the hand still."""
        self.simulation.begin(phase)
        self.simulation.wait(seconds)

    def wait_for_rest(self, phase: str, longest: float) -> None:
        """Hold the hand still until part and jig rest."""
        simulation, rest = self.simulation, Rest(self.observer)
        simulation.begin(phase)
        for _ in range(round(longest / simulation.time_step)):
            simulation.step()
            if rest.reached():
                break
