"""Pins in the frozen bed: surface of a part that is too fine for the contact mesh.

The mesh conforms to a part's convex `bed_*` hulls. What sticks out of them into the beads, such as
a motor's terminals, meets the bed here: each small piece of its real surface is a spring with a
plastic slider against the beads that were around it when they froze, as in the p-y curves of piles.
It pushes only, and where it has yielded a gap stays behind it. It has no friction: pulled straight
out, a pin leaves freely, as the vented cylinders of the discrete-element reference do, and what has
risen out of the beads meets nothing any more.

The limit is that of a wall near the surface, 2 c sqrt(Kp). Clay flows around a pile deep down at
9 c (Matlock 1970), three times as much, so that pins hold rather less here than they would.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cell.soft_jig.columns import TetMesh
from cell.soft_jig.samples import SurfaceSamples
from cell.soft_jig.stable import largest_stiffness
from cell.soft_jig.yielding import Strength

Array = NDArray[np.float64]

# What is less than a bead behind the mesh's surface lies on it, and the mesh carries it [m].
SKIN = 1e-3
# A gap between the part and its contact hulls that is narrower than twice this holds no bead: the
# hulls' facets lie up to 0.2 mm inside of a round part [m].
NARROW = 3e-4
# A face that looks up by more than this has no beads over it (cosine of 84 deg): the part came from
# above and left its slot open.
UPWARD = 0.1
# Points in one cube of this size are in the beads together, or not [m].
CUBE = 5e-4
_ARRAYS = ("p_PS", "p_JS", "normals", "areas", "cover", "yielded")


@dataclass
class Pins:
    """What one part has among the beads that the mesh does not carry.

    Attributes:
        p_PS: (n, 3) points in the part frame P [m].
        p_JS: (n, 3) the same points in J when the bed froze [m].
        normals: (n, 3) out of the part, in J, when the bed froze.
        areas: (n,) [m2].
        cover: (n,) height of beads over the points when the bed froze [m].
        yielded: (n,) depth by which the beads gave way for good [m]; it only grows.
        modulus: Contact pressure per depth [Pa/m].
    """

    p_PS: Array
    p_JS: Array
    normals: Array
    areas: Array
    cover: Array
    yielded: Array
    modulus: float

    @staticmethod
    def inside(
        mesh: TetMesh,
        samples: SurfaceSamples,
        X_JP: tuple[Array, Array],
        modulus: float,
        inertia: Array,
        dt: float,
    ) -> Pins:
        """Return what is among the beads at the moment when the bed freezes.

        Args:
            mesh: Of the frozen bed, in J.
            samples: Of the part's real surface.
            X_JP: Rotation matrix and position of the part.
            modulus: Contact pressure per depth that is wanted [Pa/m]; what a step cannot carry
                explicitly is left out (`cell.soft_jig.stable`).
            inertia: (6, 6) spatial inertia of the part about its origin in J, angular part first.
            dt: Step [s].
        """
        R_JP, p_JP = X_JP
        p_JS, normals = samples.points @ R_JP.T + p_JP, samples.normals @ R_JP.T
        loaded = np.flatnonzero(normals[:, 2] < UPWARD)
        # Seen from within the part: a face that lies on the mesh is then outside of it.
        among = loaded[_among(mesh, (p_JS - SKIN * normals)[loaded])]
        p_JS, normals, areas = p_JS[among], normals[among], samples.areas[among]
        if len(areas):
            modulus = min(modulus, largest_stiffness(inertia, p_JS - p_JP, areas, dt))
        cover = mesh.top_at(p_JS[:, :2]) - p_JS[:, 2]
        p_PS, unyielded = samples.points[among], np.zeros(len(areas))
        return Pins(p_PS, p_JS, normals, areas, cover, unyielded, modulus)

    def push(self, X_JP: tuple[Array, Array], strength: Strength) -> tuple[Array, Array]:
        """Return the force (3,) [N] on the part and its torque (3,) [N m] about P, in J.

        Args:
            X_JP: Rotation matrix and position of the part now.
            strength: Pressure at which the beads give way.
        """
        R_JP, p_JP = X_JP
        arm = self.p_PS @ R_JP.T
        moved = arm + p_JP - self.p_JS
        buried = moved[:, 2] < self.cover
        depth = np.where(buried, np.einsum("ij,ij->i", moved, self.normals), 0.0)
        limit = strength.limit(self.normals)
        self.yielded = np.maximum(self.yielded, depth - limit / self.modulus)
        pressure = self.modulus * np.maximum(depth - self.yielded, 0.0)
        force = -(pressure * self.areas)[:, None] * self.normals
        return force.sum(axis=0), np.cross(arm, force).sum(axis=0)

    def arrays(self) -> dict[str, Array]:
        """Return everything as arrays, for saving."""
        arrays = {name: getattr(self, name).copy() for name in _ARRAYS}
        return arrays | {"modulus": np.array(self.modulus)}

    @staticmethod
    def from_arrays(arrays: dict[str, Array]) -> Pins:
        """Undo `arrays`."""
        own = {name: arrays[name].copy() for name in _ARRAYS}
        return Pins(**own, modulus=float(arrays["modulus"]))


def _among(mesh: TetMesh, points: Array) -> NDArray[np.intp]:
    """Return which points (n, 3) have the mesh on all sides, `NARROW` away."""
    among = np.arange(len(points))
    for aside in NARROW * np.concatenate([np.eye(3), -np.eye(3)]):
        among = among[_contained(mesh, points[among] + aside)]
    return among


def _contained(mesh: TetMesh, points: Array) -> NDArray[np.bool_]:
    """Say which points (n, 3) are in a mesh, asking for one point of each small cube only."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    near = np.flatnonzero(np.all((points > low) & (points < high), axis=1))
    cubes = np.ceil((high - low) / CUBE).astype(np.int64) + 1
    place = np.ravel_multi_index(tuple(((points[near] - low) / CUBE).astype(np.int64).T), cubes)
    _, first, cube = np.unique(place, return_index=True, return_inverse=True)
    contained = np.zeros(len(points), dtype=bool)
    contained[near] = mesh.contains(points[near[first]])[cube]
    return contained
