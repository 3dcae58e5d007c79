"""The bed's two geometries in Drake, the contact mesh and the membrane, and what may touch them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context

from cell.soft_jig.bed import Bed
from cell.soft_jig.columns import TetMesh
from cell.soft_jig.drake_values import JigError, drake_shape, hull_vertices
from cell.soft_jig.visual import membrane_shape

Array = NDArray[np.float64]

# Collision geometries whose name starts like this touch the frozen bed; all others of the same
# body do not.
BED_PREFIX = "bed_"
MEMBRANE = "soft_jig_membrane"  # Name of the visible surface.
SILICONE_COLOR = (0.85, 0.75, 0.55, 1.0)


class BedGeometry:
    """Geometry of the bed on its base body.

    Args:
        plant: Not finalized yet.
        scene_graph: The plant's scene graph.
        base: The jig's base.
        X_BJ: Pose of the jig frame J in the base.
        bed: What is seen at first.
        contact: Mesh and properties of what is touched at first.

    Attributes:
        contact_id: Of the geometry that is touched.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        base: RigidBody,
        X_BJ: RigidTransform,
        bed: Bed,
        contact: tuple[TetMesh, ProximityProperties],
    ) -> None:
        mesh, properties = contact
        self.contact_id = plant.RegisterCollisionGeometry(
            base, X_BJ, drake_shape(mesh), "soft_jig_bed", properties
        )
        color = np.array(SILICONE_COLOR)
        self._visual_id = plant.RegisterVisualGeometry(
            base, X_BJ, membrane_shape(bed), MEMBRANE, color
        )
        self._plant, self._scene_graph, self._base = plant, scene_graph, base

    def replace(
        self,
        root_context: Context,
        mesh: TetMesh,
        properties: ProximityProperties,
        pressing: Iterable[RigidBody],
        frozen: bool,
    ) -> None:
        """Replace what is touched, in the Context.

        Args:
            root_context: Of the diagram.
            mesh: The new contact mesh.
            properties: Its contact properties.
            pressing: Bodies that the soft bed carries by forces.
            frozen: Whether bodies touch the mesh with their `bed_*` geometries.
        """
        context = self._scene_graph.GetMyMutableContextFromRoot(root_context)
        graph, source = self._scene_graph, self._plant.get_source_id()
        # Removing the role first saves Drake from rebuilding the hydroelastic body twice.
        graph.RemoveRole(context, source, self.contact_id, Role.kProximity)
        graph.ChangeShape(context, source, self.contact_id, drake_shape(mesh))
        graph.AssignRole(context, source, self.contact_id, properties)
        # A swap forgets the bed's collision filters.
        others = GeometrySet(self._own() + self._untouched(pressing, frozen))
        declaration = CollisionFilterDeclaration().ExcludeBetween(
            GeometrySet(self.contact_id), others
        )
        graph.collision_filter_manager(context).Apply(declaration)

    def draw(self, root_context: Context, bed: Bed) -> None:
        """Show the bed's surface as it is."""
        context = self._scene_graph.GetMyMutableContextFromRoot(root_context)
        source = self._plant.get_source_id()
        self._scene_graph.ChangeShape(context, source, self._visual_id, membrane_shape(bed))

    def check_can_hold(self, body: RigidBody) -> None:
        """Raise `JigError` for a body that has nothing for the frozen bed to hold."""
        if not self._touching(body):
            raise JigError(
                f"'{body.scoped_name().get_full()}' cannot be held by the jig: "
                f"none of its collision geometries is named '{BED_PREFIX}...'."
            )

    def hulls(self, body: RigidBody, X_JP: RigidTransform) -> list[Array]:
        """Return the corners (n, 3) in J of each of a body's `bed_*` geometries."""
        inspector = self._scene_graph.model_inspector()
        hulls = []
        for geometry in self._touching(body):
            vertices = hull_vertices(inspector.GetShape(geometry), self._name(geometry))
            X_JG = X_JP @ inspector.GetPoseInFrame(geometry)
            hulls.append((X_JG @ vertices.T).T)
        return hulls

    def _touching(self, body: RigidBody) -> list[GeometryId]:
        ids = self._plant.GetCollisionGeometriesForBody(body)
        return [geometry for geometry in ids if self._name(geometry).startswith(BED_PREFIX)]

    def _name(self, geometry: GeometryId) -> str:
        return self._scene_graph.model_inspector().GetName(geometry).split("::")[-1]

    def _own(self) -> list[GeometryId]:
        bodies = self._plant.GetBodiesWeldedTo(self._base)
        ids = [i for body in bodies for i in self._plant.GetCollisionGeometriesForBody(body)]
        return [i for i in ids if i != self.contact_id]

    def _untouched(self, pressing: Iterable[RigidBody], frozen: bool) -> list[GeometryId]:
        """Return parts' geometries that the bed must not touch: while soft, all of them."""
        carried = {body.index() for body in pressing}
        untouched = []
        for index in map(BodyIndex, range(self._plant.num_bodies())):
            body = self._plant.get_body(index)
            touching = self._touching(body)
            if touching or index in carried:
                ids = self._plant.GetCollisionGeometriesForBody(body)
                untouched += [i for i in ids if not (frozen and i in touching)]
        return untouched
