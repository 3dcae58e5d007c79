"""Element tests of the soft jig against formulas and discrete-element runs.

`python -m experiments.jig_element_tests [--out DIR]` presses a flat punch into the soft and into
the frozen bed, and pushes and pulls a standing cylinder out of the frozen bed, over depth and
vacuum, vented and sealed. It prints a table with reasons for the differences beyond 30 %, and
writes `element_tests.png`, `.csv` and `.txt`. All parameters are the defaults, except what the
reference defines otherwise: part friction, and no suction ("vented") or full vacuum over all of the
flat end and slightly beyond, however far it opens ("sealed").
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cell.fixtures.soft_jig import JigParameters
from cell.fixtures.soft_jig.frozen.yielding import Strength
from cell.fixtures.soft_jig.parameters import FULL_VACUUM
from experiments.jig.element_rig import Drag
from experiments.jig.element_tests import (
    CYLINDER,
    END,
    PUSH_HEIGHT,
    Array,
    frozen_punch,
    lateral_formula,
    pull,
    punch,
    push,
    reference,
    residual,
)

DEPTHS = (0.005, 0.010, 0.015)
# The lowest is an open valve: beads confined by membrane and weight alone.
VACUUMS = (1.0, 30e3, 60e3, 90e3)
WEIGHT = CYLINDER.mass * 9.81


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes:
        name: Of the quantity, with its unit.
        ours: Its value here.
        formula: Its value by the formula.
        reference: Its lowest and highest value in the reference.
    """

    name: str
    ours: float
    formula: float = float("nan")
    reference: tuple[float, float] = (float("nan"), float("nan"))


@dataclass
class Results:
    """All comparisons, drags by name, and punch curves by name (n, 2) [m, Pa]."""

    rows: list[Row]
    drags: dict[str, Drag]
    punches: dict[str, Array]


def compare() -> Results:
    """Run every test."""
    results = Results([], {}, {})
    _punch_soft_bed(results)
    _punch_frozen_bed(results)
    for sealed in (False, True):
        for vacuum in VACUUMS:
            depths = DEPTHS if vacuum == FULL_VACUUM else (0.010,)
            for depth in depths:
                kind = "sealed" if sealed else "vented"
                case = f"{kind}, {depth * 1e3:.0f} mm, {vacuum / 1e3:.0f} kPa"
                results.drags[f"push, {case}"] = push(depth, vacuum, sealed)
                results.drags[f"pull, {case}"] = pull(depth, vacuum, sealed)
                _compare_push(results, case, depth, vacuum, sealed)
                _compare_pull(results, case, depth, vacuum, sealed)
    return results


def _punch_soft_bed(results: Results) -> None:
    dome = reference()["dome_punch"]
    kinds = {
        "with membrane": {},
        "without membrane": {"membrane": False},
        "with membrane, sinking shoulder": {"shoulder": True},
    }
    for kind, options in kinds.items():
        curve, bed = punch(**options)
        results.punches[kind] = curve
        for depth, pressure in zip(dome["depth_mm"], dome["pressure_kPa"], strict=True):
            ours = float(np.interp(depth / 1e3, *curve.T)) / 1e3
            name = f"soft punch {depth} mm, {kind} [kPa]"
            results.rows.append(Row(name, ours, reference=(pressure, pressure)))
    curve, bed = punch()
    kept = residual(bed, float(curve[-1, 0]))
    back = reference()["spring_back_mm"] / 15
    results.rows.append(Row("imprint left of 15 mm [-]", kept, reference=(1 - back, 1 - back)))


def _punch_frozen_bed(results: Results) -> None:
    bearing = Strength(FULL_VACUUM, JigParameters().soil.friction_angle).bearing * END
    drag = frozen_punch()
    results.rows.append(Row("frozen punch, largest load; c Nc A [N]", drag.force.max(), bearing))
    sunk = float(drag.way[np.argmax(drag.force)]) * 1e3
    results.rows.append(Row("frozen punch, sunk by then [mm]", sunk))


def _compare_push(results: Results, case: str, depth: float, vacuum: float, sealed: bool) -> None:
    """Compare the force of a push, and its moment less that of the weight."""
    force, lever = results.drags[f"push, {case}"].holding_force, PUSH_HEIGHT + depth
    formula = lateral_formula(depth, vacuum, sealed)
    forces = np.array([np.nan])
    if vacuum == FULL_VACUUM:
        known = reference()["sealed_lateral" if sealed else "vented_lateral"]
        forces = np.array(known["force_N"][DEPTHS.index(depth)])
    span = (float(forces.min()), float(forces.max()))
    results.rows.append(Row(f"push, {case} [N]", force, formula, span))
    own, low, high = (f * lever - WEIGHT * CYLINDER.radius for f in (force, *span))
    name = f"push, {case}: moment less the weight's own [N m]"
    results.rows.append(Row(name, own, formula * lever - WEIGHT * CYLINDER.radius, (low, high)))


def _compare_pull(results: Results, case: str, depth: float, vacuum: float, sealed: bool) -> None:
    """Compare the force of a pull, and its share beyond weight and suction: side friction."""
    force, known = results.drags[f"pull, {case}"].holding_force, reference()["pull_out"]
    kind = "sealed" if sealed else "vented"
    whole, sides = known[f"{kind}_N"], known[f"{kind}_sides_N"]
    if vacuum != FULL_VACUUM or depth != DEPTHS[-1]:
        whole = sides = float("nan")
    suction = reference()["sealed_area_ratio"] * vacuum * END if sealed else 0.0
    results.rows.append(Row(f"pull, {case} [N]", force, reference=(whole, whole)))
    name = f"pull, {case}: friction on the sides [N]"
    results.rows.append(Row(name, force - (WEIGHT + suction), reference=(sides, sides)))


def plot(results: Results) -> Figure:
    """Plot the punch curves and the pushes with the reference."""
    data, figure = reference(), Figure(figsize=(12, 8), layout="constrained")
    axes = figure.subplots(2, 2)
    for name, curve in results.punches.items():
        axes[0, 0].plot(curve[:, 0] * 1e3, curve[:, 1] / 1e3, label=name)
    dome = data["dome_punch"]
    axes[0, 0].plot(dome["depth_mm"], dome["pressure_kPa"], "k.", label="discrete elements")
    axes[0, 0].set(xlabel="depth [mm]", ylabel="pressure [kPa]", title="flat punch, soft")
    for axis, kind in ((axes[0, 1], "push, vented"), (axes[1, 0], "push, sealed")):
        for k, depth in enumerate(DEPTHS):
            drag = results.drags[f"{kind}, {depth * 1e3:.0f} mm, 90 kPa"]
            axis.plot(drag.way * 1e3, drag.force, color=f"C{k}", label=f"{depth * 1e3:.0f} mm")
            known = data[f"{kind.split()[1]}_lateral"]["force_N"][k]
            axis.plot([6.3] * len(known), known, ".", color=f"C{k}")
        axis.set(xlabel="displacement [mm]", ylabel="force [N]", title=f"{kind}, 90 kPa; dots: DEM")
    for kind in ("push, vented", "push, sealed", "pull, vented", "pull, sealed"):
        names = [f"{kind}, 10 mm, {vacuum / 1e3:.0f} kPa" for vacuum in VACUUMS]
        forces = [results.drags[name].holding_force for name in names]
        axes[1, 1].plot(np.array(VACUUMS) / 1e3, forces, ".-", label=kind)
    axes[1, 1].set(xlabel="vacuum [kPa]", ylabel="holding force [N]", title="10 mm deep")
    axes[1, 1].set_yscale("log")
    for axis in axes.flat:
        axis.legend(fontsize="small")
    return figure


REASONS = """Differences beyond 30 %:
- Soft punch: the reference has no membrane; ours stretches and stiffens with depth. Without it the
  curves agree within 30 %.
- Vented pushes: forces of 1 to 4 N, which scatter by a factor of up to six between the packings of
  the reference. Ours grow with the wall of the imprint (passive wedge). In the reference dome the
  ground beside the cylinder sinks with it and leaves 4 to 7 mm of wall at 10 to 15 mm of depth, for
  which the formula gives 1.3 and 2.7 N; `jig.soil.shoulder_share` 0.85 lets it sink here; pushes
  with it have not been measured.
- Vented pull: the 2 N of the reference (the weight) are those of its rigid cup, whose imprint opens
  on evacuation; in a dome it closes by 0.05 mm in diameter, as here, and the friction due to that
  is the difference.
- Sealed pushes: the reference fails at 2 to 3 mm, ours still rises at 6: the frozen bed is softer
  (E50 10 MPa). With the 33 MPa of the reference, an upper bound, it resists 30 and 32 N at 5 and
  10 mm.
- Frozen punch: it fails at half of c Nc A, 2 to 3 mm deep, also with beads that never yield: the
  pressure of the mesh falls off towards the edges of a column once the part has sunk by half the
  mesh size. A press is 20 N.
- Sealed pull: the reference has 41 N of friction on sides that are sealed as well (0.28 of the
  vacuum as shear); suction here acts on flat faces only.
- At 0 kPa the weight alone resists with 0.034 N m: compare the moments less that of the weight.
"""


def main(out: Path = Path("out/element_tests")) -> None:
    """Run the element tests, print the table and write it with the plot."""
    out.mkdir(parents=True, exist_ok=True)
    results = compare()
    with (out / "element_tests.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["test", "ours", "formula", "reference_low", "reference_high"])
        writer.writerows((r.name, r.ours, r.formula, *r.reference) for r in results.rows)
    lines = [f"{'':58s} {'ours':>8s}  {'formula':>8s}  {'reference':>8s}"]
    for row in results.rows:
        low, high = row.reference
        lines.append(
            f"{row.name:58s} {row.ours:8.3g}  {row.formula:8.3g}  {low:8.3g} .. {high:.3g}"
        )
    text = "\n".join(lines) + "\n\n" + REASONS
    print(text)
    (out / "element_tests.txt").write_text(text, encoding="utf-8")
    FigureCanvasAgg(figure := plot(results))
    figure.savefig(out / "element_tests.png", dpi=110)


if __name__ == "__main__":
    tyro.cli(main)
