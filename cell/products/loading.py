"""Products by name, from YAML, STEP or glTF files, or from a folder of meshes in assembled pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import trimesh
from pydrake.math import RigidTransform

from cell.errors import InputError, UnknownName
from cell.paths import MODELS
from cell.products.assembly_io import ASSEMBLY_SUFFIXES, load_assembly
from cell.products.fields import one_of
from cell.products.identical import group_identical, identical_parts
from cell.products.mesh_io import MESH_SUFFIXES, REPAIR, load_folder, meters_per_unit
from cell.products.product import Part, Product
from cell.products.product_file import read_product

PRODUCTS = MODELS / "products"

DEFAULT_DENSITY = 2700.0
"""[kg/m3] [A] aluminium where no density is given: plans depend on mass ratios only."""

MOST_PARTS = 500
"""[M] 500 parts with 374 000 triangles take 46 s of CPU, 9 s of it for C and M_j, and 0.7 GB."""


def product_names() -> list[str]:
    """Return the names of the products in ``models/products``."""
    return sorted(file.stem for file in PRODUCTS.glob("*.yaml"))


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
        group: Whether to group identical parts, so that an order lists them as one item.

    Raises:
        InputError: Or one of its children, naming what cannot be used and the alternatives.
    """
    if units is not None:
        meters_per_unit(units)  # A wrong name is an error even where no unit is needed.
    product = _read(name_or_path, units, densities or {})
    if len(product.parts) > MOST_PARTS:
        raise InputError(
            f"'{name_or_path}' has {len(product.parts)} parts, and plans are for up to "
            f"{MOST_PARTS}: plan its sub-assemblies, each as one part of the whole."
        )
    repairs = {name: part.mesh.metadata.get(REPAIR) for name, part in product.parts.items()}
    remarks = [f"surface of '{name}' repaired: {done}" for name, done in repairs.items() if done]
    product = replace(product, remarks=(*product.remarks, *remarks))
    return _with_identical(product, group)


def _read(name_or_path: str | Path, units: str | None, densities: Mapping[str, float]) -> Product:
    path = Path(name_or_path)
    is_name = str(name_or_path) in product_names()
    if path.is_dir() and not is_name:
        return _from_meshes(path.resolve().name, load_folder(path, units), densities)
    file = PRODUCTS / f"{name_or_path}.yaml" if is_name else path
    kind = file.suffix.lower()
    if kind not in (".yaml", ".yml", *ASSEMBLY_SUFFIXES):
        raise _unsupported(path)
    if not file.is_file():
        raise InputError(f"No product file '{file}'.")
    if units is not None:
        raise InputError(f"'{file.name}' states its own units; --units is for a folder of meshes.")
    if kind in ASSEMBLY_SUFFIXES:
        return _from_meshes(file.stem, load_assembly(file), densities)
    if densities:
        raise InputError(f"'{file.name}' states masses; --density is for other files and folders.")
    return read_product(file)


def _unsupported(path: Path) -> InputError:
    """Return the error for what is neither a known name, nor a supported file, nor a folder."""
    if path.suffix or path.parent != Path("."):
        names = ", ".join(product_names())
        kinds = f"a name ({names}), a .yaml, .step or .glb file, or a folder of meshes"
        state = "is not a product" if path.exists() else "does not exist"
        return InputError(f"'{path}' {state}; supported: {kinds} ({', '.join(MESH_SUFFIXES)}).")
    return UnknownName("product", str(path), product_names())


def _from_meshes(
    name: str, meshes: Mapping[str, trimesh.Trimesh], densities: Mapping[str, float]
) -> Product:
    """Return a product that can only be planned: no groups, orders, joints or models."""
    for part, density in densities.items():
        if part:
            one_of("part", part, meshes)
        if not density > 0.0 or density == float("inf"):
            raise InputError(f"--density of '{part or name}' must be above zero, not {density:g}.")
    usual = densities.get("", DEFAULT_DENSITY)
    parts = {
        part: Part(part, mesh, densities.get(part, usual) * float(mesh.volume), RigidTransform())
        for part, mesh in meshes.items()
    }
    product = Product(name, parts)
    rest = [part for part in meshes if part not in densities]
    if "" in densities or not rest:
        return product
    which = "all parts" if len(rest) == len(meshes) else ", ".join(rest)
    remark = f"density of {which} taken as {DEFAULT_DENSITY:g} kg/m3; --density sets it"
    return replace(product, remarks=(remark,))


def _with_identical(product: Product, group: bool) -> Product:
    """Return the product with a remark on identical parts, or with a group for each shape."""
    same = identical_parts({name: part.mesh for name, part in product.parts.items()})
    groups = group_identical(product, same)
    if not groups:
        return product
    if not group:
        listed = "; ".join(", ".join(names) for names in groups.values())
        remark = f"identical parts: {listed}; --group makes one item of each set"
        return replace(product, remarks=(*product.remarks, remark))
    remark = "grouped: " + "; ".join(f"{g} = {', '.join(names)}" for g, names in groups.items())
    return replace(product, groups={**product.groups, **groups}, remarks=(*product.remarks, remark))
