"""Where the parts are, as far as the planner knows: frozen, timed estimates that a look refreshes.

A part in the hand follows the hand by kinematics from where it was last seen; every other part is
taken to stay where it was last seen. Frames: W of the world, P of a part, H of the hand.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, runtime_checkable

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.errors import UnknownName
from cell.workpieces.parts import Parts

State = dict[str, np.ndarray]
SEEN, CARRIED, SOURCE = "seen/", "carried/", "source"  # Keys of a saved belief.
NEVER = -np.inf  # Time of an estimate that no look has confirmed [s].
# By which a part turns and slides as it is gripped and carried: standard deviations about all axes,
# and along x, y and z of the hand [rad], [m] [A]. Along x, in which the pads close, it hardly does.
# As it is let go, it does so by as much, along all axes.
TURNED, SLID = np.deg2rad(4.0), np.array([3e-4, 2e-3, 2e-3])
LET_GO = np.diag(np.repeat([TURNED, SLID.max()], 3) ** 2)


@dataclass(frozen=True)
class Estimate:
    """What one look says about a part.

    Attributes:
        X_WP: Its pose.
        covariance: (6, 6) of the error: turns about the axes of P [rad2], then offsets along the
            axes of W [m2].
        time: When it was seen [s]; `NEVER` for what is only expected.
    """

    X_WP: RigidTransform
    covariance: np.ndarray
    time: float


class Source(Protocol):
    """A perception source.

    Attributes:
        duration: How long everything has to stand still for a look [s].
    """

    duration: float

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
        """Return where parts are now, by name; a part that is not seen is left out.

        Args:
            parts: Names of those that are asked for; what else is seen may be returned, too.
            known: What is believed at present, to start from.
        """
        ...

    def save(self) -> np.ndarray:
        """Return what the next look depends on besides the scene, such as a random state."""
        ...

    def restore(self, state: np.ndarray) -> None:
        """Return to a saved state."""


@runtime_checkable
class CarriedSource(Source, Protocol):
    """A source that the hand carries to where it sees from: it sees what it has taken since.

    Attributes:
        frame: Its optical frame C on the hand: z ahead.
    """

    frame: Frame

    def targets(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> list[np.ndarray]:
        """Return the points p_W (3,) to look at [m], each from a few sides, to see parts."""
        ...

    def take(self) -> None:
        """Take in what is in sight now; everything stands still."""


@runtime_checkable
class WatchingSource(Source, Protocol):
    """A source with an eye that stands still: it sees what the hand shows to it."""

    def stops(self, part: str, X_HP: RigidTransform) -> list[RigidTransform]:
        """Return poses X_WH of the hand H at which what it holds may be in sight.

        Args:
            part: Name of the part in the hand.
            X_HP: How it is believed to lie there.
        """
        ...

    def visible(self, part: str, X_HP: RigidTransform, q: np.ndarray) -> float:
        """Return the share of a part's surface that is in sight with the arm at ``q`` (n,) [rad].

        Args:
            part: Name of the part in the hand.
            X_HP: How it is believed to lie there.
            q: Joint angles (n,) [rad].
        """
        ...

    def watch(self, part: str, X_HP: RigidTransform) -> None:
        """Take in what is in sight now of a part in the hand; everything stands still."""


def gripped(X_WP: RigidTransform, X_WH: RigidTransform) -> np.ndarray:
    """Return the covariance (6, 6), see `Estimate`, of what gripping does to the pose of a part.

    Args:
        X_WP: Of the part.
        X_WH: Of the hand; the part turns about its origin, between the pads.
    """
    R_WH = X_WH.rotation().matrix()
    p_HP_W = X_WP.translation() - X_WH.translation()
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = X_WP.rotation().matrix().T @ R_WH, R_WH
    J[3:, :3] = np.cross(R_WH.T, p_HP_W).T  # A turn about the pads shifts the part's origin.
    return np.asarray(J @ np.diag(np.r_[np.full(3, TURNED), SLID] ** 2) @ J.T)


def random_state(rng: np.random.Generator) -> np.ndarray:
    """Return the state of a random generator as a text, for saving."""
    return np.array(repr(rng.bit_generator.state))


def restore_random_state(rng: np.random.Generator, state: np.ndarray) -> None:
    """Return a random generator to a state of `random_state`."""
    rng.bit_generator.state = ast.literal_eval(str(state))


@dataclass
class TruthSource:
    """The truth plus configurable noise.

    Attributes:
        parts: What can be seen.
        context: Of the plant, only read.
        position_noise: Standard deviation along each axis [m].
        angle_noise: Standard deviation about each axis [rad].
        rng: Of the noise.
        duration: See `Source`; the truth is known at once.
    """

    parts: Parts
    context: Context
    position_noise: float
    angle_noise: float
    rng: np.random.Generator
    duration: float = 0.0

    @staticmethod
    def of(cell: Cell, root: Context, seed: int) -> TruthSource:
        """Return the source that a cell's configuration describes.

        Args:
            cell: The cell.
            root: Context of the diagram.
            seed: Of the noise.
        """
        noise = cell.config.sensor
        return TruthSource(
            cell.parts,
            cell.plant.GetMyContextFromRoot(root),
            noise.position_noise,
            np.deg2rad(noise.angle_noise_deg),
            np.random.default_rng(seed),
        )

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        """Return where parts are now, each with noise of its own."""
        sigma = np.repeat([self.angle_noise, self.position_noise], 3)
        time = self.context.get_time()
        return {name: Estimate(self._pose(name), np.diag(sigma**2), time) for name in parts}

    def _pose(self, name: str) -> RigidTransform:
        X_WP = self.parts[name].X_WP(self.context)
        if self.position_noise == 0.0 and self.angle_noise == 0.0:
            return X_WP
        offset = self.rng.normal(scale=self.position_noise, size=3)
        turn = RollPitchYaw(self.rng.normal(scale=self.angle_noise, size=3)).ToRotationMatrix()
        return RigidTransform(X_WP.rotation() @ turn, X_WP.translation() + offset)

    def save(self) -> np.ndarray:
        """Return the state of the random generator."""
        return random_state(self.rng)

    def restore(self, state: np.ndarray) -> None:
        """Return to a saved state of the random generator."""
        restore_random_state(self.rng, state)


@dataclass
class Belief:
    """The latest estimate of every part that has been seen.

    Attributes:
        source: A perception source.
        hand: Returns the pose X_WH of the hand now, from the joint encoders.
        estimates: By name of the part.
        carried: By name of a part in the hand, X_WH at the moment its estimate speaks of.
    """

    source: Source
    hand: Callable[[], RigidTransform]
    estimates: dict[str, Estimate] = field(default_factory=dict)
    carried: dict[str, RigidTransform] = field(default_factory=dict)

    def look(self, parts: Sequence[str]) -> frozenset[str]:
        """Replace what is known of parts by what is seen now; return the names of those seen."""
        seen = self.source.look(parts, self.now)
        self.estimates.update(seen)
        for name in self.carried.keys() & seen.keys():
            self.carried[name] = self.hand()
        return frozenset(seen)

    @property
    def now(self) -> dict[str, Estimate]:
        """The estimates, with what is in the hand where that is now."""
        held = self.carried.keys() & self.estimates.keys()
        moved = {name: replace(self.estimates[name], X_WP=self.pose(name)) for name in held}
        return self.estimates | moved

    def suppose(self, part: str, X_WP: RigidTransform) -> None:
        """Believe a part to be at a pose without having looked."""
        self.estimates[part] = Estimate(X_WP, np.zeros((6, 6)), NEVER)

    def rest(self, part: str, X_WP: RigidTransform) -> None:
        """Believe a part that has been seen to have come to rest in a place that holds it."""
        self.estimates[part] = replace(self.estimates[part], X_WP=X_WP)

    def pose(self, part: str) -> RigidTransform:
        """Return the believed pose X_WP of a part now.

        Raises:
            UnknownName: It has never been seen.
        """
        if part not in self.estimates:
            raise UnknownName("part that has been seen", part, self.estimates)
        X_WP = self.estimates[part].X_WP
        if part not in self.carried:
            return X_WP
        X_WH, X_WH_then = self.hand(), self.carried[part]
        # A hand that has not moved adds no rounding.
        return X_WP if X_WH.IsExactlyEqualTo(X_WH_then) else X_WH @ X_WH_then.inverse() @ X_WP

    def carry(self, parts: Iterable[str]) -> None:
        """Let parts follow the hand from now on; they are less certain than they stood."""
        self.carried = dict.fromkeys(parts, self.hand())
        for part in self.carried.keys() & self.estimates.keys():
            known = self.estimates[part]
            spread = known.covariance + gripped(known.X_WP, self.carried[part])
            self.estimates[part] = replace(known, covariance=spread)

    def put_down(self) -> None:
        """Leave the parts in the hand where they are believed to be now, less certain."""
        for part in self.carried:
            spread = self.estimates[part].covariance + LET_GO
            self.estimates[part] = replace(
                self.estimates[part], X_WP=self.pose(part), covariance=spread
            )
        self.carried = {}

    def save(self) -> State:
        """Return everything that changes as named arrays."""
        state: State = {SOURCE: self.source.save()}
        for name, estimate in self.estimates.items():
            state[f"{SEEN}{name}/X_WP"] = estimate.X_WP.GetAsMatrix4()
            state[f"{SEEN}{name}/covariance"] = estimate.covariance
            state[f"{SEEN}{name}/time"] = np.array(estimate.time)
        for name, X_WH in self.carried.items():
            state[f"{CARRIED}{name}"] = X_WH.GetAsMatrix4()
        return state

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Return to what `save` returned."""
        self.source.restore(state[SOURCE])
        keys = [key.removesuffix("/X_WP") for key in state if key.endswith("/X_WP")]
        self.estimates = {
            key.removeprefix(SEEN): Estimate(
                RigidTransform(state[f"{key}/X_WP"]),
                state[f"{key}/covariance"],
                float(state[f"{key}/time"]),
            )
            for key in keys
        }
        self.carried = {
            key.removeprefix(CARRIED): RigidTransform(X_WH)
            for key, X_WH in state.items()
            if key.startswith(CARRIED)
        }
