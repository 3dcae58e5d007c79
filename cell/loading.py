"""Products by name, from a YAML description, or from a folder of meshes in assembled pose."""

from __future__ import annotations

from pathlib import Path

from pydrake.math import RigidTransform

from cell.errors import CellError, UnknownName
from cell.mesh_io import MESH_SUFFIXES, load_folder, meters_per_unit
from cell.paths import MODELS
from cell.product import Part, Product
from cell.product_yaml import read_product

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
    return read_product(file)


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
