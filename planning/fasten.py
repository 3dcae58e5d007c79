"""Operations place_bolts and tighten_bolts: bolts from the tray into their holes, then driven home.

The left hand sets each bolt upright into its hole, where it stands on the mouth of the thread. Then
it holds the clamped part against the driver's torque while the driver, on the right arm, comes down
on one head after another in star order: bit into socket, thread caught, run down, seated, tightened
until the clutch trips.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import Frame

from cell.phase import Follow, Outcome, Phase, Sensed, after, motion_finished
from cell.product import Grasp
from cell.simulation import Simulation
from cell.thread import BIT_SEAT, Thread, ThreadState
from planning.grasping import (
    HAND_SPEED,
    Reach,
    backed_off,
    first,
    grip,
    let_go,
    lost_grasp,
    no_grasp,
    opened,
    reachable_grasps,
    take,
)
from planning.insert_shaft import raised
from planning.kinematics import Unreachable
from planning.station import Station
from planning.timing import JointMotion

LIFT = 0.06
ABOVE = 0.012  # A bolt hovers this far above where it will stand: its tip is over the hole [m] [A].
ENTRY = 0.006  # From here on the shank can touch the clamped part [m] [D].
TOUCH_FORCE = 1.5  # The bolt stands when it pushes back this hard [N] [A].
SLOW = 0.02  # [m/s] [A]
RETREAT = 0.05
FINE_CLEARANCE = 5e-4  # Kept next to neighbours of the hole; smaller than any gap there [m] [A].


def place_bolt(station: Station, bolt: str) -> Iterator[Phase]:
    """Yield the phases that stand a bolt in its hole.

    Args:
        station: The planner's view of the cell.
        bolt: Name of a fastener of the product.
    """
    yield Phase(f"{bolt}: look", after(0.05), 1.0, awake=frozenset([bolt]))
    reach = _grasp_for_hole(station, bolt)
    yield from take(station, bolt, reach, LIFT)
    jaw = station.arm("left").frame(reach.grasp.jaw)
    X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(bolt)
    X_WStand = standing_pose(station, bolt)
    holding, held = lost_grasp(station.held_opening), frozenset([bolt])
    above = raised(X_WStand, ABOVE) @ X_JawP.inverse()
    may_touch = [("held", "*")]
    q_above = station.configuration(
        "left", jaw, above, reach.q_before, may_touch, clearance=FINE_CLEARANCE
    )
    yield Phase(
        f"{bolt}: transfer",
        motion_finished,
        timeout=20.0,
        left=station.move("left", q_above, may_touch, clearance=FINE_CLEARANCE),
        guard=holding,
        awake=held,
    )
    X_JawP = station.pose("left", reach.grasp.jaw).inverse() @ station.sense(bolt)
    yield Phase(
        f"{bolt}: align",
        motion_finished,
        timeout=5.0,
        left=station.line("left", jaw, raised(X_WStand, ENTRY) @ X_JawP.inverse(), speed=SLOW),
        guard=holding,
        awake=held,
    )
    awake = held | _assembled(station, bolt)
    yield Phase(
        f"{bolt}: lower",
        lambda sensed: sensed.finished or sensed.wrench["left"][5] > TOUCH_FORCE,
        timeout=10.0,
        left=station.line("left", jaw, raised(X_WStand, -2e-4) @ X_JawP.inverse(), speed=SLOW),
        guard=holding,
        awake=awake,
    )
    yield from let_go(station, bolt, reach.grasp, RETREAT, awake)


def standing_pose(station: Station, bolt: str) -> RigidTransform:
    """Return X_WP of a bolt that stands on the mouth of its thread, from the sensed parts."""
    fastener = station.cell.product.fasteners[bolt]
    into = station.part(fastener.into)
    X_WA = station.sense(fastener.into) @ into.X_AP.inverse()
    out = RigidTransform([0.0, 0.0, fastener.thread_depth])
    return X_WA @ station.part(bolt).X_AP @ out


def _assembled(station: Station, bolt: str) -> frozenset[str]:
    """Return the parts that a bolt at its hole can touch."""
    fastener = station.cell.product.fasteners[bolt]
    return frozenset([fastener.into, fastener.clamps])


def _grasp_for_hole(station: Station, bolt: str) -> Reach:
    """Return a grasp with which the hand also fits between the neighbours of the hole."""
    X_WStand = standing_pose(station, bolt)
    part = station.part(bolt)
    may_touch = [("left_tool", bolt), ("held", "*")]
    for reach in reachable_grasps(station, bolt, station.sense(bolt), part.grasps):
        jaw = station.arm("left").frame(reach.grasp.jaw)
        X_WJaw = X_WStand @ reach.grasp.X_PJaw
        fits = station.configurations(
            "left", jaw, X_WJaw, reach.q_before, may_touch, clearance=FINE_CLEARANCE
        )
        if fits and np.max(np.abs(fits[0] - reach.q_before)) < np.pi:
            return reach
    raise no_grasp(station, bolt)


def hold(station: Station, part: str) -> Generator[Phase, Outcome, Grasp]:
    """Yield the phases with which the left hand grips an assembled part; return the grasp."""
    reach = first(_from_the_side(station, part), part, station)
    frame = station.arm("left").frame(reach.grasp.jaw)
    yield Phase(
        f"{part}: approach to hold",
        motion_finished,
        timeout=20.0,
        left=station.move("left", reach.q_before, [("left_tool", part)]),
        jaw=opened(reach.grasp),
    )
    yield Phase(
        f"{part}: reach to hold",
        motion_finished,
        timeout=10.0,
        left=station.line("left", frame, reach.X_WJaw, speed=HAND_SPEED),
    )
    yield from grip(station, part, reach.grasp, awake=frozenset(station.fixed))
    return reach.grasp


def _from_the_side(station: Station, part: str) -> Iterator[Reach]:
    """Yield grasps that leave the space above the part to the driver."""
    X_WP = station.sense(part)
    grasps = [
        grasp
        for grasp in station.part(part).grasps
        if abs((X_WP @ grasp.X_PJaw).rotation().matrix()[2, 2]) < 0.5
    ]
    return reachable_grasps(station, part, X_WP, grasps)


def release_hold(
    station: Station, part: str, grasp: Grasp, awake: frozenset[str]
) -> Iterator[Phase]:
    """Yield the phases that let go of a part held by `hold`."""
    yield from let_go(station, part, grasp, RETREAT, awake)


def star_order(station: Station, bolts: Sequence[str]) -> list[str]:
    """Return the bolts so that each is as far as possible from those before it.

    Ties go to the one farthest from the latest bolt: 1, 4, then across again, as on a wheel.
    """
    place = {bolt: station.part(bolt).X_AP.translation() for bolt in bolts}
    order, left = [bolts[0]], list(bolts[1:])
    while left:

        def spread(bolt: str) -> tuple[float, float]:
            distances = [float(np.linalg.norm(place[bolt] - place[done])) for done in order]
            return round(min(distances), 6), distances[-1]

        order.append(max(left, key=spread))
        left.remove(order[-1])
    return order


BIT_HOVER = 0.012  # The bit waits this far above the socket [m] [A].
PLUNGE_SPEED = 0.04  # Of the bit down to the socket [m/s] [A].
FIND_SPEED = 3.0  # The bit turns this slowly until its hex drops into the socket [rad/s] [A].
SLOW_BELOW = 2.5e-4  # The spindle turns slowly when the head is this close to its seat [m] [A].
FEED_DEPTH = 0.008  # The feed can follow the bolt this far [m]: engaged length and reserve.
FEED_GAIN = 0.02  # Feed speed per missing thrust [m/s per N] [A].
FEED_LIMIT = 0.02  # [m/s] [A]


@dataclass
class Feed:
    """Servo of the driver's arm: sink so that the bit holder's spring pushes with a set force.

    Attributes:
        line: Motion straight down, as a path to be followed at the servo's own pace.
        thrust: Wanted axial force on the bit [N].
        dt: Time step [s].
        progress: Time on the line reached so far [s].
    """

    line: JointMotion
    length: float
    thrust: float
    dt: float
    progress: float = 0.0

    def __call__(self, sensed: Sensed) -> tuple[np.ndarray, np.ndarray]:
        """Return the joint target for the next step."""
        speed = float(np.clip(FEED_GAIN * (self.thrust - sensed.bit_push), -FEED_LIMIT, FEED_LIMIT))
        rate = speed * self.line.duration / self.length
        self.progress = float(np.clip(self.progress + rate * self.dt, 0.0, self.line.duration))
        q, v = self.line.at(self.progress)
        return q, v * rate


def tighten_bolt(station: Station, bolt: str) -> Iterator[Phase]:
    """Yield the phases that drive one bolt home."""
    thread = station.cell.threads[bolt]
    driver = station.config.driver
    tip = station.arm("right").frame("tool_tip")
    awake = frozenset([bolt, *station.fixed, *_driven(station)])
    X_WE = _socket_pose(station, bolt)
    near = station.arm("right").positions(station.context)
    above = backed_off(X_WE, BIT_HOVER)
    holding = [("left_tool", part) for part in station.fixed]
    q_above = _driver_configuration(station, tip, above, near, holding)
    yield Phase(
        f"{bolt}: driver above",
        motion_finished,
        timeout=20.0,
        right=station.move("right", q_above, holding, clearance=FINE_CLEARANCE),
        spindle=0.0,
        awake=frozenset([*station.fixed, *_driven(station)]),
    )
    X_WTip = station.pose("right", "tool_tip")
    X_WE = RigidTransform(X_WTip.rotation(), _socket_pose(station, bolt).translation())
    yield Phase(
        f"{bolt}: bit into socket",
        lambda sensed: sensed.finished and thread.bit_position is not None,
        timeout=5.0,
        right=station.line("right", tip, X_WE, speed=PLUNGE_SPEED),
        spindle=FIND_SPEED,
        every_step=lambda simulation: _engage(simulation, thread),
        awake=awake,
    )
    X_WDeep = RigidTransform(X_WE.rotation(), X_WE.translation() - [0.0, 0.0, FEED_DEPTH])
    line = station.line("right", tip, X_WDeep, speed=SLOW)
    feed = Follow(Feed(line, FEED_DEPTH, driver.push_force, station.config.simulation.time_step))
    yield Phase(
        f"{bolt}: run down",
        lambda sensed: _height(station, thread) < SLOW_BELOW,
        timeout=10.0,
        right=feed,
        spindle=driver.free_speed,
        every_step=lambda simulation: thread.try_catch(simulation.root),
        awake=awake,
    )
    yield Phase(
        f"{bolt}: tighten",
        lambda sensed: sensed.spindle_torque >= driver.clutch_torque,
        timeout=5.0,
        right=feed,
        spindle=driver.seat_speed,
        awake=awake,
        fine_log=True,
    )
    yield Phase(
        f"{bolt}: stop",
        after(0.05),
        timeout=1.0,
        spindle=0.0,
        start=(lambda simulation: thread.lock(simulation.root),),
        awake=awake,
    )
    X_WTip = station.pose("right", "tool_tip")
    yield Phase(
        f"{bolt}: driver off",
        motion_finished,
        timeout=5.0,
        right=station.line("right", tip, backed_off(X_WTip, BIT_HOVER + FEED_DEPTH), speed=0.1),
        start=(lambda simulation: thread.release_bit(simulation.root),),
        awake=awake,
    )


def _engage(simulation: Simulation, thread: Thread) -> None:
    thread.try_engage_bit(simulation.root)


def _height(station: Station, thread: Thread) -> float:
    """Return the height of the head above its seat once the thread has caught [m]."""
    if thread.state is ThreadState.FREE:
        return np.inf
    return float(thread.X_HF(station.context).translation()[2])


def _driven(station: Station) -> list[str]:
    """Return the bolts whose threads have caught."""
    threads = station.cell.threads.items()
    return [name for name, thread in threads if thread.state is not ThreadState.FREE]


def _socket_pose(station: Station, bolt: str) -> RigidTransform:
    """Return the pose of the bit's end when it sits in the socket of a bolt, pointing down."""
    p_WE = station.sense(bolt) @ np.array([0.0, 0.0, BIT_SEAT])
    return RigidTransform(RotationMatrix.MakeXRotation(np.pi), p_WE)


def _driver_configuration(
    station: Station,
    tip: Frame,
    X_WE: RigidTransform,
    near: np.ndarray,
    may_touch: list[tuple[str, str]],
) -> np.ndarray:
    """Return the nearest configuration with the driver turned any way about its own axis."""
    found = []
    for turn in np.deg2rad(np.arange(0.0, 360.0, 30.0)):
        X = X_WE @ RigidTransform(RotationMatrix.MakeZRotation(turn), np.zeros(3))
        found += station.configurations("right", tip, X, near, may_touch, clearance=FINE_CLEARANCE)
    if not found:
        raise Unreachable("right", tip.name(), X_WE, "no turn of the driver keeps clear there")
    return min(found, key=lambda q: float(np.max(np.abs(q - near))))
