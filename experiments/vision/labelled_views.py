"""Pictures with labels, read from a dataset that `experiments.collect_views` has written.

Frames: C of the camera, P of the part, O of the dataset's model, D of the board, the world there.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from pydrake.math import RigidTransform, RotationMatrix

from cell.errors import InputError
from cell.machines.cameras.pinhole import Pinhole
from experiments.vision.bop import MM, SPLIT, box_centre

RECORD = "collection.json"
SAME = 1e-5  # Corners of the boxes of the same mesh are no further apart [m]: it is kept as text.


@dataclass(frozen=True, eq=False)
class LabelledView:
    """One picture.

    Attributes:
        color: (h, w, 3).
        visible: (h, w) where the part is seen: 255, elsewhere 0.
        X_CP: Where the part is, by its label.
        X_CD: Where the board is.
        scene: Number of the placement that it was taken of.
        case: Posture in that, for example "motor/P2".
    """

    color: NDArray[np.uint8]
    visible: NDArray[np.uint8]
    X_CP: RigidTransform
    X_CD: RigidTransform
    scene: int
    case: str


@dataclass(frozen=True, eq=False)
class LabelledViews:
    """A dataset of one part.

    Attributes:
        views: In the order of the dataset.
        pinhole: Of the camera.
        about: What is said of it on a net's card: folder, pictures, placements by posture,
            fingerprint.
    """

    views: list[LabelledView]
    pinhole: Pinhole
    about: dict[str, Any]


def part_of(root: Path) -> str:
    """Return the name of the part that a dataset shows.

    Raises:
        InputError: It is no dataset of `collect_views`, or not complete.
    """
    record = _load(root / RECORD)
    try:
        part, complete = record["made_from"]["part"].split("/")[0], record["status"] == "complete"
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"'{root / RECORD}' is not what collect_views writes: {error}.") from error
    if not complete:
        raise InputError(
            f"'{root}' is not complete: python -m experiments.collect_views {part} --out {root} "
            "goes on with it."
        )
    return part


def read_views(root: Path, mesh: trimesh.Trimesh) -> LabelledViews:
    """Return the pictures of a dataset.

    Args:
        root: Its folder.
        mesh: Of the part [m].

    Raises:
        InputError: Something is missing, cannot be read, or shows a part of another size.
    """
    X_OP, sums, views = box_centre(mesh).inverse(), hashlib.sha256(), []
    camera, record = _load(root / "camera.json"), _load(root / RECORD)
    scenes = sorted(path for path in (root / SPLIT).glob("[0-9]*") if path.is_dir())
    if not scenes:
        raise InputError(f"'{root / SPLIT}' has no scenes.")
    try:
        pinhole = Pinhole(
            camera["width"], camera["height"], camera["fx"], camera["cx"], camera["cy"]
        )
        for folder in scenes:
            case = record["scenes"][str(int(folder.name))]["case"]
            labels, cameras = (
                _load(folder / name) for name in ("scene_gt.json", "scene_camera.json")
            )
            for number in sorted(labels, key=int):
                (label,) = labels[number]
                _check_model(root, label["obj_id"], mesh)
                X_CO = _pose(label["cam_R_m2c"], label["cam_t_m2c"])
                camera = cameras[number]
                X_CD = _pose(camera["cam_R_w2c"], camera["cam_t_w2c"])
                color = _image(folder / "rgb" / f"{int(number):06d}.png", 3)
                seen = _image(folder / "mask_visib" / f"{int(number):06d}_000000.png", 2)
                sums.update(color.tobytes())
                views.append(LabelledView(color, seen, X_CO @ X_OP, X_CD, int(folder.name), case))
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise InputError(f"'{root}' is not what collect_views writes: {error}.") from error
    about = {
        "folder": root.name,
        "pictures": len(views),
        "placements": dict(Counter(record["scenes"][str(int(s.name))]["case"] for s in scenes)),
        "sha256": sums.hexdigest(),
    }
    return LabelledViews(views, pinhole, about)


def _check_model(root: Path, number: int, mesh: trimesh.Trimesh) -> None:
    info = _load(root / "models" / "models_info.json")[str(number)]
    size = np.array([info[f"size_{axis}"] for axis in "xyz"]) / MM
    if np.abs(size - np.ptp(mesh.bounds, axis=0)).max() > SAME:
        shown = " x ".join(f"{MM * edge:.2f}" for edge in size)
        raise InputError(
            f"'{root}' shows a part of {shown} mm, which is not the size of the mesh now: "
            "collect its pictures anew."
        )


def _pose(R: list[float], t: list[float]) -> RigidTransform:
    matrix = RotationMatrix.ProjectToRotationMatrix(np.array(R, float).reshape(3, 3))
    return RigidTransform(matrix, np.array(t, float) / MM)


def _image(path: Path, dimensions: int) -> NDArray[np.uint8]:
    try:
        image = np.asarray(Image.open(path), np.uint8)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error}.") from error
    if image.ndim != dimensions:
        raise InputError(f"'{path}' has {image.ndim} dimensions, not {dimensions}.")
    return image


def _load(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read: {error}.") from error
