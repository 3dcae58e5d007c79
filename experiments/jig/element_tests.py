"""The element tests: a punch into the bed, and a cylinder in it that is pushed and pulled.

`experiments.jig_element_tests` runs them and explains the differences from the reference.
"""

from __future__ import annotations

from dataclasses import replace
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
from experiments.jig.element_rig import Drag, ElementRig
from experiments.jig.specimens import Prism

Array = NDArray[np.float64]

CYLINDER = Prism()
PUSH_HEIGHT = 0.040  # Above the apex of the bed [m].
END = np.pi * CYLINDER.radius**2  # Area of an end face of the cylinder [m2].
REFERENCE_PRESSURE = 1e3  # Surcharge on the soft dome of the reference [Pa].
SIDEWAYS, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def reference() -> dict[str, Any]:
    """Return the discrete-element results."""
    text = files("experiments.jig").joinpath("element_reference.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)


def parameters(vacuum: float = 90e3, sealed: bool = False) -> JigParameters:
    """Return the default parameters with a vacuum [Pa], vented or perfectly sealed."""
    params = JigParameters()
    # A bag bridges to a part around its edge: suction acts on 11.3 cm2 under an end of 9.6 cm2.
    strength = FULL_VACUUM * reference()["sealed_area_ratio"]
    perfect = replace(params.suction, strength=strength, lip=0.0, reach=1.0, slip=1.0)
    suction = perfect if sealed else replace(params.suction, enabled=False)
    return replace(params, vacuum=replace(params.vacuum, pressure=vacuum), suction=suction)


def punch(
    depth: float = 0.015,
    speed: float = 0.01,
    step: float = 1e-3,
    membrane: bool = True,
    shoulder: bool = False,
) -> tuple[Array, Bed]:
    """Press a flat punch into the soft bed.

    Args:
        depth: Final depth of the punch [m].
        speed: Of the punch [m/s].
        step: Time step [s].
        membrane: False: only the weight of the beads and the surcharge of the reference confine it.
        shoulder: Let the bed beside the punch sink as in the dome of the reference.

    Returns:
        Depth [m] and pressure [Pa] per step (n, 2), and the bed.
    """
    params = JigParameters()
    soil = params.soil
    if not membrane:
        soil = replace(soil, membrane_modulus=0.0, gravity_pressure=REFERENCE_PRESSURE)
    if shoulder:
        soil = replace(soil, shoulder_share=0.85, collar_place=0.030)
    bed = Bed(params.bag, soil)
    samples = SurfaceSamples.of("punch", CYLINDER.mesh())
    rows, still = [], np.zeros(3)
    for k in range(round(depth / (speed * step))):
        sunk = speed * step * (k + 1)
        X_JP = (np.eye(3), np.array([0.0, 0.0, bed.bag.cap_height - sunk]))
        force, _ = bed.press(X_JP, (still, np.array([0.0, 0.0, -speed])), samples, step)
        bed.settle(step)
        rows.append((sunk, force[2] / END))
    return np.array(rows), bed


def residual(bed: Bed, depth: float) -> float:
    """Return the fraction of a punch depth [m] that remains as imprint under its middle."""
    floor = float(bed.height_at(np.zeros((1, 2)))[0])
    return (bed.bag.cap_height - floor) / depth


def frozen_punch() -> Drag:
    """Press a cylinder that stands 5 mm deep in the frozen bed down until the bed fails."""
    rig = held(0.005, FULL_VACUUM, sealed=False)
    return rig.drag(np.array([0.0, 0.0, CYLINDER.length]), -UP, way=0.030, speed=0.05)


def held(
    depth: float, vacuum: float, sealed: bool, part: Prism = CYLINDER, time_step: float = 1e-3
) -> ElementRig:
    """Return a rig whose part is held by the frozen bed alone."""
    rig = ElementRig(parameters(vacuum, sealed), part, time_step=time_step)
    rig.lower_to(depth)
    rig.jam()
    rig.let_go()
    return rig


def push(depth: float, vacuum: float = 90e3, sealed: bool = False) -> Drag:
    """Push the standing cylinder sideways, `PUSH_HEIGHT` above the apex."""
    rig = held(depth, vacuum, sealed)
    return rig.drag(np.array([0.0, 0.0, PUSH_HEIGHT + depth]), SIDEWAYS, speed=0.02)


def pull(depth: float, vacuum: float = 90e3, sealed: bool = False) -> Drag:
    """Pull the standing cylinder out vertically."""
    rig = held(depth, vacuum, sealed)
    # The spring stretches by 50 mm/kN.
    return rig.drag(np.array([0.0, 0.0, CYLINDER.length]), UP, way=0.009, speed=0.02)


def lateral_formula(depth: float, vacuum: float, sealed: bool) -> float:
    """Return the push [N] that overturns the cylinder: (W + p A) b + R d / 2 over the lever arm.

    R is the passive resistance of the wall over width and depth d of the part (Rankine), b the
    radius, and A the area under suction in the reference, slightly more than the end face.
    """
    soil, radius = JigParameters().soil, CYLINDER.radius
    wall = Strength.of(soil, vacuum + soil.gravity_pressure).lateral * 2 * radius * depth
    sucked = vacuum * reference()["sealed_area_ratio"] * END if sealed else 0.0
    moment = (CYLINDER.mass * 9.81 + sucked) * radius + wall * depth / 2
    return float(moment / (PUSH_HEIGHT + depth))
