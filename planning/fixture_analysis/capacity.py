"""How much a body in the frozen bed withstands before it moves: sideways force, and torque.

Statics of a body embedded to a depth d over a width B:

    passive wall  R_p = B d 2 c sqrt(K_p),  c = p tan(phi),  K_p = tan^2(45 deg + phi / 2)
    overturning   M_cap = W b + R_p d / 2
    capacity      F_cap = min(R_p + mu W, M_cap / h)

p: vacuum, phi: friction angle of the beads, W: weight, b: from the centre of gravity to the edge it
tips over, h: height of the push. [D] Mohr-Coulomb soil whose confinement is the vacuum (Rankine's
passive pressure; 132 kPa for 90 kPa and 25 degrees), the same as in the simulation. The weight of
the beads is neglected (0.4 kPa at 10 mm), suction and adhesion too. The walls are those of the
frozen imprint, cell by cell: lower than it is deep, because the ground beside a sinking body goes
down with it. A load that presses down during the push adds to W at its own lever.
"""

from __future__ import annotations

import numpy as np

from cell.fixtures.soft_jig import JigParameters
from cell.fixtures.soft_jig.frozen.yielding import Strength
from planning.fixture_analysis.imprint import Imprint
from planning.fixture_analysis.loads import OperationLoad


def wall_strength(jig: JigParameters) -> float:
    """Return what a wall of frozen beads withstands per area, 2 c sqrt(K_p) [Pa]."""
    # An infinite factor turns yielding off in the simulation; statics need the beads' own strength.
    factor = jig.jammed.strength if np.isfinite(jig.jammed.strength) else 1.0
    return Strength(factor * jig.vacuum.pressure, jig.soil.friction_angle).lateral


def sideways_capacity(
    imprint: Imprint, jig: JigParameters, weight: float, p_G: np.ndarray, load: OperationLoad
) -> float:
    """Return the smallest sideways force that moves the body, over the load's directions [N].

    Args:
        imprint: With an outline.
        jig: For friction, vacuum and beads.
        weight: Of the body [N].
        p_G: (2,) its centre of gravity in the imprint's plane [m].
        load: Height, point and directions of the force.
    """
    assert imprint.contact is not None
    outline, pressure = imprint.contact, wall_strength(jig)
    friction = jig.jammed.friction * (weight + load.down)
    capacities = []
    for push in load.directions:
        height, low = imprint.walls(push)
        force = pressure * imprint.cell * height
        moment = weight * outline.lever(p_G, push) + float(force @ (low + height / 2))
        moment += load.down * outline.lever(load.p_Q, push)
        capacities.append(max(0.0, min(float(force.sum()) + friction, moment / load.height)))
    return min(capacities)


def turning_capacity(
    imprint: Imprint, jig: JigParameters, weight: float, load: OperationLoad
) -> float:
    """Return the torque about the vertical that friction under the base withstands [N m].

    That of a disc of the bearing area under uniform pressure: mu (W + F) 2/3 r.
    """
    radius = np.sqrt(imprint.contact_area / np.pi)
    return float(jig.jammed.friction * (weight + load.down) * 2.0 / 3.0 * radius)
