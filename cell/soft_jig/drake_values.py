"""What the soft jig hands to Drake and reads from it: shapes, contact properties, forces, hulls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    Convex,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
)
from pydrake.math import RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import CoulombFriction, ExternallyAppliedSpatialForce
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from cell.errors import CellError
from cell.soft_jig.columns import TetMesh
from cell.soft_jig.parameters import JigParameters

Array = NDArray[np.float64]


class JigError(CellError):
    """The soft jig was given something that it cannot hold."""


def drake_shape(mesh: TetMesh) -> Mesh:
    """Return the contact mesh as a Drake shape."""
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(mesh.vtk(), ".vtk", "soft_jig_bed")))


def drake_proximity(mesh: TetMesh, params: JigParameters, gradient: float) -> ProximityProperties:
    """Return properties with the modulus that makes Drake's pressure field have this gradient."""
    jammed = params.jammed
    properties = ProximityProperties()
    # The resolution hint is not used for meshes that are given as such.
    AddCompliantHydroelasticProperties(jammed.layer, gradient * mesh.largest_depth(), properties)
    friction = CoulombFriction(jammed.friction, jammed.friction)
    AddContactMaterial(dissipation=jammed.dissipation, friction=friction, properties=properties)
    return properties


def applied_force(
    body: RigidBody, p_BoBq_B: Array, F_Bq_W: SpatialForce
) -> ExternallyAppliedSpatialForce:
    """Return a force on a body at its point Bq, as the plant's input port takes it."""
    applied = ExternallyAppliedSpatialForce()
    applied.body_index = body.index()
    applied.p_BoBq_B = p_BoBq_B
    applied.F_Bq_W = F_Bq_W
    return applied


def force_row(applied: ExternallyAppliedSpatialForce) -> Array:
    """Return body index, p_BoBq_B, torque and force in one row (10,)."""
    F_Bq_W = applied.F_Bq_W
    return np.concatenate(
        [
            [float(int(applied.body_index))],
            applied.p_BoBq_B,
            F_Bq_W.rotational(),
            F_Bq_W.translational(),
        ]
    )


def hull_vertices(shape: Box | Convex | Mesh, name: str) -> Array:
    """Return the corners (n, 3) of a shape in its geometry frame."""
    if isinstance(shape, Box):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return signs * shape.size() / 2
    if isinstance(shape, Convex | Mesh):
        hull = shape.GetConvexHull()
        return np.array([hull.vertex(i) for i in range(hull.num_vertices())])
    kind = type(shape).__name__
    raise JigError(f"Collision '{name}' is a {kind}; the bed conforms to: Box, Convex, Mesh.")


def lean_of(R_JP: RotationMatrix) -> Array:
    """Return the horizontal shift per height of the part axis that is nearest to upright."""
    axes = R_JP.matrix()
    up = axes[:, np.argmax(np.abs(axes[2]))]
    return up[:2] / up[2]


def inertia_in_jig(context: Context, body: RigidBody, X_JP: tuple[Array, Array]) -> Array:
    """Return the spatial inertia (6, 6) of a part about its origin in J, angular part first."""
    M_P = body.CalcSpatialInertiaInBodyFrame(context)
    return M_P.ReExpress(RotationMatrix(X_JP[0])).CopyToFullMatrix6()
