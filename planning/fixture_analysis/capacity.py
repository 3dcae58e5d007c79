"""How hard a body in the frozen bed can be pushed sideways before it gives way.

Statics of a body embedded to a depth d over a width B:

    passive wall  R_p = B d 2 c sqrt(K_p),  c = p tan(phi),  K_p = tan^2(45 deg + phi / 2)
    overturning   M_cap = W b + R_p d / 2
    capacity      F_cap = min(R_p + mu W, M_cap / h)

p: vacuum, phi: friction angle of the beads, W: weight, b: from the centre of gravity to the edge it
tips over, h: height of the push. [D] Mohr-Coulomb soil whose confinement is the vacuum (Rankine's
passive pressure; 132 kPa for 90 kPa and 25 degrees). The weight of the beads is left out (0.4 kPa
at 10 mm), suction and adhesion too. The walls are those of the imprint, cell by cell, and a load
that presses down while the body is pushed adds to W at its own lever.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.fixtures.soft_jig import JigParameters
from planning.fixture_analysis.imprint import Imprint

PUSHES = tuple(np.array(d, float) for d in ((1, 0), (-1, 0), (0, 1), (0, -1)))


@dataclass(frozen=True, eq=False)
class Load:
    """What an operation does to the body on the jig.

    Attributes:
        down: Force that presses it down [N].
        sideways: Force across, in any direction [N].
        torque: About the vertical [N m].
        p_Q: (2,) where, in the imprint's plane [m].
        height: Above the body's lowest point [m].
        pushes: Directions that the force across may take, (2,) each.
    """

    down: float
    sideways: float
    torque: float
    p_Q: np.ndarray
    height: float
    pushes: tuple[np.ndarray, ...] = PUSHES


def passive_pressure(jig: JigParameters) -> float:
    """Return what a wall of frozen beads bears per area, 2 c sqrt(K_p) [Pa]."""
    phi = jig.soil.friction_angle
    cohesion = jig.vacuum.pressure * np.tan(phi)
    return float(2.0 * cohesion * np.tan(np.pi / 4 + phi / 2))


def sideways_capacity(
    imprint: Imprint, jig: JigParameters, weight: float, p_G: np.ndarray, load: Load
) -> float:
    """Return the least force across that the imprint bears, over the load's pushes [N].

    Args:
        imprint: With an outline.
        jig: For friction, vacuum and beads.
        weight: Of the body [N].
        p_G: (2,) its centre of gravity in the imprint's plane [m].
        load: Height, place and directions of the push.
    """
    return min(_capacity(imprint, jig, weight, p_G, load, push) for push in load.pushes)


def _capacity(
    imprint: Imprint,
    jig: JigParameters,
    weight: float,
    p_G: np.ndarray,
    load: Load,
    push: np.ndarray,
) -> float:
    assert imprint.contact is not None
    height, low = imprint.walls(push)
    force = passive_pressure(jig) * imprint.cell * height
    friction = jig.jammed.friction * (weight + load.down)
    moment = weight * imprint.contact.lever(p_G, push) + float(force @ (low + height / 2))
    moment += load.down * imprint.contact.lever(load.p_Q, push)
    return max(0.0, min(float(force.sum()) + friction, moment / load.height))


def turning_capacity(imprint: Imprint, jig: JigParameters, weight: float, load: Load) -> float:
    """Return the torque about the vertical that friction under the base alone bears [N m].

    That of a disc of the bearing area under uniform pressure: mu (W + F) 2/3 r.
    """
    radius = np.sqrt(imprint.contact_area / np.pi)
    return float(jig.jammed.friction * (weight + load.down) * 2.0 / 3.0 * radius)
