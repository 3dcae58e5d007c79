"""A printed board of square markers on the force plate, around the jig.

From an image of it alone one can tell where the camera is. The markers are the first twelve of
OpenCV's dictionary DICT_4X4_50: a black border one cell wide around four by four cells. Any two of
them, however they are turned, differ in five cells or more. The board is only seen: it has no
weight and touches nothing.

D is the frame of the board: its origin is the centre of the printed face, its axes are those of J.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from cell.fixtures.jig_dimensions import BASE_HEIGHT

Array = NDArray[np.float64]

# The white cells of the markers, row by row from the upper left corner, the first cell in the
# highest bit [R] OpenCV, objdetect/src/aruco/predefined_dictionaries.hpp.
CODES = (
    0xB532, 0x0F9A, 0x332D, 0x9946, 0x549E, 0x79CD,
    0x9E2E, 0xC4F2, 0xFEDA, 0xCF56, 0xF991, 0x11A7,
)  # fmt: skip
BITS = 4  # Cells of a marker along each side, without its border.
CELLS = BITS + 2
MARKER = 0.040  # Edge of a marker [m] [A].
SIDE = 0.300  # Of the board: that of the force plate [m] [D].
HOLE = 0.166  # Edge of the square that the jig stands in: 6 mm wider than its base [m] [D].
# Centres of the markers along a side [m]: none is below the hose of the jig, which leaves at -x.
ROW = np.array([-0.117, -0.039, 0.039, 0.117])
THICKNESS = 1e-3  # Of the sheet [m] [A].
INK = 2e-5  # Thickness of what is printed [m] [A]: enough that it is not drawn below the sheet.
PAPER, BLACK = 0.6, 0.04  # What they reflect [A]: paper is white without being overexposed.

# The sheet lies on the force plate, whose frame is J, as that of the jig's base.
X_JD = RigidTransform([0.0, 0.0, THICKNESS - BASE_HEIGHT])


def marker_centres() -> Array:
    """Return p_DoM (12, 2) of the markers' centres, in the order of `CODES` [m]."""
    outer = abs(ROW).max()
    return np.array([(x, y) for x in ROW for y in ROW if max(abs(x), abs(y)) == outer])


def marker_corners(margin: float = 0.0) -> Array:
    """Return p_DQ (12, 4, 3) of the markers' corners [m]: clockwise, from the upper left one.

    Args:
        margin: By which they are further out than the markers' own [m].
    """
    half = MARKER / 2 + margin
    square = half * np.array([(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
    corners = marker_centres()[:, None] + square
    return np.concatenate([corners, np.zeros((*corners.shape[:2], 1))], axis=2)


def marker_cells(code: int) -> NDArray[np.bool_]:
    """Return which cells (4, 4) of a marker are white."""
    bits = [code >> place & 1 for place in range(BITS * BITS - 1, -1, -1)]
    return np.array(bits, bool).reshape(BITS, BITS)


def sheet_mesh() -> Mesh:
    """Return the face of the sheet in D, with its hole."""
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    points = np.concatenate([SIDE / 2 * square, HOLE / 2 * square])
    return _facing_up(points, [(k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4) for k in range(4)])


def print_mesh() -> Mesh:
    """Return the black cells of all markers in D, a little above the sheet."""
    edges = np.linspace(-MARKER / 2, MARKER / 2, CELLS + 1)
    points, cells = [], []
    for code, centre in zip(CODES, marker_centres(), strict=True):
        # Neighbours share their corners, so that nothing shows between them.
        grid = len(points) * len(edges) ** 2 + np.arange(len(edges) ** 2).reshape(2 * [len(edges)])
        points.append([centre + (x, y) for y in edges[::-1] for x in edges])
        for i, j in np.argwhere(~np.pad(marker_cells(code), 1)):
            cells.append((grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1], grid[i, j]))
    return _facing_up(np.concatenate(points), cells, z=INK)


def _facing_up(xy: Array, quads: list[tuple[int, ...]], z: float = 0.0) -> Mesh:
    """Return a mesh of quadrilaterals, counterclockwise, at one height [m]."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y in xy] + ["vn 0 0 1"]
    for a, b, c, d in quads:
        for triangle in ((a, b, c), (a, c, d)):
            lines.append("f " + " ".join(f"{k + 1}//1" for k in triangle))
    file = MemoryFile("\n".join(lines) + "\n", ".obj", "marker_board")
    return Mesh(InMemoryMesh(mesh_file=file))


def add_marker_board(plant: MultibodyPlant, force_plate: RigidBody) -> None:
    """Lay the board on the force plate of a plant that is not finalized yet."""
    for name, mesh, level in (("sheet", sheet_mesh(), PAPER), ("print", print_mesh(), BLACK)):
        color = np.array([level, level, level, 1.0])
        plant.RegisterVisualGeometry(force_plate, X_JD, mesh, f"marker_board_{name}", color)
