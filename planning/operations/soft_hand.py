"""The hand that brings a part to its seat, while it is soft.

An impedance centred where the parts meet lets it comply sideways and tilt, pushes with a limited
force, and searches on a spiral if a shaft has not found its hole. It ends when the part stands
still; whether it is seated is measured, not assumed.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame

from cell.configuration.config import InsertionConfig
from cell.products.product import Grasp
from cell.simulation.conditions import All, Below, FirstOf, Height, Steady, TooMuchForce
from cell.simulation.phase import Condition, Impedance, Outcome, Phase, after
from cell.simulation.vocabulary import in_programs
from planning.operations.grasping import lost_grasp, raised
from planning.operations.station import Station
from planning.operations.targets import Descent, Spiral, There

NEAR = 0.002  # The hand goes soft this far before shaft and hole can meet [m] [A].
LANDING = 0.001  # Slow from this far above the seat to this far below it [m] [A].
BEYOND = 0.004  # The soft target ends this far below the seat, so that the hand presses [m] [A].
STALL_TIME = 0.25
STALLED = 1.25e-4  # What moves less than this in the stall time stands: 0.5 mm/s [m].
PATIENCE = 5.0  # For coming to a stand under the whole force [s] [A].
YAW_STIFFNESS = 40.0  # About the axis of the hole; the bolt holes must meet [N m/rad] [A].
LATERAL_LIMIT = 15.0  # [N] [A]
TORQUE_LIMIT = 1.0  # [N m] [A]
TOO_MUCH = 30.0  # Insertion fails above this force [N].

Target = Callable[[float], RigidTransform]  # X_WD of the compliance centre over time [s].


@dataclass(frozen=True)
class Mating:
    """What is brought to what.

    Attributes:
        part: Name of the part in the hand.
        on: Name of the part on the fixture.
        p_AoC: Compliance centre C, in the product frame A [m]: the mouth of the hole in the hand,
            the tip of the shaft in the hand, or the middle of the face that comes to rest.
        depth: How far before its seat it meets what guides it, as a shaft its hole [m]; 0: nothing
            does.
        axis: (3,) direction out of the seat, in A.
    """

    part: str
    on: str
    p_AoC: np.ndarray
    depth: float
    axis: np.ndarray


@in_programs
class MatePhase(Enum):
    """What comes besides taking the part and letting it go."""

    LOOK = "look"
    TRANSFER = "transfer"
    LOOK_OVER_SHAFT = "look over the shaft"
    ALIGN = "align"
    HOVER = "hover"
    INSERT = "insert"
    SEARCH = "search"
    INSERT_AGAIN = "insert again"
    PRESS = "press"


# Those in which the hand is soft, in their order.
SOFT = (MatePhase.INSERT, MatePhase.SEARCH, MatePhase.INSERT_AGAIN, MatePhase.PRESS)


@dataclass(frozen=True)
class SoftHand:
    """The hand that brings a part to its seat, as an impedance about the compliance centre C.

    Attributes:
        station: The planner's view of the cell.
        mating: What is brought to what.
        X_WGoal: Pose X_WP at which the part is seated, as believed.
        grasp: How the part is held.
        X_JawP: How the part lies in it.
        awake: Names of the parts that are.
    """

    station: Station
    mating: Mating
    X_WGoal: RigidTransform
    grasp: Grasp
    X_JawP: RigidTransform
    awake: frozenset[str]

    @property
    def jaw(self) -> Frame:
        """That holds the part."""
        return self.station.holder.frame(self.grasp.jaw)

    @property
    def config(self) -> InsertionConfig:
        """How soft it is, and how fast."""
        return self.station.config.insertion

    @property
    def X_PC(self) -> RigidTransform:
        """C, with the axes of the part."""
        X_AP = self.station.part(self.mating.part).X_AP
        return RigidTransform(X_AP.inverse() @ self.mating.p_AoC)

    @property
    def X_JawC(self) -> RigidTransform:
        """C in the jaw."""
        return self.X_JawP @ self.X_PC

    @property
    def X_WSeat(self) -> RigidTransform:
        """Where C is when the part is seated."""
        return self.X_WGoal @ self.X_PC

    @property
    def height(self) -> Height:
        """How high C is."""
        return Height(self.jaw, self.X_JawC)

    def gap(self, outcome: Outcome) -> float:
        """Return how high C was over its seat at the end of a phase [m]."""
        return float(self.height(outcome.sensed)[0] - self.X_WSeat.translation()[2])

    def here(self, outcome: Outcome) -> RigidTransform:
        """Return X_WC at the end of a phase, upright: a spring that still pulls would wedge it."""
        X_WC = outcome.sensed.X_WF(self.jaw) @ self.X_JawC
        return RigidTransform(self.X_WSeat.rotation(), X_WC.translation())

    def phase(
        self,
        kind: MatePhase,
        force: float,
        target: Target,
        until: Condition,
        timeout: float,
        most: float = TOO_MUCH,
    ) -> Phase:
        """Return a phase in which C is drawn to a target with a limited downward force [N].

        It fails above the force ``most`` [N].
        """
        arm, mating = self.station.holder.name, self.mating
        # It slides on whatever it touches there, not only on what it comes to.
        others = {mating.on, *self.station.fixed} - {mating.part}
        guards = lost_grasp(self.station), TooMuchForce(arm, most, "insertion force")
        return Phase(
            kind,
            until,
            timeout=timeout,
            subject=mating.part,
            commands={arm: impedance(self.config, self.jaw, self.X_JawC, target, force)},
            guard=FirstOf(guards),
            awake=self.awake,
            mating=frozenset(frozenset([mating.part, other]) for other in others),
            fine_log=True,
            tare=kind is MatePhase.INSERT,
        )

    def search(self, mouth: float, deep: float) -> Phase:
        """Return a phase that seeks the mouth of a hole on a spiral, until C has sunk.

        Args:
            mouth: Height of C over its seat at which the part stands beside its hole [m].
            deep: How far it sinks when it has found the hole [m].
        """
        config, around = self.config, 1e3 * self.config.search_radius
        target = Spiral(
            raised(self.X_WSeat, mouth - BEYOND), config.search_pitch, config.search_speed
        )
        part, on = self.mating.part, self.mating.on
        stuck = f"{part} does not slide onto {on}, tried up to {around:g} mm aside"
        height = float(self.X_WSeat.translation()[2]) + mouth - deep
        length = config.search_radius**2 * np.pi / config.search_pitch
        return self.phase(
            MatePhase.SEARCH,
            config.search_force,
            target,
            Below(self.height, height, stuck),
            length / config.search_speed,
        )


def insert(hand: SoftHand) -> Generator[Phase, Outcome, None]:
    """Yield the soft phases: insert, search if it did not go in, press."""
    config, mating, height = hand.config, hand.mating, hand.height
    start = mating.depth + NEAR
    descending = descent(hand.X_WSeat, start, config, height)
    outcome = yield hand.phase(MatePhase.INSERT, config.force_limit, *descending)
    if mating.depth > 0.0 and hand.gap(outcome) > mating.depth / 2:
        mouth = hand.gap(outcome)
        yield hand.search(mouth, 1e-3)
        again = descent(hand.X_WSeat, mouth - 1e-3, config, height)
        outcome = yield hand.phase(MatePhase.INSERT_AGAIN, config.force_limit, *again)
    pushing = pressing(hand.here(outcome), height)
    yield hand.phase(MatePhase.PRESS, config.force_limit, *pushing)


def impedance(
    config: InsertionConfig, jaw: Frame, X_JawC: RigidTransform, target: Target, force: float
) -> Impedance:
    """Return the impedance about the hole, with a limited downward force."""
    turn, side = config.rotational_stiffness, config.lateral_stiffness
    return Impedance(
        jaw,
        X_JawC,
        target,
        stiffness=np.array([turn, turn, YAW_STIFFNESS, side, side, side]),
        limit=np.array([TORQUE_LIMIT] * 3 + [LATERAL_LIMIT, LATERAL_LIMIT, force]),
    )


def descent(
    X_WSeat: RigidTransform,
    start: float,
    config: InsertionConfig,
    height: Height,
) -> tuple[Target, Condition, float]:
    """Return target, end condition and time-out of a descent from ``start`` above the seat [m].

    The target slows down around the seat, where metal meets metal, and then builds up the force.
    Only what stands still under the whole force has come to its end: a part that leans on an edge
    stands still before.
    """
    heights = [start, LANDING, -LANDING, -BEYOND]
    speeds = [config.speed, config.landing_speed, config.speed]
    times = np.cumsum([0.0, *(-np.diff(heights) / speeds)])
    stands = All((Steady(height, STALLED, STALL_TIME), after(float(times[-1]) + STALL_TIME)))
    target = Descent(X_WSeat, times, np.array(heights))
    return target, stands, float(times[-1]) + PATIENCE


def pressing(X_WC: RigidTransform, height: Height) -> tuple[Target, Condition, float]:
    """Return target, end condition and time-out of a push straight down from where the part is."""
    return There(raised(X_WC, -BEYOND)), Steady(height, STALLED, STALL_TIME), PATIENCE
