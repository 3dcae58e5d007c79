"""Yield of the frozen bed: contact pressure never stays above the strength of the beads.

Compliant hydroelastic contact is elastic without end: a wall of it holds whatever presses on it.
Here the beads' strength is added in two steps.

Every step, `relief` gives the part back what the contact pressure p has above the limit p_y: a
force of (p_y - p) per area, opposite on the bed. Drake solves the elastic pressure implicitly and
the relief is known from the step before, so the sum is p_y + k v dt: a Bingham body whose viscosity
k dt (4e5 Pa s/m at 1 ms) lies in the range assumed for the creep of jammed beads, 1e5 to 1e6.

When the excess has grown to a depth that matters, `returned` moves the surface's vertices by it,
once and for good: the plastic return. The elastic pressure then starts from p_y again, friction
follows, and what yielded stays yielded. Nothing is done, and next to nothing computed, while
nothing can yield.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import ContactSurface, GeometryId
from pydrake.math import RigidTransform

from cell.soft_jig.columns import TetMesh
from cell.soft_jig.parameters import SoilParameters

Array = NDArray[np.float64]

# A contact polygon belongs to a triangle of the bed if it is this close behind it [m].
BEHIND = 5e-3
# How far outside a triangle it may be, in barycentric coordinates: its neighbours overlap a little.
OUTSIDE = 0.05
# Weight of staying put against following the excess, relative to the largest weight of a vertex.
RIDGE = 0.02
# Least volume that a tetrahedron may keep, relative to what it had.
LEAST_VOLUME = 0.1


@dataclass(frozen=True)
class Strength:
    """Contact pressure at which jammed beads give way [Pa].

    Attributes:
        lateral: Against a vertical wall near the rim, 2 c sqrt(Kp) (Rankine's passive wedge).
        bearing: Against a horizontal floor, c Nc (Prandtl).
    """

    lateral: float
    bearing: float

    @staticmethod
    def of(soil: SoilParameters, confinement: float) -> Strength:
        """Return the strength under a confining pressure [Pa]: cohesion c = p tan(phi)."""
        cohesion = confinement * np.tan(soil.friction_angle)
        root_kp = np.tan(np.pi / 4 + soil.friction_angle / 2)
        return Strength(float(2 * cohesion * root_kp), float(cohesion * soil.cohesion_factor))

    def limit(self, normals: Array) -> Array:
        """Return the limit (n,) for unit normals (n, 3) in J; between wall and floor as n_z^2."""
        return self.lateral + (self.bearing - self.lateral) * normals[:, 2] ** 2


@dataclass(frozen=True)
class Patch:
    """The contact of one body with the bed, polygon by polygon.

    Attributes:
        points: (n, 3) centroids in J [m].
        normals: (n, 3) out of the bed, in J.
        areas: (n,) [m2].
        pressures: (n,) elastic contact pressure [Pa].
        gradients: (n,) of the pressure against depth [Pa/m], 0 where the limit is not exceeded.
        limits: (n,) pressure at which the beads yield [Pa].
    """

    points: Array
    normals: Array
    areas: Array
    pressures: Array
    gradients: Array
    limits: Array

    @staticmethod
    def of(
        surface: ContactSurface, bed: GeometryId, X_JW: RigidTransform, strength: Strength
    ) -> Patch:
        """Read a contact surface of Drake."""
        mesh, field = surface.poly_mesh_W(), surface.poly_e_MN()
        faces = range(mesh.num_faces())
        p_W = np.array([mesh.element_centroid(face) for face in faces])
        pressures = np.array([field.EvaluateCartesian(f, p_W[f]) for f in faces])
        areas = np.array([mesh.area(face) for face in faces])
        # Drake's normals point out of N into M.
        bed_is_M = surface.id_M() == bed
        R_JW = X_JW.rotation().matrix() * (-1.0 if bed_is_M else 1.0)
        normals_W = np.array([mesh.face_normal(face) for face in faces])
        normals = normals_W @ R_JW.T
        limits = strength.limit(normals)
        gradient = surface.EvaluateGradE_M_W if bed_is_M else surface.EvaluateGradE_N_W
        gradients = np.zeros(len(areas))
        for face in np.flatnonzero(pressures > limits):
            gradients[face] = abs(float(gradient(int(face)) @ normals_W[face]))
        points = p_W @ X_JW.rotation().matrix().T + X_JW.translation()
        return Patch(points, normals, areas, pressures, gradients, limits)

    @property
    def excess(self) -> Array:
        """Pressure above the limit (n,) [Pa]."""
        return np.maximum(self.pressures - self.limits, 0.0)

    @property
    def excess_depth(self) -> Array:
        """Depth by which the surface must give way (n,) [m]."""
        return np.where(self.gradients > 0, self.excess / np.maximum(self.gradients, 1.0), 0.0)

    @property
    def margin(self) -> float:
        """Least pressure that is missing to the limit [Pa]; negative while yielding."""
        return float((self.limits - self.pressures).min(initial=np.inf))

    def relief(self, p_JP: Array) -> tuple[Array, Array]:
        """Return the force on the part (3,) [N] and its torque about P (3,) [N m], in J."""
        force = -(self.excess * self.areas)[:, None] * self.normals
        return force.sum(axis=0), np.cross(self.points - p_JP, force).sum(axis=0)


# The plastic return.


def returned(mesh: TetMesh, patches: list[Patch], least: float) -> TetMesh | None:
    """Return the mesh with its surface moved to where the pressure is at its limit.

    The vertices' displacements are the smallest that carry every polygon of the patches back by
    its excess depth, in the sense of least squares over the area.

    Args:
        mesh: Of the bed, in J.
        patches: What presses on it.
        least: Displacement not worth a new mesh [m].

    Returns:
        None if nothing moves by `least` or the mesh would fold over.
    """
    faces = mesh.boundary()
    rows, cols, values, targets = [], [], [], []
    row = 0
    for patch in patches:
        owner, weights = _owners(mesh.vertices[faces], patch)
        for i in np.flatnonzero(owner >= 0):
            scale = np.sqrt(patch.areas[i])
            for vertex, weight in zip(faces[owner[i]], weights[i], strict=True):
                rows += [row] * 3
                cols += [3 * int(vertex) + axis for axis in range(3)]
                values += list(-scale * weight * patch.normals[i])
            targets.append(scale * patch.excess_depth[i])
            row += 1
    if not targets:
        return None
    unknown, column = np.unique(cols, return_inverse=True)
    matrix = np.zeros((row, len(unknown)))
    matrix[rows, column] = values
    normal = matrix.T @ matrix
    normal[np.diag_indices_from(normal)] += RIDGE * normal.diagonal().max()
    moves = np.zeros(mesh.vertices.size)
    moves[unknown] = np.linalg.solve(normal, matrix.T @ np.array(targets))
    moves = moves.reshape(-1, 3)
    moves[mesh.vertices[:, 2] <= 0] = 0.0  # The base plate does not give way.
    return _moved(mesh, moves) if np.abs(moves).max() >= least else None


def _moved(mesh: TetMesh, moves: Array) -> TetMesh | None:
    """Return the mesh with moved vertices, halving the moves until no tetrahedron folds over."""
    before = mesh.volumes()
    for _ in range(4):
        moved = TetMesh(mesh.vertices + moves, mesh.tetrahedra)
        if np.all(moved.volumes() > LEAST_VOLUME * before):
            return moved
        moves = moves / 2
    return None


def _owners(triangles: Array, patch: Patch) -> tuple[NDArray[np.int64], Array]:
    """Return for each polygon the bed's triangle that it is in (-1 if none) and its weights.

    Args:
        triangles: (t, 3, 3) corners in J [m].
        patch: The polygons.
    """
    a = triangles[:, 0]
    edges = triangles[:, 1:] - a[:, None]
    cross = np.cross(edges[:, 0], edges[:, 1])
    doubled = np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(doubled, 1e-15)[:, None]
    # Rows that give the second and third barycentric coordinate of a point relative to a.
    second = np.cross(edges[:, 1], normal) / doubled[:, None]
    third = np.cross(normal, edges[:, 0]) / doubled[:, None]
    offset = patch.points[:, None] - a[None]
    u, v = np.einsum("ptk,tk->pt", offset, second), np.einsum("ptk,tk->pt", offset, third)
    behind = -np.einsum("ptk,tk->pt", offset, normal)
    inside = np.minimum(np.minimum(u, v), 1 - u - v) > -OUTSIDE
    facing = patch.normals @ normal.T > 0.5
    fits = inside & facing & (behind > -1e-4) & (behind < BEHIND)
    distance = np.where(fits, behind, np.inf)
    owner = np.argmin(distance, axis=1)
    every = np.arange(len(owner))
    weights = np.stack([1 - u - v, u, v], axis=2)
    return np.where(fits[every, owner], owner, -1), weights[every, owner]
