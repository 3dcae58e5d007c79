"""How far the bed reaches up the part that is pressed into it: no jaw may come that low."""

from __future__ import annotations

import numpy as np
import trimesh

from cell.vectors import rotation_with_up
from planning.feasibility.solids import Solid
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.imprint import press, samples_of


def bed_reach(mesh: trimesh.Trimesh, up: str, setup: FixtureSetup) -> float:
    """Return how far the soft bed rises above the lowest point of a part, beside it [m].

    By the planner's imprint: a wide block sinks by 6 mm and a standing motor by 17.

    Args:
        mesh: The part in A [m].
        up: Axis of A that points up.
        setup: Bag, beads and the force with which the part is pressed in.
    """
    mass = float(mesh.volume)  # Of density 1: the imprint does not depend on it.
    solid = Solid("base", mesh.vertices, mesh.faces, mass, mesh.center_mass)
    R_JA = rotation_with_up(up).matrix()
    p_middle = (R_JA @ mesh.center_mass)[:2]
    imprint = press([samples_of(solid)], R_JA, p_middle, setup.jig, setup.press_force)
    return float(imprint.bed[~np.isfinite(imprint.under)].max())
