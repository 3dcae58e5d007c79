"""Parts as they are drawn: no finer than a picture shows, and made ready for the renderer once.

CAD is tessellated a hundred times finer than a picture resolves, and every step shows nearly all
parts again: what is drawn is a simplified surface, and only its pose differs between pictures.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh
from pydrake.math import RigidTransform

from cell.errors import BadPart
from cell.products.mesh_io import obj_text
from cell.products.product import Product
from planning.feasibility.solids import Solid, solids_of

SHOWN = 1.0 / 1000.0
"""[D] Of the product's size: half a pixel, as a picture is 560 of them high."""

SHOWN_ALONE = 1.0 / 200.0
"""[A] Of a part's own size: early steps show a few small parts, large."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A surface in its own frame S [m]."""

    mesh: trimesh.Trimesh

    @cached_property
    def drake_mesh(self) -> Mesh:
        """The surface with normals, as the renderer reads it."""
        file = MemoryFile(obj_text(self.mesh, normals=True), ".obj", "shape")
        return Mesh(InMemoryMesh(mesh_file=file))


@dataclass(frozen=True, eq=False)
class Body:
    """A shape and its pose in the world W of a picture."""

    shape: Shape
    X_WS: RigidTransform = RigidTransform()

    @cached_property
    def vertices(self) -> np.ndarray:
        """(n, 3) corners in W [m]."""
        return self.X_WS.multiply(np.array(self.shape.mesh.vertices, float).T).T

    @cached_property
    def bounds(self) -> np.ndarray:
        """(2, 3) lower and upper corner of the bounding box in W [m]."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def moved(self, by: np.ndarray) -> Body:
        """Return the body, translated by a vector (3,) of W [m]."""
        return Body(self.shape, RigidTransform(by) @ self.X_WS)


@dataclass(frozen=True, eq=False)
class DrawnProduct:
    """A product with the shapes that its pictures show.

    Attributes:
        product: Its parts, groups and names.
        shapes: By part; S is the product frame A, with the part in its assembled pose.
    """

    product: Product
    shapes: Mapping[str, Shape]

    @staticmethod
    def of(product: Product, solids: Mapping[str, Solid] | None = None) -> DrawnProduct:
        """Simplify all parts to what a picture of the whole product, or of one part, shows.

        Args:
            product: What is drawn.
            solids: Its parts in the product frame, if they have been built already.
        """
        solids = solids_of(product) if solids is None else solids
        corners = np.array([(solid.lower, solid.upper) for solid in solids.values()])
        size = corners[:, 1].max(axis=0) - corners[:, 0].min(axis=0)
        deviation = SHOWN * float(np.linalg.norm(size))
        shapes = {name: Shape(_simplified(solid, deviation)) for name, solid in solids.items()}
        return DrawnProduct(product, shapes)


def _simplified(solid: Solid, deviation: float) -> trimesh.Trimesh:
    """Return a part in its assembled pose, its surface moved by less than a deviation [m]."""
    deviation = min(deviation, SHOWN_ALONE * float(np.max(solid.upper - solid.lower)))
    with suppress(BadPart):  # A surface that only the renderer can use is drawn as it is.
        solid = solid.simplified(deviation)
    return trimesh.Trimesh(solid.vertices, solid.faces, process=False)


def box(bodies: Iterable[Body]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper corner (3,) of the common bounding box in W [m]."""
    bounds = np.array([body.bounds for body in bodies])
    return bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
