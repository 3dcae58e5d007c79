"""One scene of a collection: a part placed once, pictures of it from many sides, their labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from scipy.ndimage import binary_dilation

from cell.errors import RunFailure
from cell.machines.cameras.camera import Picture
from cell.machines.cameras.marker_board import X_JD
from experiments.vision.bop import LabelledImage
from experiments.vision.boxes import TRUTH, with_boxes
from experiments.vision.labelling import Marked, marked, measured_pose, visible
from experiments.vision.lighting import random_lighting
from experiments.vision.placing import Placed
from experiments.vision.pose_error import apart
from experiments.vision.studio import Studio
from planning.perception.marker_detection import detect_markers
from planning.perception.marker_erasing import without_markers
from planning.perception.part_alone import PartAlone
from planning.perception.surface import Surface

VIEWS_PER_LIGHTING = 5
MISSED = 4  # So many views in vain for each one that is wanted, and a scene is given up [A].
BORDER = 5  # Of the image that the part keeps clear of [pixels] [A].
OUTLINE = 2  # By which the part's silhouette is kept wider, when markers are erased [pixels] [A].
LABEL = (240, 200, 40)  # Colour of boxes that are based on markers: yellow as in the paper [S].


@dataclass(frozen=True)
class LabelError:
    """How wrong the label of one picture is, and what else its truth shows.

    Attributes:
        camera_mm, camera_deg: Of where the camera is on the board, by the markers.
        label_mm, label_deg: Of the part in the camera, at the centre of its box.
        mask_overlap: Intersection by union of the visible mask with what the part really covers.
        markers: How many were seen.
        left: How many are still found when they have been erased.
        painted_on_part: Pixels of the part, as it really is, that erasing has changed.
    """

    camera_mm: float
    camera_deg: float
    label_mm: float
    label_deg: float
    mask_overlap: float
    markers: int
    left: int
    painted_on_part: int


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene, ready to be written.

    Attributes:
        images: Labelled, without markers.
        errors: Of each.
        missed: Views in which the board, or part of the part, was out of sight.
        picture: PNG of the first as it was taken, with boxes of truth and label.
    """

    images: list[LabelledImage]
    errors: list[LabelError]
    missed: int
    picture: bytes


class Unlabelled(RunFailure):
    """A placement of which too little is seen to label its pictures."""


def collect_scene(
    studio: Studio, part: str, placed: Placed, count: int, rng: np.random.Generator
) -> Scene:
    """Take and label pictures of a part on the jig.

    Args:
        studio: Where.
        part: Name of the part.
        placed: How it lies.
        count: Of pictures.
        rng: Of views, lighting and noise.

    Raises:
        Unlabelled: The board is hardly ever in sight, or the part is not found by its depth.
        NoRendering: This machine cannot render.
    """
    mesh, pinhole = studio.cell.product.parts[part].mesh, studio.camera.pinhole
    surface = Surface.of(mesh)
    studio.place(part, placed.X_JP, placed.fixture)
    X_DPlanned = X_JD.inverse() @ placed.X_JPlanned
    shots, hand, missed = _shots(studio, surface, X_DPlanned, count, rng)
    found = measured_pose(shots, pinhole, surface, X_DPlanned, rng)
    if found is None:
        raise Unlabelled(f"'{part}' is not found by the depth of {len(shots)} pictures.")
    X_DP = found.X_WP
    X_WP, number = studio.X_WJ @ placed.X_JP, int(studio.cell.parts[part].body.index())
    models = PartAlone(mesh).depths(pinhole, [one.board.X_CD @ X_DP for one in shots])
    images, errors = [], []
    for one, model in zip(shots, models, strict=True):
        shot, X_CD = one.shot, one.board.X_CD
        seen = visible(shot.depth, model)
        near = np.asarray(binary_dilation(model > 0.0, iterations=OUTLINE), bool)
        blank = without_markers(shot.color, shot.depth, pinhole, X_CD, hand | near, rng)
        images.append(LabelledImage(blank, shot.depth, X_CD, X_CD @ X_DP, model > 0.0, seen))
        truly = shot.bodies == number
        camera = apart(X_CD.inverse(), (studio.X_WJ @ X_JD).inverse() @ shot.X_WC)
        label = apart(X_CD @ X_DP, shot.X_WC.inverse() @ X_WP, surface.centre)
        errors.append(
            LabelError(
                *camera,
                *label,
                mask_overlap=float((seen & truly).sum() / max((seen | truly).sum(), 1)),
                markers=len(one.board.markers),
                left=len(detect_markers(blank)),
                painted_on_part=int(((blank != shot.color).any(axis=2) & truly).sum()),
            )
        )
    return Scene(images, errors, missed, _picture(shots[0], studio, surface, X_WP, X_DP))


def _shots(
    studio: Studio, surface: Surface, X_DP: RigidTransform, count: int, rng: np.random.Generator
) -> tuple[list[Marked], NDArray[np.bool_], int]:
    """Return shots in which the board is seen and the part is whole, the hand's mask, the rest."""
    shots: list[Marked] = []
    views, taken, hand = studio.views(rng), 0, None
    with studio.open_shutter():
        while len(shots) < count:
            with studio.lit(random_lighting(rng)) as query:
                for _ in range(min(VIEWS_PER_LIGHTING, count - len(shots))):
                    next(views)
                    shot = studio.take(query, rng)
                    # Of the hand its labels are taken: a rendering of its model would be the same.
                    hand = studio.hand(shot.bodies) if hand is None else hand
                    taken += 1
                    one = marked(shot, studio.camera.pinhole)
                    if one is not None and _whole(one, studio, surface, X_DP):
                        shots.append(one)
            if taken > MISSED * count + VIEWS_PER_LIGHTING:
                raise Unlabelled(
                    f"Of {taken} views {len(shots)} show enough markers and the whole part: the "
                    "board is out of sight."
                )
    assert hand is not None
    return shots, hand, taken - len(shots)


def _whole(one: Marked, studio: Studio, surface: Surface, X_DP: RigidTransform) -> bool:
    """Return whether the box of the part is inside an image."""
    pinhole = studio.camera.pinhole
    pixels = pinhole.project((one.board.X_CD @ X_DP @ surface.corners.T).T)
    size = np.array([pinhole.width, pinhole.height])
    return bool(((pixels > BORDER) & (pixels < size - 1 - BORDER)).all())


def _picture(
    one: Marked, studio: Studio, surface: Surface, X_WP: RigidTransform, X_DP: RigidTransform
) -> bytes:
    shot = one.shot
    picture = Picture(0.0, shot.X_WC, studio.camera.pinhole, shot.depth, shot.color)
    return with_boxes(picture, surface, {TRUTH: X_WP, LABEL: shot.X_WC @ one.board.X_CD @ X_DP})


FIGURES = ("camera_mm", "camera_deg", "label_mm", "label_deg", "mask_overlap")


def summary(errors: Sequence[LabelError]) -> dict[str, float]:
    """Return medians and tails of errors, and what erasing has left."""
    figures: dict[str, float] = {"images": len(errors)}
    for name in FIGURES:
        values = [getattr(error, name) for error in errors]
        tail = 5 if name == "mask_overlap" else 95
        for percentile in (50, tail):
            figures[f"{name}_{percentile}"] = float(np.percentile(values, percentile))
    figures["markers_50"] = float(np.median([error.markers for error in errors]))
    figures["markers_left"] = sum(error.left for error in errors)
    figures["painted_on_part"] = sum(error.painted_on_part for error in errors)
    return figures
