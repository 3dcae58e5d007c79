"""A body in the frozen bed before anything runs: the planner's imprint, frozen as in simulation.

The body is pressed in straight (`imprint`), the bed freezes around it with the code of the jig, and
what then holds it is read as contact springs. Pieces that touch are those of the parts' models, the
convex hull of a part without one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.errors import InputError
from cell.fixtures.soft_jig import JigParameters, SurfaceSamples
from cell.fixtures.soft_jig.bed_pieces import bed_pieces
from cell.fixtures.soft_jig.frozen.contacts import frozen_contacts
from cell.fixtures.soft_jig.frozen.freezing import freeze, frozen_gradient
from cell.fixtures.soft_jig.frozen.pins import Pins
from cell.fixtures.soft_jig.frozen.suction import Seal
from cell.fixtures.soft_jig.frozen.yielding import Strength
from cell.products.product import Part
from planning.feasibility.solids import Solid, combined_cog
from planning.fixture_analysis.held_body import GRAVITY, HeldBody
from planning.fixture_analysis.imprint import PartSurface, pressed, samples_of


@dataclass(frozen=True, eq=False)
class HeldPart:
    """A part as the frozen bed feels it.

    Attributes:
        surface: Points on it, in A.
        hulls: Vertices (n, 3) in A of the convex pieces that touch the bed [m].
        friction: Of the membrane on it.
        pins: Whether its surface outside of the pieces touches the beads as well.
    """

    surface: PartSurface
    hulls: Sequence[np.ndarray]
    friction: float
    pins: bool

    @staticmethod
    def of(part: Part, solid: Solid, membrane: float) -> HeldPart:
        """Return a part of a product, given the friction of the membrane."""
        pieces = bed_pieces(part.model, part.mesh, membrane)
        hulls = [(part.X_AP @ hull.T).T for hull in pieces.hulls]
        return HeldPart(samples_of(solid), hulls, pieces.friction, pieces.own)


def frozen_body(
    parts: Sequence[HeldPart],
    solids: Sequence[Solid],
    R_JA: np.ndarray,
    p_middle: np.ndarray,
    jig: JigParameters,
    press_force: float,
    vacuum: float | None = None,
) -> HeldBody:
    """Press a body into the bed, freeze it, and return what holds the body.

    Args:
        parts: Of the body, those that reach the bed.
        solids: All parts of the body, for its weight.
        R_JA: (3, 3) posture.
        p_middle: (2,) point of the turned body, in the plane, that goes to the middle of the bag.
        jig: Bag, beads, pump and frozen bed.
        press_force: At which the pressing ends [N].
        vacuum: That the pump draws [Pa]; None: all that it can.

    Raises:
        InputError: Without a vacuum the bed does not freeze.
    """
    vacuum = jig.vacuum.pressure if vacuum is None else vacuum
    if vacuum <= 0.0:
        raise InputError(f"A vacuum of {vacuum:g} Pa does not freeze the bed.")
    sunk = pressed([part.surface for part in parts], R_JA, p_middle, jig, press_force)
    bed, X_JA = sunk.bed, (R_JA, sunk.p_JA)
    surface = _together([part.surface for part in parts])
    hulls = [hull @ R_JA.T + sunk.p_JA for part in parts for hull in part.hulls]
    seal = Seal.under(bed, surface, X_JA, jig.suction.lip)
    mesh = freeze(bed, jig, vacuum, [seal], hulls)
    gradient = frozen_gradient(bed, jig, vacuum)
    factor = jig.jammed.strength
    strength = Strength(factor * (bed.confinement + vacuum), jig.soil.friction_angle)
    outside = _together([part.surface for part in parts if part.pins])
    contacts = frozen_contacts(
        mesh,
        hulls,
        gradient,
        strength,
        min(part.friction for part in parts),
        X_JA,
        (seal, Pins.inside(mesh, outside, X_JA, gradient)),
        (jig.suction, vacuum),
    )
    p_JG = R_JA @ combined_cog({solid.name: solid for solid in solids}, [s.name for s in solids])
    p_JG, weight = p_JG + sunk.p_JA, GRAVITY * sum(solid.mass for solid in solids)
    return HeldBody(contacts, p_JG, weight, sunk.p_JA)


def _together(surfaces: Sequence[PartSurface]) -> SurfaceSamples:
    """Return the points of several parts as those of one body."""
    samples = [surface.samples for surface in surfaces]
    return SurfaceSamples(
        "body",
        np.concatenate([np.zeros((0, 3)), *(own.points for own in samples)]),
        np.concatenate([np.zeros((0, 3)), *(own.normals for own in samples)]),
        np.concatenate([np.zeros(0), *(own.areas for own in samples)]),
    )
