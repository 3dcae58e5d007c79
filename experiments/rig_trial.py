"""One trial with the rig: place a part on the jig, and push it if that is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cell.config import CellConfig
from cell.errors import BadPart
from cell.phase import PhaseFailed
from cell.product import Grasp, Part
from cell.rig import HandPose, Rig
from cell.rig_simulation import RigSimulation
from experiments.postures import AXES, MM, Posture, Push
from experiments.reach import Fingers
from planning.operations.grasping import CLEAR, CLEARANCE, GRIP_TIME, RELEASE_TIME, tip_opening
from planning.operations.pick_place import DEEPEST, JAM_TIME, PRESS_SPEED, SETTLE_TIME
from planning.operations.placement import upright

HOVER = 0.001  # The part starts this far above the bag [m] [A].
HOLD_TIME = 0.2  # The hand stays this long after the bag has frozen [s] [A].
RETREAT = 0.08
REST_TIME = 0.3  # After the hand has left, before it comes to push [s] [A].
TRAVEL_SPEED = 0.3  # Of the hand in the free [m/s] [A].
COAST_TIME = 0.6  # From the hand's stop until everything rests again [s] [A].


@dataclass(frozen=True)
class Disturbance:
    """What is not where it should be in a trial.

    Attributes:
        X_PDrawn: Error of the part in the grasp.
        jig_offset: (2,) of the jig on the force plate [m].
    """

    X_PDrawn: RigidTransform
    jig_offset: np.ndarray

    @staticmethod
    def draw(config: CellConfig, rng: np.random.Generator) -> Disturbance:
        """Draw one."""
        push = config.push
        angles = rng.normal(scale=np.deg2rad(push.grasp_angle_sigma_deg), size=3)
        offset = rng.normal(scale=push.grasp_position_sigma, size=3)
        jig = rng.normal(scale=push.jig_position_sigma, size=2)
        return Disturbance(RigidTransform(RollPitchYaw(angles), offset), jig)


@dataclass
class Trial:
    """What happened.

    Attributes:
        planned: Pose of the part over the jig before it is pressed in, as aimed at.
        held: Its pose when the bag had frozen, in the hand.
        placed: Its pose after the hand had left; None if it did not get so far.
        speed: Of the part then [m/s].
        before, after: Pose of the jig around the push, in W.
        last_jig: Pose of the jig at the end, whatever happened.
        moved: Pose of the part on the jig at the end.
        failure: The phase that failed and why; None if all phases ran.
        log: Arrays of the whole trial.
        sim_seconds, cpu_seconds: Simulated time, and CPU time spent stepping [s].
    """

    planned: RigidTransform
    held: RigidTransform | None = None
    placed: RigidTransform | None = None
    speed: float = 0.0
    before: RigidTransform | None = None
    after: RigidTransform | None = None
    last_jig: RigidTransform = field(default_factory=RigidTransform)
    moved: RigidTransform | None = None
    failure: tuple[str, str] | None = None
    log: dict[str, np.ndarray] = field(default_factory=dict)
    sim_seconds: float = 0.0
    cpu_seconds: float = 0.0


def planned_pose(
    part: Part, posture: Posture, X_WJ: RigidTransform, height: float
) -> RigidTransform:
    """Return X_WP: upright, centre of mass over the jig, lowest point at a height over J [m]."""
    R_WP = upright(posture.up, 0.0)
    points = part.mesh.vertices @ R_WP.matrix().T
    centre = R_WP @ part.mesh.center_mass
    offset = np.array([-centre[0], -centre[1], height - points[:, 2].min()])
    return RigidTransform(R_WP, X_WJ.translation() + offset)


def check_fits(config: CellConfig, part: Part, posture: Posture) -> None:
    """Raise `BadPart` for a part that is wider than the bag."""
    R_WP = upright(posture.up, 0.0)
    size = np.ptp(part.mesh.vertices @ R_WP.matrix().T, axis=0)
    aperture = 2 * config.jig.bag.aperture_radius
    if max(size[:2]) > aperture:
        raise BadPart(
            part.name,
            f"it is {1e3 * max(size[:2]):.0f} mm wide in posture {posture.name}, "
            f"the bag's aperture {1e3 * aperture:.0f} mm",
        )


def tip_pose(rig: Rig, X_WP: RigidTransform, grasp: Grasp) -> HandPose:
    """Return where the hand is when its jaw is at a grasp of the part."""
    hand = rig.gripper.instance
    X_TipMount = rig.plant.GetFrameByName("tip", hand).GetFixedPoseInBodyFrame().inverse()
    X_TipJaw = X_TipMount @ rig.plant.GetFrameByName(grasp.jaw, hand).GetFixedPoseInBodyFrame()
    return HandPose.of(X_WP @ grasp.X_PJaw @ X_TipJaw.inverse())


Watch = Callable[[str, RigSimulation], None]


def ignore(event: str, simulation: RigSimulation) -> None:
    """Watch nothing."""


def run_trial(
    rig: Rig,
    posture: Posture,
    push: Push | None,
    rng: np.random.Generator,
    watch: Watch = ignore,
) -> Trial:
    """Place the part with the rig's hand and, if asked, push it.

    Args:
        rig: Built for the part; used again and again.
        posture: How the part is placed.
        push: None: only place.
        rng: Draws the disturbance.
        watch: Told of the events "placed", "before", "after" and "end".
    """
    config, part = rig.config, rig.part.part
    X_WJ = config.workcell.X_WJ
    disturbance = Disturbance.draw(config, rng)
    X_WP = planned_pose(part, posture, X_WJ, config.jig.bag.cap_height + HOVER)
    pose = tip_pose(rig, X_WP, posture.grasp)
    offset = np.array([*disturbance.jig_offset, 0.0])
    trial = Trial(planned=X_WJ.InvertAndCompose(X_WP))
    simulation = RigSimulation(
        rig,
        RigidTransform(X_WJ.rotation(), X_WJ.translation() + offset),
        X_WP @ disturbance.X_PDrawn,
        pose,
    )
    try:
        _place(simulation, posture.grasp, trial, SETTLE_TIME if push is None else REST_TIME)
        watch("placed", simulation)
        if push is not None:
            _push(simulation, push, trial, watch)
    except PhaseFailed as error:
        trial.failure = (error.phase, error.evidence)
    watch("end", simulation)
    trial.moved, trial.last_jig = simulation.X_JP, simulation.X_WJ
    trial.log = simulation.log.arrays()
    trial.sim_seconds, trial.cpu_seconds = simulation.time, simulation.stepping_cpu
    return trial


def _place(simulation: RigSimulation, grasp: Grasp, trial: Trial, settle: float) -> None:
    """Grip, press, freeze, let go: as the robot does it."""
    rig = simulation.rig
    opening = tip_opening(grasp)
    simulation.begin("grip")
    simulation.wait(REST_TIME / 3)
    simulation.tare()
    simulation.jaws(opening, grasp.force)
    simulation.wait(GRIP_TIME)
    rig.let_part_go(simulation.root)
    simulation.wait(0.1)
    simulation.begin("press")
    simulation.press_with_part()
    if not simulation.lower(PRESS_SPEED, DEEPEST, rig.config.placement.press_force):
        raise PhaseFailed("press", f"no resistance within {DEEPEST * 1e3:g} mm")
    simulation.begin("jam")
    simulation.evacuate()
    for _ in range(round(JAM_TIME / simulation.time_step)):
        simulation.step()
        if simulation.frozen:
            break
    simulation.wait(HOLD_TIME)
    if not simulation.frozen:
        raise PhaseFailed("jam", f"the bag is still soft after {JAM_TIME:g} s")
    trial.held = simulation.X_JP
    simulation.begin("release")
    simulation.jaws(opening + CLEARANCE)
    simulation.wait(RELEASE_TIME)
    start = simulation.pose
    for distance, speed in ((CLEAR, 0.08), (RETREAT, TRAVEL_SPEED)):
        back = start.p_WT - distance * start.R_WT.matrix()[:, 2]
        simulation.move(replace(start, p_WT=back), speed)
    simulation.begin("settle")
    simulation.wait(settle)
    trial.placed, trial.speed = simulation.X_JP, simulation.speed


def _push(simulation: RigSimulation, push: Push, trial: Trial, watch: Watch) -> None:
    """Bring the closed hand beside the part, push, and back off."""
    numbers = simulation.rig.config.push
    simulation.begin("approach")
    simulation.jaws(0.0)
    simulation.sleep()
    start, direction = push_start(simulation, push)
    high = start.p_WT + np.array([0.0, 0.0, 0.12]) - 0.05 * direction
    simulation.move(replace(start, p_WT=high), 2 * TRAVEL_SPEED)
    simulation.move(replace(start, p_WT=start.p_WT - 0.02 * direction), TRAVEL_SPEED)
    simulation.move(start, TRAVEL_SPEED / 3)
    simulation.wake()
    simulation.wait(0.1)
    trial.before = simulation.X_WJ
    watch("before", simulation)
    simulation.begin("push")
    goal = replace(start, p_WT=start.p_WT + numbers.stroke * direction)
    simulation.push(goal, numbers.speed, numbers.acceleration)
    simulation.begin("coast")
    simulation.wait(COAST_TIME)
    trial.after = simulation.X_WJ
    watch("after", simulation)


def push_start(simulation: RigSimulation, push: Push) -> tuple[HandPose, np.ndarray]:
    """Return where the hand starts its push, and the direction (3,) in W.

    The one rule for all cases: the fingers' lowest point at `height_fraction` of the exposed height
    of the pushed face where the hand meets it, and `bed_clearance` above the bed at least; the hand
    starts `start_gap` before it touches.
    """
    rig, numbers = simulation.rig, simulation.rig.config.push
    X_WP = simulation.X_WP
    foot, top = (X_WP @ (np.array(point) * MM) for point in (push.foot, push.top))
    direction = X_WP.rotation() @ AXES[push.along]
    direction = np.array([direction[0], direction[1], 0.0]) / np.hypot(*direction[:2])
    bed = bed_height(simulation, foot[:2])
    low = max(foot[2], bed)
    height = max(low + numbers.height_fraction * (top[2] - low), bed + numbers.bed_clearance)
    fingers = Fingers.of_hand(rig)
    travel = fingers.travel(X_WP @ rig.samples.points.T, top[:2], height, direction)
    p_WT = np.array([*top[:2], height + fingers.below_tip])
    p_WT += (travel - numbers.start_gap) * direction
    turn = float(np.arctan2(-direction[0], direction[1]))
    return HandPose(p_WT, turn), direction


def bed_height(simulation: RigSimulation, p_WQ: np.ndarray, radius: float = 5e-3) -> float:
    """Return the highest the bed stands in W around a point (2,) [m]."""
    jig, X_WJ = simulation.rig.soft_jig, simulation.X_WJ
    if jig is None:
        return float(X_WJ.translation()[2] + simulation.rig.config.jig.bag.cap_height)
    p_JQ = X_WJ.inverse() @ np.array([*p_WQ, X_WJ.translation()[2]])
    ring = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    around = p_JQ[:2] + radius * np.column_stack([np.cos(ring), np.sin(ring)])
    heights = jig.bed.height_at(np.vstack([p_JQ[:2], around]))
    return float(X_WJ.translation()[2] + heights.max())
