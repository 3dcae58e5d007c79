"""One trial: a hand places a part on the jig, and pushes it if the case has a push."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol, cast

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cell.configuration.config import CellConfig
from cell.errors import BadPart
from cell.fixtures import fixture_class
from cell.fixtures.base import FixtureError
from cell.fixtures.custom.fixture import CustomFixture
from cell.machines.cameras.camera import FixedView
from cell.products.product import Part, Product
from cell.simulation.phase import PhaseFailed
from cell.simulation.state import State
from cell.workpieces.work import fixture_work
from experiments.paper.postures import Posture, PushSpec
from experiments.paper.push_rule import push_line
from experiments.paper.rig.stage import Observer
from experiments.speed.meter import Meter
from planning.operations.pick_place.phases import SETTLE_TIME
from planning.operations.placement import upright
from planning.operations.push.phases import PushLine

HOVER = 0.001  # Clearance of the part over the bag at the reference pose for the depth [m] [A].
REST_TIME = 0.3  # From the retreat of the hand to its approach for a push [s] [A].
READY_TIME = 0.1  # With everything awake, before the first contact [s] [A].
COAST_TIME = 0.6  # From the stop of the hand until everything is at rest again, at most [s] [A].


@dataclass(frozen=True)
class TrialDisturbance:
    """Placement errors of a trial, the same for both hands.

    Attributes:
        X_PDrawn: Pose error of the part in the grasp.
        jig_offset: (2,) position error of the jig on the force plate [m].
        seed: Of everything else that is random with a robot: sensor noise, sampling planners.
    """

    X_PDrawn: RigidTransform
    jig_offset: np.ndarray
    seed: int

    @staticmethod
    def draw(config: CellConfig, rng: np.random.Generator) -> TrialDisturbance:
        """Return random errors with the standard deviations of the configuration."""
        push = config.push
        angles = rng.normal(scale=np.deg2rad(push.grasp_angle_sigma_deg), size=3)
        offset = rng.normal(scale=push.grasp_position_sigma, size=3)
        jig = rng.normal(scale=push.jig_position_sigma, size=2)
        seed = int(rng.integers(1 << 20))
        return TrialDisturbance(RigidTransform(RollPitchYaw(angles), offset), jig, seed)

    @staticmethod
    def none() -> TrialDisturbance:
        """Return no errors: the part is gripped as planned, the jig where it is believed to be."""
        return TrialDisturbance(RigidTransform(), np.zeros(2), 0)

    def displaced(self, X_WJ: RigidTransform) -> RigidTransform:
        """Return the true pose of a jig whose nominal pose is X_WJ."""
        p_WJ = X_WJ.translation() + np.array([*self.jig_offset, 0.0])
        return RigidTransform(X_WJ.rotation(), p_WJ)


class Clock(Protocol):
    """The clock of a simulation, of the rig or the cell."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...

    @property
    def stepping_cpu(self) -> float:
        """CPU seconds spent stepping so far."""
        ...


class Hand(Protocol):
    """The hand of one trial; its methods are called in this order.

    Each may raise `PhaseFailed`, a verdict on the trial, also if no motion can be found.
    """

    @property
    def observer(self) -> Observer:
        """Observer of part and jig."""
        ...

    @property
    def planned(self) -> RigidTransform:
        """Nominal X_JP over the jig, with the lowest point `HOVER` above the fixture."""
        ...

    @property
    def meter(self) -> Meter:
        """CPU time spent stepping, by class of what goes on."""
        ...

    @property
    def simulation(self) -> Clock:
        """The simulation of the trial."""
        ...

    def save(self) -> State:
        """Return the state of the trial, to look at."""
        ...

    def press(self) -> None:
        """Press the part into the bag and freeze it; the part stays in the grasp."""
        ...

    def let_go(self) -> None:
        """Release the part and retreat."""
        ...

    def approach(self, line: PushLine) -> None:
        """Move the closed hand to the start of a push; part and jig sleep during the motion."""
        ...

    def push(self, line: PushLine) -> None:
        """Push along the line, with an abrupt stop at its end."""
        ...

    def wait(self, phase: str, seconds: float) -> None:
        """Hold still, in a phase of its own."""
        ...

    def wait_for_rest(self, phase: str, longest: float) -> None:
        """Hold still until part and jig rest or a time has passed [s], in a phase of its own."""
        ...


class Bench(Protocol):
    """Setup for repeated trials of one posture."""

    def begin(self, disturbance: TrialDisturbance) -> Hand:
        """Set up a new trial."""
        ...


@dataclass
class TrialRecord:
    """The record of one trial; poses that were not reached are None.

    Attributes:
        planned: Nominal X_JP of the part over the jig, before it is pressed in.
        seat: X_JP in which a fixture made for it holds the part; None for other fixtures.
        held: X_JP in the grasp when the bag has frozen.
        placed: X_JP after the hand has left.
        off_supports: How far it then stands off the supports of such a fixture [m].
        speed: Of the part at that time [m/s].
        view: Of the camera above the jig; None if the trial was not run here.
        before, after: X_WJ of the jig before and after the push.
        last_jig: X_WJ of the jig at the end of the trial, also after a failure.
        moved: X_JP of the part at the end of the trial.
        failure: The phase that failed and the evidence; None if all phases ran.
        state: At the end of the trial, also after a failure.
        log: Arrays of the trial.
        sim_seconds, cpu_seconds: Simulated time, and CPU time spent stepping [s].
        meter: The same by class of what goes on.
    """

    planned: RigidTransform
    seat: RigidTransform | None = None
    held: RigidTransform | None = None
    placed: RigidTransform | None = None
    off_supports: float | None = None
    speed: float = 0.0
    view: FixedView | None = None
    before: RigidTransform | None = None
    after: RigidTransform | None = None
    last_jig: RigidTransform = field(default_factory=RigidTransform)
    moved: RigidTransform | None = None
    failure: tuple[str, str] | None = None
    state: State = field(default_factory=dict)
    log: dict[str, np.ndarray] = field(default_factory=dict)
    sim_seconds: float = 0.0
    cpu_seconds: float = 0.0
    meter: Meter = field(default_factory=Meter)


def planned_pose(
    part: Part, posture: Posture, X_WJ: RigidTransform, height: float, yaw: float = 0.0
) -> RigidTransform:
    """Return X_WP with the posture's axis up and the centre of mass over the jig.

    Args:
        part: The part.
        posture: Its posture.
        X_WJ: Of the jig.
        height: Of the lowest point over J [m].
        yaw: About the vertical [rad].
    """
    R_WP = upright(posture.up, yaw)
    points = part.mesh.vertices @ R_WP.matrix().T
    centre = R_WP @ part.mesh.center_mass
    offset = np.array([-centre[0], -centre[1], height - points[:, 2].min()])
    return RigidTransform(R_WP, X_WJ.translation() + offset)


def held(config: CellConfig, posture: Posture) -> CellConfig:
    """Return the configuration for a fixture that is made for a posture, if it is of that kind."""
    return config.with_changes({"custom.held.part": posture.part, "custom.held.up": posture.up})


def gripped(product: Product, posture: Posture) -> Product:
    """Return the product reduced to the posture's part and its grasp."""
    part = replace(product.parts[posture.part], grasps=(posture.grasp,))
    return replace(product, parts={part.name: part}, groups={}, orders=(), joints=())


def check_fits(config: CellConfig, product: Product, posture: Posture) -> None:
    """Raise an error for a part that the fixture cannot hold in a posture.

    Raises:
        BadPart: It is wider than the bag.
        FixtureError: A fixture cannot be made for it.
    """
    if work := fixture_work(held(config, posture), gripped(product, posture)):
        cast(type[CustomFixture], fixture_class(config.workcell.fixture)).design(work)
        return
    part = product.parts[posture.part]
    R_WP = upright(posture.up, 0.0)
    size = np.ptp(part.mesh.vertices @ R_WP.matrix().T, axis=0)
    aperture = 2 * config.jig.bag.aperture_radius
    if max(size[:2]) > aperture:
        raise BadPart(
            part.name,
            f"it is {1e3 * max(size[:2]):.0f} mm wide in posture {posture.name}, "
            f"the bag's aperture {1e3 * aperture:.0f} mm",
        )


def misfit(config: CellConfig, product: Product, posture: Posture) -> str:
    """Return why the fixture cannot hold a part in a posture; "" if it can."""
    try:
        check_fits(config, product, posture)
    except (BadPart, FixtureError) as reason:
        return str(reason)
    return ""


Watch = Callable[[str, Observer], None]


def ignore(event: str, observer: Observer) -> None:
    """Ignore the event."""


def run_trial(hand: Hand, push: PushSpec | None, watch: Watch = ignore) -> TrialRecord:
    """Place the part and push it.

    Args:
        hand: Of a new trial.
        push: The push; None only places the part.
        watch: Called at the events "placed", "before", "after" and "end".
    """
    observer, stage = hand.observer, hand.observer.stage
    part, fixture = stage.part.part.name, stage.fixture
    trial = TrialRecord(hand.planned, fixture.seat(part))
    trial.view = FixedView.above(observer.X_WJ, stage.config.camera)
    try:
        hand.press()
        trial.planned, trial.held = hand.planned, observer.X_JP
        hand.let_go()
        if push is None:
            hand.wait_for_rest("settle", SETTLE_TIME)
        else:
            hand.wait("settle", REST_TIME)
        trial.placed, trial.speed = observer.X_JP, observer.speed
        trial.off_supports = fixture.off_supports(part, trial.placed)
        watch("placed", observer)
        if push is not None:
            _push(hand, push, trial, watch)
    except PhaseFailed as error:
        trial.failure = (error.phase, error.evidence)
    watch("end", observer)
    trial.moved, trial.last_jig = observer.X_JP, observer.X_WJ
    trial.state, trial.log = hand.save(), observer.log.arrays()
    clock = hand.simulation
    trial.sim_seconds, trial.cpu_seconds = clock.time, clock.stepping_cpu
    trial.meter = hand.meter
    return trial


def _push(hand: Hand, push: PushSpec, trial: TrialRecord, watch: Watch) -> None:
    """Move the closed hand to the start of the push, push, and let the jig coast."""
    observer = hand.observer
    line = push_line(observer.stage, observer.root, push, observer.X_WJ, observer.X_WP)
    hand.approach(line)
    hand.wait("ready", READY_TIME)
    observer.tare_hand()  # In free air: at the start of the trial a jaw may have touched the part.
    trial.before = observer.X_WJ
    watch("before", observer)
    hand.push(line)
    hand.wait_for_rest("coast", COAST_TIME)
    trial.after = observer.X_WJ
    watch("after", observer)
