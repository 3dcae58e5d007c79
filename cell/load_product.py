"""Products by name, from a YAML description, or from a folder of meshes in assembled pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh
import yaml
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from cell.errors import BadOrder, BadPart, CellError, UnknownName
from cell.fields import Fields, names_at
from cell.mesh_io import LARGEST_PART, MESH_SUFFIXES, load_folder, load_mesh, meters_per_unit
from cell.paths import MODELS
from cell.product import Fastener, Grasp, Part, Product

PRODUCT_KEYS = (
    "name",
    "units",
    "up",
    "contact_tolerance_mm",
    "tray",
    "parts",
    "groups",
    "orders",
    "fasteners",
)
PART_KEYS = ("model", "mesh", "mass_kg", "assembled_pose", "tray_pose", "grasps")
POSE_KEYS = ("xyz_mm", "rpy_deg")
GRASP_KEYS = ("name", "jaw", "at_mm", "closing", "approach", "width_mm", "force_N", "turn")
TURN_KEYS = ("axis", "every_deg")
FASTENER_KEYS = (
    "into",
    "clamps",
    "thread",
    "diameter_mm",
    "pitch_mm",
    "thread_depth_mm",
    "torque_Nm",
    "nut_factor",
)
JAWS = ("tip", "wide", "nose")
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")

FOLDER_DENSITY = 2700.0
"""[kg/m3] [A] aluminium for every part of a folder: plans depend on mass ratios only."""


def product_names() -> list[str]:
    """Return the names of the products in ``models/products``."""
    return sorted(file.stem for file in (MODELS / "products").glob("*.yaml"))


def load_product(name_or_path: str | Path, units: str | None = None) -> Product:
    """Return a product.

    Args:
        name_or_path: A name in ``models/products``, a YAML file, or a folder of meshes
            (.obj, .stl, .ply, .glb) in assembled pose, one part each, named by the file's stem.
        units: "mm", "cm", "m" or "in": unit of the folder's files; None for millimetres, or
            metres in the case of .glb. A YAML file states its own.

    Raises:
        CellError: Or one of its children, naming what cannot be used and the alternatives.
    """
    path = Path(name_or_path)
    if units is not None:
        meters_per_unit(units)  # A wrong name is an error even where no unit is needed.
    if path.is_dir():
        return _from_folder(path, units)
    named = MODELS / "products" / f"{name_or_path}.yaml"
    file = named if str(name_or_path) in product_names() else path
    if file.suffix.lower() not in (".yaml", ".yml"):
        raise _unsupported(name_or_path)
    if not file.is_file():
        raise CellError(f"No product file '{file}'.")
    if units is not None:
        raise CellError(f"'{file.name}' states its own units; --units is for a folder of meshes.")
    return _from_yaml(file)


def _unsupported(name_or_path: str | Path) -> CellError:
    """Return the error for something that is neither a name, nor a YAML file, nor a folder."""
    path = Path(name_or_path)
    if path.suffix or path.parent != Path("."):
        kinds = f"a name ({', '.join(product_names())}), a .yaml file, or a folder of meshes"
        state = "is not a product" if path.exists() else "does not exist"
        return CellError(f"'{path}' {state}; supported: {kinds} ({', '.join(MESH_SUFFIXES)}).")
    return UnknownName("product", str(name_or_path), product_names())


def _from_folder(folder: Path, units: str | None) -> Product:
    """Return a product that is only planned: no groups, no orders, no models."""
    meshes = load_folder(folder, units)
    parts = {
        name: Part(name, mesh, FOLDER_DENSITY * mesh.volume, RigidTransform())
        for name, mesh in meshes.items()
    }
    return Product(folder.resolve().name, parts)


def _from_yaml(file: Path) -> Product:
    """Return the product that a YAML file describes."""
    fields = Fields(_read_yaml(file), file.name, PRODUCT_KEYS)
    units = fields.text("units") if "units" in fields else "mm"
    parts = {name: _part(name, data, file, units) for name, data in fields.mapping("parts").items()}
    if not parts:
        raise CellError(f"{file.name}: a product has at least one part.")
    product = Product(fields.text("name") if "name" in fields else file.stem, parts)
    product = replace(product, groups=_groups(fields, parts))
    product = replace(product, fasteners=_fasteners(fields, product))
    product = replace(product, orders=_orders(fields, product))
    return replace(product, **_settings(fields))


class _UniqueKeys(yaml.SafeLoader):
    """A safe loader to which a repeated key is an error, as two parts of one name are."""


def _construct_mapping(loader: _UniqueKeys, node: yaml.MappingNode) -> dict[Any, Any]:
    keys = [key.value for key, _ in node.value if key.tag != "tag:yaml.org,2002:merge"]
    repeated = {key for key in keys if keys.count(key) > 1}
    if repeated:
        place = f"line {node.start_mark.line + 1}"
        raise CellError(f"{node.start_mark.name}, {place}: '{min(repeated)}' occurs twice.")
    loader.flatten_mapping(node)
    return dict(loader.construct_pairs(node, deep=True))


_UniqueKeys.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _construct_mapping)


def _read_yaml(file: Path) -> Any:
    """Return the content of a YAML file."""
    try:
        with file.open() as stream:
            return yaml.load(stream, Loader=_UniqueKeys)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split())
        raise CellError(f"'{file}' is not valid YAML: {reason}.") from error


def _settings(fields: Fields) -> dict[str, Any]:
    """Return the optional settings of a product that are present."""
    settings: dict[str, Any] = {}
    if "up" in fields:
        settings["up"] = _one_of("axis", fields.text("up"), AXES)
    if "contact_tolerance_mm" in fields:
        settings["contact_tolerance"] = fields.positive("contact_tolerance_mm") * 1e-3
    if "tray" in fields:
        settings["tray"] = _model_name(fields.text("tray"))
    return settings


def _part(name: str, data: Any, file: Path, units: str) -> Part:
    """Return one part; its mesh and mass come from its model, or from the file itself."""
    fields = Fields(data, f"{file.name}: parts.{name}", PART_KEYS)
    if ("model" in fields) == ("mesh" in fields):
        raise BadPart(name, "it needs either a 'model' or a 'mesh' with a 'mass_kg'")
    model = _model_name(fields.text("model")) if "model" in fields else None
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


def _model_name(name: str) -> str:
    """Return the name of an SDF model that exists."""
    known = sorted(file.stem for file in (MODELS / "sdf").glob("*/*.sdf"))
    return _one_of("model", name, known)


def _one_of(kind: str, name: str, known: tuple[str, ...] | list[str]) -> str:
    if name not in known:
        raise UnknownName(kind, name, known)
    return name


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
        jaw=_one_of("jaw", fields.text("jaw"), JAWS),
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


def _groups(fields: Fields, parts: Mapping[str, Part]) -> dict[str, tuple[str, ...]]:
    """Return the groups; a part is in one of them at most."""
    groups: dict[str, tuple[str, ...]] = {}
    taken: dict[str, str] = {}
    for group, members in fields.mapping("groups").items():
        if group in parts:
            raise CellError(f"{fields.where}: '{group}' is both a part and a group.")
        groups[group] = names_at(members, f"{fields.where}.groups.{group}")
        for name in groups[group]:
            _one_of("part", name, list(parts))
            if name in taken:
                raise CellError(f"{fields.where}: '{name}' is in '{taken[name]}' and '{group}'.")
            taken[name] = group
    return groups


def _orders(fields: Fields, product: Product) -> tuple[tuple[str, ...], ...]:
    """Return the assembly orders; each lists every part once, itself or by its group."""
    if "orders" not in fields:
        return ()
    entries = fields.raw("orders")
    if not isinstance(entries, list):
        raise CellError(f"{fields.where}.orders: expected a list of orders, got {entries!r}.")
    orders = tuple(names_at(e, f"{fields.where}.orders[{k}]") for k, e in enumerate(entries))
    for order in orders:
        listed = [part for item in order for part in product.members(item)]
        if sorted(listed) != sorted(product.parts):
            raise BadOrder(
                f"{fields.where}: order [{', '.join(order)}] must list each of "
                f"{', '.join(product.items())} once."
            )
    return orders


def _fasteners(fields: Fields, product: Product) -> dict[str, Fastener]:
    """Return a fastener for each member of each named part or group."""
    return {
        part: _fastener(
            part, Fields(data, f"{fields.where}: fasteners.{item}", FASTENER_KEYS), product
        )
        for item, data in fields.mapping("fasteners").items()
        for part in product.members(item)
    }


def _fastener(part: str, fields: Fields, product: Product) -> Fastener:
    return Fastener(
        part=part,
        into=_one_of("part", fields.text("into"), list(product.parts)),
        clamps=_one_of("part", fields.text("clamps"), list(product.parts)),
        thread=fields.text("thread"),
        diameter=fields.positive("diameter_mm") * 1e-3,
        pitch=fields.positive("pitch_mm") * 1e-3,
        thread_depth=fields.positive("thread_depth_mm") * 1e-3,
        torque=fields.positive("torque_Nm"),
        nut_factor=fields.positive("nut_factor"),
    )
