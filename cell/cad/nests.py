"""A tray for any parts: each stands on a pedestal between stop boxes, screws hang between rails.

Nests cut from a part's shape let it rattle (24 mm/s [M]); boxes hold it still. Frame T: origin at
the centre of the base plate's top face, +z up. Lengths in millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold

from cell.cad.motor_unit import box_piece, mesh
from cell.cad.sdf import Model, Piece, Visual, mesh_inertia
from cell.cad.shapes import box
from cell.cad.tray import (
    BASE_GREY,
    NEST_TEAL,
    PLASTIC,
    PRINTED,
    RAIL_WIDTH,
    RIDGE_HEIGHT,
    RIDGE_WIDTH,
    THIN_PLASTIC,
)

BASE_HEIGHT = 8.0
PEDESTAL = 30.0  # [D] Fingers reach 24 mm below the middle of their pads.
# [A] Of the pedestal inside of the outline of what stands on it, at most as a share of its side.
PEDESTAL_INSET, INSET_SHARE = 2.0, 0.25
PLAY = 0.5  # Between a part and its stops [A]; it comes to rest within 0.07 s [M].
STOP_THICKNESS = 3.0  # [A]
STOP_HEIGHT, STOP_SHARE = 6.0, 0.35  # Highest stop, and as a share of the part's height [A].
STOP_AT, STOP_WIDTH = 0.12, 0.2  # From each corner, and width, as shares of a side [A].
LEAST_STOP = 4.0  # Width of the narrowest [A].
RAIL_PLAY = 0.35  # Between a shank and each ridge [A].
SPACING = 1.6  # [A] Between screws, in diameters of their heads, and `FINGERS` more.
FINGERS = 6.0  # [D] Two noses, opened, between two heads.
BELOW = 5.0  # A screw's tip hangs this far above the base [A].


@dataclass(frozen=True)
class Nest:
    """The place of one part.

    Attributes:
        name: Of the part.
        pieces: Pedestal and stops, in T.
        p_TrayP: Where the part's origin is [mm].
    """

    name: str
    pieces: tuple[Piece, ...]
    p_TrayP: np.ndarray


def outline(solid: Manifold) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper corners (3,) of the lowest layer of a part [mm]: what stops touch."""
    height = stop_height(solid)
    bottom = solid.bounding_box()[2]
    low = np.array(solid.trim_by_plane([0, 0, -1], -(bottom + height)).bounding_box())
    return low[:3], low[3:]


def stop_height(solid: Manifold) -> float:
    """Return how far stops reach up a part [mm]."""
    box = solid.bounding_box()
    return float(min(STOP_HEIGHT, STOP_SHARE * (box[5] - box[2])))


def stop_nest(name: str, solid: Manifold, at: tuple[float, float]) -> Nest:
    """Return the nest of a part as it stands in its own frame, centred on a place of the tray.

    Eight stops stand near its corners, so that jaws reach the middle of its sides.

    Args:
        name: Of the part.
        solid: The part in P, turned as it is to stand [mm].
        at: (x, y) of the middle of its outline, in T [mm].
    """
    low, high = outline(solid)
    centre = (low + high) / 2.0
    p_TrayP = np.array([at[0] - centre[0], at[1] - centre[1], PEDESTAL - low[2]])
    low, high = low + p_TrayP, high + p_TrayP
    top = PEDESTAL + stop_height(solid)
    foot = solid.trim_by_plane([0, 0, -1], -(solid.bounding_box()[2] + 0.1)).bounding_box()
    foot_low, foot_high = np.array(foot[:2]) + p_TrayP[:2], np.array(foot[3:5]) + p_TrayP[:2]
    inset = np.minimum(PEDESTAL_INSET, INSET_SHARE * (foot_high - foot_low))
    stand_low = np.append(foot_low + inset, 0.0)
    stand_high = np.append(foot_high - inset, PEDESTAL)
    boxes = [("pedestal", stand_low, stand_high)]
    for axis, other in ((0, 1), (1, 0)):
        side = high[other] - low[other]
        half = max(LEAST_STOP, STOP_WIDTH * side) / 2.0
        for k, share in enumerate((STOP_AT, 1.0 - STOP_AT)):
            middle = low[other] + share * side
            for sign, face in ((-1.0, low[axis]), (1.0, high[axis])):
                ends = sorted((face + sign * PLAY, face + sign * (PLAY + STOP_THICKNESS)))
                corner_low, corner_high = np.zeros(3), np.array([0.0, 0.0, top])
                corner_low[axis], corner_high[axis] = ends
                corner_low[other], corner_high[other] = middle - half, middle + half
                boxes.append(
                    (f"stop_{'xy'[axis]}{'+' if sign > 0 else '-'}{k}", corner_low, corner_high)
                )
    pieces = tuple(
        box_piece(f"{name}_{what}", tuple(lower), tuple(upper), PLASTIC)
        for what, lower, upper in boxes
    )
    return Nest(name, pieces, p_TrayP)


def rail_nest(
    names: Sequence[str], diameter: float, length: float, head: float, at: tuple[float, float]
) -> list[Nest]:
    """Return the nest of a row of equal screws, which hang by their heads between two rails.

    Args:
        names: Of the screws.
        diameter: Of the shank [mm].
        length: Of the shank [mm].
        head: Its diameter [mm].
        at: (x, y) of the middle of the row, in T [mm].
    """
    z, spacing = length + BELOW, rail_spacing(head)
    half_length = rail_length(len(names), head) / 2.0
    pieces = []
    for side, sign in (("near", -1.0), ("far", 1.0)):
        for what, width, low, high, contact in (
            ("rail", RAIL_WIDTH, 0.0, z - RIDGE_HEIGHT, PLASTIC),
            ("ridge", RIDGE_WIDTH, z - RIDGE_HEIGHT, z, THIN_PLASTIC),
        ):
            gap = sign * (diameter / 2.0 + RAIL_PLAY)
            y_low, y_high = sorted((at[1] + gap, at[1] + gap + sign * width))
            lower, upper = (at[0] - half_length, y_low, low), (at[0] + half_length, y_high, high)
            pieces.append(box_piece(f"{names[0]}_{what}_{side}", lower, upper, contact))
    first = at[0] - spacing * (len(names) - 1) / 2.0
    places = [np.array([first + k * spacing, at[1], z]) for k in range(len(names))]
    own = [tuple(pieces), *((),) * (len(names) - 1)]
    return [Nest(*nest) for nest in zip(names, own, places, strict=True)]


def rail_spacing(head: float) -> float:
    """Return the distance between screws in a row [mm], given the diameter of their heads."""
    return SPACING * head + FINGERS


def rail_length(count: int, head: float) -> float:
    """Return the length of the rails of a row of screws [mm]."""
    return (count - 1) * rail_spacing(head) + 3.0 * head


def tray_model(name: str, nests: Sequence[Nest], size: tuple[float, float]) -> Model:
    """Return the tray of some nests on a base plate of a size (x, y) [mm]."""
    x, y = size[0] / 2.0, size[1] / 2.0
    low, high = (-x, -y, -BASE_HEIGHT), (x, y, 0.0)
    base = box_piece("base", low, high, PLASTIC)
    pieces = [piece for nest in nests for piece in nest.pieces]
    visuals = [Visual("base_look", base.shape, BASE_GREY, base.X_PS)]
    visuals += [Visual(f"{p.name}_look", p.shape, NEST_TEAL, p.X_PS) for p in pieces]
    slab = mesh(box(low, high))
    inertia = mesh_inertia(slab, PRINTED * slab.volume, name)
    return Model(name, inertia, [base, *pieces], visuals)
