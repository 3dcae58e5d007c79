"""The paper's table I, measured: soft jig, jig with supports and custom jig side by side.

    python -m experiments.fixture_comparison --out out/fixture_comparison
    python -m experiments.fixture_comparison --products motor_unit --case motor/P2 --trials 3

For every fixture and posture of the parts of some products: whether it can be fixed, what has to be
made or set for it, how far the placed part is from where it was meant to be, with a grasp disturbed
by 1 mm and 2 degrees per axis, and what an undisturbed one bears by direction. The same with parts
that are larger than the fixture that is made for them knows; the soft jig knows no size. The hand
is that of the rig, the jig is where it is believed to be.

Prints the tables, and writes comparison.json after each row. What is in that file of the folder
already is not run again: an interrupted table is continued by the same command. A row takes 1 to 3
CPU minutes.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.fixtures import fixture_class
from cell.fixtures.base import Fixture
from cell.fixtures.rigid_jig import RigidJig
from cell.fixtures.support_jig import SupportJig
from cell.products.loading import load_product
from cell.products.product import Product
from experiments.campaigns.code_version import code_digest
from experiments.cli.common import Common
from experiments.cli.ending import exit_code
from experiments.paper.cases import case_seed
from experiments.paper.holding import Held, holding
from experiments.paper.postures import Posture, chosen
from experiments.paper.product_postures import postures_of
from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import TrialDisturbance, TrialRecord, check_fits, run_trial
from experiments.paper.trial_metrics import measure_place, place_succeeded, stands
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.provenance import finite
from experiments.reporting.statistics import wilson
from planning.operations.measures import angle_between

FIXTURES = ("soft_jig", "support_jig", "rigid_jig")
DISTURBED = {
    "push.grasp_position_sigma": 1e-3,
    "push.grasp_angle_sigma_deg": 2.0,
    "push.jig_position_sigma": 0.0,
}
EXACT = {**DISTURBED, "push.grasp_position_sigma": 0.0, "push.grasp_angle_sigma_deg": 0.0}
FILE = "comparison.json"
# The paper's marks [S]: ease of fixing, versatility, positioning; it marks no custom jig.
PAPER = {
    "soft_jig": (True, True, False),
    "support_jig": (False, True, True),
}
LARGER = (0.0, 1e-4, 3e-4)
"""By which the parts are larger than drawn [m]."""


@dataclass(frozen=True)
class ComparisonOptions:
    """Options of the script."""

    products: Annotated[tuple[str, ...], arg(metavar="NAME|FILE ...")] = ("motor_unit", "idler")
    """Products whose parts are compared: names, or anything else that can be loaded."""

    trials: int = 10
    """Disturbed placements of each row."""

    case: Annotated[str | None, arg(metavar="motor/P2")] = None
    """A posture, or a part for all of its postures. Default: all."""

    pulls: bool = True
    """Whether to measure what the fixtures bear."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


@dataclass
class Row:
    """One posture on one fixture.

    Attributes:
        product: Its name or file.
        fixture: Its name.
        case: Label of the posture.
        larger_m: By which the part is larger than drawn.
        refused: Why it cannot be fixed at all; "" if it can.
        effort: What it takes, by kind.
        trials: Disturbed placements.
        upright: Of these, upright and at rest.
        seated: Of these, on the seat as well; those of the soft jig are where they are put.
        seated_interval: Wilson's 95 % interval of the share of these.
        offsets_m, angles_rad: Of each upright one, sideways from where it was meant to be, and the
            angle.
        holds: By direction, what an undisturbed one bears.
        ms_per_step: CPU time of the undisturbed placement.
    """

    product: str
    fixture: str
    case: str
    larger_m: float = 0.0
    refused: str = ""
    effort: dict[str, float] = field(default_factory=dict)
    trials: int = 0
    upright: int = 0
    seated: int = 0
    seated_interval: tuple[float, float] | None = None
    offsets_m: list[float] = field(default_factory=list)
    angles_rad: list[float] = field(default_factory=list)
    holds: dict[str, Held] = field(default_factory=dict)
    ms_per_step: float | None = None


@dataclass(frozen=True)
class Wanted:
    """A row that is to be run.

    Attributes:
        product: That was loaded.
        source: Its name or file, as it was asked for.
        fixture: Name of the fixture.
        posture: Of the part.
        larger: By which the part is larger than drawn [m].
    """

    product: Product
    source: str
    fixture: str
    posture: Posture
    larger: float

    @property
    def key(self) -> tuple[str, str, str, float]:
        """What tells it from others."""
        return self.source, self.fixture, self.posture.label, self.larger


def wanted_rows(options: ComparisonOptions) -> list[Wanted]:
    """Return the rows of the table.

    Raises:
        UnknownName: No posture of the products has the label that is asked for.
    """
    loaded = [(source, load_product(source)) for source in options.products]
    postures = {source: postures_of(product) for source, product in loaded}
    known = {posture.label: posture for own in postures.values() for posture in own}
    labels = {posture.label for posture in chosen("posture to place", known, options.case)}
    return [
        Wanted(product, source, fixture, posture, larger)
        for source, product in loaded
        for posture in postures[source]
        if posture.label in labels
        for fixture in FIXTURES
        for larger in (LARGER if fixture_class(fixture).custom else LARGER[:1])
    ]


def compare(config: CellConfig, wanted: Wanted, options: ComparisonOptions) -> Row:
    """Return what comes out for one posture on one fixture."""
    product, posture = wanted.product, wanted.posture
    row = Row(wanted.source, wanted.fixture, posture.label, wanted.larger)
    config = config.with_changes({"workcell.fixture": wanted.fixture, **DISTURBED})
    try:
        check_fits(config, product, posture)
    except InputError as error:
        row.refused = str(error)
        return row
    bench = RigBench.build(config, product, posture, wanted.larger)
    row.effort = effort(bench.rig.fixture)
    for k in range(options.trials):
        draw = TrialDisturbance.draw(config, case_seed(options.common.seed, posture.label, k))
        _count(row, run_trial(bench.begin(draw), None))
    row.seated_interval = wilson(row.seated, row.trials) if row.trials else None
    if wanted.larger:
        return row
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
        return {"supports to set": 3, "posts to set": len(fixture.posts.sides)}
    return {"evacuations": 1}


def _count(row: Row, trial: TrialRecord) -> None:
    """Enter a disturbed placement."""
    row.trials += 1
    measured = measure_place(trial)
    # A larger part stands on its supports with its reference higher by half of what it has grown.
    if "off_supports_m" in measured:
        measured["off_supports_m"] -= row.larger_m / 2
    row.seated += place_succeeded(trial, measured)
    if trial.placed is None or not stands(trial, measured):
        return
    row.upright += 1
    meant = trial.planned if trial.seat is None else trial.seat
    off = trial.placed.translation() - meant.translation()
    row.offsets_m.append(float(np.hypot(off[0], off[1])))
    row.angles_rad.append(angle_between(meant, trial.placed))


def table(rows: Sequence[Row]) -> Table:
    """Return what came out, for a terminal."""
    shown = Table(title="Fixtures")
    for column in ("case", "fixture", "larger [mm]", "upright", "seated", "95 %"):
        shown.add_column(column)
    shown.add_column("offset [mm]")
    shown.add_column("angle [deg]")
    for column in ("sideways [N]", "up [N]", "moment z [N m]", "ms/step", "takes"):
        shown.add_column(column)
    for row in rows:
        if row.refused:
            shown.add_row(row.case, row.fixture, f"{1e3 * row.larger_m:g}", "refused")
            continue
        sideways = [row.holds[f"force {way}"] for way in ("+x", "-x", "+y", "-y") if row.holds]
        shown.add_row(
            row.case,
            row.fixture,
            f"{1e3 * row.larger_m:g}",
            f"{row.upright}/{row.trials}",
            f"{row.seated}/{row.trials}",
            "{:.0%}-{:.0%}".format(*row.seated_interval) if row.seated_interval else "",
            _spread(1e3 * np.array(row.offsets_m)),
            _spread(np.rad2deg(row.angles_rad)),
            _load(min(sideways, key=lambda held: held.load)) if sideways else "",
            _load(row.holds["force +z"]) if row.holds else "",
            _load(row.holds["moment z"]) if row.holds else "",
            "" if row.ms_per_step is None else f"{row.ms_per_step:.1f}",
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
        own = [row for row in rows if row.fixture == name and row.larger_m == 0.0]
        trials = sum(row.trials for row in own)
        offsets = [value for row in own for value in row.offsets_m]
        found[name] = {
            "paper": PAPER.get(name),
            "postures_taken": sum(not row.refused for row in own),
            "postures": len(own),
            "seated_share": sum(row.seated for row in own) / trials if trials else None,
            "seated_interval": wilson(sum(row.seated for row in own), trials) if trials else None,
            "median_offset_m": float(np.median(offsets)) if offsets else None,
        }
    return found


def to_dict(rows: Sequence[Row]) -> Mapping[str, Any]:
    """Return all of it as plain values."""
    return {"rows": [asdict(row) for row in rows], "fixtures": marks(rows)}


def rows_in(file: Path, about: Mapping[str, Any]) -> list[Row]:
    """Return the rows that a file has already.

    Raises:
        InputError: They were made with other options or code, or it is no file of this script.
    """
    if not file.exists():
        return []
    try:
        found = json.loads(file.read_text())
        rows = [
            Row(**row | {"holds": {key: Held(**held) for key, held in row["holds"].items()}})
            for row in found["rows"]
        ]
        made = found["about"]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"'{file}' is not a table of this script: {error}.") from error
    differ = [
        f"{key} {made.get(key)}, now {about[key]}" for key in about if made.get(key) != about[key]
    ]
    if differ:
        raise InputError(
            f"'{file}' has other {'; '.join(differ)}: choose another --out, or remove it."
        )
    return rows


def digest(config: CellConfig) -> str:
    """Return what tells a configuration from others."""
    text = json.dumps(finite(config.to_dict()), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def run(options: ComparisonOptions) -> int:
    """Run the script; return the exit code."""
    config, wanted = options.common.load_config(), wanted_rows(options)
    about = {
        "trials": options.trials,
        "seed": options.common.seed,
        "pulls": options.pulls,
        "settings": digest(config),
        "code": code_digest(Path(__file__)),
    }
    console = Console(quiet=options.common.quiet, highlight=False, width=180)
    with output_folder(options.common.out) as out:
        rows = rows_in(out / FILE, about)
        done = {(row.product, row.fixture, row.case, row.larger_m) for row in rows}
        for number, each in enumerate(wanted):
            started = time.process_time()
            if each.key not in done:
                rows.append(compare(config, each, options))
                write_json(out / FILE, {**to_dict(rows), "about": about})
            said = "done before" if each.key in done else rows[-1].refused or "done"
            spent = time.process_time() - started
            console.print(
                f"{number + 1} of {len(wanted)}: {each.source} {each.posture.label}, "
                f"{each.fixture}, {1e3 * each.larger:g} mm larger: {said}, {spent:.0f} CPU s",
                markup=False,
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
