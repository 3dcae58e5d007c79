"""The cell as a place to take pictures in: its hand carries the camera round the jig.

The cell stands still, nothing is simulated: the arm is put where it looks from, and a part with its
imprint is taken over from where it was pressed in. Views are planned one after another, each so
that the arm reaches it and gets there straight in joint space, clear of everything.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from cell.builder import Cell, build_cell
from cell.configuration.config import CellConfig
from cell.errors import RunFailure
from cell.machines.cameras.camera import HAND_EYE, Camera
from cell.machines.cameras.color_image import photographed
from cell.machines.cameras.rendering import Lighting, rendering
from cell.products.product import Product
from planning.motion.collision_model import CollisionModel, Surroundings
from planning.operations.planning_copy import collision_model
from planning.perception.viewpoints import scattered

Array = NDArray[np.float64]

AIM_HEIGHT = 0.04  # Over J of what is looked at: about the middle of a part in the bag [m] [A].
AIM_SPREAD = 0.01  # Standard deviation of the point that is looked at, along each axis [m] [A].
TRIES = 200  # Of random places, before a view is given up [A]; one in two is reached [M].
SAMPLES = 2  # Of a pixel of the colour image along each axis [A].
LIT, BARE = "lit", "bare"  # Renderers: of colour with shadows; of depth and labels.


@dataclass(frozen=True, eq=False)
class Shot:
    """What the camera on the hand took, and the truth about it.

    Attributes:
        color: (h, w, 3) with the errors of lens and sensor.
        depth: (h, w) as measured [m], 0 where there is none.
        X_WM: Where the tool's mount was.
        X_WC: Where the camera was: the truth.
        bodies: (h, w) number of the body that each pixel shows: the truth.
    """

    color: NDArray[np.uint8]
    depth: Array
    X_WM: RigidTransform
    X_WC: RigidTransform
    bodies: NDArray[np.int64]


class Studio:
    """See the module.

    Args:
        config: Of the cell; the camera is mounted and the markers are there in any case.
        product: Whose parts are in the cell.
    """

    def __init__(self, config: CellConfig, product: Product) -> None:
        changes = {"camera.mounted": True, "camera.markers": True, "workcell.jig_base_fixed": True}
        self.config = config.with_changes(changes)
        self.cell: Cell = build_cell(self.config, product)
        assert self.cell.diagram is not None
        self.root: Context = self.cell.diagram.CreateDefaultContext()
        self.cell.monitor.initialize(self.root)
        self._context = self.cell.plant.GetMyMutableContextFromRoot(self.root)
        self._model: CollisionModel = collision_model(self.cell, self.config)
        self._parts = {p.part.name: p.X_WP(self._context) for p in self.cell.parts}

    @property
    def camera(self) -> Camera:
        """The camera on the hand."""
        return self.cell.cameras[HAND_EYE]

    @property
    def X_WJ(self) -> RigidTransform:
        """Where the jig stands."""
        return self.cell.X_WJ

    def place(self, part: str, X_JP: RigidTransform, fixture: Mapping[str, Any]) -> None:
        """Put a part on the jig.

        Args:
            part: Its name.
            X_JP: Its pose.
            fixture: State of the fixture that it has left its imprint in, as `Fixture.save` says.
        """
        self.cell.fixture.restore(self.root, fixture)
        self._parts[part] = self.X_WJ @ X_JP
        self.cell.parts[part].joint.SetPose(self._context, self._parts[part])

    def go_home(self) -> None:
        """Bring the arm home, from where views begin."""
        arm = self.cell.holder
        self.cell.plant.SetPositions(self._context, arm.instance, arm.home)

    def views(self, rng: np.random.Generator) -> Iterator[None]:
        """Bring the hand to one random view of the jig after another, for ever.

        Raises:
            RunFailure: None of many places can be reached from the one before.
        """
        arm = self.cell.holder
        p_WAim = self.X_WJ @ np.array([0.0, 0.0, AIM_HEIGHT])
        while True:
            q = next(
                (
                    q
                    for _ in range(TRIES)
                    if (q := self._next(p_WAim + AIM_SPREAD * rng.normal(size=3), rng)) is not None
                ),
                None,
            )
            if q is None:
                raise RunFailure(
                    f"The {arm.name} arm finds no view of the jig in {TRIES} tries: every one is "
                    "out of reach, or something is in the way."
                )
            self.cell.plant.SetPositions(self._context, arm.instance, q)
            yield

    def _next(self, p_WTarget: Array, rng: np.random.Generator) -> Array | None:
        """Return joint angles (n,) that see a point from somewhere, straight from here; or None."""
        arm, frame = self.cell.holder, self.camera.body.body_frame()
        here = arm.positions(self._context)
        tool = {f"{arm.name}_tool": self.cell.plant.GetPositions(self._context, arm.tool_instance)}
        self._model.arrange(Surroundings(tools=tool, X_WP=self._parts))
        for X_WC in scattered(p_WTarget, rng):
            for q in arm.configurations(self._context, frame, X_WC, here)[:1]:
                reached = arm.model.is_regular(q) and self._model.is_free(arm.name, q)
                if reached and self._model.is_edge_free(arm.name, here, q):
                    return q
        return None

    @contextmanager
    def lit(self, lighting: Lighting) -> Iterator[QueryObject]:
        """Give what `take` renders colour with, under one lighting: it is costly to set up."""
        scene = self.cell.scene_graph
        with rendering(scene, self.root, lighting=lighting, renderer=LIT) as query:
            yield query

    @contextmanager
    def open_shutter(self) -> Iterator[None]:
        """Have what `take` renders depth and labels with ready."""
        with rendering(self.cell.scene_graph, self.root, shadows=False, renderer=BARE):
            yield

    def take(self, query: QueryObject, rng: np.random.Generator) -> Shot:
        """Take a picture from where the hand is."""
        camera, X_WC = self.camera, self.camera.X_WC(self.root)
        mount = self.cell.holder.frame("mount")
        return Shot(
            color=photographed(camera.render_color(query, X_WC, LIT, SAMPLES), rng),
            depth=camera.stereo.measured(camera.render_depth(query, X_WC, BARE), rng),
            X_WM=mount.CalcPoseInWorld(self._context),
            X_WC=X_WC,
            bodies=camera.render_labels(query, X_WC, BARE),
        )

    def hand(self, bodies: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which pixels (h, w) show the hand itself, the same in every picture.

        Args:
            bodies: (h, w) of a shot.
        """
        own = self.cell.plant.GetBodyIndices(self.cell.holder.tool_instance)
        return np.isin(bodies, [int(index) for index in own])
