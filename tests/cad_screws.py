"""Bolts and nuts with real flanks, made in code. Lengths in millimetres."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, Manifold
from tiny_products import box, rod, to_trimesh

from planning.feasibility.solids import Solid


def thread(
    major: float,
    minor: float,
    pitch: float,
    low: float,
    high: float,
    *,
    starts: int = 1,
    left: bool = False,
    facets: int = 32,
    crest: float = 1 / 8,
    root: float = 1 / 4,
) -> Manifold:
    """Thread about z by its diameters; crest and root are flat over these shares of the pitch.

    Every cross-section is the same one, turned: its radius runs from crest to root and back once
    per start. Threads of one pitch share their phase, wherever they begin.
    """
    turn = np.arange(max(16, 12 * starts)) / max(16, 12 * starts)
    flank = (1 - crest - root) / 2
    places = [0, crest, crest + flank, crest + flank + root, 1]
    radii = np.interp(turn * starts % 1.0, places, [major, major, minor, minor, major]) / 2
    angles = 2 * np.pi * turn
    outline = CrossSection([np.c_[radii * np.cos(angles), radii * np.sin(angles)]])
    lead = pitch * starts * (-1 if left else 1)
    turns = (high - low) / lead
    divisions = max(1, round(abs(turns) * facets))
    shape = Manifold.extrude(outline, high - low, divisions, 360 * turns)
    return shape.translate([0, 0, low]).rotate([0, 0, 360 * low / lead])


def hexagon(width: float, low: float, high: float) -> Manifold:
    """Hexagonal prism about z by its width across flats."""
    return rod(width / np.cos(np.pi / 6), low, high, 6)


def m8_bolt(**options) -> Manifold:
    """M8, threaded from z = -3 to its head at 20."""
    return thread(8, 6.62, 1.25, -3, 20, **options) + hexagon(13, 20, 25)


def m8_nut(clearance: float = 0.05, pitch: float = 1.25, **options) -> Manifold:
    """M8 nut from z = 0 to 6.5, its flanks at a distance from the bolt's."""
    wider = 4 * clearance  # Of the diameter: flanks of 30 degrees move apart by half the radius.
    return hexagon(13, 0, 6.5) - thread(8 + wider, 6.62 + wider, pitch, -2, 9, **options)


def solid(shape: Manifold, name: str) -> Solid:
    """Return a shape as a part in the product frame [m]."""
    mesh = to_trimesh(shape)
    return Solid(name, np.array(mesh.vertices), np.array(mesh.faces), 1.0, np.zeros(3))


def plate_with(hole: Manifold) -> Manifold:
    """Plate from z = 0 to 10 with a hole."""
    return box((20, 20, 10), (-10, -10, 0)) - hole
