"""Bodies that sleep: locked where they are and without contact, they cost almost nothing.

A sleeping body still weighs on what bears it. The contact force that it exerted on the jig's base
or on the force plate in its last step goes on as a constant external force, so that the force
plate reads the same whether a part sleeps or not. Whether a body sleeps is read from the Context:
its joint is locked.

The rule of the cell's own runs (measured: outcomes do not change): a part is awake while anything
but its resting support touches it or is commanded to.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet, SceneGraph
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, LeafSystem

from cell.bodies import body_of, full_name
from cell.contact.links import ContactLinks
from cell.forces import applied_force, forces_from_rows, forces_to_rows, no_forces

Forces = list[ExternallyAppliedSpatialForce]


@dataclass
class SleepMemory:
    """What is remembered of bodies that sleep, by their scoped names.

    Attributes:
        loads: Forces of each sleeping body on what bears it.
        latest: Forces of each body that was awake when a state was saved, at that time: Drake
            derives contact from the step that led there and has none after a restore.
        restored_at: Time for which ``latest`` holds [s].
    """

    loads: dict[str, Forces] = field(default_factory=dict)
    latest: dict[str, Forces] = field(default_factory=dict)
    restored_at: float = -inf


class Sleep(LeafSystem):
    """Puts free bodies to sleep, and lets them go on weighing on what bears them.

    Output port ``loads``: the forces that sleeping bodies exert on what bears them.

    Args:
        plant: The finalized plant.
        scene_graph: Its scene graph.
        bearers: Bodies whose load a sensor feels: the jig's base, the force plate.
        links: Contacts of the plant that springs stand for at times; None: there are none.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        bearers: Sequence[RigidBody],
        links: ContactLinks | None = None,
    ) -> None:
        super().__init__()
        self._plant, self._scene_graph = plant, scene_graph
        self._bearers, self._links = tuple(bearers), links
        joints = map(plant.get_joint, plant.GetJointIndices())
        self._joints = {int(joint.child_body().index()): joint for joint in joints}
        self._index = self.DeclareAbstractParameter(Value[object](SleepMemory()))
        self.DeclareAbstractOutputPort(
            "loads", no_forces, self._calc_loads, {self.all_parameters_ticket()}
        )

    def memory(self, root: Context) -> SleepMemory:
        """Return what is remembered in a Context of the diagram; not to be changed."""
        return self.GetMyContextFromRoot(root).get_abstract_parameter(self._index).get_value()

    def _changed(self, root: Context) -> SleepMemory:
        context = self.GetMyMutableContextFromRoot(root)
        return context.get_mutable_abstract_parameter(self._index).get_mutable_value()

    def _calc_loads(self, context: Context, output: AbstractValue) -> None:
        memory: SleepMemory = context.get_abstract_parameter(self._index).get_value()
        output.set_value([force for forces in memory.loads.values() for force in forces])

    def put_to_sleep(
        self, root: Context, body: RigidBody, apart_from: Sequence[RigidBody] = ()
    ) -> None:
        """Stop a free body where it is, lock it, and end its contacts.

        Args:
            root: Context of the diagram.
            body: Of the plant, free; one that sleeps stays as it is.
            apart_from: End its contacts with these bodies only; empty: all of its contacts.
        """
        context = self._plant.GetMyMutableContextFromRoot(root)
        if not body.is_locked(context):
            loads = self._load_of(root, body)
            self._changed(root).loads[full_name(body)] = loads
            self._plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity.Zero())
            self._joints[int(body.index())].Lock(context)
            self._set_contact(root, body, apart_from, active=False)
            if self._links is not None:
                self._links.pause(root, body, apart_from)

    def wake(self, root: Context, body: RigidBody, apart_from: Sequence[RigidBody] = ()) -> None:
        """Let a body move again, from rest; arguments as of `put_to_sleep`."""
        context = self._plant.GetMyMutableContextFromRoot(root)
        if body.is_locked(context):
            memory = self._changed(root)
            loads = memory.loads.pop(full_name(body), [])
            if root.get_time() == memory.restored_at:  # It may fall asleep again before any step.
                memory.latest[full_name(body)] = loads
            self._set_contact(root, body, apart_from, active=True)
            self._joints[int(body.index())].Unlock(context)
            if self._links is not None:
                self._links.resume(root, body, apart_from)

    def _set_contact(
        self, root: Context, body: RigidBody, apart_from: Sequence[RigidBody], *, active: bool
    ) -> None:
        context = self._scene_graph.GetMyMutableContextFromRoot(root)
        filters = self._scene_graph.collision_filter_manager(context)
        geometries = GeometrySet(self._plant.GetCollisionGeometriesForBody(body))
        if apart_from:
            others = [g for b in apart_from for g in self._plant.GetCollisionGeometriesForBody(b)]
            declaration = CollisionFilterDeclaration()
            declare = declaration.AllowBetween if active else declaration.ExcludeBetween
            filters.Apply(declare(geometries, GeometrySet(others)))
        elif active:
            filters.Activate(geometries)
        else:
            filters.Deactivate(geometries)

    def _load_of(self, root: Context, body: RigidBody) -> Forces:
        """Return the forces that a body exerted on the bearers in the latest step."""
        memory, name = self.memory(root), full_name(body)
        if root.get_time() == memory.restored_at:
            return memory.latest.get(name, [])
        return list(self._contact_forces(root, body))

    def _contact_forces(self, root: Context, body: RigidBody) -> Iterator[Any]:
        """Yield the contact forces of a body on the bearers."""
        context = self._plant.GetMyContextFromRoot(root)
        geometries = self._plant.GetCollisionGeometriesForBody
        own = set(geometries(body))
        bearers = [bearer for bearer in self._bearers if bearer.index() != body.index()]
        bearer_of = {geometry: bearer for bearer in bearers for geometry in geometries(bearer)}
        results = self._plant.get_contact_results_output_port().Eval(context)
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface = info.contact_surface()
            M, N = surface.id_M(), surface.id_N()
            bearer = bearer_of.get(N if M in own else M)
            if bearer is not None and (M in own or N in own):
                # Drake states the force on the body of geometry M, at the surface's centroid.
                F_W = -info.F_Ac_W() if M in own else info.F_Ac_W()
                X_BW = self._plant.EvalBodyPoseInWorld(context, bearer).inverse()
                yield applied_force(bearer.index(), X_BW @ surface.centroid(), F_W)
        bearer_indices = {bearer.index() for bearer in bearers}
        for other, wrench in () if self._links is None else self._links.wrenches(root, body):
            if other.index() in bearer_indices:
                X_BW = self._plant.EvalBodyPoseInWorld(context, other).inverse()
                F_W = SpatialForce(wrench[:3], wrench[3:])
                yield applied_force(other.index(), X_BW.translation(), F_W)

    # Saving.

    def wake_all(self, root: Context) -> None:
        """Wake every body that sleeps apart from all others; callers' own bodies among them."""
        for name in list(self.memory(root).loads):
            self.wake(root, body_of(self._plant, name))

    def save(self, root: Context, bodies: Sequence[RigidBody]) -> dict[str, Any]:
        """Return the loads of sleeping bodies, and those of the others in the latest step.

        Args:
            root: Context of the diagram.
            bodies: Of the cell; a caller's own are saved while they sleep.
        """
        names = {full_name(body): body for body in bodies}
        context = self._plant.GetMyContextFromRoot(root)
        asleep = {name: [] for name, body in names.items() if body.is_locked(context)}
        loads = asleep | self.memory(root).loads
        return {
            "loads": {name: forces_to_rows(forces) for name, forces in loads.items()},
            "latest": {
                name: forces_to_rows(self._load_of(root, body))
                for name, body in names.items()
                if name not in loads
            },
        }

    def restore(self, root: Context, state: Mapping[str, Any], time: float) -> None:
        """Return to saved loads; bodies that slept and are awake now fall asleep.

        Args:
            root: Context of the diagram.
            state: As `save` returned it.
            time: At which it was saved [s].
        """
        for name in state.get("loads", {}):
            self.put_to_sleep(root, body_of(self._plant, name))
        memory = self._changed(root)
        memory.restored_at = time
        for kept, name in ((memory.loads, "loads"), (memory.latest, "latest")):
            kept.clear()
            kept.update({k: forces_from_rows(rows) for k, rows in state.get(name, {}).items()})
