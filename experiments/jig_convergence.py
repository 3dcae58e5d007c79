"""Convergence of what the frozen bed holds: `python -m experiments.jig_convergence [--out DIR]`.

The holding force of a standing cylinder, a lying cylinder and the plate on its foot against the
mesh of the frozen bed, the cell of the soft one, the time step and Drake's contact approximation,
one at a time from the defaults. Vented, 90 kPa: elastic contact and yield alone. Prints a table
with the change over the last refinement and writes it as `convergence.csv`.

The approximation in use is "lagged": what it holds does not depend on how fast the part is dragged.
With "sap" (regularised friction, dissipation as a relaxation time) the force grows with speed, and
comes down towards that of "lagged" as the speed goes to zero: both are measured at two speeds.
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
class Setting:
    """One variation: what is varied, to what, and the rig's numbers."""

    varied: str
    value: str
    params: JigParameters
    time_step: float = 1e-3
    approximation: str = "lagged"
    speed: float = SPEED


def settings() -> Iterator[Setting]:
    """Yield the variations, coarse to fine; the default is in every sequence."""
    params = parameters()
    for size in MESH_SIZES:
        jammed = replace(params.jammed, mesh_size=size)
        yield Setting("mesh size", f"{size * 1e3:g} mm", replace(params, jammed=jammed))
    for cell in CELLS:
        bag = replace(params.bag, cell=cell)
        yield Setting("bed cell", f"{cell * 1e3:g} mm", replace(params, bag=bag))
    for step in STEPS:
        yield Setting("time step", f"{step * 1e3:g} ms", params, time_step=step)
    for name in APPROXIMATIONS:
        yield Setting("approximation", name, params, approximation=name)
    for name in APPROXIMATIONS:
        yield Setting("dragged slowly", name, params, approximation=name, speed=SLOW)


def specimens() -> dict[str, Specimen]:
    """Return what is held."""
    plate = load_product("motor_unit").parts["plate"]
    return {
        "standing": Prism(),
        "lying": Prism(lying=True),
        "plate P2": ProductPart(plate, (0, 1, 0)),
    }


def holding_force(specimen: Specimen, setting: Setting, depth: float = DEPTH) -> float:
    """Return what a part holds against a push near its top, across its least stable side [N]."""
    rig = ElementRig(
        setting.params, specimen, time_step=setting.time_step, approximation=setting.approximation
    )
    rig.lower_to(depth, speed=0.04)
    rig.jam()
    rig.let_go(0.2)
    top = rig.X_JP.inverse() @ np.array([0.0, 0.0, rig.params.bag.cap_height + lever(specimen)])
    # A lying cylinder along x is pushed across, the plate out of its plane.
    direction = SIDEWAYS if isinstance(specimen, Prism) and not specimen.lying else across(rig)
    return rig.drag(top, direction, speed=setting.speed).holding_force


def lever(specimen: Specimen) -> float:
    """Return how far over the apex the push acts [m]: 40 mm where the part is that tall."""
    height = np.ptp(specimen.mesh().vertices @ specimen.X_CP.rotation().matrix()[2])
    return float(min(PUSH_HEIGHT, height - DEPTH - 0.005))


def across(rig: ElementRig) -> np.ndarray:
    """Return the horizontal axis of J in which the part is thinnest."""
    corners = rig.part.mesh().vertices @ rig.X_JP.rotation().matrix().T
    return np.eye(3)[int(np.argmin(np.ptp(corners, axis=0)[:2]))]


def last_refinement(rows: Sequence[Sequence[Any]]) -> dict[str, list[float]]:
    """Return what each varied number changes by from its last but one value to its last.

    Args:
        rows: Name of what is varied, its value, and one force per specimen [N].

    Returns:
        Relative changes, one per specimen; approximations have no finer end.
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
    for setting in settings():
        forces = [holding_force(part, setting) for part in parts.values()]
        rows.append([setting.varied, setting.value, *forces])
        values = "".join(f"{force:9.2f} N" for force in forces)
        print(f"{setting.varied:14s} {setting.value:8s}{values}", flush=True)
    for varied, changes in last_refinement(rows).items():
        print(f"{varied:14s} {'last':8s}" + "".join(f"{change:+9.1%}  " for change in changes))
    with (out / "convergence.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["varied", "value", *(f"{name} [N]" for name in parts)])
        writer.writerows(rows)


if __name__ == "__main__":
    tyro.cli(main)
