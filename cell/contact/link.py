"""A linked contact: what its springs stand for, and whether they still do.

The springs know the six relative displacements only. From these follows what every polygon would
carry in full contact, and with it whether the contact would still stick: no polygon may have to
pull, stick beyond friction, or press harder than the bed can bear, and the displacement must be so
small that the polygons are still the same.

Sticking is a question of statics: the contact sticks if *some* distribution of tangential forces,
each within its friction cone, balances the load (the lower bound theorem of plasticity). The
elastic distribution is tried first; what exceeds its cones is then passed on to polygons that have
reserves. A patch is thus given up where all of it slides, not where its first edge does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from cell.contact.polygons import Polygons
from cell.contact.springs import TANGENTIAL, Springs, line_wrenches
from cell.vectors import cross, exact_pose

Array = NDArray[np.float64]

# Polygons may pull with this share of the normal force, and friction be exceeded by this share of
# what it could bear, before the springs count as wrong: half of the 2 % within which a link shall
# let go at the load at which full contact does [A].
TOLERANCE = 0.01
# Polygons are the same ones while bodies move by less [m]: a fifth of the clearance of a tight fit,
# and of the depth of a frozen bed's contact [A].
FAR = 5e-5
# A contact would stick with this share to spare when it is linked.
SPARE = 5 * TOLERANCE
# A contact is not checked again before its force has changed by this share of the normal one [A].
NEGLIGIBLE = 0.002
# Tries to find friction that balances the load; a patch near its limit takes most [A].
REDISTRIBUTIONS = 12
SPRING_FIELDS = tuple(Springs.__dataclass_fields__)


@dataclass
class Link:
    """The springs between two bodies A and B, and the contact that they stand for.

    Attributes:
        X_WA, X_WB: Poses of the bodies when they were linked.
        springs: With the stiffness of the contact, at those poses.
        softening: Stiffness of the installed springs over that: what Drake's solver can resolve.
        preload: (6,) forces of the installed springs at those poses [N].
        polygons: The contact at those poses.
        limits: (n,) pressure that the polygons can bear [Pa].
        tangential: (n, 3) friction on A at the polygons when they were linked, in W [N].
        checked: (6,) forces of the springs at the latest full check [N].
    """

    X_WA: RigidTransform
    X_WB: RigidTransform
    springs: Springs
    softening: float
    preload: Array
    polygons: Polygons
    limits: Array
    tangential: Array
    checked: Array

    @staticmethod
    def of(
        polygons: Polygons,
        wrench: Array,
        limits: Array,
        X_WA: RigidTransform,
        X_WB: RigidTransform,
    ) -> Link:
        """Return the link that replaces a contact.

        Args:
            polygons: Of the contact.
            wrench: (6,) that A feels from it, about the origin of W.
            limits: (n,) pressure that the polygons can bear [Pa].
            X_WA: Present pose of A.
            X_WB: Present pose of B.

        Raises:
            LinAlgError: The contact does not resist every displacement.
        """
        springs = Springs.of(polygons, wrench)
        normal = polygons.normals * (polygons.pressures * polygons.areas)[:, None]
        rest = wrench - line_wrenches(polygons.points, normal).sum(axis=0)
        forces = springs.forces
        link = Link(X_WA, X_WB, springs, 1.0, forces, polygons, limits, normal, forces)
        link.tangential = link._spread(rest, link._stick_stiffness())
        return link

    @property
    def normal_force(self) -> float:
        """Sum of the normal forces when the bodies were linked [N]."""
        return float(self.polygons.pressures @ self.polygons.areas)

    @property
    def installed_stiffness(self) -> Array:
        """Stiffness (6,) of the springs in the plant [N/m]."""
        return self.softening * self.springs.stiffness

    def admissible(self) -> bool:
        """Return whether the contact sticks as it is, with something to spare."""
        return self._overload(np.zeros_like(self.tangential), 1.0 - SPARE) is None

    def wrench(self, X_WA: RigidTransform, X_WB: RigidTransform) -> Array:
        """Return the wrench (6,) that A feels at poses of the bodies, about Wo."""
        return self.springs.lines.T @ self._forces(self.displacement(X_WA, X_WB))

    def jolted(self, displacement: Array) -> bool:
        """Return whether the load has changed so much since the latest check as to need another.

        A blow takes a contact from rest beyond its limits within a few steps, and springs that go
        on for longer pass all of it on: what they hold together is struck harder than it would be.
        """
        change = np.abs(self._forces(displacement) - self.checked).sum()
        return bool(change > SPARE * self.normal_force)

    def violation(self, displacement: Array) -> str | None:
        """Return why full contact has to come back at a `displacement`: None if it has not."""
        if np.max(np.sum(self._moved(displacement) ** 2, axis=1)) > FAR**2:
            return "displacement"
        forces = self._forces(displacement)
        if np.abs(forces - self.checked).sum() < NEGLIGIBLE * self.normal_force:
            return None
        self.checked = forces
        elongations = (self.springs.forces - forces) / self.springs.stiffness
        own = np.linalg.solve(self.springs.lines, elongations).astype(np.float64)
        return self._overload(self._moved(own))

    def relax(self, displacement: Array) -> bool:
        """Let the bodies return to where the contact itself would hold them under this load.

        The installed springs give way more than the contact does. Their preload is raised by what
        they lack, as multipliers are in the method of augmented Lagrangians (Hestenes 1969), so
        that they are soft against shocks and yet hold a lasting load as stiffly as the contact.

        Returns:
            Whether the preload has changed.
        """
        if self.softening == 1.0:
            return False
        forces = self._forces(displacement)
        elongations = (self.springs.forces - forces) / self.springs.stiffness
        preload = forces + self.installed_stiffness * elongations
        changed = np.abs(preload - self.preload).sum() > NEGLIGIBLE * self.normal_force
        if changed:
            self.preload = preload
        return bool(changed)

    def displacement(self, X_WA: RigidTransform, X_WB: RigidTransform) -> Array:
        """Return how A has moved relative to B (6,): rotation vector [rad], way of Wo [m].

        Small rotations only; in W as it was seen from B when they were linked.
        """
        moved = (self.X_WB @ X_WB.inverse() @ X_WA @ self.X_WA.inverse()).GetAsMatrix34()
        R, p = moved[:, :3], moved[:, 3]
        turn = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        return np.concatenate([turn, p])

    def _forces(self, displacement: Array) -> Array:
        """Return the forces (6,) of the installed springs at a relative displacement (6,)."""
        return self.preload - self.installed_stiffness * (self.springs.lines @ displacement)

    def _moved(self, displacement: Array) -> Array:
        """Return the ways (n, 3) of A at the polygons."""
        return displacement[3:] + cross(displacement[:3], self.polygons.points)

    def _overload(self, moved: Array, share: float = 1.0) -> str | None:
        """Return what the polygons cannot bear after ways (n, 3) of A [m], if anything.

        Args:
            moved: Of A at each polygon, as the contact itself would let it move.
            share: Of friction and strength that may be used.
        """
        polygons = self.polygons
        approach = -np.einsum("ij,ij->i", moved, polygons.normals)
        pressures = polygons.pressures + polygons.gradients * approach
        if (pressures > share * self.limits).any():
            return "yield"
        normal = pressures * polygons.areas
        if -np.minimum(normal, 0.0).sum() > TOLERANCE * self.normal_force:
            return "opening"
        cones = share * polygons.friction * np.maximum(normal, 0.0)
        along = moved + approach[:, None] * polygons.normals
        sticking = self.tangential - self._stick_stiffness()[:, None] * along
        return None if self._sticks(sticking, cones) else "friction"

    def _sticks(self, wanted: Array, cones: Array) -> bool:
        """Return whether forces within friction cones (n,) [N] balance what `wanted` (n, 3) do."""
        points = self.polygons.points
        centre, size = self._centre_and_size()
        allowed = TOLERANCE * cones.sum()
        demand = line_wrenches(points, wanted).sum(axis=0)
        forces = wanted
        for _ in range(REDISTRIBUTIONS):
            lengths = np.sqrt(np.sum(forces**2, axis=1))
            inside = forces * np.minimum(1.0, cones / np.maximum(lengths, 1e-12))[:, None]
            lost = demand - line_wrenches(points, inside).sum(axis=0)
            force, torque = lost[3:], lost[:3] - cross(centre, lost[3:])
            if np.linalg.norm(force) + np.linalg.norm(torque) / size <= allowed:
                return True
            stuck = lengths < cones
            if not stuck.any():
                return False
            forces = inside + self._spread(lost, self._stick_stiffness() * stuck)
        return False

    def _centre_and_size(self) -> tuple[Array, float]:
        """Return the contact's centre, and how far its polygons are from there (rms) [m]."""
        points = self.polygons.points
        centre = np.average(points, axis=0, weights=self.polygons.areas)
        size = np.sqrt(np.mean(np.sum((points - centre) ** 2, axis=1)))
        return centre, max(float(size), 1e-4)

    def _stick_stiffness(self) -> Array:
        return TANGENTIAL * self.polygons.areas * self.polygons.gradients

    def _spread(self, wrench: Array, stiffness: Array) -> Array:
        """Return tangential forces (n, 3) of springs (n,) under a rigid displacement.

        They add up to the wrench (6,) about Wo as far as tangential forces can.
        """
        points, normals = self.polygons.points, self.polygons.normals
        centre, size = self._centre_and_size()
        arms = points - centre
        about = wrench.copy()
        about[:3] -= cross(centre, wrench[3:])
        # Columns: ways of the polygons for unit displacements about the centre, along the faces.
        ways = np.zeros((len(arms), 3, 6))
        ways[:, :, 3:] = np.eye(3)
        ways[:, :, :3] = cross(np.eye(3), arms[:, None]).transpose(0, 2, 1)
        ways -= normals[:, :, None] * np.einsum("ni,nij->nj", normals, ways)[:, None, :]
        K = np.einsum("n,nij,nik->jk", stiffness, ways, ways)
        scale = np.array([1.0 / size] * 3 + [1.0] * 3)
        solution = np.linalg.lstsq(K * scale[:, None] * scale, about * scale, rcond=1e-9)[0] * scale
        return np.einsum("n,nij,j->ni", stiffness, ways, solution)

    # Saving.

    def arrays(self) -> dict[str, Any]:
        """Return everything as nested dictionaries of arrays."""
        return {
            "X_WA": self.X_WA.GetAsMatrix34(),
            "X_WB": self.X_WB.GetAsMatrix34(),
            "springs": {name: getattr(self.springs, name) for name in SPRING_FIELDS},
            "softening": np.array(self.softening),
            "preload": self.preload,
            "polygons": dict(vars(self.polygons)),
            "limits": self.limits,
            "tangential": self.tangential,
            "checked": self.checked,
        }

    @staticmethod
    def from_arrays(arrays: Mapping[str, Any]) -> Link:
        """Undo `arrays`."""
        return Link(
            X_WA=exact_pose(arrays["X_WA"]),
            X_WB=exact_pose(arrays["X_WB"]),
            springs=Springs(**arrays["springs"]),
            softening=float(arrays["softening"]),
            preload=arrays["preload"],
            polygons=Polygons(**arrays["polygons"]),
            limits=arrays["limits"],
            tangential=arrays["tangential"],
            checked=arrays["checked"],
        )
