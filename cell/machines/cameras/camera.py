"""A depth camera: on the hand that grips, or fixed above the jig; it renders when it is asked.

Both are RealSense D435 as far as the numbers go. Depth is that of the left infrared imager, with
the errors of `stereo_depth`; the colour image is taken from the same place, as the maker's driver
aligns it. Label images say which body each pixel shows: they are for making data and for verdicts,
not for what is sensed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    QueryObject,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia
from pydrake.systems.framework import Context

from cell.configuration.machines import CameraConfig
from cell.machines.arm import Arm
from cell.machines.cameras.pinhole import Pinhole
from cell.machines.cameras.rendering import RENDERER, camera_core, rendering
from cell.machines.cameras.stereo_depth import StereoDepth

Array = NDArray[np.float64]

HAND_EYE, ABOVE = "hand_eye", "above"  # Names of the two cameras.
SIZE = (0.090, 0.025, 0.025)  # Of the housing along x, y and z of C [m] [R D400 data sheet].
MASS = 0.072  # [kg] [R D400 data sheet]
LENS = 0.0042  # Of the imagers, behind the front glass [m] [R D400 data sheet].
FARTHEST = 10.0  # Depth that is rendered [m].
ANODISED = (0.75, 0.76, 0.78, 1.0)


@dataclass(frozen=True)
class Picture:
    """What a camera took at one time.

    Attributes:
        time: [s].
        X_WC: Where the camera was.
        pinhole: Its geometry.
        depth: (h, w) as measured [m], 0 where there is none.
        color: (h, w, 3) bytes; None: not asked for.
    """

    time: float
    X_WC: RigidTransform
    pinhole: Pinhole
    depth: Array
    color: NDArray[np.uint8] | None = None

    def points(self) -> Array:
        """Return p_WQ (n, 3) of all pixels that have a depth [m]."""
        p_CQ = self.pinhole.points(self.depth)
        return p_CQ @ self.X_WC.rotation().matrix().T + self.X_WC.translation()


@dataclass(frozen=True)
class FixedView:
    """What a camera that stands still projects by.

    Attributes:
        X_WC: Where it is.
        pinhole: Its geometry.
    """

    X_WC: RigidTransform
    pinhole: Pinhole

    @staticmethod
    def above(X_WJ: RigidTransform, config: CameraConfig) -> FixedView:
        """Return the view straight down on a jig that stands at a pose."""
        down = RotationMatrix.MakeXRotation(np.pi)
        p_WC = X_WJ.translation() + np.array([0.0, 0.0, config.height_above_jig])
        pinhole = Pinhole.centred(config.width, config.height, config.focal_length)
        return FixedView(RigidTransform(down, p_WC), pinhole)


@dataclass(frozen=True)
class Camera:
    """A camera in the cell.

    Attributes:
        name: "hand_eye" or "above".
        plant, scene_graph: Drake's.
        body: What it is fixed to.
        X_BC: Its frame C on that body: x to the right of the image, y down, z into the scene.
        pinhole: Its geometry.
        stereo: How it measures depth.
    """

    name: str
    plant: MultibodyPlant
    scene_graph: SceneGraph
    body: RigidBody
    X_BC: RigidTransform
    pinhole: Pinhole
    stereo: StereoDepth

    def placed(self, X_WC: RigidTransform) -> Camera:
        """Return such a camera, fixed at a pose in the world."""
        return replace(self, body=self.plant.world_body(), X_BC=X_WC)

    def X_WC(self, root: Context) -> RigidTransform:
        """Return where it is."""
        context = self.plant.GetMyContextFromRoot(root)
        return self.plant.EvalBodyPoseInWorld(context, self.body) @ self.X_BC

    def take(self, root: Context, rng: np.random.Generator, *, color: bool = False) -> Picture:
        """Take a picture of the scene as it is now; the state is not changed.

        Args:
            root: Context of the diagram.
            rng: Of the depth noise.
            color: Whether to take the colour image, too.

        Raises:
            NoRendering: This machine cannot render.
        """
        X_WC = self.X_WC(root)
        with rendering(self.scene_graph, root) as query:
            true = self.render_depth(query, X_WC)
            rgb = self.render_color(query, X_WC) if color else None
        measured = self.stereo.measured(true, rng)
        return Picture(root.get_time(), X_WC, self.pinhole, measured, rgb)

    def labels(self, root: Context) -> NDArray[np.int64]:
        """Return the number of the body that each pixel shows (h, w): the truth."""
        with rendering(self.scene_graph, root) as query:
            return self.render_labels(query, self.X_WC(root))

    # What a renderer gives that is already there, see `rendering`: it is costly to make.

    def render_depth(
        self, query: QueryObject, X_WC: RigidTransform, renderer: str = RENDERER
    ) -> Array:
        """Return the true depth (h, w) [m]."""
        core = camera_core(self.pinhole.drake, renderer)
        near_to_far = DepthRange(core.clipping().near(), FARTHEST)
        world = self.scene_graph.world_frame_id()
        image = query.RenderDepthImage(DepthRenderCamera(core, near_to_far), world, X_WC)
        return np.array(image.data[:, :, 0], float)

    def render_color(
        self, query: QueryObject, X_WC: RigidTransform, renderer: str = RENDERER, samples: int = 1
    ) -> NDArray[np.uint8]:
        """Return the colour image (h, w, 3), without noise.

        Args:
            query: Of `rendering`.
            X_WC: Of the camera.
            renderer: Its name there.
            samples: Of a pixel along each axis, whose mean is taken, as a sensor does. With one,
                edges are jagged, and those along the rows of pixels are off by up to half a pixel.
        """
        core = camera_core(self.pinhole.finer(samples).drake, renderer)
        camera, world = ColorRenderCamera(core, False), self.scene_graph.world_frame_id()
        rgb = np.array(query.RenderColorImage(camera, world, X_WC).data[:, :, :3])
        if samples == 1:
            return rgb
        shape = self.pinhole.height, samples, self.pinhole.width, samples, 3
        return np.round(rgb.reshape(shape).mean(axis=(1, 3))).astype(np.uint8)

    def render_labels(
        self, query: QueryObject, X_WC: RigidTransform, renderer: str = RENDERER
    ) -> NDArray[np.int64]:
        """Return the number of the body that each pixel shows (h, w)."""
        camera = ColorRenderCamera(camera_core(self.pinhole.drake, renderer), show_window=False)
        image = query.RenderLabelImage(camera, self.scene_graph.world_frame_id(), X_WC)
        return np.array(image.data[:, :, 0], int)


def add_hand_eye(plant: MultibodyPlant, arm: Arm, config: CameraConfig) -> None:
    """Put a camera on the tool of an arm, before the plant is finalized."""
    instance = plant.AddModelInstance(f"{arm.name}_{HAND_EYE}")
    inertia = SpatialInertia.SolidBoxWithMass(MASS, *SIZE)
    body = plant.AddRigidBody(HAND_EYE, instance, inertia)
    X_CHousing = RigidTransform([0.0, 0.0, LENS - SIZE[2] / 2.0])
    friction = CoulombFriction(0.3, 0.3)  # [A] Anodised aluminium; it is not meant to touch.
    plant.RegisterCollisionGeometry(body, X_CHousing, Box(*SIZE), "housing", friction)
    plant.RegisterVisualGeometry(body, X_CHousing, Box(*SIZE), "housing", list(ANODISED))
    mount = plant.GetFrameByName("mount", arm.tool.instance)
    plant.WeldFrames(mount, body.body_frame(), config.X_MC)
    plant.set_gravity_enabled(instance, False)  # The arm bears it, as it bears its tool.


def cameras_of(
    plant: MultibodyPlant, scene_graph: SceneGraph, X_WJ: RigidTransform, config: CameraConfig
) -> Mapping[str, Camera]:
    """Return the handles of the cameras in a cell, by name.

    Args:
        plant: With the camera on the hand, if it is mounted.
        scene_graph: The plant's.
        X_WJ: Where the jig stands.
        config: Of the cameras.
    """
    above = FixedView.above(X_WJ, config)
    stereo = StereoDepth(
        focal_length=config.focal_length,
        baseline=config.baseline,
        noise=config.disparity_noise,
        step=config.disparity_step,
        most=config.largest_disparity,
        bias=config.disparity_bias,
        edge_loss=config.edge_loss,
        dropouts=config.dropouts,
    )
    places = {ABOVE: (plant.world_body(), above.X_WC)}
    if plant.HasBodyNamed(HAND_EYE):
        places[HAND_EYE] = (plant.GetBodyByName(HAND_EYE), RigidTransform())
    return {
        name: Camera(name, plant, scene_graph, body, X_BC, above.pinhole, stereo)
        for name, (body, X_BC) in places.items()
    }
