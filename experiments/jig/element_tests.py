"""The element tests: a punch into the bed, and a cylinder in it that is pushed and pulled.

`experiments.jig_element_tests` runs them and says why they differ from the reference.
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
PUSH_HEIGHT = 0.040  # Over the bed's apex [m].
END = np.pi * CYLINDER.radius**2  # Of the cylinder [m2].
REFERENCE_PRESSURE = 1e3  # On the reference's dome while soft [Pa].
SIDEWAYS, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def reference() -> dict[str, Any]:
    """Return the discrete-element figures."""
    text = files("experiments.jig").joinpath("element_reference.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)


def parameters(vacuum: float = 90e3, sealed: bool = False) -> JigParameters:
    """Return the defaults with a vacuum [Pa] and the reference's limits of the seal."""
    params = JigParameters()
    # A bag bridges to a part around its edge: 11.3 cm2 are sucked on under an end of 9.6 cm2.
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
    """Press the flat punch into the soft bed.

    Args:
        depth: Of the punch in the end [m].
        speed: Of the punch [m/s].
        step: [s].
        membrane: Without it only the beads' weight and the reference's 1 kPa hold the bed.
        shoulder: Let the bed beside the punch sink as in the reference's dome.

    Returns:
        Depth [m] and pressure [Pa] rows (n, 2), and the bed.
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
    """Return the share of a punch's depth [m] that stays in the bed under its middle."""
    floor = float(bed.height_at(np.zeros((1, 2)))[0])
    return (bed.bag.cap_height - floor) / depth


def frozen_punch() -> Drag:
    """Push a cylinder that stands 5 mm deep in the frozen bed down, until it gives way."""
    rig = held(0.005, FULL_VACUUM, sealed=False)
    return rig.drag(np.array([0.0, 0.0, CYLINDER.length]), -UP, way=0.030, speed=0.05)


def held(
    depth: float, vacuum: float, sealed: bool, part: Prism = CYLINDER, time_step: float = 1e-3
) -> ElementRig:
    """Return a rig whose part stands in the frozen bed, let go."""
    rig = ElementRig(parameters(vacuum, sealed), part, time_step=time_step)
    rig.lower_to(depth)
    rig.jam()
    rig.let_go()
    return rig


def push(depth: float, vacuum: float = 90e3, sealed: bool = False) -> Drag:
    """Push the standing cylinder sideways, 40 mm above the apex."""
    rig = held(depth, vacuum, sealed)
    return rig.drag(np.array([0.0, 0.0, PUSH_HEIGHT + depth]), SIDEWAYS, speed=0.02)


def pull(depth: float, vacuum: float = 90e3, sealed: bool = False) -> Drag:
    """Pull the standing cylinder up."""
    rig = held(depth, vacuum, sealed)
    return rig.drag(
        np.array([0.0, 0.0, CYLINDER.length]), UP, way=0.009, speed=0.02
    )  # The spring stretches by 50 mm/kN.


def lateral_formula(depth: float, vacuum: float, sealed: bool) -> float:
    """Return the push [N] that overturns the cylinder: (W + p A) b + R d / 2 over the lever.

    R is the passive wall over the part's width and depth (Rankine); b the radius; A what is sucked
    on in the reference, a little more than the end.
    """
    soil, radius = JigParameters().soil, CYLINDER.radius
    wall = Strength.of(soil, vacuum + soil.gravity_pressure).lateral * 2 * radius * depth
    sucked = vacuum * reference()["sealed_area_ratio"] * END if sealed else 0.0
    moment = (CYLINDER.mass * 9.81 + sucked) * radius + wall * depth / 2
    return float(moment / (PUSH_HEIGHT + depth))
