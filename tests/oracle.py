"""An independent answer to "does i, moved along +axis, hit k?": sweep i as a solid and intersect.

The sweep is the union of i with a prism over each of its up-faces, and the intersection with k is
taken by manifold3d's booleans. It shares no code with ``planning.feasibility.interference`` and is
100 times slower. The tolerance means the same in both: i starts that much further along, and the
part of k that it sweeps must be wide enough, seen along the axis, for a disc of that radius.
"""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold, OpType

FAR = 500.0  # [mm] Longer than any scene of the tests.
TURN = {
    0: (0.0, -90.0, 0.0),
    1: (90.0, 0.0, 0.0),
    2: (0.0, 0.0, 0.0),
}  # [deg] Brings the axis to z, up or down.


def sweep(shape: Manifold, axis: int) -> Manifold:
    """Return all that a shape passes through on its way along +axis."""
    travel = FAR * np.eye(3)[axis]
    mesh = shape.to_mesh64()
    triangles = np.array(mesh.vert_properties)[:, :3][np.array(mesh.tri_verts)]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    # Walls (|n| within rounding of 0) sweep no volume of their own.
    ahead = normals[:, axis] > 1e-9 * np.linalg.norm(normals, axis=1)
    prisms = [Manifold.hull_points(np.vstack([t, t + travel])) for t in triangles[ahead]]
    return Manifold.batch_boolean([shape, *prisms], OpType.Add)


def is_blocked(moving: Manifold, staying: Manifold, axis: int, tolerance: float) -> bool:
    """Say whether one shape moved along +axis hits the other; lengths in millimetres."""
    start = moving.translate(list(tolerance * np.eye(3)[axis]))
    common = sweep(start, axis) ^ staying
    if common.volume() < tolerance**3:
        return False
    shadow: CrossSection = common.rotate(TURN[axis]).project()
    return not shadow.offset(-tolerance, JoinType.Round).is_empty()
