"""Convergence of the holding force: `python -m experiments.jig_convergence [--workers N]`.

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
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from cell import CellConfig
from cell.errors import RunFailure
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Row
from experiments.cli.ending import exit_code
from experiments.jig.holding import SPECIMENS, SPEED

# Coarse to fine [m], [s]; the defaults are among them.
MESH_SIZES = (10e-3, 5e-3, 2.5e-3)
CELLS = (2e-3, 1.5e-3, 1e-3, 0.75e-3)
STEPS = (2e-3, 1e-3, 0.5e-3)
APPROXIMATIONS = ("lagged", "similar", "sap")
SLOW = 0.005  # Of the drag [m/s].


@dataclass(frozen=True)
class Variation:
    """One variation from the defaults.

    Attributes:
        varied: Name of the varied quantity.
        value: Its value, as text.
        changes: Of settings, by path.
        speed: Of the drag [m/s].
    """

    varied: str
    value: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    speed: float = SPEED


def variations() -> Iterator[Variation]:
    """Yield the variations, coarse to fine; the default is part of every sequence."""
    for size in MESH_SIZES:
        yield Variation("mesh size", f"{size * 1e3:g} mm", {"jig.jammed.mesh_size": size})
    for cell in CELLS:
        yield Variation("bed cell", f"{cell * 1e3:g} mm", {"jig.bag.cell": cell})
    for step in STEPS:
        yield Variation("time step", f"{step * 1e3:g} ms", {"simulation.time_step": step})
    for name in APPROXIMATIONS:
        yield Variation("approximation", name, {"simulation.contact_approximation": name})
    for name in APPROXIMATIONS:
        changes = {"simulation.contact_approximation": name}
        yield Variation("dragged slowly", name, changes, speed=SLOW)


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


def main(out: Path = Path("out/convergence"), workers: int = 1) -> int:
    """Run what is missing of the study, print the table and write it; return the exit code."""
    return exit_code("jig_convergence", lambda: run(out, workers))


def run(out: Path, workers: int) -> int:
    """Run the study as a campaign; return 0.

    Raises:
        RunFailure: A trial came to no verdict.
    """
    out.mkdir(parents=True, exist_ok=True)
    found = list(variations())
    points = [
        {"specimen": name, "speed": each.speed, **each.changes}
        for each in found
        for name in SPECIMENS
    ]
    wanted = [trials("hold", [point], config=vented()) for point in points]
    planned = {trial.key: trial for (trial,) in wanted}
    ended = {row.key: row for row in run_campaign(list(planned.values()), out, workers=workers)}
    forces = [force_of(ended[trial.key]) for (trial,) in wanted]
    rows: list[list[str | float]] = [
        [each.varied, each.value, *forces[k * len(SPECIMENS) : (k + 1) * len(SPECIMENS)]]
        for k, each in enumerate(found)
    ]
    for varied, value, *values in rows:
        print(f"{varied:14s} {value:8s}" + "".join(f"{force:9.2f} N" for force in values))
    for varied, changes in last_refinement(rows).items():
        print(f"{varied:14s} {'last':8s}" + "".join(f"{change:+9.1%}  " for change in changes))
    with (out / "convergence.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["varied", "value", *(f"{name} [N]" for name in SPECIMENS)])
        writer.writerows(rows)
    return 0


def vented() -> CellConfig:
    """Return the default configuration without suction: elastic contact and yield alone."""
    return CellConfig.load("default", {"jig.suction.enabled": False})


def force_of(row: Row) -> float:
    """Return the holding force that a trial measured [N].

    Raises:
        RunFailure: It came to no verdict.
    """
    force = row.measured.get("holding_N")
    if force is None:
        raise RunFailure(f"{row.varied}: {row.evidence or row.verdict}")
    return force


if __name__ == "__main__":
    sys.exit(tyro.cli(main))
