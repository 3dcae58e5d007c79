"""Element tests of the soft jig against formulas and discrete-element runs.

`python -m experiments.jig_element_tests [--out DIR]` presses a flat punch into the soft bed, and
drags and pulls a standing cylinder out of the frozen one, over depth and vacuum, vented and sealed.
It prints a table and writes `element_tests.png` and `element_tests.csv`. One parameter set: the
defaults. Only what the reference defines otherwise is set: part friction, no suction ("vented") or
a seal of full vacuum that never opens ("sealed").
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import tyro
import yaml
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cell.soft_jig import JigParameters
from cell.soft_jig.bed import Bed
from cell.soft_jig.samples import SurfaceSamples
from cell.soft_jig.yielding import Strength
from experiments.element_rig import Drag, ElementRig
from experiments.specimens import Prism

Array = NDArray[np.float64]

CYLINDER = Prism()
DEPTHS = (0.005, 0.010, 0.015)
# The lowest stands for an open valve: beads held by membrane and weight alone.
VACUUMS = (1.0, 30e3, 60e3, 90e3)
PUSH_HEIGHT = 0.040  # Over the bed's apex [m].
SIDEWAYS, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Row:
    """One comparison: ours, the formula's and the reference's lowest and highest value."""

    name: str
    ours: float
    formula: float = float("nan")
    reference: tuple[float, float] = (float("nan"), float("nan"))


def reference() -> dict[str, Any]:
    """Return the discrete-element figures."""
    text = files("experiments").joinpath("element_reference.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)


def parameters(vacuum: float = 90e3, sealed: bool = False) -> JigParameters:
    """Return the defaults with a vacuum [Pa] and the reference's limits of the seal."""
    params = JigParameters()
    perfect = replace(params.suction, strength=90e3, lip=0.0, reach=1.0, slip=1.0)
    suction = perfect if sealed else replace(params.suction, enabled=False)
    return replace(params, vacuum=replace(params.vacuum, pressure=vacuum), suction=suction)


def punch(depth: float = 0.015, speed: float = 0.01, step: float = 1e-3) -> Array:
    """Press the flat punch into the soft bed; return depth [m] and pressure [Pa] rows (n, 2)."""
    params = JigParameters()
    bed = Bed(params.bag, params.soil)
    samples = SurfaceSamples.of("punch", CYLINDER.mesh())
    rows, still = [], np.zeros(3)
    for k in range(round(depth / (speed * step))):
        sunk = speed * step * (k + 1)
        X_JP = (np.eye(3), np.array([0.0, 0.0, bed.bag.cap_height - sunk]))
        force, _ = bed.press(X_JP, (still, np.array([0.0, 0.0, -speed])), samples, step)
        bed.settle(step)
        rows.append((sunk, force[2] / (np.pi * CYLINDER.radius**2)))
    return np.array(rows)


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

    R is the passive wall over the part's width and depth (Rankine); b the radius.
    """
    soil, radius = JigParameters().soil, CYLINDER.radius
    wall = Strength.of(soil, vacuum + soil.gravity_pressure).lateral * 2 * radius * depth
    sucked = vacuum * np.pi * radius**2 if sealed else 0.0
    moment = (CYLINDER.mass * 9.81 + sucked) * radius + wall * depth / 2
    return float(moment / (PUSH_HEIGHT + depth))


def compare() -> tuple[list[Row], dict[str, Drag], Array]:
    """Run every test; return the table, the drags and the punch curve."""
    data, rows, drags = reference(), [], {}
    curve = punch()
    dome = data["dome_punch"]
    for depth, pressure in zip(dome["depth_mm"], dome["pressure_kPa"], strict=True):
        ours = float(np.interp(depth / 1e3, *curve.T)) / 1e3
        rows.append(Row(f"soft punch {depth} mm [kPa]", ours, reference=(pressure, pressure)))
    for sealed in (False, True):
        kind = "sealed" if sealed else "vented"
        for depth, forces in zip(DEPTHS, data[f"{kind}_lateral"]["force_N"], strict=True):
            drag = drags[f"{kind} {depth * 1e3:.0f} mm"] = push(depth, sealed=sealed)
            formula = lateral_formula(depth, 90e3, sealed)
            name = f"push, {kind}, {depth * 1e3:.0f} mm, 90 kPa [N]"
            rows.append(Row(name, drag.holding_force, formula, (min(forces), max(forces))))
        top = data["pull_out"][f"{kind}_N"]
        ours = pull(DEPTHS[-1], sealed=sealed).holding_force
        rows.append(Row(f"pull out, {kind}, 15 mm, 90 kPa [N]", ours, reference=(top, top)))
    for vacuum in VACUUMS[:-1]:
        ours = push(0.010, vacuum).holding_force
        name = f"push, vented, 10 mm, {vacuum / 1e3:.0f} kPa [N]"
        rows.append(Row(name, ours, lateral_formula(0.010, vacuum, False)))
    return rows, drags, curve


def plot(drags: dict[str, Drag], curve: Array) -> Figure:
    """Draw the punch curve and the pushes beside the reference."""
    data, figure = reference(), Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(curve[:, 0] * 1e3, curve[:, 1] / 1e3, label="bed with membrane")
    dome = data["dome_punch"]
    left.plot(dome["depth_mm"], dome["pressure_kPa"], "k.", label="discrete elements, no membrane")
    left.set(xlabel="depth [mm]", ylabel="pressure [kPa]", title="flat punch, soft")
    for k, (name, drag) in enumerate(drags.items()):
        right.plot(drag.way * 1e3, drag.force, color=f"C{k}", label=name)
        kind, depth, _ = name.split()
        forces = data[f"{kind}_lateral"]["force_N"][[5, 10, 15].index(int(depth))]
        right.plot([6.3] * len(forces), forces, ".", color=f"C{k}")
    right.set(
        xlabel="displacement [mm]", ylabel="force [N]", title="push at 90 kPa; dots: reference"
    )
    left.legend()
    right.legend()
    return figure


def main(out: Path = Path("out/element_tests")) -> None:
    """Run the element tests, print the table and write it with the plot into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    rows, drags, curve = compare()
    with (out / "element_tests.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["test", "ours", "formula", "reference_low", "reference_high"])
        writer.writerows((row.name, row.ours, row.formula, *row.reference) for row in rows)
    for row in rows:
        low, high = row.reference
        print(f"{row.name:36s} {row.ours:8.2f}  {row.formula:8.2f}  {low:8.2f} .. {high:.2f}")
    FigureCanvasAgg(figure := plot(drags, curve))
    figure.savefig(out / "element_tests.png", dpi=110)


if __name__ == "__main__":
    tyro.cli(main)
