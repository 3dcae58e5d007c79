"""Operation tighten_bolts: standing bolts driven home in star order.

The driver, on the right arm, comes down on one head after another: bit into socket, thread caught,
run down, seated, tightened until the clutch trips.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import Frame

from cell.simulation.phase import Follow, Phase, Sensed, after, motion_finished
from cell.workpieces.thread import BIT_SEAT, Thread, ThreadState
from planning.motion.kinematics import Unreachable
from planning.motion.timing import JointMotion
from planning.operations.grasping import backed_off
from planning.operations.station import FINE_CLEARANCE, Station

BIT_HOVER = 0.012  # The bit waits this far above the socket [m] [A].
LEAVE_SPEED = 0.1  # Of the bit out of it [m/s] [A].
PLUNGE_SPEED = 0.04  # Of the bit down to the socket [m/s] [A].
FIND_SPEED = 3.0  # The bit turns this slowly until its hex drops into the socket [rad/s] [A].
SLOW_BELOW = 2.5e-4  # The spindle turns slowly when the head is this close to its seat [m] [A].
FEED_DEPTH = 0.008  # The feed can follow the bolt this far [m]: engaged length and reserve.
FEED_GAIN = 0.02  # Feed speed per missing thrust [m/s per N] [A].
FEED_LIMIT = 0.02  # [m/s] [A]
STOP_TIME = 0.05  # Of the spindle [s] [A].
CLUTCH_TIME = 0.002  # The clutch does not feel shorter shocks [s] [A].


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


@dataclass
class Feed:
    """Servo of the driver's arm: sink so that the bit holder's spring pushes with a set force.

    Attributes:
        line: Motion straight down, as a path to be followed at the servo's own pace.
        length: Of that path [m].
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


@dataclass
class Clutch:
    """End condition: the spindle has kept up a torque; a shock does not trip it.

    Attributes:
        torque: To trip at [N m].
    """

    torque: float
    _reached: float | None = None

    def __call__(self, sensed: Sensed) -> bool:
        """Return whether the clutch trips."""
        if sensed.spindle_torque < self.torque:
            self._reached = None
        elif self._reached is None:
            self._reached = sensed.time
        # Times are multiples of the step, so half a microsecond only absorbs rounding.
        return self._reached is not None and sensed.time >= self._reached + CLUTCH_TIME - 5e-7


def tighten_bolt(station: Station, bolt: str) -> Iterator[Phase]:
    """Yield the phases that drive one bolt home."""
    yield from _approach(station, bolt)
    yield from _drive(station, bolt)
    yield from _leave(station, bolt)


def _approach(station: Station, bolt: str) -> Iterator[Phase]:
    """Yield the phases that bring the driver over the head and the bit into its socket."""
    thread, tip = station.cell.threads[bolt], station.arm("right").frame("tool_tip")
    holding = [("left_tool", part) for part in station.fixed]
    above = backed_off(_socket_pose(station, bolt), BIT_HOVER)
    yield Phase(
        f"{bolt}: driver above",
        motion_finished,
        timeout=20.0,
        right=station.move(
            "right",
            _driver_configuration(station, tip, above, holding),
            holding,
            clearance=FINE_CLEARANCE,
        ),
        spindle=0.0,
        awake=frozenset([*station.fixed, *_driven(station)]),
    )
    R_WE = station.pose("right", "tool_tip").rotation()
    X_WE = RigidTransform(R_WE, _socket_pose(station, bolt).translation())
    yield Phase(
        f"{bolt}: bit into socket",
        lambda sensed: sensed.finished and thread.bit_position is not None,
        timeout=5.0,
        right=station.line("right", tip, X_WE, speed=PLUNGE_SPEED),
        spindle=FIND_SPEED,
        every_step=lambda simulation: thread.try_engage_bit(simulation.root),
        awake=_awake(station, bolt),
    )


def _drive(station: Station, bolt: str) -> Iterator[Phase]:
    """Yield the phases that run the bolt down and tighten it until the clutch trips."""
    thread, driver = station.cell.threads[bolt], station.config.driver
    feed = Follow(_feed(station))
    yield Phase(
        f"{bolt}: run down",
        lambda sensed: _height(station, thread) < SLOW_BELOW,
        timeout=10.0,
        right=feed,
        spindle=driver.free_speed,
        every_step=lambda simulation: thread.try_catch(simulation.root),
        awake=_awake(station, bolt),
    )
    yield Phase(
        f"{bolt}: tighten",
        Clutch(thread.fastener.torque),
        timeout=5.0,
        right=feed,
        spindle=driver.seat_speed,
        awake=_awake(station, bolt),
        fine_log=True,
    )
    yield Phase(
        f"{bolt}: stop",
        after(STOP_TIME),
        timeout=1.0,
        spindle=0.0,
        start=(lambda simulation: thread.lock(simulation.root),),
        awake=_awake(station, bolt),
    )


def _leave(station: Station, bolt: str) -> Iterator[Phase]:
    """Yield the phase that pulls the bit out of the socket."""
    thread, tip = station.cell.threads[bolt], station.arm("right").frame("tool_tip")
    off = backed_off(station.pose("right", "tool_tip"), BIT_HOVER + FEED_DEPTH)
    yield Phase(
        f"{bolt}: driver off",
        motion_finished,
        timeout=5.0,
        right=station.line("right", tip, off, speed=LEAVE_SPEED),
        start=(lambda simulation: thread.release_bit(simulation.root),),
        awake=_awake(station, bolt),
    )


def _feed(station: Station) -> Feed:
    """Return the servo that follows the bolt straight down from where the driver is."""
    X_WTip, tip = station.pose("right", "tool_tip"), station.arm("right").frame("tool_tip")
    deep = RigidTransform(X_WTip.rotation(), X_WTip.translation() - [0.0, 0.0, FEED_DEPTH])
    line = station.line("right", tip, deep, speed=FEED_LIMIT)
    config = station.config
    return Feed(line, FEED_DEPTH, config.driver.push_force, config.simulation.time_step)


def _awake(station: Station, bolt: str) -> frozenset[str]:
    return frozenset([bolt, *station.fixed, *_driven(station)])


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
    may_touch: list[tuple[str, str]],
) -> np.ndarray:
    """Return the nearest configuration with the driver turned any way about its own axis."""
    found, near = [], station.arm("right").positions(station.context)
    for turn in np.deg2rad(np.arange(0.0, 360.0, 30.0)):
        X = X_WE @ RigidTransform(RotationMatrix.MakeZRotation(turn), np.zeros(3))
        found += station.configurations("right", tip, X, near, may_touch, clearance=FINE_CLEARANCE)
    if not found:
        raise Unreachable("right", tip.name(), X_WE, "no turn of the driver keeps clear there")
    return min(found, key=lambda q: float(np.max(np.abs(q - near))))
