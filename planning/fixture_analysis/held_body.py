"""A body that a fixture holds, as the holding map takes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.math import RigidTransform

from cell.fixtures.contacts import Contacts
from cell.fixtures.custom.fixture import Design
from cell.fixtures.custom.work import MM, Work
from planning.feasibility.solids import Solid, combined_cog
from planning.fixture_analysis.holding_map import Bearing, holding_map

GRAVITY = 9.81  # [m/s2]


@dataclass(frozen=True, eq=False)
class HeldBody:
    """A body on a fixture.

    Attributes:
        contacts: That hold it, in J.
        p_JG: (3,) centre of gravity [m].
        weight: [N].
        p_JA: (3,) place of the product frame; its rotation is the posture [m].
        steady: (6,) wrench about the centre of gravity that the fixture exerts besides.
    """

    contacts: Contacts
    p_JG: np.ndarray
    weight: float
    p_JA: np.ndarray
    steady: np.ndarray = field(default_factory=lambda: np.zeros(6))

    def bears(self, directions: np.ndarray, most: float | np.ndarray) -> list[Bearing]:
        """Return what it bears along wrenches (d, 6), at most so many times; see `holding_map`."""
        return holding_map(
            self.contacts, self.p_JG, self.weight, directions, steady=self.steady, most=most
        )


@dataclass(frozen=True, eq=False)
class LoadCase:
    """A load of an operation on the body that a fixture holds, and what is borne of it.

    Attributes:
        force: (3,) in J [N].
        torque: About the vertical [N m].
        p_JQ: (3,) where the force acts [m].
        bearing: In multiples of this load.
    """

    force: np.ndarray
    torque: float
    p_JQ: np.ndarray
    bearing: Bearing


def seated_body(
    design: Design, work: Work, solids: Sequence[Solid], X_AP: RigidTransform
) -> HeldBody:
    """Return a body whose lowest part is in a fixture that is made for it.

    Args:
        design: Of the fixture.
        work: What it is made for.
        solids: All parts of the body, in A, for its weight.
        X_AP: Of the part that the fixture is made for.
    """
    X_JA = work.X_JD @ design.X_DP @ X_AP.inverse()
    p_JG = X_JA @ combined_cog({solid.name: solid for solid in solids}, [s.name for s in solids])
    steady = np.zeros(6)
    for touch, way in design.clamps:
        force = work.params.posts.clamp_force * (work.X_JD.rotation() @ way)
        arm = work.X_JD @ (touch / MM) - p_JG
        steady += np.concatenate([np.cross(arm, force), force])
    weight = GRAVITY * sum(solid.mass for solid in solids)
    return HeldBody(design.contacts(work), p_JG, weight, X_JA.translation(), steady)
