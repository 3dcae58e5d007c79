"""Products by name, from YAML, STEP or glTF files, or from a folder of CAD in assembled pose."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Sized
from dataclasses import replace
from pathlib import Path

import trimesh
from pydrake.math import RigidTransform

from cell.errors import BadPart, InputError, UnknownName
from cell.paths import MODELS, is_file, possible_path
from cell.products.fields import one_of
from cell.products.folder import CAD_SUFFIXES, Contents, read_file, read_folder
from cell.products.identical import group_identical, identical_parts
from cell.products.mesh_io import (
    LARGEST_PART,
    MESH_SUFFIXES,
    REPAIR,
    SMALLEST_PART,
    UNIT_SUFFIXES,
    meters_per_unit,
)
from cell.products.parts import NOT_WANTED, Parts, parts_of
from cell.products.product import LeftOut, Part, Product
from cell.products.product_file import read_product
from cell.products.read_options import ReadOptions
from cell.products.tree import named_parts, natural

PRODUCTS = MODELS / "products"
PRODUCT_SUFFIXES = (".yaml", ".yml")

DEFAULT_DENSITY = 2700.0
"""[kg/m3] [A] aluminium where no density is given: plans depend on mass ratios only."""

MANY_PARTS = 500
"""[M] 500 parts with 374 000 triangles take 46 s of CPU, 9 s of it for C and M_j, and 0.7 GB."""

MOST_PARTS = 5000
"""[D] The matrices take 112 bytes per pair of parts: 2.8 GB."""

SHOWN = 12
"""[A] names in one remark: about two lines."""


def product_names() -> list[str]:
    """Return the names of the products in ``models/products``."""
    return sorted(file.stem for file in PRODUCTS.glob("*.yaml"))


def load_product(name_or_path: str | Path, options: ReadOptions | None = None) -> Product:
    """Return a product.

    Args:
        name_or_path: A name in ``models/products``, a product file (YAML), a STEP or glTF (.glb)
            assembly, or a folder of meshes and assemblies in assembled pose.
        options: How CAD is read, and what of it is wanted; None for what files say.

    Raises:
        InputError: Or one of its children, naming what cannot be used and the alternatives.
    """
    options = options or ReadOptions()
    if options.units is not None:
        meters_per_unit(options.units)  # A wrong name is an error even where no unit is needed.
    if options.depth is not None and options.depth < 1:
        raise InputError(f"--depth must be 1 or more, not {options.depth}.")
    path = possible_path(name_or_path)
    if is_product_file(name_or_path):
        product = _from_product_file(name_or_path, options)
    elif path.is_dir():
        product = _from_cad(path.resolve().name, read_folder(path, options), options)
    elif path.suffix.lower() not in CAD_SUFFIXES:
        raise _unsupported(path)
    elif not is_file(path):
        raise InputError(f"No product file '{path}'.")
    else:
        product = _from_cad(path.stem, read_file(path, options), options)
    return _with_identical(product, options.group)


def is_product_file(name_or_path: str | Path) -> bool:
    """Return whether this is a product's name, or a product file (YAML), and not only CAD."""
    path = Path(name_or_path)
    known = str(name_or_path) in product_names()
    return known or (path.suffix.lower() in PRODUCT_SUFFIXES and not path.is_dir())


def require_product_file(name_or_path: str | Path) -> None:
    """Raise `InputError` for CAD, which can be planned but not assembled, with what works."""
    path = possible_path(name_or_path)
    if is_product_file(name_or_path) or not path.exists():
        return  # What does not exist is named when it is read.
    if not path.is_dir() and path.suffix.lower() not in CAD_SUFFIXES:
        raise _unsupported(path)
    unit = " with --units mm" if _needs_unit(path) else ""
    raise InputError(
        f"'{path}' can be planned, but not assembled: soft-jig init{unit} drafts a product file "
        "(.yaml) of it, with models and tray, that can."
    )


def _needs_unit(path: Path) -> bool:
    """Return whether a mesh in the input states no unit."""
    files = path.iterdir() if path.is_dir() else [path]
    plain = set(MESH_SUFFIXES) - set(UNIT_SUFFIXES)
    return any(file.suffix.lower() in plain for file in files)


def _from_product_file(name_or_path: str | Path, options: ReadOptions) -> Product:
    known = str(name_or_path) in product_names()
    file = PRODUCTS / f"{name_or_path}.yaml" if known else Path(name_or_path)
    if not is_file(file):
        raise InputError(f"No product file '{file}'.")
    if options.units is not None:
        raise InputError(f"'{file.name}' states its own units; --units is for CAD.")
    if options.densities:
        raise InputError(f"'{file.name}' states masses; --density is for CAD.")
    if options.split or options.leave_out or options.depth is not None:
        what = "--split, --leave-out and --depth are for CAD"
        raise InputError(f"'{file.name}' lists its parts and groups itself; {what}.")
    product = read_product(file, outside=options.outside)
    repairs = {name: part.mesh.metadata.get(REPAIR, "") for name, part in product.parts.items()}
    sizes = _sizes({name: part.mesh for name, part in product.parts.items()})
    return replace(product, remarks=(*product.remarks, *sizes, *_repaired(repairs)))


def _unsupported(path: Path) -> InputError:
    """Return the error for what is neither a known name, nor a supported file, nor a folder."""
    if path.suffix or path.parent != Path("."):
        names = ", ".join(product_names())
        kinds = f"a name ({names}), a .yaml, .step or .glb file, or a folder of meshes"
        state = "is not a product" if path.exists() else "does not exist"
        return InputError(f"'{path}' {state}; supported: {kinds} ({', '.join(CAD_SUFFIXES)}).")
    return UnknownName("product", str(path), product_names())


def _from_cad(name: str, contents: Contents, options: ReadOptions) -> Product:
    """Return a product that can only be planned: no orders, joints or models."""
    named = list(named_parts(contents.tree, name))
    if len(named) > MOST_PARTS:
        raise InputError(f"'{name}' has {len(named)} parts; up to {MOST_PARTS} can be planned.")
    parts = parts_of(named, split=options.split, leave_out=options.leave_out)
    left_out = tuple(dict.fromkeys((*contents.left_out, *parts.left_out)))
    everything = dict.fromkeys([*parts.meshes, *(leaf for leaf, _ in named)])
    known = {*everything, *_sub_assemblies(everything), *(thing.name for thing in left_out)}
    for unwanted in options.leave_out:
        one_of("part or sub-assembly", unwanted, known)
    if not parts.meshes:
        raise _nothing_solid(name, parts.left_out)
    meshes = dict(sorted(parts.meshes.items(), key=lambda item: natural(item[0])))
    masses, assumed = _masses(name, meshes, options.densities)
    groups = _groups(meshes, options.depth)
    return Product(
        name,
        {n: Part(n, mesh, masses[n], RigidTransform()) for n, mesh in meshes.items()},
        groups,
        remarks=(
            *contents.remarks,
            *_sizes(meshes),
            *_several(parts),
            *_repaired(parts.repairs),
            *_tree(meshes, groups),
            *assumed,
        ),
        left_out=left_out,
    )


def _nothing_solid(name: str, left_out: Sequence[LeftOut]) -> InputError:
    """Return the error for CAD of which nothing can be planned, with the reasons."""
    unsound = [thing for thing in left_out if thing.reason != NOT_WANTED]
    if len(unsound) == 1:
        return BadPart(unsound[0].name, f"it is no solid: {unsound[0].reason}")
    why = "; ".join(f"{thing.name}: {thing.reason}" for thing in unsound[:SHOWN])
    return InputError(f"'{name}' holds no solid" + (f": {why}." if why else "."))


def _masses(
    name: str, meshes: Mapping[str, trimesh.Trimesh], densities: Mapping[str, float]
) -> tuple[dict[str, float], list[str]]:
    """Return masses [kg] by part, and a remark on the density that was assumed."""
    for part, density in densities.items():
        if part:
            one_of("part", part, meshes)
        if not density > 0.0 or density == float("inf"):
            raise InputError(f"--density of '{part or name}' must be above zero, not {density:g}.")
    usual = densities.get("", DEFAULT_DENSITY)
    masses = {
        part: densities.get(part, usual) * float(mesh.volume) for part, mesh in meshes.items()
    }
    rest = [part for part in meshes if part not in densities]
    if "" in densities or not rest:
        return masses, []
    which = "all parts" if len(rest) == len(meshes) else _listed(rest)
    return masses, [f"density of {which} taken as {DEFAULT_DENSITY:g} kg/m3; --density sets it"]


def _sub_assemblies(parts: Iterable[str]) -> dict[str, list[str]]:
    """Return the parts of each sub-assembly, by the path that their names begin with."""
    found: dict[str, list[str]] = {}
    for part in parts:
        for end in (k for k, character in enumerate(part) if character == "/"):
            found.setdefault(part[:end], []).append(part)
    return found


def _groups(parts: Iterable[str], depth: int | None) -> dict[str, tuple[str, ...]]:
    """Return the parts of each sub-assembly at a level of the tree, which make one item."""
    found = _sub_assemblies(parts)
    groups = {
        name: tuple(members)
        for name, members in found.items()
        if depth is not None and name.count("/") == depth - 1
    }
    if depth is not None and not groups:
        deepest = max((name.count("/") + 1 for name in found), default=0)
        there = f"the deepest sub-assembly is at level {deepest}" if found else "there is none"
        raise InputError(f"--depth {depth} asks for sub-assemblies: {there}.")
    return groups


def _parts(members: Sized) -> str:
    return "1 part" if len(members) == 1 else f"{len(members)} parts"


def _tree(parts: Iterable[str], groups: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Return a remark on the sub-assemblies, if there are any."""
    found = _sub_assemblies(parts)
    if not found:
        return []
    if groups:
        listed = _listed([f"{name} ({_parts(members)})" for name, members in groups.items()])
        return [f"sub-assemblies that are one item each: {listed}"]
    listed = _listed([f"{n} ({_parts(members)})" for n, members in found.items() if "/" not in n])
    return [f"sub-assemblies: {listed}; --depth 1 makes one item of each"]


def _several(parts: Parts) -> list[str]:
    """Return remarks on parts with several bodies, by what is said of these."""
    alike: dict[str, list[str]] = {}
    for name, bodies in parts.several.items():
        alike.setdefault(bodies, []).append(name)
    return [
        f"{_listed(names)} {'holds' if len(names) == 1 else 'each hold'} {bodies}; "
        "--split makes them parts"
        for bodies, names in alike.items()
    ]


def _sizes(meshes: Mapping[str, trimesh.Trimesh]) -> list[str]:
    """Return remarks on parts of a size that nothing here can hold, or that units may explain."""
    sizes = {name: float(mesh.extents.max()) for name, mesh in meshes.items()}
    large = [name for name, size in sizes.items() if size > LARGEST_PART]
    small = [name for name, size in sizes.items() if size < SMALLEST_PART]
    remarks = []
    if large:
        longest = max(sizes.values())
        remarks.append(
            f"{_listed(large)} up to {longest:.3g} m long: planned, but nothing here can hold more "
            f"than {LARGEST_PART:g} m (wrong units?)"
        )
    if small:
        least = 1e6 * min(sizes.values())
        remarks.append(f"{_listed(small)} down to {least:.3g} micrometres long: wrong units?")
    if len(meshes) > MANY_PARTS:
        remarks.append(f"{len(meshes)} parts: matrices of more than {MANY_PARTS} take minutes")
    return remarks


def _repaired(repairs: Mapping[str, str]) -> list[str]:
    return [f"surface of '{name}' repaired: {done}" for name, done in repairs.items() if done]


def _listed(names: Sequence[str]) -> str:
    """Return names separated by commas, and how many more there are."""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def _with_identical(product: Product, group: bool) -> Product:
    """Return the product with a remark on identical parts, or with a group for each shape."""
    same = identical_parts({name: part.mesh for name, part in product.parts.items()})
    groups = group_identical(product, same)
    if not groups:
        return product
    if not group:
        listed = "; ".join(_listed(names) for names in groups.values())
        remark = f"identical parts: {listed}; --group makes one item of each set"
        return replace(product, remarks=(*product.remarks, remark))
    remark = "grouped: " + "; ".join(f"{g} = {_listed(names)}" for g, names in groups.items())
    return replace(product, groups={**product.groups, **groups}, remarks=(*product.remarks, remark))
