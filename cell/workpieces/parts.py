"""The loose parts of a product in the plant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import QuaternionFloatingJoint, RigidBody
from pydrake.systems.framework import Context

from cell.errors import BadPart, UnknownName
from cell.paths import model_url, new_parser
from cell.products.product import Part, Product
from cell.sleep import Sleep


@dataclass(frozen=True)
class LoosePart:
    """One part of the product as a free body of the plant.

    Attributes:
        part: Its description.
        plant: The plant.
        body: The rigid body; its frame is the part frame P.
        joint: Six degrees of freedom in W.
    """

    part: Part
    plant: MultibodyPlant
    body: RigidBody
    joint: QuaternionFloatingJoint

    def asleep(self, root: Context) -> bool:
        """Return whether the part sleeps."""
        return self.body.is_locked(self.plant.GetMyContextFromRoot(root))

    def X_WP(self, context: Context) -> RigidTransform:
        """Return the true pose of the part (plant context)."""
        return self.plant.EvalBodyPoseInWorld(context, self.body)

    def velocity(self, context: Context) -> np.ndarray:
        """Return the spatial velocity (6,) in W, angular first."""
        return self.plant.EvalBodySpatialVelocityInWorld(context, self.body).get_coeffs()


@dataclass(frozen=True)
class Parts:
    """All loose parts of a product, by name.

    Attributes:
        by_name: The parts.
        sleeper: Puts them to sleep; None until the cell is complete.
    """

    by_name: Mapping[str, LoosePart] = field(default_factory=dict)
    sleeper: Sleep | None = None

    def __getitem__(self, name: str) -> LoosePart:
        if name not in self.by_name:
            raise UnknownName("part in the cell", name, self.by_name)
        return self.by_name[name]

    def __iter__(self) -> Iterator[LoosePart]:
        return iter(self.by_name.values())

    def sleep(self, root: Context, name: str) -> None:
        """Freeze a part where it is."""
        assert self.sleeper is not None
        self.sleeper.put_to_sleep(root, self[name].body)

    def wake(self, root: Context, name: str) -> None:
        """Let a part move again, from rest."""
        assert self.sleeper is not None
        self.sleeper.wake(root, self[name].body)

    def sleep_all_but(self, root: Context, awake: Iterable[str]) -> None:
        """Wake the named parts and let every other one sleep."""
        names = {self[name].part.name for name in awake}
        for name in self.by_name:
            (self.wake if name in names else self.sleep)(root, name)


def add_parts(plant: MultibodyPlant, product: Product, X_WT: RigidTransform) -> Parts:
    """Add every part that has a model, at its pose in the tray T.

    Args:
        plant: Not finalized yet.
        product: Its parts; those without a model are left out.
        X_WT: Pose of the tray.
    """
    parts = {}
    for part in product.parts.values():
        if part.model is not None and part.X_TrayP is not None:
            (instance,) = new_parser(plant, part.model).AddModelsFromUrl(model_url(part.model))
            taken = plant.GetModelInstanceName(instance) != part.name
            if taken and plant.HasModelInstanceNamed(part.name):
                raise BadPart(part.name, "something else in the cell has this name")
            plant.RenameModelInstance(instance, part.name)
            body = plant.get_body(plant.GetBodyIndices(instance)[0])
            joint = plant.AddJoint(
                QuaternionFloatingJoint(f"{part.name}_free", plant.world_frame(), body.body_frame())
            )
            X_WP = X_WT @ part.X_TrayP
            joint.SetDefaultPose(X_WP)
            parts[part.name] = LoosePart(part, plant, body, joint)
    return Parts(parts)
