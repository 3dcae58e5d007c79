"""The holding map against simulated pulls: what a fixture bears, by direction.

    python -m experiments.holding_map --case motor/P2 --out out/holding_map
    python -m experiments.holding_map --case plate/P1 --fixture rigid_jig

For a part in a posture, the map says, before anything runs, which force and moment the fixture
bears in each direction and what fails first: the soft jig from the planner's imprint, a fixture
that is made for the part from its design. Then a hand presses the part in, and the part is pulled
in the same directions at 20 N/s, in a copy of the same state each time. Prints both with their
ratio, and writes holding_map.json and holding_map.png.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, Any, Literal, cast

import numpy as np
import tyro
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from pydrake.math import RigidTransform
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.configuration.config import CellConfig
from cell.errors import RunFailure
from cell.fixtures import FixtureError, fixture_class
from cell.fixtures.custom.fixture import CustomFixture
from cell.machines.grippers import HAND_E
from cell.products.loading import load_product
from cell.products.product import Product
from cell.workpieces.work import fixture_work
from experiments.cli.common import Common
from experiments.cli.ending import exit_code
from experiments.paper.cases import case_seed
from experiments.paper.holding import MOST, TURN_MOST, pull
from experiments.paper.postures import POSTURES, Posture, chosen
from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import TrialDisturbance, check_fits, gripped, held, run_trial, upright
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.plots import DPI, figure_png
from planning.feasibility.solids import solids_of
from planning.fixture_analysis.frozen_body import HeldPart, frozen_body
from planning.fixture_analysis.held_body import HeldBody, seated_body
from planning.fixture_analysis.holding_map import Bearing, sphere_of_forces

EXACT = {
    "push.grasp_position_sigma": 0.0,
    "push.grasp_angle_sigma_deg": 0.0,
    "push.jig_position_sigma": 0.0,
}
CLEAR = 0.1  # A criterion counts where it is this much ahead of the next one.


@dataclass(frozen=True)
class MapOptions:
    """Options of the script."""

    case: Annotated[str | None, arg(metavar="motor/P2")] = None
    """A posture, or a part for all of its postures. Default: all six."""

    fixture: Literal["soft_jig", "rigid_jig", "support_jig"] = "soft_jig"
    """What holds the part."""

    directions: int = 30
    """Directions of the force, spread over the sphere; the six axes of moment come in addition."""

    pulls: bool = True
    """Whether to simulate the pulls."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


@dataclass(frozen=True)
class Row:
    """One direction of one case.

    Attributes:
        case: Label of the posture.
        direction: (6,) unit moment or unit force in J.
        mapped: By the map.
        pulled: In simulation; None if not asked for.
    """

    case: str
    direction: np.ndarray
    mapped: Bearing
    pulled: Bearing | None

    @property
    def ratio(self) -> float:
        """Load of the map over that of the simulation; NaN where the part did not move."""
        if self.pulled is None or not (self.pulled.moved and self.mapped.moved):
            return float("nan")
        return self.mapped.load / self.pulled.load

    @property
    def agrees(self) -> bool | None:
        """Whether the criterion is right; None where it is not clear, or nothing failed."""
        if self.pulled is None or not self.pulled.criterion or self.mapped.margin <= CLEAR:
            return None
        return self.mapped.criterion == self.pulled.criterion if self.mapped.criterion else None


def mapped_body(config: CellConfig, product: Product, posture: Posture) -> HeldBody:
    """Return a part in its posture on its fixture, as the planner computes it.

    Raises:
        FixtureError: A fixture cannot be made for it.
    """
    part = replace(product.parts[posture.part], X_AP=RigidTransform())
    alone = gripped(product, posture)
    (solid,) = solids_of(replace(alone, parts={part.name: part})).values()
    if work := fixture_work(held(config, posture), alone, HAND_E):
        kind = cast(type[CustomFixture], fixture_class(config.workcell.fixture))
        return seated_body(kind.design(work), work, [solid], RigidTransform())
    felt = HeldPart.of(part, solid, config.jig.jammed.friction)
    R_JP = upright(posture.up, 0.0).matrix()
    p_middle = (R_JP @ part.mesh.center_mass)[:2]
    return frozen_body([felt], [solid], R_JP, p_middle, config.jig, config.placement.press_force)


def study(
    config: CellConfig, product: Product, posture: Posture, options: MapOptions
) -> tuple[list[Row], float]:
    """Return all directions of a posture, and the CPU time of the map [s].

    Raises:
        RunFailure: The part could not be placed.
    """
    check_fits(config, product, posture)
    started = time.process_time()
    body = mapped_body(config, product, posture)
    moments = np.vstack([np.eye(6)[:3], -np.eye(6)[:3]])
    directions = np.vstack([sphere_of_forces(options.directions), moments + 0.0])
    found = body.bears(directions, np.where(directions[:, :3].any(axis=1), TURN_MOST, MOST))
    seconds = time.process_time() - started
    pulled: list[Bearing | None] = [None] * len(found)
    if options.pulls:
        bench = RigBench.build(config, product, posture)
        draw = TrialDisturbance.draw(config, case_seed(0, posture.label, 0))
        hand = bench.begin(draw)
        trial = run_trial(hand, None)
        if trial.failure is not None:
            raise RunFailure(f"{posture.label} was not placed: {trial.failure[1]}")
        pulled = [pull(hand.simulation, direction) for direction in directions]
    rows = zip(directions, found, pulled, strict=True)
    return [Row(posture.label, *row) for row in rows], seconds


def table(rows: Sequence[Row]) -> Table:
    """Return the directions of one case for a terminal."""
    shown = Table(title=rows[0].case)
    for column in ("direction", "map", "simulated", "ratio", "fails first", "margin", "simulated"):
        shown.add_column(column)
    for row in rows:
        turning = row.direction[:3].any()
        axis = row.direction[:3] if turning else row.direction[3:]
        unit, pulled = "N m" if turning else "N", row.pulled
        shown.add_row(
            f"{'moment' if turning else 'force'} ({', '.join(f'{x:.2f}' for x in axis)})",
            f"{_load(row.mapped)} {unit}",
            f"{_load(pulled)} {unit}" if pulled else "",
            f"{row.ratio:.2f}" if np.isfinite(row.ratio) else "",
            row.mapped.criterion,
            f"{row.mapped.margin:.2f}" if row.mapped.criterion else "",
            pulled.criterion if pulled else "",
        )
    return shown


def _load(bearing: Bearing) -> str:
    return f"{'' if bearing.moved else '> '}{bearing.load:.3g}"


def summary(rows: Sequence[Row], seconds: float) -> dict[str, Any]:
    """Return how well the map does in one case."""
    ratios = np.array([row.ratio for row in rows if np.isfinite(row.ratio)])
    judged = [row.agrees for row in rows if row.agrees is not None]
    return {
        "case": rows[0].case,
        "map_cpu_seconds": seconds,
        "directions": len(rows),
        "compared": len(ratios),
        "ratio": [float(x) for x in np.percentile(ratios, [0, 50, 100])] if len(ratios) else None,
        "within_20_percent": int(np.sum(np.abs(ratios - 1) <= 0.2)),
        "criterion_clear": len(judged),
        "criterion_right": int(sum(judged)),
    }


def plot(rows: Sequence[Row]) -> bytes:
    """Plot map over simulated pulls, forces and moments, with a band of 20 %."""
    figure = Figure(figsize=(9, 4.2), dpi=DPI, layout="constrained")
    panels = zip(figure.subplots(1, 2), ("force [N]", "moment [N m]"), (False, True), strict=True)
    for axes, label, turning in panels:
        loads = []
        for case in dict.fromkeys(row.case for row in rows):
            points = [
                (row.pulled.load, row.mapped.load)
                for row in rows
                if row.case == case and row.pulled and bool(row.direction[:3].any()) == turning
                and np.isfinite(row.ratio)
            ]  # fmt: skip
            if points:
                axes.loglog(*np.array(points).T, "o", markersize=4, label=case)
                loads += points
        if loads:
            ends = np.array([0.8 * np.min(loads), 1.25 * np.max(loads)])
            axes.fill_between(ends, 0.8 * ends, 1.2 * ends, color="0.9", zorder=0)
            axes.plot(ends, ends, "0.6", linewidth=0.8, zorder=0)
            axes.legend(fontsize=8, frameon=False)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(f"simulated {label}")
        axes.set_ylabel(f"map {label}")
    return figure_png(figure)


def run(options: MapOptions) -> int:
    """Run the script; return the exit code."""
    config = options.common.load_config().with_changes(EXACT)
    config = config.with_changes({"workcell.fixture": options.fixture})
    product, console = load_product("motor_unit"), Console(quiet=options.common.quiet, width=140)
    postures = chosen("posture to hold", POSTURES, options.case)
    rows: list[Row] = []
    summaries = []
    with output_folder(options.common.out) as out:
        for posture in postures:
            try:
                own, seconds = study(config, product, posture, options)
            except FixtureError as error:
                if len(postures) == 1:
                    raise
                console.print(f"{posture.label}: refused. {error}", markup=False)
                continue
            rows += own
            summaries.append(summary(own, seconds))
            console.print(table(own))
            console.print(summaries[-1], markup=False)
            listed = [_plain(row) for row in rows]
            write_json(out / "holding_map.json", {"cases": summaries, "rows": listed})
        if options.pulls:
            (out / "holding_map.png").write_bytes(plot(rows))
    return 0


def _plain(row: Row) -> dict[str, Any]:
    """Return a row as plain values; SI units."""
    return asdict(row) | {"ratio": row.ratio if np.isfinite(row.ratio) else None}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, or 2 for bad input."""
    options = tyro.cli(
        MapOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("holding_map", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
