"""The element tests: a punch into the bed, and a cylinder in it that is pushed and pulled.

`experiments.jig_element_tests` runs them and explains the differences from the reference.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from cell.fixtures.soft_jig import JigParameters
from cell.fixtures.soft_jig.frozen.yielding import Strength
from cell.fixtures.soft_jig.parameters import FULL_VACUUM
from cell.fixtures.soft_jig.soft.bed import Bed
from cell.fixtures.soft_jig.soft.samples import SurfaceSamples
from experiments.jig.curves import Curve
from experiments.jig.element_rig import Drag, ElementRig
from experiments.jig.specimens import FRICTION, Prism

Array = NDArray[np.float64]

CYLINDER = Prism()
LYING = Prism(lying=True)
PUSH_HEIGHT = 0.040  # Above the apex of the bed [m].
SPEED = 0.020  # Of a push or pull, as in the reference [m/s].
END = np.pi * CYLINDER.radius**2  # Area of an end face of the cylinder [m2].
REFERENCE_PRESSURE = 1e3  # Surcharge on the soft dome of the reference [Pa].
SIDEWAYS, ACROSS, UP = np.eye(3)


@dataclass(frozen=True)
class Case:
    """A cylinder in the frozen bed that is moved until it gives way.

    Attributes:
        action: "push" (standing, sideways), "pull" (standing, upwards), "across" or "along" (lying,
            at its centre of mass).
        sealed: Whether the part is pressed down by the whole vacuum; else air reaches the gap.
        depth: Of its lowest point below the apex [m].
        vacuum: [Pa].
        bed: "dome" as the bag is, or "cup": flat, in a rigid wall.
    """

    action: str
    sealed: bool
    depth: float
    vacuum: float = FULL_VACUUM
    bed: str = "dome"

    @property
    def test(self) -> str:
        """Its name in the reference."""
        kind = "sealed" if self.sealed else "vented"
        return f"{self.action}, {kind}, {self.depth * 1e3:.0f} mm"

    def run(self, part: Prism = CYLINDER, time_step: float = 1e-3) -> Drag:
        """Press, freeze, let go, and move the part."""
        lying = self.action in ("across", "along")
        part = replace(part, lying=lying)
        rig = held(self, part, time_step)
        if lying:
            direction = ACROSS if self.action == "across" else SIDEWAYS
            return rig.drag(np.array([0.0, 0.0, part.length / 2]), direction, 0.005, SPEED)
        if self.action == "push":
            top = np.array([0.0, 0.0, PUSH_HEIGHT + self.depth])
            return rig.drag(top, SIDEWAYS, 0.006, SPEED)
        # The spring stretches by 50 mm/kN.
        return rig.drag(np.array([0.0, 0.0, part.length]), UP, 0.009, SPEED)


def reference() -> dict[str, Any]:
    """Return the discrete-element results."""
    text = files("experiments.jig").joinpath("element_reference.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)


def parameters(vacuum: float = 90e3, sealed: bool = False, bed: str = "dome") -> JigParameters:
    """Return the default parameters with the friction of the reference.

    Args:
        vacuum: [Pa].
        sealed: Perfectly; else vented.
        bed: "dome" or "cup".
    """
    params = JigParameters()
    # A bag bridges to a part around its edge: suction acts on 11.3 cm2 under an end of 9.6 cm2.
    strength = FULL_VACUUM * reference()["sealed_area_ratio"]
    perfect = replace(params.suction, strength=strength, lip=0.0, reach=1.0, slip=1.0)
    suction = perfect if sealed else replace(params.suction, enabled=False)
    changed = {
        # Part and membrane alike: their mean is that of the pair.
        "jammed": replace(params.jammed, friction=FRICTION),
        "vacuum": replace(params.vacuum, pressure=vacuum),
        "suction": suction,
    }
    if bed == "cup":
        # A cap of 1 m radius on a wall: its surface rises by 1.25 mm over 50 mm.
        size = {"rim_height": 0.0397, "cap_height": 0.0397 + 0.00125, "cap_radius": 1.0}
        changed["bag"] = replace(params.bag, **size)
        # [R] In the reference's cup the ground beside the part stays, and on evacuation the dent
        # opens by 0.04 to 0.19 mm: 1 to 3 of 80 beads touch the side then.
        changed["soil"] = replace(params.soil, shoulder_share=0.0)
        changed["jammed"] = replace(changed["jammed"], squeeze=0.0, touched_vented=0.03)
    return replace(params, **changed)


def punch(
    depth: float = 0.015,
    speed: float = 0.01,
    step: float = 1e-3,
    membrane: bool = True,
) -> tuple[Array, Bed]:
    """Press a flat punch into the soft bed.

    Args:
        depth: Final depth of the punch [m].
        speed: Of the punch [m/s].
        step: Time step [s].
        membrane: False: only the weight of the beads and the surcharge of the reference confine it.

    Returns:
        Depth [m] and pressure [Pa] per step (n, 2), and the bed.
    """
    params = JigParameters()
    soil = params.soil
    if not membrane:
        soil = replace(soil, membrane_modulus=0.0, gravity_pressure=REFERENCE_PRESSURE)
    bed = Bed(params.bag, soil)
    curve = pressed(bed, CYLINDER, depth, speed, step)
    return np.column_stack([curve.displacement, curve.force / END]), bed


def pressed(bed: Bed, part: Prism, depth: float, speed: float, step: float) -> Curve:
    """Press a standing part straight down into the soft bed; return force over depth.

    Args:
        bed: Bare; it keeps the imprint.
        part: Rigid and driven.
        depth: Final depth [m].
        speed: [m/s].
        step: Time step [s].
    """
    samples = SurfaceSamples.of("punch", part.mesh())
    rows, still = [], np.zeros(3)
    for k in range(round(depth / (speed * step))):
        sunk = speed * step * (k + 1)
        X_JP = (np.eye(3), np.array([0.0, 0.0, bed.bag.cap_height - sunk]))
        force, _ = bed.press(X_JP, (still, np.array([0.0, 0.0, -speed])), samples, step)
        bed.settle(step)
        rows.append((sunk, force[2]))
    return Curve(*np.array(rows).T)


def residual(bed: Bed, depth: float) -> float:
    """Return the fraction of a punch depth [m] that remains as imprint under its middle."""
    floor = float(bed.height_at(np.zeros((1, 2)))[0])
    return (bed.bag.cap_height - floor) / depth


def frozen_punch() -> Drag:
    """Press a cylinder that stands 5 mm deep in the frozen bed down until the bed fails."""
    rig = held(Case("punch", sealed=False, depth=0.005))
    return rig.drag(np.array([0.0, 0.0, CYLINDER.length]), -UP, way=0.030, speed=0.05)


def held(case: Case, part: Prism = CYLINDER, time_step: float = 1e-3) -> ElementRig:
    """Return a rig whose part is held by the frozen bed alone."""
    rig = ElementRig(parameters(case.vacuum, case.sealed, case.bed), part, time_step=time_step)
    rig.lower_to(case.depth)
    rig.jam()
    rig.let_go()
    return rig


def lateral_formula(depth: float, vacuum: float, sealed: bool) -> float:
    """Return the push [N] that overturns the cylinder: (W + p A) b + R d / 2 over the lever arm.

    R is the passive resistance of the wall over width and depth d of the part (Rankine), b the
    radius, and A the area under suction in the reference, slightly more than the end face.
    """
    soil, radius = JigParameters().soil, CYLINDER.radius
    strength = Strength(vacuum + soil.gravity_pressure, soil.friction_angle).lateral
    wall = strength * 2 * radius * depth
    sucked = vacuum * reference()["sealed_area_ratio"] * END if sealed else 0.0
    moment = (CYLINDER.mass * 9.81 + sucked) * radius + wall * depth / 2
    return float(moment / (PUSH_HEIGHT + depth))
