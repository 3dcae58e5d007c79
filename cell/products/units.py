"""Units of length: what a CAD file states, and taking it in another unit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from cell.errors import InputError
from cell.products.mesh_io import METERS_PER_UNIT, UNIT_SUFFIXES
from cell.products.step_text import StepText
from cell.products.tree import Node


def stated_unit(file: Path) -> float:
    """Return the unit of length that a STEP or glTF file states [m].

    Raises:
        InputError: It states several, or none.
    """
    if file.suffix.lower() in UNIT_SUFFIXES:
        return 1.0
    stated = sorted(StepText(file.read_bytes()).length_units())
    if len(stated) != 1:
        several = " and ".join(unit_name(unit) for unit in stated) or "no unit that is known"
        raise InputError(f"'{file.name}' states {several}: --units cannot override that.")
    return stated[0]


def unit_name(unit: float) -> str:
    """Return the name of a unit that is given in metres."""
    same = (name for name, value in METERS_PER_UNIT.items() if np.isclose(unit, value, rtol=1e-6))
    return next(same, f"units of {unit:g} m")


def scaled(node: Node, factor: float, done: dict[int, trimesh.Trimesh] | None = None) -> Node:
    """Return a tree whose lengths are multiplied by a factor; meshes stay shared."""
    done = {} if done is None else done
    surfaces = []
    for surface in node.surfaces:
        if id(surface.mesh) not in done:
            done[id(surface.mesh)] = surface.mesh.copy().apply_scale(factor)
        X_AP = surface.X_AP.copy()
        X_AP[:3, 3] *= factor
        surfaces.append(replace(surface, mesh=done[id(surface.mesh)], X_AP=X_AP))
    children = tuple(scaled(child, factor, done) for child in node.children)
    return replace(node, surfaces=tuple(surfaces), children=children)
