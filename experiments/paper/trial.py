"""One trial: a hand places a part on the jig, and pushes it if that is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cell.configuration.config import CellConfig
from cell.errors import BadPart
from cell.products.product import Part
from cell.simulation.phase import PhaseFailed
from experiments.paper.postures import Posture, Push
from experiments.paper.push_rule import push_line
from experiments.paper.rig.stage import Observer
from planning.operations.pick_place.phases import SETTLE_TIME
from planning.operations.placement import upright
from planning.operations.push.phases import PushLine

HOVER = 0.001  # The part starts this far above the bag, or would, where depth is counted [m] [A].
REST_TIME = 0.3  # After the hand has left, before it comes to push [s] [A].
READY_TIME = 0.1  # With everything awake, before anything touches [s] [A].
COAST_TIME = 0.6  # From the hand's stop until everything rests again [s] [A].


@dataclass(frozen=True)
class Disturbance:
    """What is not where it should be in a trial: the same draws for every hand.

    Attributes:
        X_PDrawn: Error of the part in the grasp.
        jig_offset: (2,) of the jig on the force plate [m].
        seed: Of what else is random with a robot: sensor noise, sampling planners.
    """

    X_PDrawn: RigidTransform
    jig_offset: np.ndarray
    seed: int

    @staticmethod
    def draw(config: CellConfig, rng: np.random.Generator) -> Disturbance:
        """Draw one."""
        push = config.push
        angles = rng.normal(scale=np.deg2rad(push.grasp_angle_sigma_deg), size=3)
        offset = rng.normal(scale=push.grasp_position_sigma, size=3)
        jig = rng.normal(scale=push.jig_position_sigma, size=2)
        seed = int(rng.integers(1 << 20))
        return Disturbance(RigidTransform(RollPitchYaw(angles), offset), jig, seed)

    def displaced(self, X_WJ: RigidTransform) -> RigidTransform:
        """Return where the jig really stands."""
        p_WJ = X_WJ.translation() + np.array([*self.jig_offset, 0.0])
        return RigidTransform(X_WJ.rotation(), p_WJ)


class Clock(Protocol):
    """What a trial reads of a simulation, the rig's or the cell's."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...

    @property
    def stepping_cpu(self) -> float:
        """CPU seconds spent stepping so far."""
        ...


class Hand(Protocol):
    """A hand at work in one trial; its methods are called in this order.

    Any of them may raise `PhaseFailed`, a verdict on the trial, also where no motion can be found.
    """

    @property
    def observer(self) -> Observer:
        """Looks at part and jig, and records."""
        ...

    @property
    def planned(self) -> RigidTransform:
        """X_JP over the jig as aimed at, with the lowest point `HOVER` above the bag."""
        ...

    @property
    def simulation(self) -> Clock:
        """What the hand works in."""
        ...

    def press(self) -> None:
        """Bring the part to the jig, press it in and freeze the bag; the part stays in the hand."""
        ...

    def let_go(self) -> None:
        """Release the part and back off."""
        ...

    def approach(self, line: PushLine) -> None:
        """Bring the closed hand to the start of a push; part and jig sleep and then wake."""
        ...

    def push(self, line: PushLine) -> None:
        """Push along the line, with a dead stop at its end."""
        ...

    def wait(self, phase: str, seconds: float) -> None:
        """Hold still, in a phase of its own."""
        ...


class Bench(Protocol):
    """Where trials of one posture are run, again and again."""

    def begin(self, disturbance: Disturbance) -> Hand:
        """Put everything in its place for a new trial."""
        ...


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
        log: Arrays of the trial.
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
    part: Part, posture: Posture, X_WJ: RigidTransform, height: float, yaw: float = 0.0
) -> RigidTransform:
    """Return X_WP: upright, centre of mass over the jig, lowest point at a height over J [m]."""
    R_WP = upright(posture.up, yaw)
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


Watch = Callable[[str, Observer], None]


def ignore(event: str, observer: Observer) -> None:
    """Watch nothing."""


def run_trial(hand: Hand, push: Push | None, watch: Watch = ignore) -> Trial:
    """Place the part and, if asked, push it.

    Args:
        hand: At the beginning of a trial.
        push: None: only place.
        watch: Told of the events "placed", "before", "after" and "end".
    """
    trial, seen = Trial(planned=hand.planned), hand.observer
    try:
        _place(hand, trial, SETTLE_TIME if push is None else REST_TIME)
        watch("placed", seen)
        if push is not None:
            _push(hand, push, trial, watch)
    except PhaseFailed as error:
        trial.failure = (error.phase, error.evidence)
    watch("end", seen)
    trial.moved, trial.last_jig = seen.X_JP, seen.X_WJ
    trial.log = seen.log.arrays()
    clock = hand.simulation
    trial.sim_seconds, trial.cpu_seconds = clock.time, clock.stepping_cpu
    return trial


def _place(hand: Hand, trial: Trial, settle: float) -> None:
    seen = hand.observer
    hand.press()
    trial.planned, trial.held = hand.planned, seen.X_JP
    hand.let_go()
    hand.wait("settle", settle)
    trial.placed, trial.speed = seen.X_JP, seen.speed


def _push(hand: Hand, push: Push, trial: Trial, watch: Watch) -> None:
    """Bring the closed hand beside the part, push, and let everything coast."""
    seen = hand.observer
    line = push_line(seen.stage, seen.root, push, seen.X_WJ, seen.X_WP)
    hand.approach(line)
    hand.wait("ready", READY_TIME)
    seen.tare_hand()  # In free air: when the trial began, a jaw may have touched the part.
    trial.before = seen.X_WJ
    watch("before", seen)
    hand.push(line)
    hand.wait("coast", COAST_TIME)
    trial.after = seen.X_WJ
    watch("after", seen)
