"""How a part looks to the two jaws that close on it: its outermost surface on a grid, from each.

A jaw that closes meets what stands out furthest under its face. Where both do that over the same
patch, the normals there are along the closing direction and the grip is closed by force for any
friction; where the patches are apart, the line between them has to lie in both friction cones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

CELL = 1e-3  # [A] Of the grid [m]: a third of the narrowest jaw.
FACING = 0.89  # [D] Cosine of the angle of friction of a pad on metal: tan 27 degrees = 0.5.
TOUCH = 1e-4  # [A] What stands back less touches a rubber pad [m]; 40 N press it in by as much [M].


@dataclass(frozen=True)
class DepthMaps:
    """The surface of a part as both jaws see it.

    Attributes:
        y, z: (n,), (m,) places of the grid along both axes of a jaw's face [m].
        far, near: (n, m) outermost x towards +x and towards -x [m]; -inf, inf where nothing is.
        facing: (n, m) whether both surfaces there face the jaws: steeper ones slip off their edges.
    """

    y: np.ndarray
    z: np.ndarray
    far: np.ndarray
    near: np.ndarray
    facing: np.ndarray

    @staticmethod
    def of(mesh: trimesh.Trimesh, R: np.ndarray) -> DepthMaps:
        """Return the maps of a mesh for jaws with axes R, (3, 3) columns x, y, z."""
        corners = mesh.triangles @ R
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        y = np.arange(low[1] + CELL / 2, high[1], CELL)
        z = np.arange(low[2] + CELL / 2, high[2], CELL)
        far, near = np.full((len(y), len(z)), -np.inf), np.full((len(y), len(z)), np.inf)
        far_faces, near_faces = np.zeros(far.shape, bool), np.zeros(far.shape, bool)
        faces = np.abs(mesh.face_normals @ R[:, 0]) > FACING
        for triangle, face in zip(corners, faces, strict=True):
            first, last = triangle[:, 1:].min(axis=0), triangle[:, 1:].max(axis=0)
            i = np.searchsorted(y, [first[0] - 1e-9, last[0] + 1e-9])
            k = np.searchsorted(z, [first[1] - 1e-9, last[1] + 1e-9])
            if i[0] == i[1] or k[0] == k[1]:
                continue
            (ax, *a), (bx, *b), (cx, *c) = triangle
            u, v = np.subtract(b, a), np.subtract(c, a)
            area = u[0] * v[1] - u[1] * v[0]
            if abs(area) < 1e-14:
                continue
            dy, dz = y[i[0] : i[1], None] - a[0], z[None, k[0] : k[1]] - a[1]
            s, t = (dy * v[1] - dz * v[0]) / area, (u[0] * dz - u[1] * dy) / area
            inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
            x = ax + s * (bx - ax) + t * (cx - ax)
            at = np.s_[i[0] : i[1], k[0] : k[1]]
            farther, nearer = inside & (x > far[at]), inside & (x < near[at])
            far[at][farther], near[at][nearer] = x[farther], x[nearer]
            far_faces[at][farther], near_faces[at][nearer] = face, face
        return DepthMaps(y, z, far, near, far_faces & near_faces)

    def grip(self, y: tuple[float, float], z: tuple[float, float]) -> Grip | None:
        """Return what two jaws meet whose faces span these ranges [m].

        None if there is nothing that both touch, opposite to each other.
        """
        (i, j), (k, m) = np.searchsorted(self.y, y), np.searchsorted(self.z, z)
        far, near = self.far[i:j, k:m], self.near[i:j, k:m]
        if not far.size:
            return None
        top, bottom = float(far.max()), float(near.min())
        on_far, on_near = far > top - TOUCH, near < bottom + TOUCH
        both = on_far & on_near & self.facing[i:j, k:m]
        count = int(both.sum())
        if top == -np.inf or count == 0:
            return None
        ys, zs = self.y[i:j], self.z[k:m]
        apart = np.linalg.norm(np.subtract(_middle(on_far, ys, zs), _middle(on_near, ys, zs)))
        rows, columns = np.nonzero(both)
        middle = _middle(both, ys, zs)
        offsets = ys[rows] - middle[0], zs[columns] - middle[1]
        return Grip(
            width=top - bottom,
            middle=(top + bottom) / 2.0,
            area=count * CELL**2,
            slant=float(apart) / max(top - bottom, 1e-6),
            spread=float(np.hypot(*offsets).mean()),
        )


def _middle(cells: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[float, float]:
    """Return the mean place of cells (n, m) of a grid [m]."""
    along_y, along_z = cells.sum(axis=1), cells.sum(axis=0)
    count = along_y.sum()
    return float(along_y @ y) / count, float(along_z @ z) / count


@dataclass(frozen=True)
class Grip:
    """Two jaws on a part.

    Attributes:
        width: Between them [m].
        middle: x midway between them [m].
        area: That both touch, opposite to each other [m2].
        slant: Tangent of the angle between the closing direction and the line from patch to patch.
        spread: Mean distance of the touching cells from their middle [m]: what bears a torque.
    """

    width: float
    middle: float
    area: float
    slant: float
    spread: float

    def force_closed(self, friction: float) -> bool:
        """Return whether friction alone holds the part against any small load."""
        return self.slant < friction
