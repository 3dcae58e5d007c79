"""One part of a product file: mesh and mass, poses, and the ways to hold it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from cell.errors import BadPart, CellError
from cell.paths import MODELS
from cell.products.fields import Fields, one_of
from cell.products.mesh_io import LARGEST_PART, load_mesh
from cell.products.product import Grasp, Part

PART_KEYS = ("model", "mesh", "mass_kg", "assembled_pose", "tray_pose", "grasps")
POSE_KEYS = ("xyz_mm", "rpy_deg")
GRASP_KEYS = ("name", "jaw", "at_mm", "closing", "approach", "width_mm", "force_N", "turn")
TURN_KEYS = ("axis", "every_deg")
JAWS = ("tip", "wide", "nose")


def read_part(name: str, data: Any, file: Path, units: str) -> Part:
    """Return one part; its mesh and mass come from its model, or from the file itself."""
    fields = Fields(data, f"{file.name}: parts.{name}", PART_KEYS)
    if ("model" in fields) == ("mesh" in fields):
        raise BadPart(name, "it needs either a 'model' or a 'mesh' with a 'mass_kg'")
    model = model_name(fields.text("model")) if "model" in fields else None
    mesh = _mesh(name, fields, file, units, model)
    tray_pose = _pose(fields, "tray_pose") if "tray_pose" in fields else None
    return Part(
        name=name,
        mesh=mesh,
        mass=_mass(name, fields, model),
        X_AP=_pose(fields, "assembled_pose") if "assembled_pose" in fields else RigidTransform(),
        model=model,
        X_TrayP=tray_pose,
        grasps=_grasps(fields),
    )


def _mesh(name: str, fields: Fields, file: Path, units: str, model: str | None) -> trimesh.Trimesh:
    """Return the closed surface of a part [m]."""
    if model is None:
        return load_mesh(file.parent / fields.text("mesh"), name, units)
    return load_mesh(MODELS / "sdf" / model / f"{model}.obj", name, "m")


def _mass(name: str, fields: Fields, model: str | None) -> float:
    """Return the mass [kg]: the model's where there is one, so that it is written down once."""
    if model is None:
        mass = fields.raw("mass_kg")
        if not isinstance(mass, int | float) or not mass > 0.0:
            raise BadPart(name, f"its mass_kg is {mass!r}; a mass is a number above zero")
        return float(mass)
    if "mass_kg" in fields:
        raise BadPart(name, f"its mass comes from model '{model}': remove 'mass_kg'")
    root = ElementTree.parse(MODELS / "sdf" / model / f"{model}.sdf").getroot()
    return sum(float(mass.text or "nan") for mass in root.iter("mass"))


def model_name(name: str) -> str:
    """Return the name of an SDF model that exists."""
    known = sorted(file.stem for file in (MODELS / "sdf").glob("*/*.sdf"))
    return one_of("model", name, known)


def _pose(fields: Fields, key: str) -> RigidTransform:
    """Return a pose from millimetres and degrees; a missing half is zero."""
    pose = Fields(fields.raw(key), f"{fields.where}.{key}", POSE_KEYS)
    p = pose.vector("xyz_mm") * 1e-3 if "xyz_mm" in pose else np.zeros(3)
    if np.max(np.abs(p)) > LARGEST_PART:
        raise CellError(f"{fields.where}.{key}: {p} m is outside of the cell; wrong units?")
    rpy = np.deg2rad(pose.vector("rpy_deg")) if "rpy_deg" in pose else np.zeros(3)
    return RigidTransform(RollPitchYaw(rpy), p)


def _grasps(fields: Fields) -> tuple[Grasp, ...]:
    """Return the grasps of a part, those with a ``turn`` repeated around its axis."""
    if "grasps" not in fields:
        return ()
    entries = fields.raw("grasps")
    if not isinstance(entries, list):
        raise CellError(f"{fields.where}.grasps: expected a list, got {entries!r}.")
    where = f"{fields.where}.grasps"
    return tuple(
        grasp
        for k, entry in enumerate(entries)
        for grasp in _turned(Fields(entry, f"{where}[{k}]", GRASP_KEYS))
    )


def _turned(fields: Fields) -> list[Grasp]:
    """Return one grasp, or one per angle of its ``turn``."""
    grasp = Grasp(
        name=fields.text("name"),
        jaw=one_of("jaw", fields.text("jaw"), JAWS),
        X_PJaw=_jaw_pose(fields),
        width=fields.positive("width_mm") * 1e-3,
        force=fields.positive("force_N"),
    )
    if "turn" not in fields:
        return [grasp]
    turn = Fields(fields.raw("turn"), f"{fields.where}.turn", TURN_KEYS)
    axis, step = _unit(turn, "axis"), turn.positive("every_deg")
    angles = np.arange(0.0, 360.0 - 1e-6, step)
    return [
        replace(
            grasp,
            name=f"{grasp.name}_{angle:g}",
            X_PJaw=RigidTransform(_about(axis, np.deg2rad(angle))) @ grasp.X_PJaw,
        )
        for angle in angles
    ]


def _jaw_pose(fields: Fields) -> RigidTransform:
    """Return X_PJaw: x closes, z approaches, y completes them."""
    x, z = _unit(fields, "closing"), _unit(fields, "approach")
    if abs(x @ z) > 1e-6:
        raise CellError(f"{fields.where}: 'closing' and 'approach' are not perpendicular.")
    R_PJaw = RotationMatrix(np.column_stack([x, np.cross(z, x), z]))
    return RigidTransform(R_PJaw, fields.vector("at_mm") * 1e-3)


def _unit(fields: Fields, key: str) -> np.ndarray:
    vector = fields.vector(key)
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise CellError(f"{fields.where}.{key}: a direction has a length.")
    return vector / length


def _about(axis: np.ndarray, angle: float) -> RotationMatrix:
    """Return the rotation by an angle [rad] about a unit axis."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return RotationMatrix(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
