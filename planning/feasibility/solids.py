"""Parts in their assembled poses, with what the geometry queries of the planner need."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import fcl
import manifold3d
import numpy as np

from cell.errors import BadPart
from cell.products.product import Part, Product
from planning.feasibility.directions import axis_index, unit_vector


@dataclass(frozen=True, eq=False)
class Solid:
    """One part in the product frame A.

    Attributes:
        name: Of the part.
        vertices: (n, 3) corners in A [m].
        faces: (m, 3) indices into vertices, counter-clockwise seen from outside.
        mass: [kg].
        p_AoG: (3,) centre of gravity in A [m], of uniform density within the part.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    mass: float
    p_AoG: np.ndarray

    @cached_property
    def lower(self) -> np.ndarray:
        """(3,) lower corner of the bounding box in A [m]."""
        return self.vertices.min(axis=0)

    @cached_property
    def upper(self) -> np.ndarray:
        """(3,) upper corner of the bounding box in A [m]."""
        return self.vertices.max(axis=0)

    def lowest(self, up: str) -> float:
        """Return the height of the lowest point when the axis ``up`` points up [m]."""
        axis = axis_index(up)
        return float(self.lower[axis] if up[0] == "+" else -self.upper[axis])

    @cached_property
    def triangles(self) -> np.ndarray:
        """(m, 3, 3) corners of each face in A [m]."""
        return self.vertices[self.faces]

    @cached_property
    def doubled_areas(self) -> np.ndarray:
        """(m, 3) outward normal of each face, twice its area long [m2]."""
        a, b, c = (self.triangles[:, corner] for corner in range(3))
        (ux, uy, uz), (vx, vy, vz) = (b - a).T, (c - a).T
        return np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)

    @cached_property
    def face_boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corners (m, 3) of each face's bounding box in A [m]."""
        a, b, c = (self.triangles[:, corner] for corner in range(3))
        return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)

    @cached_property
    def thickness(self) -> float:
        """2 V / A [m]: exact for a sheet, the radius for a wire, the wall's for a tube."""
        a, b, c = (self.triangles[:, corner] for corner in range(3))
        volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
        return 4.0 * abs(volume) / float(np.linalg.norm(self.doubled_areas, axis=1).sum())

    @cached_property
    def manifold(self) -> manifold3d.Manifold:
        """The part for boolean operations."""
        mesh = manifold3d.Mesh64(self.vertices, self.faces.astype(np.uint64))
        manifold = manifold3d.Manifold(mesh)
        if manifold.status() != manifold3d.Error.NoError or manifold.is_empty():
            reason = f"its surface does not bound a solid ({manifold.status().name})"
            raise BadPart(self.name, reason)
        return manifold

    @cached_property
    def proximity(self) -> fcl.CollisionObject:
        """The part's surface for distance queries."""
        return self.proximity_of(np.arange(len(self.faces)))

    def proximity_of(self, which: np.ndarray) -> fcl.CollisionObject:
        """Return some of the part's faces, given by their indices, for distance queries."""
        return surface_of(self.triangles[which])

    def without(self, other: Solid) -> Solid:
        """Return this part with the other's volume cut out; mass and p_AoG stay."""
        return self.shaped(self.manifold - other.manifold)

    def simplified(self, deviation: float) -> Solid:
        """Return this part with fewer faces, which lie within a deviation [m] of its own."""
        known: dict[float, Solid] = vars(self).setdefault("_simplified", {})
        if deviation not in known:
            # A manifold that is built for this alone is not kept: it is larger than the mesh.
            whole = self if "manifold" in vars(self) else replace(self)
            known[deviation] = self.shaped(whole.manifold.simplify(deviation))
        return known[deviation]

    def shaped(self, manifold: manifold3d.Manifold) -> Solid:
        """Return this part with another shape; mass and p_AoG stay."""
        mesh = manifold.to_mesh64()
        vertices, faces = np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, int)
        shaped = Solid(self.name, vertices, faces, self.mass, self.p_AoG)
        vars(shaped)["manifold"] = manifold  # It need not be built from the mesh again.
        return shaped


def surface_of(triangles: np.ndarray) -> fcl.CollisionObject:
    """Return triangles (m, 3, 3) for distance queries."""
    corners = triangles.reshape(-1, 3)
    tree = fcl.BVHModel()
    tree.beginModel(len(corners), len(triangles))
    tree.addSubModel(corners, np.arange(len(corners)).reshape(-1, 3))
    tree.endModel()
    return fcl.CollisionObject(tree, fcl.Transform())


def solid_of(part: Part) -> Solid:
    """Place a part's mesh in the product frame."""
    vertices = part.X_AP.multiply(np.array(part.mesh.vertices, float).T).T
    p_AoG = part.X_AP.multiply(np.array(part.mesh.center_mass, float))
    return Solid(part.name, vertices, np.array(part.mesh.faces, int), part.mass, p_AoG.ravel())


def solids_of(product: Product) -> dict[str, Solid]:
    """Place all parts, by name in matrix order."""
    return {name: solid_of(part) for name, part in product.parts.items()}


def boxes_apart(a: Solid, b: Solid, gap: float) -> bool:
    """Return whether the bounding boxes are further apart than the gap [m] along some axis."""
    return bool(np.any(a.lower - b.upper > gap) or np.any(b.lower - a.upper > gap))


def combined_cog(solids: Mapping[str, Solid], names: Iterable[str]) -> np.ndarray:
    """Return p_AoG (3,) of several parts [m]: sum(m_i p_i) / sum(m_i), the paper's CoG formula."""
    chosen = [solids[name] for name in names]
    return np.average([s.p_AoG for s in chosen], axis=0, weights=[s.mass for s in chosen])


def cog_height(solids: Mapping[str, Solid], names: Iterable[str], up: str) -> float:
    """Return how high the combined CoG is above the lowest point when ``up`` points up [m]."""
    names = list(names)
    lowest = min(solids[name].lowest(up) for name in names)
    return float(combined_cog(solids, names) @ unit_vector(up)) - lowest
