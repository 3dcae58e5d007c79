"""Messages as Foxglove reads them: schemas and values of JSON, from plain numbers.

Foxglove tells what a message is by the name of its schema. The schemas are written after the public
documentation of its message types [R]: https://docs.foxglove.dev/docs/sdk/schemas.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

Schema = dict[str, Any]
Value = dict[str, Any]

NUMBER: Schema = {"type": "number"}
TEXT: Schema = {"type": "string"}
FLAG: Schema = {"type": "boolean"}
WHOLE: Schema = {"type": "integer"}


def record(title: str | None = None, **fields: Schema) -> Schema:
    """Return the schema of an object with these fields."""
    schema: Schema = {"type": "object", "properties": fields}
    return schema if title is None else {"title": title, **schema}


def several(item: Schema) -> Schema:
    """Return the schema of an array."""
    return {"type": "array", "items": item}


STAMP = record("time", sec=WHOLE, nsec=WHOLE)
SPAN = record("duration", sec=WHOLE, nsec=WHOLE)
XYZ = record(x=NUMBER, y=NUMBER, z=NUMBER)
XYZW = record(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = record("foxglove.Pose", position=XYZ, orientation=XYZW)
COLOR = record("foxglove.Color", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
SOLID = {"pose": POSE, "size": XYZ, "color": COLOR}
ENTITY = record(
    "foxglove.SceneEntity",
    timestamp=STAMP,
    frame_id=TEXT,
    id=TEXT,
    lifetime=SPAN,
    frame_locked=FLAG,
    metadata=several(record("foxglove.KeyValuePair", key=TEXT, value=TEXT)),
    arrows=several(record("foxglove.ArrowPrimitive")),
    cubes=several(record("foxglove.CubePrimitive", **SOLID)),
    spheres=several(record("foxglove.SpherePrimitive", **SOLID)),
    cylinders=several(
        record("foxglove.CylinderPrimitive", bottom_scale=NUMBER, top_scale=NUMBER, **SOLID)
    ),
    lines=several(record("foxglove.LinePrimitive")),
    triangles=several(
        record(
            "foxglove.TriangleListPrimitive",
            pose=POSE,
            points=several(XYZ),
            color=COLOR,
            colors=several(COLOR),
            indices=several(WHOLE),
        )
    ),
    texts=several(record("foxglove.TextPrimitive")),
    models=several(record("foxglove.ModelPrimitive")),
)
DELETION = record("foxglove.SceneEntityDeletion", timestamp=STAMP, type=WHOLE, id=TEXT)
TRANSFORM = record(
    "foxglove.FrameTransform",
    timestamp=STAMP,
    parent_frame_id=TEXT,
    child_frame_id=TEXT,
    translation=XYZ,
    rotation=XYZW,
)
JOINT = record("foxglove.JointState", name=TEXT, position=NUMBER, velocity=NUMBER)
KNOWN = {  # By their names in Foxglove.
    "foxglove.FrameTransforms": record(transforms=several(TRANSFORM)),
    "foxglove.SceneUpdate": record(deletions=several(DELETION), entities=several(ENTITY)),
    "foxglove.JointStates": record(timestamp=STAMP, joints=several(JOINT)),
    "foxglove.Log": record(
        timestamp=STAMP, level=WHOLE, message=TEXT, name=TEXT, file=TEXT, line=WHOLE
    ),
}
# What Foxglove has no type for; it plots every number in it.
WRENCH = record(timestamp=STAMP, frame_id=TEXT, force=XYZ, torque=XYZ)
INFO = 2  # Level of a log message.


def readings(names: Sequence[str]) -> Schema:
    """Return the schema of named numbers."""
    return record(None, timestamp=STAMP, **dict.fromkeys(names, NUMBER))


def stamp(time: float) -> Value:
    """Return a time [s] from the start of the run."""
    nanoseconds = round(time * 1e9)
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def xyz(vector: np.ndarray) -> Value:
    """Return a vector (3,)."""
    return dict(zip("xyz", np.asarray(vector, dtype=float).tolist(), strict=True))


def xyzw(X: RigidTransform) -> Value:
    """Return the rotation of a pose as a quaternion."""
    quaternion = X.rotation().ToQuaternion()
    return xyz(quaternion.xyz()) | {"w": float(quaternion.w())}


def pose(X: RigidTransform) -> Value:
    """Return a pose."""
    return {"position": xyz(X.translation()), "orientation": xyzw(X)}


def transform(time: float, child: str, X: RigidTransform) -> Value:
    """Return the pose of a frame in the world."""
    return {
        "timestamp": stamp(time),
        "parent_frame_id": "world",
        "child_frame_id": child,
        "translation": xyz(X.translation()),
        "rotation": xyzw(X),
    }


def color(rgba: Sequence[float]) -> Value:
    """Return a colour; each share from 0 to 1."""
    return dict(zip("rgba", map(float, rgba), strict=True))


def solid(X: RigidTransform, size: Sequence[float], rgba: Sequence[float]) -> Value:
    """Return a box, sphere or cylinder by its pose and its extent [m]."""
    return {"pose": pose(X), "size": xyz(np.array(size)), "color": color(rgba)}


def triangles(
    X: RigidTransform, points: np.ndarray, faces: np.ndarray, rgba: Sequence[float]
) -> Value:
    """Return a surface.

    Args:
        X: Its pose.
        points: (n, 3) [m].
        faces: (m, 3) indices.
        rgba: Its colour.
    """
    return {
        "pose": pose(X),
        "points": [xyz(point) for point in np.round(points, 6)],
        "color": color(rgba),
        "colors": [],
        "indices": faces.ravel().tolist(),
    }


def entity(time: float, name: str, frame: str, shapes: Mapping[str, Sequence[Value]]) -> Value:
    """Return something visible that moves with a frame.

    Args:
        time: From which it is there [s].
        name: What comes later with the same one replaces it.
        frame: That it moves with.
        shapes: Kind ("cubes", "triangles" ...) -> primitives.
    """
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": stamp(time),
        "frame_id": frame,
        "id": name,
        "lifetime": stamp(0.0),
        "frame_locked": True,
        "metadata": [],
        **{kind: list(shapes.get(kind, ())) for kind in kinds},
    }
