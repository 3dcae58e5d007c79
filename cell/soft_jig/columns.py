"""Tetrahedral meshes of prismatic columns that stand on z = 0 and share their vertical edges.

A column is a planar cell with a height at each corner. Where two neighbours have different heights
the taller one shows a wall. Every column gets one interior vertex, its apex, and is filled with
tetrahedra from its triangulated faces to the apex. In a hydroelastic body the surface has zero
pressure and the apexes carry the pressure, so the apex's distance behind a face sets that face's
stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from numpy.typing import NDArray

from cell.errors import CellError

Array = NDArray[np.float64]
Triangle = tuple[int, int, int]

# Heights closer than this are the same node [m].
SAME_HEIGHT = 2e-5
# Twice the area over which a face that looks up is more than a wall [m2].
FLAT = 1e-10
# From this many corners on, a face is round and gets a triangle in its middle.
MANY = 16
# How far the center of a smaller face's fan is moved from the middle towards its first corner.
FAN_SHIFT = 0.3
# Size of the triangle in the middle of a many-sided face, relative to the face.
CORE = 0.4


class BadMesh(CellError):
    """The contact mesh of the jig came out invalid."""


@dataclass(frozen=True)
class TetMesh:
    """A tetrahedral volume mesh: vertices (n, 3) [m] and tetrahedra (m, 4), positive volumes."""

    vertices: Array
    tetrahedra: NDArray[np.int64]

    def volumes(self) -> Array:
        """Return the signed volume of each tetrahedron (m,) [m3]."""
        a, b, c, d = (self.vertices[self.tetrahedra[:, k]] for k in range(4))
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6

    def boundary(self) -> NDArray[np.int64]:
        """Return the outer triangles (k, 3)."""
        faces = self.tetrahedra[:, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]].reshape(-1, 3)
        _, first, count = np.unique(
            np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
        )
        return faces[first[count == 1]]

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Say which points (k, 3) are in one of the tetrahedra."""
        inside = np.zeros(len(points), dtype=bool)
        near = np.arange(len(points))
        corners = self.vertices[self.tetrahedra]
        edges = np.linalg.inv(corners[:, 1:] - corners[:, :1])
        for corner, inverse in zip(corners[:, 0], edges, strict=True):
            weights = (points[near] - corner) @ inverse
            within = (weights.min(axis=1) >= 0) & (weights.sum(axis=1) <= 1)
            inside[near[within]] = True
            near = near[~within]
        return inside

    def top_at(self, xy: Array) -> Array:
        """Return the height (k,) of the surface over (k, 2) points; -inf beside the mesh [m]."""
        corners = self.vertices[self.boundary()]
        top = np.full(len(xy), -np.inf)
        for a, b, c in corners:
            sides = np.column_stack([b - a, c - a])[:2]
            if np.linalg.det(sides) > FLAT:
                u, v = np.linalg.solve(sides, (xy - a[:2]).T)
                inside = (u >= 0) & (v >= 0) & (u + v <= 1)
                height = a[2] + u * (b - a)[2] + v * (c - a)[2]
                top = np.where(inside, np.maximum(top, height), top)
        return top

    def largest_depth(self) -> float:
        """Return the largest distance of a vertex from the surface [m].

        Drake scales its pressure field by this length: modulus = gradient * largest depth.
        """
        surface = self.vertices[self.boundary()]
        inner = np.setdiff1d(np.arange(len(self.vertices)), np.unique(self.boundary()))
        depths = [0.0]
        for point in self.vertices[inner]:
            nearest = trimesh.triangles.closest_point(surface, np.tile(point, (len(surface), 1)))
            depths.append(float(np.linalg.norm(nearest - point, axis=1).min()))
        return max(depths)

    def vtk(self) -> str:
        """Return the mesh as the text of a legacy VTK file, which Drake reads."""
        n, m = len(self.vertices), len(self.tetrahedra)
        points = "%.10g %.10g %.10g\n" * n % tuple(self.vertices.ravel())
        cells = "4 %d %d %d %d\n" * m % tuple(self.tetrahedra.ravel())
        return (
            "# vtk DataFile Version 3.0\nsoft jig\nASCII\nDATASET UNSTRUCTURED_GRID\n"
            f"POINTS {n} double\n{points}CELLS {m} {5 * m}\n{cells}"
            f"CELL_TYPES {m}\n" + "10\n" * m
        )


@dataclass
class Column:
    """One cell.

    Attributes:
        corners: Indices of its plane vertices, counter-clockwise.
        tops: (k,) height at each corner [m].
        center_top: Height at the middle of the top face [m].
        apex: (3,) the interior vertex.
    """

    corners: list[int]
    tops: Array
    center_top: float
    apex: Array


@dataclass
class ColumnMesh:
    """Builder of a `TetMesh` from columns.

    Attributes:
        plane: (n, 2) plane vertices.
        lean: (2,), or (n, 2) per plane vertex: horizontal shift per height above the vertex's
            lowest top. Walls of a part that stands a little askew are parallel to it.
    """

    plane: Array
    columns: list[Column]
    lean: Array = field(default_factory=lambda: np.zeros(2))

    def build(self) -> TetMesh:
        """Return the mesh; raises `BadMesh` if an apex does not see all faces of its column."""
        self._number_nodes()
        edges = self._edges()
        tetrahedra: list[tuple[int, int, int, int]] = []
        for column in self.columns:
            apex = self._add(column.apex)
            faces = self._top(column) + self._bottom(column)
            for a, b in _cyclic(column.corners):
                faces += self._side(column, a, b, edges)
            tetrahedra += [(face[0], face[2], face[1], apex) for face in faces]
        return _checked(np.array(self._nodes), np.array(tetrahedra, dtype=np.int64))

    def _number_nodes(self) -> None:
        heights: list[list[float]] = [[0.0] for _ in self.plane]
        for column in self.columns:
            for corner, top in zip(column.corners, column.tops, strict=True):
                heights[corner].append(float(top))
        self._nodes: list[Array] = []
        self._levels: list[tuple[list[float], list[int]]] = []
        lean = np.broadcast_to(self.lean, self.plane.shape)
        for xy, shift, values in zip(self.plane, lean, heights, strict=True):
            merged = _merge(sorted(values))
            foot = merged[min(1, len(merged) - 1)]
            ids = [self._add([*(xy + shift * max(z - foot, 0.0)), z]) for z in merged]
            self._levels.append((merged, ids))

    def _add(self, point: Array | list[float]) -> int:
        self._nodes.append(np.asarray(point, dtype=float))
        return len(self._nodes) - 1

    def _rank(self, corner: int, top: float) -> int:
        levels = np.array(self._levels[corner][0])
        return int(np.argmin(np.abs(levels - top)))

    def _edges(self) -> dict[tuple[int, int], list[tuple[int, int]]]:
        """Return for each edge (low, high vertex) the pairs of ranks of the columns on it."""
        edges: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for column in self.columns:
            rank = self._ranks(column)
            for a, b in _cyclic(column.corners):
                low, high = min(a, b), max(a, b)
                edges.setdefault((low, high), []).append((rank[low], rank[high]))
        return edges

    def _ranks(self, column: Column) -> dict[int, int]:
        return {
            corner: self._rank(corner, top)
            for corner, top in zip(column.corners, column.tops, strict=True)
        }

    def _top(self, column: Column) -> list[Triangle]:
        rank = self._ranks(column)
        ring = [self._levels[c][1][rank[c]] for c in column.corners]
        return self._fan(ring, column.center_top)

    def _bottom(self, column: Column) -> list[Triangle]:
        return self._fan([self._levels[c][1][0] for c in reversed(column.corners)], 0.0)

    def _fan(self, ring: list[int], center_height: float) -> list[Triangle]:
        if len(ring) == 3:
            return [(ring[0], ring[1], ring[2])]
        if len(ring) == 4:
            return [(ring[0], ring[1], ring[2]), (ring[0], ring[2], ring[3])]
        corners = np.array([self._nodes[i] for i in ring])
        middle = np.array([*corners[:, :2].mean(axis=0), center_height])
        if len(ring) < MANY:
            # Not in the middle, where Drake puts the part's fan.
            center = self._add(middle + FAN_SHIFT * (corners[0] - middle))
            return [(a, b, center) for a, b in _cyclic(ring)]
        slope = np.linalg.lstsq(corners[:, :2] - middle[:2], corners[:, 2] - corners[:, 2].mean())[
            0
        ]
        inner = [self._add(point) for point in _core(corners, middle, slope)]
        return _annulus(ring, inner) + [(inner[0], inner[1], inner[2])]

    def _side(
        self, column: Column, a: int, b: int, edges: dict[tuple[int, int], list[tuple[int, int]]]
    ) -> list[Triangle]:
        """Triangulate one vertical face so that the neighbour finds the same triangles."""
        low, high = min(a, b), max(a, b)
        rank = self._ranks(column)
        own = (rank[low], rank[high])
        below = [p for p in edges[low, high] if p != own and p[0] <= own[0] and p[1] <= own[1]]
        faces: list[Triangle] = []
        start = (0, 0)
        for stop in [*sorted(below), own]:
            faces += self._strip(low, high, start, stop)
            start = stop
        return (
            faces
            if (a, b) == (low, high)
            else [(third, second, first) for first, second, third in faces]
        )

    def _strip(
        self, low: int, high: int, start: tuple[int, int], stop: tuple[int, int]
    ) -> list[Triangle]:
        (z_low, id_low), (z_high, id_high) = self._levels[low], self._levels[high]
        i, j = start
        faces: list[Triangle] = []
        while (i, j) != stop:
            step_low = j == stop[1] or (i < stop[0] and z_low[i + 1] <= z_high[j + 1])
            third = id_low[i + 1] if step_low else id_high[j + 1]
            faces.append((id_low[i], id_high[j], third))
            i, j = (i + 1, j) if step_low else (i, j + 1)
        return faces


def _core(corners: Array, middle: Array, slope: Array) -> Array:
    """Return a triangle (3, 3) in the middle of a face.

    Drake triangulates a part's faces around their middle. With a fan of its own there, the bed
    would cut every one of the part's triangles many times; one triangle cuts each of them once.
    """
    xy = CORE * (corners[[0, len(corners) // 3, 2 * len(corners) // 3], :2] - middle[:2])
    return np.column_stack([xy + middle[:2], xy @ slope + middle[2]])


def _annulus(ring: list[int], inner: list[int]) -> list[Triangle]:
    """Triangulate between a ring and the triangle in its middle; both start at the same angle."""
    n = len(ring)
    owner = [inner[int(3 * (k + 0.5) / n + 0.5) % 3] for k in range(n)]
    faces: list[Triangle] = []
    for k, (a, b) in enumerate(_cyclic(ring)):
        before = owner[k - 1]
        if before != owner[k]:
            faces.append((a, owner[k], before))
        faces.append((a, b, owner[k]))
    return faces


def _cyclic(ring: list[int]) -> list[tuple[int, int]]:
    return list(zip(ring, [*ring[1:], ring[0]], strict=True))


def _merge(values: list[float]) -> list[float]:
    merged = [values[0]]
    for value in values[1:]:
        if value - merged[-1] > SAME_HEIGHT:
            merged.append(value)
    return merged


def _checked(vertices: Array, tetrahedra: NDArray[np.int64]) -> TetMesh:
    mesh = TetMesh(vertices, tetrahedra)
    volumes = mesh.volumes()
    if volumes.min() < 1e-14:
        worst = vertices[tetrahedra[np.argmin(volumes)]].mean(axis=0) * 1e3
        x, y, z = worst.round(1)
        raise BadMesh(f"The jig's contact mesh folds over near ({x}, {y}, {z}) mm in J.")
    return mesh
