"""Variants of a product from a table of dimensions: one line per variant, one column per dimension.

A column of a product in CAD is a part and what of it changes, in mm: ``plate.z`` its extent along z
of the product frame, its low end staying where it is, ``plate.dz`` a shift. A part is stretched as
a whole, with its holes and heads. A column of a product file is the path of a value in it:
``joints.0.torque_Nm``, ``parts.motor.grasps.0.force_N``. An empty cell leaves a dimension as it is.
"""

from __future__ import annotations

import csv
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from cell.errors import InputError, UnknownName
from cell.products.loading import PRODUCTS, is_product_file, load_product, product_names
from cell.products.model_files import OWN_MODELS
from cell.products.product import Product
from cell.products.read_options import ReadOptions
from cell.yaml_text import parse_yaml, read_yaml

MM = 1e-3
AXES = "xyz"
NAME = "variant"  # Heads the first column.

Changes = Mapping[str, Any]


def read_table(file: Path) -> dict[str, Changes]:
    """Return the changes of each variant by its name.

    Raises:
        InputError: It cannot be read, or is no such table.
    """
    try:
        lines = list(csv.reader(file.read_text(encoding="utf-8").splitlines(), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"'{file}' cannot be read: {error}.") from error
    if not lines or lines[0][:1] != [NAME] or len(lines[0]) < 2:
        raise InputError(f"'{file}': its first line is '{NAME},DIMENSION,...'.")
    heads, found = [head.strip() for head in lines[0]], {}
    for number, line in enumerate(lines[1:], start=2):
        if not any(cell.strip() for cell in line):
            continue
        if len(line) != len(heads):
            raise InputError(f"'{file}', line {number}: {len(line)} cells, not {len(heads)}.")
        name = line[0].strip()
        if not name or name in found or Path(name).name != name or name in (".", ".."):
            raise InputError(f"'{file}', line {number}: '{name}' is no new name of a variant.")
        where = f"'{file}', line {number}"
        cells = zip(heads[1:], line[1:], strict=True)
        found[name] = {head: parse_yaml(text, where) for head, text in cells if text.strip()}
    if not found:
        raise InputError(f"'{file}' has no variant.")
    return found


def write_variant(base: Path | str, changes: Changes, folder: Path, options: ReadOptions) -> Path:
    """Write a changed product into a folder; return what `load_product` reads of it.

    Args:
        base: A product file or name, or CAD.
        changes: Value by dimension.
        folder: To be made.
        options: How CAD is read.

    Raises:
        InputError: A dimension is unknown, or its value impossible.
    """
    if is_product_file(base):
        return _write_product_file(base, changes, folder)
    product = load_product(base, options)
    meshes = dict(_changed_meshes(product, changes))
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.glb"):
        old.unlink()
    for name, mesh in meshes.items():
        mesh.export(folder / f"{name}.glb")  # In metres by its specification.
    return folder


def _changed_meshes(product: Product, changes: Changes) -> Iterator[tuple[str, Any]]:
    """Yield name and surface of each part in the product frame [m]."""
    wanted: dict[str, dict[str, float]] = {}
    for head, value in changes.items():
        name, _, way = head.rpartition(".")
        if name not in product.parts:
            raise UnknownName(f"part of the dimension '{head}'", name, product.parts)
        if way.removeprefix("d") not in AXES or not way.removeprefix("d"):
            raise UnknownName(f"dimension of '{name}'", way, [*AXES, *(f"d{a}" for a in AXES)])
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise InputError(f"{head} is a number in mm, not {value!r}.")
        if not way.startswith("d") and value <= 0.0:
            raise InputError(f"{head} is a length above 0 mm, not {value:g}.")
        wanted.setdefault(name, {})[way] = MM * float(value)
    for name, part in product.parts.items():
        mesh = part.mesh.copy()
        mesh.apply_transform(part.X_AP.GetAsMatrix4())
        points = np.array(mesh.vertices)
        for way, value in wanted.get(name, {}).items():
            k = AXES.index(way[-1])
            low, size = points[:, k].min(), np.ptp(points[:, k])
            if not way.startswith("d"):
                points[:, k] = low + (points[:, k] - low) * (value / size)
        for way, value in wanted.get(name, {}).items():
            points[:, AXES.index(way[-1])] += value if way.startswith("d") else 0.0
        mesh.vertices = points
        yield name, mesh


def _write_product_file(base: Path | str, changes: Changes, folder: Path) -> Path:
    known = str(base) in product_names()
    file = PRODUCTS / f"{base}.yaml" if known else Path(base)
    data = read_yaml(file)
    for path, value in changes.items():
        _put(data, path, value)
    folder.mkdir(parents=True, exist_ok=True)
    own = file.parent / OWN_MODELS
    if not known and own.is_dir():
        shutil.copytree(own, folder / OWN_MODELS, dirs_exist_ok=True)
    written = folder / "product.yaml"
    written.write_text(yaml.safe_dump(data, sort_keys=False))
    load_product(written)
    return written


def _put(data: Any, path: str, value: Any) -> None:
    """Change the value at a dotted path, which must be there."""
    *way, last = path.split(".")
    place = data
    for key in way:
        place = place[_key(place, key, path)]
    place[_key(place, last, path)] = value


def _key(place: Any, key: str, path: str) -> str | int:
    if isinstance(place, dict) and key in place:
        return key
    if isinstance(place, list) and key.isdigit() and int(key) < len(place):
        return int(key)
    known = (
        place if isinstance(place, dict) else range(len(place) if isinstance(place, list) else 0)
    )
    raise UnknownName(f"key of the product file in '{path}'", key, map(str, known))
