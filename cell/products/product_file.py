"""Product files in YAML: parts, groups, joints and orders, with every key and name checked."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path, PureWindowsPath

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from cell.errors import BadOrder, BadPart, InputError
from cell.products.fields import Fields, mapping_at, names_at, one_of
from cell.products.joints import read_joints
from cell.products.mesh_io import LARGEST_PART, load_mesh
from cell.products.model_files import find_model
from cell.products.product import Grasp, Part, Product
from cell.yaml_text import read_yaml

PRODUCT_KEYS = (
    "name",
    "units",
    "up",
    "contact_tolerance_mm",
    "tray",
    "parts",
    "groups",
    "orders",
    "joints",
)
REPLACED_KEYS = {
    "fasteners": "'joints', with 'type: screw' and 'part:' the bolt or group",
    "fits": "'joints', with 'type: fit'",
}
PART_KEYS = ("model", "mesh", "mass_kg", "assembled_pose", "tray_pose", "grasps")
POSE_KEYS = ("xyz_mm", "rpy_deg")
GRASP_KEYS = ("name", "jaw", "at_mm", "closing", "approach", "width_mm", "force_N", "turn")
TURN_KEYS = ("axis", "every_deg")
JAWS = ("tip", "wide", "nose")
LEAST_TURN = 1.0  # [deg] [A] Between two grasps: 360 of them are tried in seconds.
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


def read_product(file: Path, *, outside: bool = False) -> Product:
    """Return the product that a YAML file describes.

    Args:
        file: The product file; models and meshes are looked up from its folder.
        outside: Whether they may lie outside of that folder; see `find_model`.

    Raises:
        InputError: Or one of its children, with the place in the file.
    """
    data = mapping_at(read_yaml(file), file.name)
    for old, new in REPLACED_KEYS.items():
        if old in data:
            raise InputError(f"{file.name}: '{old}' is not a key any more; use {new}.")
    fields = Fields(data, file.name, PRODUCT_KEYS)
    units = fields.text("units", "mm")
    parts = {
        name: _part(name, entry, file, units, outside)
        for name, entry in _part_entries(fields, outside)
    }
    if not parts:
        raise InputError(f"{file.name}: a product has at least one part.")
    product = Product(
        name=fields.text("name", file.stem),
        parts=parts,
        groups=_groups(fields, parts),
        up=one_of("axis", fields.text("up", "+z"), AXES),
    )
    if "contact_tolerance_mm" in fields:
        tolerance = fields.positive("contact_tolerance_mm") * 1e-3
        product = replace(product, contact_tolerance=tolerance)
    if "tray" in fields:
        tray = find_model(fields.text("tray"), file, outside=outside)
        product = replace(product, tray=tray.model)
    # Joints and orders refer to parts and groups by name.
    joints = read_joints(fields.entries("joints"), product)
    return replace(product, joints=joints, orders=_orders(fields, product))


def _groups(fields: Fields, parts: Mapping[str, Part]) -> dict[str, tuple[str, ...]]:
    """Return the groups; a part is a member of one at most."""
    groups: dict[str, tuple[str, ...]] = {}
    taken: dict[str, str] = {}
    for group, members in fields.mapping("groups").items():
        if group in parts:
            raise InputError(f"{fields.where}: '{group}' is both a part and a group.")
        groups[group] = names_at(members, fields.at(f"groups.{group}"))
        if not groups[group]:
            raise InputError(f"{fields.where}: group '{group}' has no parts.")
        for name in groups[group]:
            one_of("part", name, parts)
            if name in taken:
                raise InputError(f"{fields.where}: '{name}' is in '{taken[name]}' and '{group}'.")
            taken[name] = group
    return groups


def _orders(fields: Fields, product: Product) -> tuple[tuple[str, ...], ...]:
    """Return the assembly orders; each lists every part once, by itself or by its group."""
    orders = tuple(names_at(entry, where) for entry, where in fields.entries("orders"))
    for order in orders:
        listed = [part for item in order for part in product.members(item)]
        if sorted(listed) != sorted(product.parts):
            raise BadOrder(
                f"{fields.where}: order [{', '.join(order)}] must list each of "
                f"{', '.join(product.items())} once."
            )
    return orders


def _part_entries(fields: Fields, outside: bool) -> Iterator[tuple[str, Fields]]:
    """Yield every part's name and entry, with its mesh in the product file's folder.

    A product file may come from anybody: it has no business elsewhere, unless it is told so. Links
    are followed.
    """
    for name, entry in fields.mapping("parts").items():
        part = Fields(entry, fields.at(f"parts.{name}"), PART_KEYS)
        path = PureWindowsPath(part.text("mesh", "."))  # It splits at both kinds of slashes.
        depths = itertools.accumulate(-1 if piece == ".." else 1 for piece in path.parts)
        if not outside and (path.anchor or min(depths, default=0) < 0):
            raise InputError(
                f"{part.at('mesh')}: '{path}' is not in the product's folder (--allow-outside)."
            )
        yield name, part


def _part(name: str, fields: Fields, file: Path, units: str, outside: bool) -> Part:
    """Return one part; mesh and mass are those of its model, or stated in the file.

    Args:
        name: Of the part.
        fields: Its entry.
        file: The product file, beside which models and meshes are looked up.
        units: Unit of mesh files.
        outside: Whether models may lie outside of the product's folder.
    """
    if ("model" in fields) == ("mesh" in fields):
        raise BadPart(name, "it needs either a 'model' or a 'mesh' with a 'mass_kg'")
    if "model" in fields:
        found = find_model(fields.text("model"), file, outside=outside)
        model = found.model
        if "mass_kg" in fields:
            raise BadPart(
                name, f"its mass comes from its model '{found.sdf.name}': remove 'mass_kg'"
            )
        mesh, mass = load_mesh(found.mesh, name, "m"), found.mass()
    else:
        model = None
        mesh = load_mesh(file.parent / fields.text("mesh"), name, units)
        mass = fields.positive("mass_kg")
    return Part(
        name=name,
        mesh=mesh,
        mass=mass,
        X_AP=_pose(fields, "assembled_pose") if "assembled_pose" in fields else RigidTransform(),
        model=model,
        X_TrayP=_pose(fields, "tray_pose") if "tray_pose" in fields else None,
        grasps=tuple(
            grasp
            for entry, where in fields.entries("grasps")
            for grasp in _grasps(Fields(entry, where, GRASP_KEYS))
        ),
    )


def _pose(fields: Fields, key: str) -> RigidTransform:
    """Return a pose from millimetres and degrees; a missing half is zero."""
    pose = Fields(fields.raw(key), fields.at(key), POSE_KEYS)
    p = pose.vector("xyz_mm") * 1e-3 if "xyz_mm" in pose else np.zeros(3)
    if key == "tray_pose" and np.max(np.abs(p)) > LARGEST_PART:
        raise InputError(f"{fields.at(key)}: {p} m is outside of the cell; wrong units?")
    rpy = np.deg2rad(pose.vector("rpy_deg")) if "rpy_deg" in pose else np.zeros(3)
    return RigidTransform(RollPitchYaw(rpy), p)


def _grasps(fields: Fields) -> list[Grasp]:
    """Return one grasp, or with a ``turn`` one per angle about an axis of P."""
    x, z = fields.direction("closing"), fields.direction("approach")
    if abs(x @ z) > 1e-6:
        raise InputError(f"{fields.where}: 'closing' and 'approach' are not perpendicular.")
    R_PJaw = RotationMatrix(np.column_stack([x, np.cross(z, x), z]))
    grasp = Grasp(
        name=fields.text("name"),
        jaw=one_of("jaw", fields.text("jaw"), JAWS),
        X_PJaw=RigidTransform(R_PJaw, fields.vector("at_mm") * 1e-3),
        width=fields.positive("width_mm") * 1e-3,
        force=fields.positive("force_N"),
    )
    if "turn" not in fields:
        return [grasp]
    turn = Fields(fields.raw("turn"), fields.at("turn"), TURN_KEYS)
    axis, step = turn.direction("axis"), turn.positive("every_deg")
    if step < LEAST_TURN:
        raise InputError(f"{turn.at('every_deg')}: expected {LEAST_TURN:g} or more, got {step:g}.")
    return [
        replace(
            grasp,
            name=f"{grasp.name}_{angle:g}",
            X_PJaw=RigidTransform(_rotation(axis, np.deg2rad(angle))) @ grasp.X_PJaw,
        )
        for angle in np.arange(0.0, 360.0 - 1e-6, step)
    ]


def _rotation(axis: np.ndarray, angle: float) -> RotationMatrix:
    """Return the rotation about a unit axis (3,) by an angle [rad], by Rodrigues' formula."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return RotationMatrix(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
