"""Products by name, from YAML, STEP or glTF files, or from a folder of meshes in assembled pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import trimesh
from pydrake.math import RigidTransform

from cell.errors import CellError, UnknownName
from cell.paths import MODELS
from cell.products.assembly_io import ASSEMBLY_SUFFIXES, load_assembly
from cell.products.fields import one_of
from cell.products.identical import group_identical, identical_parts
from cell.products.mesh_io import MESH_SUFFIXES, REPAIR, load_folder, meters_per_unit
from cell.products.product import Part, Product
from cell.products.product_yaml import read_product

DEFAULT_DENSITY = 2700.0
"""[kg/m3] [A] aluminium where nothing is said: plans depend on mass ratios only."""

MOST_PARTS = 500
"""[M] 500 parts with 374 000 triangles take 80 s of CPU, 12 s of it for C and M_j, and 1.1 GB."""


def product_names() -> list[str]:
    """Return the names of the products in ``models/products``."""
    return sorted(file.stem for file in (MODELS / "products").glob("*.yaml"))


def load_product(
    name_or_path: str | Path,
    units: str | None = None,
    *,
    densities: Mapping[str, float] | None = None,
    group: bool = False,
) -> Product:
    """Return a product.

    Args:
        name_or_path: A name in ``models/products``, a YAML file, a STEP or glTF (.glb)
            assembly, or a folder of meshes (.obj, .stl, .ply, .glb) in assembled pose, named by
            the file's stem.
        units: "mm", "cm", "m" or "in": unit of a folder's files; None where all of them are in
            metres by their format (.glb). Other files state their own.
        densities: Densities of parts [kg/m3] by name; "" for all that are not named. Not for
            a YAML file, which states masses.
        group: Whether to make a group, one item of an order, of identical parts.

    Raises:
        CellError: Or one of its children, naming what cannot be used and the alternatives.
    """
    if units is not None:
        meters_per_unit(units)  # A wrong name is an error even where no unit is needed.
    product = _read(name_or_path, units, densities or {})
    if len(product.parts) > MOST_PARTS:
        raise CellError(
            f"'{name_or_path}' has {len(product.parts)} parts, and plans are for up to "
            f"{MOST_PARTS}: plan its sub-assemblies, each as one part of the whole."
        )
    return _with_identical(product, group)


def _read(name_or_path: str | Path, units: str | None, densities: Mapping[str, float]) -> Product:
    path = Path(name_or_path)
    named = MODELS / "products" / f"{name_or_path}.yaml"
    if path.is_dir() and str(name_or_path) not in product_names():
        return _from_meshes(path.resolve().name, load_folder(path, units), densities)
    file = named if str(name_or_path) in product_names() else path
    kind = file.suffix.lower()
    if kind not in (".yaml", ".yml", *ASSEMBLY_SUFFIXES):
        raise _unsupported(name_or_path)
    if not file.is_file():
        raise CellError(f"No product file '{file}'.")
    if units is not None:
        raise CellError(f"'{file.name}' states its own units; --units is for a folder of meshes.")
    if kind in ASSEMBLY_SUFFIXES:
        return _from_meshes(file.stem, load_assembly(file), densities)
    if densities:
        raise CellError(f"'{file.name}' states masses; --density is for other files and folders.")
    product = read_product(file)
    meshes = {name: part.mesh for name, part in product.parts.items()}
    return replace(product, remarks=_repairs(meshes))


def _unsupported(name_or_path: str | Path) -> CellError:
    """Return the error for something that is neither a name, nor a known file, nor a folder."""
    path = Path(name_or_path)
    if path.suffix or path.parent != Path("."):
        names = ", ".join(product_names())
        kinds = f"a name ({names}), a .yaml, .step or .glb file, or a folder of meshes"
        state = "is not a product" if path.exists() else "does not exist"
        return CellError(f"'{path}' {state}; supported: {kinds} ({', '.join(MESH_SUFFIXES)}).")
    return UnknownName("product", str(name_or_path), product_names())


def _from_meshes(
    name: str, meshes: Mapping[str, trimesh.Trimesh], densities: Mapping[str, float]
) -> Product:
    """Return a product that is only planned: no groups, no orders, no models."""
    for part, density in densities.items():
        if part:
            one_of("part", part, list(meshes))
        if not density > 0.0 or density == float("inf"):
            raise CellError(f"--density of '{part or name}' must be above zero, not {density:g}.")
    usual = densities.get("", DEFAULT_DENSITY)
    parts = {
        part: Part(part, mesh, densities.get(part, usual) * float(mesh.volume), RigidTransform())
        for part, mesh in meshes.items()
    }
    rest = [part for part in meshes if part not in densities]
    assumed = () if "" in densities or not rest else (_density_remark(rest, len(meshes)),)
    return Product(name, parts, remarks=(*assumed, *_repairs(meshes)))


def _density_remark(parts: Sequence[str], count: int) -> str:
    which = "all parts" if len(parts) == count else ", ".join(parts)
    return f"density of {which} taken as {DEFAULT_DENSITY:g} kg/m3; --density sets it"


def _repairs(meshes: Mapping[str, trimesh.Trimesh]) -> tuple[str, ...]:
    done = {name: mesh.metadata.get(REPAIR, "") for name, mesh in meshes.items()}
    return tuple(
        f"surface of '{name}' repaired: {repair}" for name, repair in done.items() if repair
    )


def _with_identical(product: Product, group: bool) -> Product:
    """Return the product with a remark about identical parts, or with a group for each shape."""
    same = identical_parts({name: part.mesh for name, part in product.parts.items()})
    groups = group_identical(product, same)
    if not groups:
        return product
    listed = "; ".join(f"{', '.join(names)}" for names in groups.values())
    if not group:
        remark = f"identical parts: {listed}; --group makes one item of each set"
        return replace(product, remarks=(*product.remarks, remark))
    remark = "grouped: " + "; ".join(f"{g} = {', '.join(names)}" for g, names in groups.items())
    return replace(product, groups={**product.groups, **groups}, remarks=(*product.remarks, remark))
