"""CAD files, by themselves or in a folder in assembled pose, as one tree of parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cell.errors import BadPart, InputError
from cell.products.assembly_io import ASSEMBLY_SUFFIXES, load_assembly, referred_files
from cell.products.mesh_io import MESH_SUFFIXES, METERS_PER_UNIT, load_surfaces, meters_per_unit
from cell.products.parts import NOT_WANTED
from cell.products.product import LeftOut
from cell.products.read_options import ReadOptions
from cell.products.tree import Node, Surface, fit_for_orders, trimmed
from cell.products.units import scaled, stated_unit, unit_name

CAD_SUFFIXES = tuple(dict.fromkeys((*MESH_SUFFIXES, *ASSEMBLY_SUFFIXES)))


@dataclass(frozen=True)
class Contents:
    """What CAD files hold.

    Attributes:
        tree: Sub-assemblies and parts.
        left_out: Files that are not part of it.
        remarks: What was assumed, one sentence each.
    """

    tree: Node
    left_out: tuple[LeftOut, ...] = ()
    remarks: tuple[str, ...] = ()


def read_folder(folder: Path, options: ReadOptions) -> Contents:
    """Read every CAD file of a folder in the order of names; hidden files are ignored.

    A file with one part is that part; the others are sub-assemblies. They are named by the file's
    stem.

    Raises:
        InputError: Or `BadPart`: no CAD file, two of one name, one that cannot be read, no unit.
    """
    files, left_out = _sorted_files(folder, options.leave_out)
    referred = {f: file for file in files for f in referred_files(file)}
    left_out += [
        LeftOut(file.name, f"read as part of {referred[file].name}, which refers to it")
        for file in files
        if file in referred
    ]
    files = [file for file in files if file not in referred] or files  # If they refer in a circle.
    if not files:
        kinds = ", ".join(CAD_SUFFIXES)
        held = ", ".join(thing.name for thing in left_out[:12])
        but = f" It holds {held}." if held else ""
        raise InputError(f"Folder '{folder}' holds no mesh; supported: {kinds}.{but}")
    stems: dict[str, Path] = {}
    for file in files:
        if other := stems.get(file.stem):
            both = f"two files of that name in '{folder}', {other.name} and {file.name}"
            raise BadPart(file.stem, f"{both}; --leave-out {file.name} keeps the other")
        stems[file.stem] = file
    without = [file.name for file in files if file.suffix.lower() not in ASSEMBLY_SUFFIXES]
    nodes, remarks = [], []
    for file in files:
        if file.suffix.lower() in ASSEMBLY_SUFFIXES:
            contents = read_file(file, replace(options, units=None) if without else options)
            nodes.append(replace(contents.tree, given=fit_for_orders(file.stem)))
            remarks += contents.remarks
            remarks += _keeps_its_unit(file, options.units, without[0]) if without else []
        else:
            nodes.append(_mesh_node(file, options.units))
    return Contents(trimmed(Node(children=tuple(nodes))), tuple(left_out), tuple(remarks))


def read_file(file: Path, options: ReadOptions) -> Contents:
    """Read one CAD file; its tree has no levels that tell nothing apart.

    Raises:
        InputError: Or `BadPart`: it cannot be read, has no unit, or states one that --units cannot
            override.
    """
    if file.suffix.lower() not in ASSEMBLY_SUFFIXES:
        return Contents(_mesh_node(file, options.units))
    tree = trimmed(load_assembly(file, options.tolerance))
    if options.units is None:
        return Contents(tree)
    stated, taken = stated_unit(file), meters_per_unit(options.units)
    if stated == taken:
        return Contents(tree)
    remark = (
        f"warning: '{file.name}' states {unit_name(stated)}, and is taken as {options.units}, "
        "because --units says so"
    )
    return Contents(scaled(tree, taken / stated), remarks=(remark,))


def _sorted_files(folder: Path, leave_out: Sequence[str]) -> tuple[list[Path], list[LeftOut]]:
    """Return the CAD files of a folder, and what else it holds."""
    files, left_out = [], []
    for path in sorted(folder.iterdir()):
        wanted = next((name for name in leave_out if name in (path.name, path.stem)), None)
        if path.name.startswith("."):
            if path.suffix.lower() in CAD_SUFFIXES:
                left_out.append(LeftOut(path.name, "a hidden file"))
            continue
        if wanted is not None:
            left_out.append(LeftOut(wanted, NOT_WANTED))
        elif path.is_dir():
            left_out.append(LeftOut(f"{path.name}/", "a sub-folder: plan it by itself"))
        elif path.suffix.lower() in CAD_SUFFIXES:
            files.append(path)
        elif path.suffix.lower() in (".yaml", ".yml"):
            left_out.append(LeftOut(path.name, "a product file or configuration, not CAD"))
        else:
            left_out.append(LeftOut(path.name, "not a mesh or STEP file"))
    return files, left_out


def _mesh_node(file: Path, units: str | None) -> Node:
    """Return the part in a mesh file of a format that states no unit."""
    if units is None:
        known = ", ".join(METERS_PER_UNIT)
        raise InputError(f"'{file.name}' states no unit of length: add --units, one of {known}.")
    surfaces = load_surfaces(file, file.stem)
    for _, mesh in surfaces:
        mesh.apply_scale(meters_per_unit(units))
    objects = tuple(Surface(mesh, name=name) for name, mesh in surfaces)
    return Node(given=fit_for_orders(file.stem), surfaces=objects)


def _keeps_its_unit(file: Path, units: str | None, other: str) -> list[str]:
    """Return a remark if a file states another unit than is given for those that state none."""
    stated = stated_unit(file)
    if units is None or stated == meters_per_unit(units):
        return []
    kept = f"'{file.name}' is in {unit_name(stated)}, as it states"
    return [f"{kept}; --units {units} is for files that state none, such as '{other}'"]
