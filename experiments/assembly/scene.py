"""What is visible of a cell, as entities of a recording."""

from __future__ import annotations

from collections import defaultdict

from pydrake.geometry import (
    Box,
    Cylinder,
    GeometryId,
    Rgba,
    SceneGraphInspector,
    Sphere,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody

from cell.builder import Cell
from cell.fixtures.soft_jig import SoftJig
from cell.fixtures.soft_jig.bed_geometry import MEMBRANE, SILICONE_COLOR
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.fixtures.soft_jig.visual import membrane_mesh
from cell.shapes import shape_mesh
from experiments.assembly.foxglove import Value, entity, solid, triangles

GREY = Rgba(0.6, 0.6, 0.6, 1.0)  # Of what has no colour of its own.


def frame_of(body: RigidBody) -> str:
    """Return the name of a body's frame in a recording; the world's is "world"."""
    name = body.scoped_name().to_string()
    return "world" if name == "WorldModelInstance::world" else name


def bodies_of(plant: MultibodyPlant) -> list[RigidBody]:
    """Return all bodies of a plant."""
    return [plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())]


def scene(cell: Cell) -> list[Value]:
    """Return an entity per body that is seen; the bag of a soft jig apart, which changes."""
    inspector, entities = cell.scene_graph.model_inspector(), []
    for body in bodies_of(cell.plant):
        shapes: dict[str, list[Value]] = defaultdict(list)
        for geometry in cell.plant.GetVisualGeometriesForBody(body):
            if inspector.GetName(geometry).split("::")[-1] != MEMBRANE:
                kind, value = _primitive(inspector, geometry)
                shapes[kind].append(value)
        if shapes:
            entities.append(entity(0.0, frame_of(body), frame_of(body), shapes))
    return entities


def bag(jig: SoftJig, time: float, bed: Bed) -> Value:
    """Return the surface of a jig from a time on [s]."""
    points, faces = membrane_mesh(bed)
    surface = triangles(jig.X_BJ, points, faces, SILICONE_COLOR)
    return entity(time, MEMBRANE, frame_of(jig.base), {"triangles": [surface]})


def _primitive(inspector: SceneGraphInspector, geometry: GeometryId) -> tuple[str, Value]:
    """Return the kind of a primitive and the primitive."""
    X, shape = inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry)
    tint, properties = GREY, inspector.GetIllustrationProperties(geometry)
    if properties is not None and properties.HasProperty("phong", "diffuse"):
        tint = properties.GetProperty("phong", "diffuse")
    rgba = (tint.r(), tint.g(), tint.b(), tint.a())
    if isinstance(shape, Box):
        return "cubes", solid(X, shape.size(), rgba)
    if isinstance(shape, Sphere):
        return "spheres", solid(X, [2 * shape.radius()] * 3, rgba)
    if isinstance(shape, Cylinder):
        width = 2 * shape.radius()
        scales = {"bottom_scale": 1.0, "top_scale": 1.0}
        return "cylinders", solid(X, [width, width, shape.length()], rgba) | scales
    mesh = shape_mesh(shape)
    return "triangles", triangles(X, mesh.vertices, mesh.faces, rgba)
