"""What links do in a plant: read a contact, put springs in its place, take its geometry out.

The springs are distance constraints, which Drake adds before a plant is finalized only. A stock of
them is added then, switched off; which bodies they join is set when they are used.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    DistanceConstraintParams,
    HydroelasticContactInfo,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    BodyIndex,
    JacobianWrtVariable,
    MultibodyConstraintId,
    RigidBody,
)
from pydrake.systems.framework import Context

from cell.bodies import body_of, full_name
from cell.contact.link import Link
from cell.contact.polygons import Polygons
from cell.contact.springs import LENGTH, Springs

Array = NDArray[np.float64]
Pair = tuple[int, int]  # Numbers of two bodies A and B, the smaller one first.

SPRINGS = 6  # Of a link.
DAMPING_TIME = 1e-3  # Damping over stiffness of the springs [s] [A].
# Drake softens constraints beyond a stiffness of 4 pi^2 / (beta^2 dt (dt + tau) w), w being the
# mobility along them and beta = 0.1, and then loses their free lengths. They are kept below this
# share of it (measured: a preload of 872 N survives at 0.4, halves at 1).
NEAR_RIGID, RIGID_SHARE = 0.1, 0.4


class PlantSide:
    """Contacts and springs in the Contexts of one plant.

    Args:
        plant: Not finalized yet.
        scene_graph: The plant's.
        most: Links at a time.
        spare: Two bodies that springs without use join: a free one, and not the world, with which
            Drake 1.58 crashes; None if there are no springs.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        most: int,
        spare: tuple[RigidBody, RigidBody] | None,
    ) -> None:
        self.plant, self.scene_graph = plant, scene_graph
        self._constraints: list[MultibodyConstraintId] = []
        if spare is not None:
            first, second = spare
            # Too soft to matter: a new Context has them switched on.
            self._constraints = [
                plant.AddDistanceConstraint(
                    first, np.zeros(3), second, np.zeros(3), LENGTH, stiffness=1e-9, damping=0.0
                )
                for _ in range(SPRINGS * most)
            ]

    # Bodies.

    def bodies(self, pair: Pair) -> tuple[RigidBody, RigidBody]:
        """Return the bodies A and B of a pair."""
        A, B = (self.plant.get_body(BodyIndex(index)) for index in pair)
        return A, B

    def poses(self, context: Context, pair: Pair) -> tuple[RigidTransform, RigidTransform]:
        """Return X_WA and X_WB."""
        A, B = (self.plant.EvalBodyPoseInWorld(context, body) for body in self.bodies(pair))
        return A, B

    def name(self, pair: Pair) -> str:
        """Return the name under which a pair is saved."""
        return "|".join(full_name(body) for body in self.bodies(pair))

    def pair(self, name: str) -> Pair:
        """Undo `name`."""
        a, b = (int(body_of(self.plant, body).index()) for body in name.split("|"))
        return a, b

    def _body_of(self, geometry: GeometryId) -> int:
        frame = self.scene_graph.model_inspector().GetFrameId(geometry)
        return int(self.plant.GetBodyFromFrameId(frame).index())

    # Contacts.

    def contacts(self, context: Context) -> dict[Pair, list[HydroelasticContactInfo]]:
        """Return the contacts of the latest step by pair of bodies."""
        results = self.plant.get_contact_results_output_port().Eval(context)
        found: dict[Pair, list[HydroelasticContactInfo]] = {}
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface = info.contact_surface()
            M, N = self._body_of(surface.id_M()), self._body_of(surface.id_N())
            found.setdefault((min(M, N), max(M, N)), []).append(info)
        return found

    def read(
        self, pair: Pair, contacts: Sequence[HydroelasticContactInfo]
    ) -> tuple[Polygons, Array]:
        """Return the polygons of the contacts of a pair, and the wrench (6,) on A about Wo."""
        parts, wrench = [], np.zeros(6)
        for info in contacts:
            surface = info.contact_surface()
            A_is_M = self._body_of(surface.id_M()) == pair[0]
            mu = [self._friction(i) for i in (surface.id_M(), surface.id_N())]
            # As Drake combines them.
            friction = 2 * mu[0] * mu[1] / sum(mu) if sum(mu) > 0 else 0.0
            parts.append(Polygons.of(surface, A_is_M=A_is_M, friction=friction))
            # Drake states the force on the body of geometry M, at the surface's centroid.
            F_W = info.F_Ac_W().Shift(-surface.centroid()).get_coeffs()
            wrench += F_W if A_is_M else -F_W
        return Polygons.together(parts), wrench

    def _friction(self, geometry: GeometryId) -> float:
        properties = self.scene_graph.model_inspector().GetProximityProperties(geometry)
        return properties.GetProperty("material", "coulomb_friction").static_friction()

    def touching(self, root: Context, pair: Pair) -> Array:
        """Return which geometries of A and of B are not filtered, as rows (k, 2) of numbers."""
        context = self.scene_graph.GetMyContextFromRoot(root)
        inspector = self.scene_graph.get_query_output_port().Eval(context).inspector()
        first, second = map(self.plant.GetCollisionGeometriesForBody, self.bodies(pair))
        rows = [
            (i, k)
            for i, a in enumerate(first)
            for k, b in enumerate(second)
            if not inspector.CollisionFiltered(a, b)
        ]
        return np.array(rows, dtype=float).reshape(-1, 2)

    def hide(self, root: Context, pair: Pair, rows: Array, *, hidden: bool) -> None:
        """Take pairs of geometries (`touching`) out of contact, or put them back."""
        context = self.scene_graph.GetMyMutableContextFromRoot(root)
        first, second = map(self.plant.GetCollisionGeometriesForBody, self.bodies(pair))
        declaration = CollisionFilterDeclaration()
        declare = declaration.ExcludeBetween if hidden else declaration.AllowBetween
        for i, k in rows.astype(int):
            declare(GeometrySet(first[i]), GeometrySet(second[k]))
        self.scene_graph.collision_filter_manager(context).Apply(declaration)

    # Springs.

    def free_slots(self, used: Iterator[int]) -> tuple[int, ...]:
        """Return the numbers of six springs that are not in use; fewer where there are none."""
        taken = set(used)
        free = (slot for slot in range(len(self._constraints)) if slot not in taken)
        return tuple(slot for slot, _ in zip(free, range(SPRINGS), strict=False))

    def switch(self, root: Context, slots: Sequence[int], *, on: bool) -> None:
        """Switch springs on or off."""
        context = self.plant.GetMyMutableContextFromRoot(root)
        for slot in slots:
            self.plant.SetConstraintActiveStatus(context, self._constraints[slot], on)

    def switch_all_off(self, root: Context) -> None:
        """Switch the springs of a new Context off: Drake has all of them on."""
        self.switch(root, range(len(self._constraints)), on=False)

    def set_springs(self, root: Context, pair: Pair, slots: Sequence[int], link: Link) -> None:
        """Let springs join two bodies as a link says."""
        A, B = self.bodies(pair)
        springs, stiffness = link.springs, link.installed_stiffness
        ends = springs.points - LENGTH * springs.directions
        p_AP = (link.X_WA.inverse() @ springs.points.T).T
        p_BQ = (link.X_WB.inverse() @ ends.T).T
        lengths, damping = LENGTH + link.preload / stiffness, stiffness * DAMPING_TIME
        context = self.plant.GetMyMutableContextFromRoot(root)
        rows = zip(slots, p_AP, p_BQ, lengths, stiffness, damping, strict=True)
        for slot, p_P, p_Q, length, k, d in rows:
            params = DistanceConstraintParams(A.index(), p_P, B.index(), p_Q, length, k, d)
            self.plant.SetDistanceConstraintParams(context, self._constraints[slot], params)

    def resolvable(self, context: Context, pair: Pair, springs: Springs, dt: float) -> float:
        """Return the share of the springs' stiffness that Drake's solver can resolve, up to 1."""
        world, kV = self.plant.world_frame(), JacobianWrtVariable.kV
        jacobians = []
        for body, X_WB in zip(self.bodies(pair), self.poses(context, pair), strict=True):
            p_BWo = X_WB.inverse().translation()
            jacobians.append(
                self.plant.CalcJacobianSpatialVelocity(
                    context, kV, body.body_frame(), p_BWo, world, world
                )
            )
        along = springs.lines @ (jacobians[0] - jacobians[1])
        mass = self.plant.CalcMassMatrix(context)
        mobility = np.einsum("ij,ji->i", along, np.linalg.solve(mass, along.T))
        rigid = 4 * np.pi**2 / (NEAR_RIGID**2 * dt * (dt + DAMPING_TIME))
        return min(1.0, float(RIGID_SHARE * rigid / np.max(springs.stiffness * mobility)))
