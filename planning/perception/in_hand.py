"""What a part in the hand looks like to a camera that stands still, past the hand that holds it.

The hand and its arm hide some of it and touch it, but where they are is known: from their models
and the joint encoders. What is measured near their surface is left out, and what they would hide is
foreseen, so that the arm can show the part from where most of it is in sight.
Frames: W of the world, H of the hand, P of the part, C of the camera.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context
from scipy.ndimage import minimum_filter
from scipy.spatial import KDTree

from cell.machines.arm import Arm
from cell.machines.cameras.camera import Camera, Picture
from cell.shapes import shape_mesh
from planning.perception.registration import View
from planning.perception.surface import FACING, Surface

Array = NDArray[np.float64]

SPACING = 2e-3  # Between points on the arm [m] [A].
# Measured points this near to the hand count as the hand's [m] [A]: the spacing and three standard
# deviations of a D435's depth at 0.36 m.
NEAR = 4e-3
ROUND = 0.15  # Only points this near to the middle of the part are looked at [m] [A].
CELL = 6  # Pixels of one cell of the image in which it is foreseen what hides what [A].
THIN = 4  # Of so many points of the arm and the part one is used there: 4 mm apart [A].
DEPTH = 0.36  # Of the part's middle below the camera: twice the least that has a depth [m] [A].
ASIDE = 0.12  # Off the optical axis [m] [A]: in the middle of the image the hand hides the part.
AZIMUTHS = np.deg2rad(np.arange(0.0, 360.0, 45.0))
TURNS = np.deg2rad([0.0, -90.0, 90.0, 180.0])  # Of the hand about the vertical [A].


@dataclass
class InHand:
    """See the module.

    Attributes:
        camera: That stands still; it looks straight down.
        arm: Whose hand holds the part.
        root: Context of the diagram: joint angles are read from it.
        carried: The camera on the hand; None: there is none.
        views: Taken so far: points in H.
    """

    camera: Camera
    arm: Arm
    root: Context
    carried: Camera | None = None
    views: list[View] = field(default_factory=list)

    def __post_init__(self) -> None:
        plant = self.arm.plant
        self._copy = plant.CreateDefaultContext()
        instances = [self.arm.instance, self.arm.tool_instance]
        if self.carried is not None:
            instances.append(self.carried.body.model_instance())
        self._points = {
            body: points
            for instance in instances
            for body in plant.GetBodyIndices(instance)
            if len(points := self._sampled(body))
        }

    def stops(self, surface: Surface, X_HP: RigidTransform) -> list[RigidTransform]:
        """Return poses X_WH of the upright hand with the part beside the middle of the image.

        Args:
            surface: Of the part.
            X_HP: How it is believed to lie in the hand.
        """
        X_WC, R_WH = self.camera.X_WC(self.root), self._X_WH().rotation()
        poses = []
        for azimuth in AZIMUTHS:
            p_WCentre = X_WC @ np.array([ASIDE * np.cos(azimuth), ASIDE * np.sin(azimuth), DEPTH])
            for turn in TURNS:
                R = RotationMatrix.MakeZRotation(float(turn)) @ R_WH
                poses.append(RigidTransform(R, p_WCentre - R @ (X_HP @ surface.centre)))
        return poses

    def visible(self, surface: Surface, X_HP: RigidTransform, q: Array) -> float:
        """Return the share of a part's surface that both imagers see with the arm at joint angles.

        Args:
            surface: Of the part.
            X_HP: How it is believed to lie in the hand.
            q: (n,) [rad].
        """
        plant, context = self.arm.plant, self.root
        now = plant.GetMyContextFromRoot(context)
        plant.SetPositions(self._copy, plant.GetPositions(now))
        plant.SetPositions(self._copy, self.arm.instance, q)
        X_CW = self.camera.X_WC(self.root).inverse()
        X_CP = X_CW @ self.arm.frame("tip").CalcPoseInWorld(self._copy) @ X_HP
        p_CQ = (X_CP @ surface.points[::THIN].T).T
        normals = surface.normals[::THIN] @ X_CP.rotation().matrix().T
        p_CArm = (X_CW @ self._arm_points(self._copy)[::THIN].T).T
        seen = np.ones(len(p_CQ), bool)
        for imager in (np.zeros(3), np.array([self.camera.stereo.baseline, 0.0, 0.0])):
            rays = p_CQ - imager
            cosine = -np.einsum("ij,ij->i", rays, normals) / np.linalg.norm(rays, axis=1)
            seen &= (cosine > FACING) & self._unhidden(rays, p_CArm - imager)
        return float(np.mean(seen))

    def watch(self, surface: Surface, X_HP: RigidTransform, rng: np.random.Generator) -> None:
        """Take a picture, and keep what it shows about the part that is not the hand.

        Args:
            surface: Of the part.
            X_HP: How it is believed to lie in the hand.
            rng: Of the depth noise.
        """
        self.views.append(self.view_in(self.camera.take(self.root, rng), surface, X_HP))

    def view_in(self, picture: Picture, surface: Surface, X_HP: RigidTransform) -> View:
        """Return what a picture shows about a part in the hand that is not the hand, in H."""
        X_WH = self._X_WH()
        points = picture.points()
        points = points[np.linalg.norm(points - X_WH @ X_HP @ surface.centre, axis=1) < ROUND]
        tree = KDTree(self._arm_points(self.arm.plant.GetMyContextFromRoot(self.root)))
        apart = np.asarray(tree.query(points, distance_upper_bound=NEAR)[0])
        X_HW = X_WH.inverse()
        return View((X_HW @ points[~np.isfinite(apart)].T).T, X_HW @ picture.X_WC.translation())

    def views_now(self) -> list[View]:
        """Return the views as if all had been taken with the hand where it is now; forget them."""
        X_WH, views = self._X_WH(), self.views
        self.views = []
        return [View((X_WH @ view.points.T).T, X_WH @ view.p_WC) for view in views]

    def _X_WH(self) -> RigidTransform:
        context = self.arm.plant.GetMyContextFromRoot(self.root)
        return self.arm.frame("tip").CalcPoseInWorld(context)

    def _arm_points(self, context: Context) -> Array:
        """Return points p_W (n, 3) of the arm and what is on it [m]."""
        plant = self.arm.plant
        return np.concatenate(
            [
                (plant.EvalBodyPoseInWorld(context, plant.get_body(body)) @ points.T).T
                for body, points in self._points.items()
            ]
        )

    def _sampled(self, body: BodyIndex) -> Array:
        """Return points (n, 3) of what is visible of a body, in its frame [m]."""
        plant, inspector = self.arm.plant, self.camera.scene_graph.model_inspector()
        found = [np.zeros((0, 3))]
        for geometry in plant.GetVisualGeometriesForBody(plant.get_body(body)):
            mesh = shape_mesh(inspector.GetShape(geometry))
            mesh.apply_transform(inspector.GetPoseInFrame(geometry).GetAsMatrix4())
            count = int(np.ceil(mesh.area / SPACING**2))
            found.append(np.asarray(trimesh.sample.sample_surface(mesh, count, seed=0)[0]))
        return np.concatenate(found)

    def _unhidden(self, p_CQ: Array, p_CArm: Array) -> NDArray[np.bool_]:
        """Return which points (n, 3) are within the image and not behind those of the arm."""
        pinhole = self.camera.pinhole
        size = np.array([pinhole.width, pinhole.height])
        nearest = np.full(tuple(-(-size // CELL)), np.inf)
        ahead = p_CArm[p_CArm[:, 2] > 0.02]
        pixel = pinhole.project(ahead)
        inside = ((pixel >= 0.0) & (pixel < size)).all(axis=1)
        column, row = (pixel[inside] // CELL).astype(int).T
        np.minimum.at(nearest, (column, row), ahead[inside, 2])
        nearest = minimum_filter(nearest, 3)
        pixel = pinhole.project(p_CQ)
        inside = ((pixel >= 0.0) & (pixel < size)).all(axis=1)
        column, row = (np.clip(pixel, 0.0, size - 1.0) // CELL).astype(int).T
        return inside & (p_CQ[:, 2] < nearest[column, row])
