"""The paper's table I, measured: soft jig, jig with supports and custom jig side by side.

    python -m experiments.fixture_comparison --trials 5 --out out/fixture_comparison

For every fixture and posture of the motor unit: whether it can be fixed, what has to be made or set
for it, how far the placed part is from where it was meant to be, with a grasp disturbed by 1 mm and
2 degrees per axis, and what an undisturbed one bears by direction. The hand is that of the rig, the
jig is where it is believed to be. Prints the tables, and writes them to comparison.json.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.fixtures.base import Fixture
from cell.fixtures.rigid_jig import RigidJig
from cell.fixtures.support_jig import SupportJig
from cell.products.loading import load_product
from cell.products.product import Product
from experiments.cli.common import Common
from experiments.cli.ending import exit_code
from experiments.paper.cases import case_seed
from experiments.paper.holding import Held, holding
from experiments.paper.postures import POSTURES, Posture, chosen
from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import TrialDisturbance, TrialRecord, check_fits, run_trial
from experiments.paper.trial_metrics import measure_place, place_succeeded, tilt_between
from experiments.reporting.output import output_folder, write_json
from planning.operations.measures import angle_between

FIXTURES = ("soft_jig", "support_jig", "rigid_jig")
DISTURBED = {
    "push.grasp_position_sigma": 1e-3,
    "push.grasp_angle_sigma_deg": 2.0,
    "push.jig_position_sigma": 0.0,
}
EXACT = {**DISTURBED, "push.grasp_position_sigma": 0.0, "push.grasp_angle_sigma_deg": 0.0}
# The paper's marks [S]: ease of fixing, versatility, positioning; it marks no custom jig.
PAPER = {
    "soft_jig": (True, True, False),
    "support_jig": (False, True, True),
}
SEATED = 5e-4  # A part this near to its seat in height is seated [m] [A].


@dataclass(frozen=True)
class ComparisonOptions:
    """Options of the script."""

    trials: int = 5
    """Disturbed placements of each posture on each fixture."""

    case: Annotated[str | None, arg(metavar="motor/P2")] = None
    """A posture, or a part for all of its postures. Default: all six."""

    pulls: bool = True
    """Whether to measure what the fixtures bear."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


@dataclass
class Row:
    """One posture on one fixture.

    Attributes:
        fixture: Its name.
        case: Label of the posture.
        refused: Why it cannot be fixed at all; "" if it can.
        effort: What it takes, by kind.
        trials: Disturbed placements.
        upright: Of these, upright and at rest.
        seated: Of these, on the seat; those of the soft jig are where they are put.
        offsets_m, angles_rad: Of each upright one, sideways from where it was meant to be, and the
            angle.
        holds: By direction, what an undisturbed one bears.
        ms_per_step: CPU time of the undisturbed placement.
    """

    fixture: str
    case: str
    refused: str = ""
    effort: dict[str, float] = field(default_factory=dict)
    trials: int = 0
    upright: int = 0
    seated: int = 0
    offsets_m: list[float] = field(default_factory=list)
    angles_rad: list[float] = field(default_factory=list)
    holds: dict[str, Held] = field(default_factory=dict)
    ms_per_step: float = float("nan")


def compare(
    config: CellConfig, product: Product, name: str, posture: Posture, options: ComparisonOptions
) -> Row:
    """Return what comes out for one posture on one fixture."""
    row = Row(name, posture.label)
    config = config.with_changes({"workcell.fixture": name, **DISTURBED})
    try:
        check_fits(config, product, posture)
    except InputError as error:
        row.refused = str(error)
        return row
    bench = RigBench.build(config, product, posture)
    row.effort = effort(bench.rig.fixture)
    for k in range(options.trials):
        draw = TrialDisturbance.draw(config, case_seed(options.common.seed, posture.label, k))
        _count(row, run_trial(bench.begin(draw), None))
    exact = config.with_changes(EXACT)
    hand = bench.begin(TrialDisturbance.draw(exact, case_seed(0, posture.label, 0)))
    trial = run_trial(hand, None)
    row.ms_per_step = 1e3 * trial.cpu_seconds / max(1, hand.simulation.steps)
    if options.pulls and trial.failure is None:
        row.holds = dict(holding(hand.simulation))
    return row


def effort(fixture: Fixture) -> dict[str, float]:
    """Return what has to be made, set and pumped for one part in one posture."""
    if isinstance(fixture, RigidJig):
        return {"parts to make": 1, "printed_cm3": 1e6 * float(fixture.mesh.volume)}
    if isinstance(fixture, SupportJig):
        return {"supports to set": 3, "posts to set": len(fixture.made.posts.sides)}
    return {"evacuations": 1}


def _count(row: Row, trial: TrialRecord) -> None:
    """Enter a disturbed placement."""
    row.trials += 1
    if trial.placed is None or not place_succeeded(trial, measure_place(trial)):
        return
    row.upright += 1
    meant = trial.planned if trial.seat is None else trial.seat
    off = trial.placed.translation() - meant.translation()
    seated = abs(off[2]) < SEATED and tilt_between(meant, trial.placed) < np.deg2rad(0.5)
    row.seated += trial.seat is None or seated
    row.offsets_m.append(float(np.hypot(off[0], off[1])))
    row.angles_rad.append(angle_between(meant, trial.placed))


def table(rows: Sequence[Row]) -> Table:
    """Return what came out, for a terminal."""
    shown = Table(title="Fixtures")
    for column in ("fixture", "case", "upright", "seated", "offset [mm]", "angle [deg]"):
        shown.add_column(column)
    for column in ("sideways [N]", "up [N]", "moment z [N m]", "ms/step", "takes"):
        shown.add_column(column)
    for row in rows:
        if row.refused:
            shown.add_row(row.fixture, row.case, "refused")
            continue
        sideways = [row.holds[f"force {way}"] for way in ("+x", "-x", "+y", "-y") if row.holds]
        shown.add_row(
            row.fixture,
            row.case,
            f"{row.upright}/{row.trials}",
            f"{row.seated}/{row.trials}",
            _spread(1e3 * np.array(row.offsets_m)),
            _spread(np.rad2deg(row.angles_rad)),
            _load(min(sideways, key=lambda held: held.load)) if sideways else "",
            _load(row.holds["force +z"]) if row.holds else "",
            _load(row.holds["moment z"]) if row.holds else "",
            f"{row.ms_per_step:.1f}",
            ", ".join(f"{value:g} {kind}" for kind, value in row.effort.items()),
        )
    return shown


def _spread(values: np.ndarray) -> str:
    return f"{np.median(values):.2f} (most {values.max():.2f})" if len(values) else ""


def _load(held: Held) -> str:
    return f"{'' if held.moved else '> '}{held.load:.1f}"


def marks(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """Return by fixture what stands beside the paper's marks."""
    found = {}
    for name in dict.fromkeys(row.fixture for row in rows):
        own = [row for row in rows if row.fixture == name]
        trials = sum(row.trials for row in own)
        offsets = [value for row in own for value in row.offsets_m]
        found[name] = {
            "paper": PAPER.get(name),
            "postures_taken": sum(not row.refused for row in own),
            "postures": len(own),
            "seated_share": sum(row.seated for row in own) / trials if trials else None,
            "median_offset_m": float(np.median(offsets)) if offsets else None,
        }
    return found


def to_dict(rows: Sequence[Row]) -> Mapping[str, Any]:
    """Return all of it as plain values."""
    return {"rows": [asdict(row) for row in rows], "fixtures": marks(rows)}


def run(options: ComparisonOptions) -> int:
    """Run the script; return the exit code."""
    config, product = options.common.load_config(), load_product("motor_unit")
    postures = chosen("posture to place", POSTURES, options.case)
    console, rows = Console(quiet=options.common.quiet, highlight=False, width=180), []
    with output_folder(options.common.out) as out:
        for posture in postures:
            for name in FIXTURES:
                rows.append(compare(config, product, name, posture, options))
                write_json(out / "comparison.json", to_dict(rows))
                console.print(
                    f"{name}, {posture.label}: {rows[-1].refused or 'done'}", markup=False
                )
    console.print(table(rows))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, or 2 for bad input."""
    options = tyro.cli(
        ComparisonOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("fixture_comparison", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
