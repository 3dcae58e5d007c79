"""The loose parts of a product in the plant, and putting to sleep what nothing touches.

A sleeping part has zero velocity, a locked floating joint and no contact: it costs almost nothing.
The rule (measured: outcomes do not change): a part is awake while anything but its resting support
touches it or is commanded to.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, FilterId, GeometrySet, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import QuaternionFloatingJoint, RigidBody
from pydrake.systems.framework import Context

from cell.errors import UnknownName
from cell.paths import model_url, new_parser
from cell.products.product import Part, Product


@dataclass
class LoosePart:
    """One part of the product as a free body of the plant.

    Attributes:
        part: Its description.
        plant: The plant.
        scene_graph: Where its collision filter is set while it sleeps.
        body: The rigid body; its frame is the part frame P.
        joint: Six degrees of freedom in W.
        sleep_filter: The filter that is active while it sleeps; None while it is awake.
    """

    part: Part
    plant: MultibodyPlant
    scene_graph: SceneGraph
    body: RigidBody
    joint: QuaternionFloatingJoint
    sleep_filter: FilterId | None = None

    @property
    def asleep(self) -> bool:
        """Return whether the part sleeps."""
        return self.sleep_filter is not None

    def X_WP(self, context: Context) -> RigidTransform:
        """Return the true pose of the part (plant context)."""
        return self.plant.EvalBodyPoseInWorld(context, self.body)

    def velocity(self, context: Context) -> np.ndarray:
        """Return the spatial velocity (6,) in W, angular first."""
        return self.plant.EvalBodySpatialVelocityInWorld(context, self.body).get_coeffs()

    def kinetic_energy(self, context: Context) -> float:
        """Return the kinetic energy [J]."""
        V_WP = self.plant.EvalBodySpatialVelocityInWorld(context, self.body)
        M = self.body.CalcSpatialInertiaInBodyFrame(context).ReExpress(
            self.X_WP(context).rotation()
        )
        return 0.5 * float(V_WP.get_coeffs() @ M.CopyToFullMatrix6() @ V_WP.get_coeffs())

    def sleep(self, root: Context) -> None:
        """Freeze the part where it is."""
        if self.asleep:
            return
        context = self.plant.GetMyMutableContextFromRoot(root)
        self.plant.SetVelocities(context, self._with_zero_velocity(context))
        self.joint.Lock(context)
        self.hide(root)

    def wake(self, root: Context) -> None:
        """Let the part move again, from rest."""
        if self.asleep:
            self.show(root)
            self.joint.Unlock(self.plant.GetMyMutableContextFromRoot(root))

    def reset(self, root: Context) -> None:
        """Sleep in a Context where nothing is known of this part yet, or where it sleeps."""
        self.show(root)
        self.sleep(root)

    def hide(self, root: Context) -> None:
        """Filter every contact of the part."""
        geometries = GeometrySet(self.plant.GetCollisionGeometriesForBody(self.body))
        inspector = self.scene_graph.model_inspector()
        everything = GeometrySet(inspector.GetAllGeometryIds(Role.kProximity))
        self.sleep_filter = self._filters(root).ApplyTransient(
            CollisionFilterDeclaration().ExcludeBetween(geometries, everything)
        )

    def show(self, root: Context) -> None:
        """Take the filter off again."""
        if self.sleep_filter is not None:
            self._filters(root).RemoveDeclaration(self.sleep_filter)
            self.sleep_filter = None

    def _filters(self, root: Context):
        context = self.scene_graph.GetMyMutableContextFromRoot(root)
        return self.scene_graph.collision_filter_manager(context)

    def _with_zero_velocity(self, context: Context) -> np.ndarray:
        v = self.plant.GetVelocities(context).copy()
        start = self.joint.velocity_start()
        v[start : start + 6] = 0.0
        return v


@dataclass(frozen=True)
class Parts:
    """All loose parts of a product, by name."""

    by_name: Mapping[str, LoosePart] = field(default_factory=dict)

    def __getitem__(self, name: str) -> LoosePart:
        if name not in self.by_name:
            raise UnknownName("part in the cell", name, self.by_name)
        return self.by_name[name]

    def __iter__(self) -> Iterator[LoosePart]:
        return iter(self.by_name.values())

    @contextmanager
    def filters_lifted(self, root: Context) -> Iterator[None]:
        """Lift the filters of sleeping parts.

        Drake forbids lasting changes of geometry roles and filters while passing ones are active.
        """
        asleep = [part for part in self if part.asleep]
        for part in asleep:
            part.show(root)
        try:
            yield
        finally:
            for part in asleep:
                part.hide(root)

    def reset(self, root: Context) -> None:
        """Let every part sleep, in a new Context too."""
        for part in self:
            part.reset(root)

    def sleep_all_but(self, root: Context, awake: Iterable[str]) -> None:
        """Wake the named parts and let every other one sleep."""
        names = {self[name].part.name for name in awake}
        for name, part in self.by_name.items():
            if name in names:
                part.wake(root)
            else:
                part.sleep(root)


def add_parts(
    plant: MultibodyPlant, scene_graph: SceneGraph, product: Product, X_WT: RigidTransform
) -> Parts:
    """Add every part that has a model, at its pose in the tray T.

    Args:
        plant: Not finalized yet.
        scene_graph: Where collision filters are set.
        product: Its parts; those without a model are left out.
        X_WT: Pose of the tray.
    """
    parts = {}
    for part in product.parts.values():
        if part.model is not None and part.X_TrayP is not None:
            (instance,) = new_parser(plant).AddModelsFromUrl(model_url(part.model))
            plant.RenameModelInstance(instance, part.name)
            body = plant.get_body(plant.GetBodyIndices(instance)[0])
            joint = plant.AddJoint(
                QuaternionFloatingJoint(f"{part.name}_free", plant.world_frame(), body.body_frame())
            )
            X_WP = X_WT @ part.X_TrayP
            joint.SetDefaultPose(X_WP)
            parts[part.name] = LoosePart(part, plant, scene_graph, body, joint)
    return Parts(parts)
