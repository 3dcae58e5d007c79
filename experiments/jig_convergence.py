"""Convergence of the holding force: `python -m experiments.jig_convergence [--out DIR]`.

The holding force of a standing cylinder, a lying cylinder and the plate on its foot, over the mesh
size of the frozen bed, the cell of the soft bed, the time step and the contact approximation, one
at a time from the defaults. Vented at 90 kPa: elastic contact and yield alone. Prints a table with
the change over the last refinement and writes it as `convergence.csv`.

The approximation in use is "lagged": its holding force is independent of the speed of the drag.
With "sap" (regularised friction, dissipation as a relaxation time) the force grows with speed, and
tends to that of "lagged" as the speed goes to zero: both are measured at two speeds.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from cell import load_product
from cell.fixtures.soft_jig import JigParameters
from experiments.jig.element_rig import ElementRig
from experiments.jig.element_tests import PUSH_HEIGHT, SIDEWAYS, parameters
from experiments.jig.specimens import Prism, ProductPart, Specimen

DEPTH = 0.010
# Coarse to fine [m], [s]; the defaults are among them.
MESH_SIZES = (10e-3, 5e-3, 2.5e-3)
CELLS = (2e-3, 1.5e-3, 1e-3, 0.75e-3)
STEPS = (2e-3, 1e-3, 0.5e-3)
APPROXIMATIONS = ("lagged", "similar", "sap")
SPEED, SLOW = 0.020, 0.005  # Of the drag [m/s].


@dataclass(frozen=True)
class Variation:
    """One variation from the defaults.

    Attributes:
        varied: Name of the varied quantity.
        value: Its value, as text.
        params: Of the jig.
        time_step: [s].
        approximation: Discrete contact approximation of Drake.
        speed: Of the drag [m/s].
    """

    varied: str
    value: str
    params: JigParameters
    time_step: float = 1e-3
    approximation: str = "lagged"
    speed: float = SPEED


def variations() -> Iterator[Variation]:
    """Yield the variations, coarse to fine; the default is part of every sequence."""
    params = parameters()
    for size in MESH_SIZES:
        jammed = replace(params.jammed, mesh_size=size)
        yield Variation("mesh size", f"{size * 1e3:g} mm", replace(params, jammed=jammed))
    for cell in CELLS:
        bag = replace(params.bag, cell=cell)
        yield Variation("bed cell", f"{cell * 1e3:g} mm", replace(params, bag=bag))
    for step in STEPS:
        yield Variation("time step", f"{step * 1e3:g} ms", params, time_step=step)
    for name in APPROXIMATIONS:
        yield Variation("approximation", name, params, approximation=name)
    for name in APPROXIMATIONS:
        yield Variation("dragged slowly", name, params, approximation=name, speed=SLOW)


def specimens() -> dict[str, Specimen]:
    """Return the specimens by name."""
    plate = load_product("motor_unit").parts["plate"]
    return {
        "standing": Prism(),
        "lying": Prism(lying=True),
        "plate P2": ProductPart(plate, (0, 1, 0)),
    }


def holding_force(specimen: Specimen, variation: Variation, depth: float = DEPTH) -> float:
    """Return the resistance [N] to a push near the top of a part, across its least stable side."""
    rig = ElementRig(
        variation.params,
        specimen,
        time_step=variation.time_step,
        approximation=variation.approximation,
    )
    rig.lower_to(depth, speed=0.04)
    rig.jam()
    rig.let_go(0.2)
    top = rig.X_JP.inverse() @ np.array([0.0, 0.0, rig.params.bag.cap_height + lever(specimen)])
    # A cylinder lying along x is pushed across its axis, the plate out of its plane.
    direction = SIDEWAYS if isinstance(specimen, Prism) and not specimen.lying else across(rig)
    return rig.drag(top, direction, speed=variation.speed).holding_force


def lever(specimen: Specimen) -> float:
    """Return the height of the push over the apex [m]: `PUSH_HEIGHT` if the part is that tall."""
    height = np.ptp(specimen.mesh().vertices @ specimen.X_CP.rotation().matrix()[2])
    return float(min(PUSH_HEIGHT, height - DEPTH - 0.005))


def across(rig: ElementRig) -> np.ndarray:
    """Return the horizontal axis (3,) of J along which the part is thinnest."""
    corners = rig.part.mesh().vertices @ rig.X_JP.rotation().matrix().T
    return np.eye(3)[int(np.argmin(np.ptp(corners, axis=0)[:2]))]


def last_refinement(rows: Sequence[Sequence[Any]]) -> dict[str, list[float]]:
    """Return the relative change of each force over the last refinement of each quantity.

    Args:
        rows: Name of the varied quantity, its value, and one force per specimen [N].

    Returns:
        Relative changes by quantity, one per specimen, without the approximations.
    """
    changes = {}
    refined = [row[0] for row in rows if row[1] not in APPROXIMATIONS]
    for varied in dict.fromkeys(refined):
        before, last = [np.array(row[2:], dtype=float) for row in rows if row[0] == varied][-2:]
        changes[varied] = list(last / before - 1)
    return changes


def main(out: Path = Path("out/convergence")) -> None:
    """Run the study, print the table and write it."""
    out.mkdir(parents=True, exist_ok=True)
    parts = specimens()
    rows: list[list[str | float]] = []
    for variation in variations():
        forces = [holding_force(part, variation) for part in parts.values()]
        rows.append([variation.varied, variation.value, *forces])
        values = "".join(f"{force:9.2f} N" for force in forces)
        print(f"{variation.varied:14s} {variation.value:8s}{values}", flush=True)
    for varied, changes in last_refinement(rows).items():
        print(f"{varied:14s} {'last':8s}" + "".join(f"{change:+9.1%}  " for change in changes))
    with (out / "convergence.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["varied", "value", *(f"{name} [N]" for name in parts)])
        writer.writerows(rows)


if __name__ == "__main__":
    tyro.cli(main)
