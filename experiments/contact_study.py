"""What linked contact changes: against full contact, and beside what half its time step changes.

    python -m experiments.contact_study --seeds 3 --workers 2 --out out/contact_study

Runs three assemblies with several seeds, every placement and every push, each in three ways: as
configured, with full contact, and with full contact at half the time step. A quantity that the
default changes by more than the step does is marked. A run whose result is in the folder already is
not repeated. Prints the tables, and writes them to study.json.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from experiments.cli.assemble import Assemble
from experiments.cli.common import BadUsage, Common
from experiments.cli.ending import exit_code
from experiments.cli.paper import Place, Push
from experiments.reporting.output import output_folder, write_json

DEFAULT, FULL, HALF = "default", "full", "full, half step"
HALVED = 0.5e-3  # [s]
WAYS = {
    DEFAULT: (),
    FULL: ("simulation.contact=full",),
    HALF: ("simulation.contact=full", f"simulation.time_step={HALVED:g}"),
}
ASSEMBLIES = {
    "motor unit": ("motor_unit", None),
    "motor unit, second order": ("motor_unit", "plate,bolts,motor"),
    "idler": ("idler", None),
}
RIG = {"place": Place, "push": Push}
RIG_QUANTITIES = ("displacement_m", "push_shear_peak_N", "depth_m", "tilt_rad")


@dataclass(frozen=True)
class StudyOptions:
    """Options of the script."""

    seeds: int = 3
    """Seeds of each assembly, from 0; the experiments on the rig run one trial of seed 0."""

    workers: Annotated[int, arg(metavar="CORES")] = 1
    """Runs at a time."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


@dataclass(frozen=True)
class StudyRun:
    """One run of the study.

    Attributes:
        name: Of an assembly, or "place" or "push".
        way: How its contact is computed.
        seed: Of the run.
    """

    name: str
    way: str
    seed: int

    @property
    def folder(self) -> str:
        """In that of the study."""
        return f"{self.name} {self.way} {self.seed}".replace(",", "").replace(" ", "_")

    def common(self, options: StudyOptions) -> Common:
        """Return the options of the command that carries it out."""
        own = options.common
        overrides = (*own.overrides, *WAYS[self.way])
        out = own.out / self.folder
        return replace(own, overrides=overrides, seed=self.seed, out=out, quiet=True)


def study_runs(seeds: int) -> list[StudyRun]:
    """Return all runs of the study, the longest ones first."""
    assemblies = [
        StudyRun(name, way, seed) for way in (HALF, FULL, DEFAULT) for name in ASSEMBLIES
        for seed in range(seeds)
    ]  # fmt: skip
    return assemblies + [StudyRun(name, way, 0) for way in (HALF, FULL, DEFAULT) for name in RIG]


def carry_out(options: StudyOptions, run: StudyRun) -> dict[str, Any]:
    """Return the result of a run, from its folder if it is there."""
    common = run.common(options)
    file = common.out / "result.json"
    if not file.exists():
        if run.name in RIG:
            RIG[run.name](trials=1, common=common).run()
        else:
            product, order = ASSEMBLIES[run.name]
            Assemble(product, order=order, common=common).run()
    return json.loads(file.read_text(encoding="utf-8"))


Values = dict[tuple[str, str], np.ndarray]  # By operation and quantity, over bolts.


def assembly_values(result: dict[str, Any]) -> Values:
    """Return what was measured in an assembly; that of several bolts is one array."""
    found: dict[tuple[str, str], list[float]] = {}
    for step in result["steps"]:
        for name, value in step["measured"].items():
            key = step["name"], name.rpartition("/")[2]
            found.setdefault(key, []).append(np.nan if value is None else float(value))
    return {key: np.array(values) for key, values in found.items()}


def rig_values(result: dict[str, Any]) -> Values:
    """Return what was measured in the cases of an experiment."""
    return {
        (label(case), name): np.array([case["measured"][name]])
        for case in result["cases"]
        for name in RIG_QUANTITIES
        if case["measured"].get(name) is not None
    }


def label(case: dict[str, Any]) -> str:
    """Return the label of a case, for example "motor/P2/a"."""
    return "/".join(case[key] for key in ("part", "posture", "direction") if key in case)


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


def outcome_table(results: dict[StudyRun, dict[str, Any]]) -> Table:
    """Return verdicts and CPU times of all runs, and of each case of the rig."""
    table = Table("", "seed", *WAYS, title="Outcomes, and CPU time [s]", title_justify="left")
    for run in (run for run in results if run.way == FULL):
        own = [results[replace(run, way=way)] for way in WAYS]
        if run.name not in RIG:
            cells = [f"{r['verdict']} {sum(s['cpu_seconds'] for s in r['steps']):.0f}" for r in own]
            table.add_row(run.name, str(run.seed), *cells)
            continue
        for k, case in enumerate(own[1]["cases"]):
            cells = ["success" if r["cases"][k]["successes"] else "failure" for r in own]
            table.add_row(f"{run.name} {label(case)}", str(run.seed), *cells)
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
    for name in ("seeds", "workers"):
        if getattr(options, name) < 1:
            raise BadUsage(f"--{name} must be >= 1, not {getattr(options, name)}.")
    wanted = study_runs(options.seeds)
    for each in wanted:
        each.common(options).load_config()  # Bad values are refused before hours of computation.
    console = Console(quiet=options.common.quiet, highlight=False)
    results: dict[StudyRun, dict[str, Any]] = {}
    with output_folder(options.common.out) as out:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(options.workers, spawn, max_tasks_per_child=1) as pool:
            done = pool.map(carry_out, [options] * len(wanted), wanted)
            for each, result in zip(wanted, done, strict=True):
                results[each] = result
                console.print(f"{each.name}, {each.way}, {each.seed}: {result['verdict']}")
        rows = compared(results)
        write_json(Path(out) / "study.json", {"rows": [vars(row) for row in rows]})
    console.print(outcome_table(results))
    console.print(comparison_table(rows))
    return 0


def compared(results: dict[StudyRun, dict[str, Any]]) -> list[Compared]:
    """Return every quantity of every assembly and experiment."""
    rows = []
    for name in (*ASSEMBLIES, *RIG):
        values = rig_values if name in RIG else assembly_values
        ways = {
            way: [values(r) for each, r in results.items() if (each.name, each.way) == (name, way)]
            for way in WAYS
        }
        rows += compare(name, ways)
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 for a run that failed, or 2 for bad input."""
    options = tyro.cli(
        StudyOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("contact_study", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
