"""Names under which bodies of a plant are remembered, in a Context or in a saved state."""

from __future__ import annotations

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody


def full_name(body: RigidBody) -> str:
    """Return the name of a body with its model instance: "instance::body"."""
    return body.scoped_name().get_full()


def body_of(plant: MultibodyPlant, name: str) -> RigidBody:
    """Undo `full_name`; the name of the instance may have scopes itself."""
    instance, _, body = name.rpartition("::")
    return plant.GetBodyByName(body, plant.GetModelInstanceByName(instance))
