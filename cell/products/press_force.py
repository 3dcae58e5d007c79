"""How much force seats a press fit: two thick-walled cylinders, one shrunk on the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.products.materials import MODULI, POISSON_RATIO

FRICTION = 0.12  # [A] Metal in metal, pressed in with a trace of oil.


@dataclass(frozen=True)
class Ring:
    """A part of a press fit, taken for a cylinder.

    Attributes:
        material: Its name.
        inner, outer: Radii [m]; 0: it is solid.
    """

    material: str
    inner: float
    outer: float


def press_force(shaft: Ring, hub: Ring, interference: float, length: float) -> float:
    """Return the force that seats a shaft in a hub over a length [N].

    [R] Lame: the pressure p closes the radial interference, p r (C_hub / E_hub + C_shaft /
    E_shaft), with C = (b^2 + a^2) / (b^2 - a^2) + nu for the hub, - nu for the shaft, and radii a
    and b; then F = mu p 2 pi r L.

    Args:
        shaft: Its outer radius is that of the fit.
        hub: What is around it.
        interference: Radial [m].
        length: Engaged [m].
    """
    radius = shaft.outer

    def compliance(ring: Ring, inner: float, outer: float, sign: float) -> float:
        wide, narrow = outer**2, inner**2
        spread = (wide + narrow) / (wide - narrow) + sign * POISSON_RATIO
        return float(spread / MODULI[ring.material])

    around = max(hub.outer, 1.05 * radius)
    gives = compliance(hub, radius, around, 1.0) + compliance(shaft, shaft.inner, radius, -1.0)
    pressure = interference / (radius * gives)
    return float(FRICTION * pressure * 2.0 * np.pi * radius * length)
