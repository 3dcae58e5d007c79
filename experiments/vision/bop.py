"""Pictures with labels as a BOP dataset, the format that public training code reads.

The format: https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md. Lengths
are in millimetres. O is the frame of a model there: its axes are those of the part's frame P, its
origin is the centre of the part's bounding box. The world is the board of markers, D. The camera's
frame C and its pixels are as everywhere here: those of OpenCV.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial import ConvexHull
from scipy.spatial.distance import pdist
from trimesh.exchange.ply import export_ply

from cell.machines.cameras.pinhole import Pinhole
from cell.whole_file import cannot_write

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MM = 1e3  # In a metre.
DEPTH_SCALE = 0.1  # [mm] of a step of the depth images: finer than the noise.
SPLIT = "train"


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """One picture with its label.

    Attributes:
        color: (h, w, 3).
        depth: (h, w) [m], 0 where there is none.
        X_CD: The world in the camera.
        X_CP: The part in the camera.
        mask: (h, w) its whole silhouette.
        visible: (h, w) what is seen of it.
    """

    color: NDArray[np.uint8]
    depth: Array
    X_CD: RigidTransform
    X_CP: RigidTransform
    mask: Mask
    visible: Mask


def scene_folder(root: Path, number: int) -> Path:
    """Return the folder of a scene."""
    return root / SPLIT / f"{number:06d}"


def box_centre(mesh: trimesh.Trimesh) -> RigidTransform:
    """Return X_PO of a part's model."""
    return RigidTransform(np.mean(mesh.bounds, axis=0))


def write_head(root: Path, pinhole: Pinhole, meshes: Mapping[int, trimesh.Trimesh]) -> None:
    """Write the camera and the models.

    Args:
        root: Folder of the dataset.
        pinhole: Of the camera.
        meshes: Of the parts in their frames P [m], by the number of the object.
    """
    folder, infos = root / "models", {}
    folder.mkdir(exist_ok=True)
    for number, mesh in meshes.items():
        model = mesh.copy()
        model.apply_translation(-box_centre(mesh).translation())
        model.apply_scale(MM)
        text = export_ply(model, encoding="ascii", vertex_normal=True)
        (folder / f"obj_{number:06d}.ply").write_bytes(text)
        infos[str(number)] = _model_info(model)
    _write(folder / "models_info.json", infos)
    camera = {
        "cx": pinhole.cx,
        "cy": pinhole.cy,
        "depth_scale": DEPTH_SCALE,
        "fx": pinhole.focal_length,
        "fy": pinhole.focal_length,
        "height": pinhole.height,
        "width": pinhole.width,
    }
    _write(root / "camera.json", camera)


def write_scene(
    root: Path,
    number: int,
    images: Sequence[LabelledImage],
    pinhole: Pinhole,
    object_number: int,
    X_PO: RigidTransform,
) -> None:
    """Write a scene, whole or not at all; one that is there already is replaced.

    Args:
        root: Folder of the dataset.
        number: Of the scene.
        images: Its pictures.
        pinhole: Of the camera.
        object_number: Of the part that they show.
        X_PO: Its model's frame.

    Raises:
        MachineError: It cannot be written.
    """
    folder = scene_folder(root, number)
    partial = folder.with_name(f".{folder.name}.part")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        for name in ("rgb", "depth", "mask", "mask_visib"):
            (partial / name).mkdir(parents=True)
        for k, image in enumerate(images):
            _save(partial / "rgb" / f"{k:06d}.png", image.color)
            _save(partial / "depth" / f"{k:06d}.png", _depth_steps(image.depth))
            for name, mask in (("mask", image.mask), ("mask_visib", image.visible)):
                _save(partial / name / f"{k:06d}_000000.png", np.where(mask, 255, 0))
        cameras = {str(k): _camera(image, pinhole) for k, image in enumerate(images)}
        poses = [_rotation_and_offset(image.X_CP @ X_PO) for image in images]
        labels = {
            str(k): [{"cam_R_m2c": R, "cam_t_m2c": t, "obj_id": object_number}]
            for k, (R, t) in enumerate(poses)
        }
        infos = {str(k): [_label_info(image)] for k, image in enumerate(images)}
        _write(partial / "scene_camera.json", cameras)
        _write(partial / "scene_gt.json", labels)
        _write(partial / "scene_gt_info.json", infos)
        shutil.rmtree(folder, ignore_errors=True)
        os.rename(partial, folder)
    except OSError as error:
        raise cannot_write(folder, error) from error


def _depth_steps(depth: Array) -> NDArray[np.uint16]:
    steps = np.round(MM / DEPTH_SCALE * depth)
    return np.where(steps <= np.iinfo(np.uint16).max, steps, 0).astype(np.uint16)


def _camera(image: LabelledImage, pinhole: Pinhole) -> dict[str, Any]:
    R, t = _rotation_and_offset(image.X_CD)
    matrix = pinhole.matrix.ravel().tolist()
    return {"cam_K": matrix, "cam_R_w2c": R, "cam_t_w2c": t, "depth_scale": DEPTH_SCALE}


def _rotation_and_offset(X: RigidTransform) -> tuple[list[float], list[float]]:
    """Return a pose as the format has it: nine numbers row by row, and three in mm."""
    R = RotationMatrix.ProjectToRotationMatrix(X.rotation().matrix()).matrix()
    return R.ravel().tolist(), (MM * X.translation()).tolist()


def _label_info(image: LabelledImage) -> dict[str, Any]:
    """Return what the format's own script computes: counts of pixels and boxes around them."""
    total, seen = int(image.mask.sum()), int(image.visible.sum())
    return {
        "bbox_obj": _box(image.mask) if seen else _box(image.visible),
        "bbox_visib": _box(image.visible),
        "px_count_all": total,
        "px_count_valid": int((image.mask & (image.depth > 0.0)).sum()),
        "px_count_visib": seen,
        "visib_fract": seen / total if total else 0.0,
    }


def _box(mask: Mask) -> list[int]:
    """Return left, top, and the differences to the last column and row; -1 for nothing."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return [-1, -1, -1, -1]
    left, top = int(columns.min()), int(rows.min())
    return [left, top, int(columns.max()) - left, int(rows.max()) - top]


def _model_info(model: trimesh.Trimesh) -> dict[str, float]:
    lower, size = model.bounds[0], np.ptp(model.bounds, axis=0)
    corners = model.vertices[ConvexHull(model.vertices).vertices]
    info = {"diameter": float(pdist(corners).max())}
    info |= {f"min_{axis}": float(value) for axis, value in zip("xyz", lower, strict=True)}
    return info | {f"size_{axis}": float(value) for axis, value in zip("xyz", size, strict=True)}


def _save(path: Path, values: NDArray[Any]) -> None:
    """Write a PNG: bytes, or 16 bits for depth."""
    if values.dtype != np.uint16:
        values = values.astype(np.uint8)
    Image.fromarray(values).save(path)


def _write(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
