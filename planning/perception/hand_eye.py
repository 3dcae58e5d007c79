"""The depth camera on the hand as a perception source.

The hand carries it round what is to be seen; from the depth images of all sides together every part
is registered against its mesh, from where it is believed to be. Parts that nothing has been seen of
yet are taken to be in the tray: the tray with its parts is registered first, as one, and every part
is expected in its place there. For parts that are too small for the camera, such as bolts, that is
all that is known: a place in a rack whose pose has been seen.

A part in the hand is in sight of the camera that is fixed above the jig, as far as the hand does
not hide it. What rides on it goes along with what is seen of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.configuration.config import CellConfig
from cell.machines.cameras.camera import ABOVE, HAND_EYE, Camera, Picture
from cell.products.product import Product
from planning.perception.belief import NEVER, Estimate, random_state, restore_random_state
from planning.perception.in_hand import InHand
from planning.perception.layout import parts_in_tray, tray_expected
from planning.perception.registration import View, near_to, register, starts_within, views_of
from planning.perception.surface import Surface

Array = NDArray[np.float64]

# Diagonal of the smallest part that is registered [m] [M]: of an M3 screw, 13 mm long, a view from
# 0.28 m shows 8 by 8 pixels; its registered pose is off by 1 to 2 mm, its rack's by 0.1.
SMALLEST = 0.02
TOGETHER = 0.06  # Parts no further apart are looked at together [m] [A].
# Least share of the points near a part that have a partner on it [M]: 0.8 and more if it is found,
# 0.6 for the tray with its parts, 0.2 where there is something else.
SHARE = 0.4
# By which a part that nobody handled may have moved since it was seen: by what else was done there.
# Standard deviations about and along each axis [rad], [m] [A].
MOVED = np.diag(np.repeat([np.deg2rad(0.5), 5e-4], 3) ** 2)
NEST = 2e-3  # A part further from its place in the tray is not there, or that is not the tray [m].


@dataclass
class HandEye:
    """See the module.

    Attributes:
        camera: On the hand.
        root: Context of the diagram that is rendered.
        product: Its parts, and the tray.
        tray: Where that is expected.
        rng: Of the depth noise.
        in_hand: What the fixed camera sees of the part in the hand.
        duration: See `planning.perception.belief.Source`; the hand stands still by itself.
        pictures: Taken since the latest look.
    """

    camera: Camera
    root: Context
    product: Product
    tray: Estimate
    rng: np.random.Generator
    in_hand: InHand
    duration: float = 0.0
    pictures: list[Picture] = field(default_factory=list)
    _surfaces: dict[str, Surface] = field(default_factory=dict)
    _tray_model: Surface | None = None

    @staticmethod
    def of(cell: Cell, root: Context, config: CellConfig, seed: int) -> HandEye:
        """Return the source of a cell.

        Args:
            cell: The cell.
            root: Context of its diagram.
            config: What the planner believes the cell to be.
            seed: Of the depth noise.
        """
        rng = np.random.default_rng([seed, 2])
        camera, fixed = cell.cameras[HAND_EYE], cell.cameras[ABOVE]
        in_hand = InHand(fixed, cell.holder, root, camera)
        return HandEye(camera, root, cell.product, tray_expected(config), rng, in_hand)

    @property
    def frame(self) -> Frame:
        """The camera's frame C: z ahead."""
        return self.camera.body.body_frame()

    def targets(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> list[Array]:
        """Return the points p_W (3,) to look at to see parts: one for those that are together."""
        groups: list[list[Array]] = []
        for name in parts:
            if known[name].time == NEVER and self.product.tray is not None:
                middle = self.tray.X_WP @ self._tray_surface.centre
            else:
                middle = known[name].X_WP @ self._surface(name).centre
            near = (g for g in groups if np.linalg.norm(np.mean(g, axis=0) - middle) < TOGETHER)
            group = next(near, None)
            if group is None:
                groups.append([middle])
            else:
                group.append(middle)
        return [np.mean(group, axis=0) for group in groups]

    def take(self) -> None:
        """Take a picture."""
        self.pictures.append(self.camera.take(self.root, self.rng))

    def stops(self, part: str, X_HP: RigidTransform) -> list[RigidTransform]:
        """Return poses X_WH of the hand at which the fixed camera may see what it holds."""
        return self.in_hand.stops(self._surface(part), X_HP)

    def visible(self, part: str, X_HP: RigidTransform, q: Array) -> float:
        """Return the share of a part's surface that it sees with the arm at ``q`` (n,) [rad]."""
        return self.in_hand.visible(self._surface(part), X_HP, q)

    def watch(self, part: str, X_HP: RigidTransform) -> None:
        """Take a picture of the part in the hand with the fixed camera."""
        self.in_hand.watch(self._surface(part), X_HP, self.rng)

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        """Return what the pictures since the latest look show; without any, nothing.

        With pictures of the part in the hand, it is the first of the parts, and others ride on it.
        """
        if self.in_hand.views:
            return self._held(parts, known)
        pictures, self.pictures = self.pictures, []
        if not pictures:
            return {}
        seen = self._in_tray(pictures, known)
        for name in parts:
            surface = self._surface(name)
            if surface.size >= SMALLEST:
                prior = {**known, **seen}[name]
                found = self._registered(surface, pictures, prior)
                if found is not None and name in seen and _apart(found, seen[name]) > NEST:
                    return {}  # One of the two is wrong.
                seen.pop(name, None)
                if found is not None:
                    seen[name] = found
        return seen

    def _held(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        """Return where the part in the hand is, the first one, and what rides on it."""
        prior, surface = known[parts[0]], self._surface(parts[0])
        views = [near_to(view, surface, prior.X_WP, self.rng) for view in self.in_hand.views_now()]
        found = self._fitted(surface, views, prior)
        if found is None:
            return {}
        X_WOld = prior.X_WP.inverse()
        riders = {
            name: replace(known[name], X_WP=found.X_WP @ X_WOld @ known[name].X_WP, time=found.time)
            for name in parts[1:]
        }
        return {parts[0]: found, **riders}

    def _in_tray(
        self, pictures: Sequence[Picture], known: Mapping[str, Estimate]
    ) -> dict[str, Estimate]:
        """Return where the parts are that were only expected so far, by the tray that is seen."""
        unseen = [name for name, estimate in known.items() if estimate.time == NEVER]
        if not unseen or self.product.tray is None:
            return {}
        tray = self._registered(self._tray_surface, pictures, self.tray)
        if tray is None:
            return {}
        places = parts_in_tray(self.product, tray)
        return {name: places[name] for name in unseen}

    def _registered(
        self, surface: Surface, pictures: Sequence[Picture], prior: Estimate
    ) -> Estimate | None:
        """Return the estimate of what has a surface, None if it is not there."""
        return self._fitted(surface, views_of(pictures, surface, prior.X_WP, self.rng), prior)

    def _fitted(self, surface: Surface, views: Sequence[View], prior: Estimate) -> Estimate | None:
        """Return the estimate that fits views, None if what they show is something else.

        What has been seen before holds what is hardly in sight.
        """
        if prior.time == NEVER:
            more = starts_within(prior.X_WP, prior.covariance)
            found = register(surface, views, prior.X_WP, more)
        else:
            found = register(surface, views, prior.X_WP, covariance=prior.covariance + MOVED)
        if found is None or found.share < SHARE:
            return None
        return Estimate(found.X_WP, found.covariance, self.root.get_time())

    def _surface(self, name: str) -> Surface:
        if name not in self._surfaces:
            self._surfaces[name] = Surface.of(self.product.parts[name].mesh)
        return self._surfaces[name]

    @property
    def _tray_surface(self) -> Surface:
        if self._tray_model is None:
            assert self.product.tray is not None
            # With its parts: a tray is flat, and slides by millimetres along itself without them.
            parts = [
                part.mesh.copy().apply_transform(part.X_TrayP.GetAsMatrix4())
                for part in self.product.parts.values()
                if part.X_TrayP is not None
            ]
            self._tray_model = Surface.of_model(self.product.tray, parts)
        return self._tray_model

    def save(self) -> np.ndarray:
        """Return the state of the random generator; pictures do not outlive a look."""
        return random_state(self.rng)

    def restore(self, state: np.ndarray) -> None:
        """Return to a saved state of the random generator."""
        restore_random_state(self.rng, state)
        self.pictures, self.in_hand.views = [], []


def _apart(one: Estimate, other: Estimate) -> float:
    """Return the distance of two estimates [m]."""
    return float(np.linalg.norm(one.X_WP.translation() - other.X_WP.translation()))
