"""What linked contact changes: against full contact, and beside what half its time step changes.

    python -m experiments.contact_study --seeds 3 --workers 2 --out out/contact_study

Runs three assemblies with several seeds, every placement and every push, each in three ways: as
configured, with full contact, and with full contact at half the time step. A quantity that the
default changes by more than the step does is marked. Prints the tables, and writes them to
study.json.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.configuration.config import CellConfig
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Row, Trial
from experiments.cli.common import Common, check_counts
from experiments.cli.ending import exit_code
from experiments.paper.cases import cases_of
from experiments.reporting.output import output_folder, write_json
from experiments.reporting.provenance import finite

DEFAULT, FULL, HALF = "default", "full", "full, half step"
HALVED = 0.5e-3  # [s]
WAYS = {
    DEFAULT: (),
    FULL: ("simulation.contact=full",),
    HALF: ("simulation.contact=full", f"simulation.time_step={HALVED:g}"),
}
ASSEMBLIES = {
    "motor unit": ("motor_unit", ""),
    "motor unit, second order": ("motor_unit", "plate,bolts,motor"),
    "idler": ("idler", ""),
}
RIG = ("place", "push")
RIG_QUANTITIES = ("displacement_m", "push_shear_peak_N", "depth_m", "tilt_rad")


@dataclass(frozen=True)
class StudyOptions:
    """Options of the script."""

    seeds: int = 3
    """Seeds of each assembly, from 0; the experiments on the rig run one trial of seed 0."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Runs at a time. What is done already is not run again."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


@dataclass(frozen=True)
class StudyRun:
    """One trial of the study.

    Attributes:
        name: Of an assembly, or "place" or "push".
        where: Case of an experiment on the rig; "" for an assembly.
        way: How its contact is computed.
        seed: Of the run.
    """

    name: str
    where: str
    way: str
    seed: int

    def trial(self, config: CellConfig) -> Trial:
        """Return the trial of a campaign that carries it out."""
        config = config.with_changes(WAYS[self.way])
        if self.name in RIG:
            (trial,) = trials(self.name, [{"case": self.where}], config=config, seeds=[self.seed])
            return trial
        product, order = ASSEMBLIES[self.name]
        point = {"order": order}
        (trial,) = trials("assemble", [point], product=product, config=config, seeds=[self.seed])
        return trial


def study_runs(seeds: int) -> list[StudyRun]:
    """Return all runs of the study, the longest ones first."""
    ways = (HALF, FULL, DEFAULT)
    assemblies = [
        StudyRun(name, "", way, k) for way in ways for name in ASSEMBLIES for k in range(seeds)
    ]
    rig = [
        StudyRun(name, case.label, way, 0)
        for way in ways
        for name in RIG
        for case in cases_of(name, None)
    ]
    return assemblies + rig


Values = dict[tuple[str, str], np.ndarray]  # By step or case and quantity, over bolts.


def values_of(run: StudyRun, row: Row) -> Values:
    """Return what was measured in a run; that of several bolts is one array."""
    found: dict[tuple[str, str], list[float]] = {}
    for name, value in row.measured.items():
        step, _, quantity = name.rpartition("/")
        if run.name not in RIG or quantity in RIG_QUANTITIES:
            key = run.where or step.partition("/")[0], quantity
            found.setdefault(key, []).append(np.nan if value is None else value)
    return {key: np.array(values) for key, values in found.items()}


@dataclass(frozen=True)
class Compared:
    """One quantity in three ways.

    Attributes:
        name: Of the assembly or experiment.
        where: Operation or case.
        quantity: With its unit in the name.
        full: Its mean in full contact.
        changed: Largest change by the default, over seeds and bolts.
        by_step: Largest change by half the time step.
    """

    name: str
    where: str
    quantity: str
    full: float
    changed: float
    by_step: float

    @property
    def marked(self) -> bool:
        """Whether the default changes it by more than the step does."""
        return not self.changed <= self.by_step


def compare(name: str, ways: dict[str, list[Values]]) -> Iterator[Compared]:
    """Yield every quantity of an assembly or experiment, given its values by way and seed."""
    for key in ways[FULL][0]:
        rows = {
            way: np.concatenate([values.get(key, np.array([np.nan])) for values in runs])
            for way, runs in ways.items()
        }
        alike = len({len(row) for row in rows.values()}) == 1
        changed, by_step = (
            float(np.max(np.abs(rows[way] - rows[FULL]))) if alike else np.nan
            for way in (DEFAULT, HALF)
        )
        yield Compared(name, *key, float(np.mean(rows[FULL])), changed, by_step)


def outcome_table(rows: Mapping[StudyRun, Row]) -> Table:
    """Return verdict and CPU time of every run."""
    table = Table("", "seed", *WAYS, title="Outcomes, and CPU time [s]", title_justify="left")
    for run in (run for run in rows if run.way == FULL):
        own = [rows[replace(run, way=way)] for way in WAYS]
        cells = [f"{row.verdict} {row.cpu_seconds:.0f}" for row in own]
        table.add_row(f"{run.name} {run.where}".rstrip(), str(run.seed), *cells)
    return table


def comparison_table(rows: Sequence[Compared]) -> Table:
    """Return all quantities; those that are marked have a star."""
    title = "Largest change by the default, and of full contact by half its step"
    table = Table("", "quantity", "full", DEFAULT, "half step", "", title=title)
    for row in rows:
        numbers = (f"{value:.4g}" for value in (row.full, row.changed, row.by_step))
        table.add_row(f"{row.name}: {row.where}", row.quantity, *numbers, "*" * row.marked)
    return table


def run(options: StudyOptions) -> int:
    """Run what is missing, write ``study.json`` and print the tables; return 0.

    Raises:
        InputError: An option or a value is invalid.
    """
    check_counts(options, "seeds", "workers")
    config = options.common.load_config()
    # Bad values are refused before hours of computation.
    wanted = {run: run.trial(config) for run in study_runs(options.seeds)}
    console = Console(quiet=options.common.quiet, highlight=False)
    with output_folder(options.common.out) as out:
        done = run_campaign(
            list(wanted.values()),
            out,
            workers=options.workers,
            about={"command": "contact_study"},
            console=console,
            report=False,
        )
        ended = {row.key: row for row in done}
        rows = {run: ended[trial.key] for run, trial in wanted.items()}
        found = compared(rows)
        write_json(out / "study.json", {"rows": [finite(vars(row)) for row in found]})
    console.print(outcome_table(rows))
    console.print(comparison_table(found))
    return 0


def compared(rows: Mapping[StudyRun, Row]) -> list[Compared]:
    """Return every quantity of every assembly and experiment."""
    found = []
    for name in (*ASSEMBLIES, *RIG):
        for where in dict.fromkeys(run.where for run in rows if run.name == name):
            ways = {
                way: [
                    values_of(run, row)
                    for run, row in rows.items()
                    if (run.name, run.where, run.way) == (name, where, way)
                ]
                for way in WAYS
            }
            found += compare(name, ways)
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(
        StudyOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("contact_study", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
