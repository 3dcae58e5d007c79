"""Benchmark of the simulation: `python -m experiments.speed_benchmark`.

CPU seconds per simulated second by operation, by class of phase and by layer. The first time, the
whole assembly is run once, which takes minutes, and the state at the start of each phase is kept in
``--states``; it is run anew when the states do not fit the cell or its operations any more
(`experiments.speed.whole_run`). From then on only the beginning of one phase of each kind is run,
the middle one where there are several: it stands for the simulated time of all of them.

    python -m experiments.speed_benchmark
    python -m experiments.speed_benchmark --phase tighten --window 0.3
    python -m experiments.speed_benchmark --remake

Classes (`planning.operations.phase_class`): free, carrying, dwell, contact. Layers
(`experiments.speed.layers`): geometry, constraints, solver, Python. "run" is the mean over all
phases from start to end in the run that made the states; where it differs from the sum, the machine
was busier then, or phases do not cost the same from beginning to end: a press begins in the air.

A ratio is the cost in iterations of a fixed workload (`experiments.speed.calibration`) that runs in
turn with the measurements: it compares machines. Writes ``speed.json`` and ``speed.png``, and adds
a line to the history, to whose latest line the ratios are compared. All is CPU time of one process;
set OPENBLAS_NUM_THREADS=1 for strictly one core.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from cell.errors import InputError
from cell.products.loading import load_product
from cell.products.product import Product
from experiments.assembly.prepare import RunningCell
from experiments.cli.common import BadUsage, Common, check_counts
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder, whole_file, write_json
from experiments.reporting.provenance import finite, versions
from experiments.speed.calibration import Kernel
from experiments.speed.layers import TimedMonitor, measure_phase
from experiments.speed.report import (
    Measured,
    append_entry,
    class_table,
    latest_entry,
    operation_table,
    phase_row,
    phase_table,
    plot_classes,
    summary,
    totals,
)
from experiments.speed.whole_run import (
    Outdated,
    PhaseRun,
    WholeRun,
    make_whole_run,
    read_whole_run,
    resumed,
)
from planning.assembly_plan.explain import stop_text
from planning.assembly_plan.planner import plan
from planning.operations.operation import Step
from planning.operations.phase_class import PhaseClass
from planning.operations.sequence import steps


@dataclass(frozen=True)
class SpeedOptions:
    """Options of the script."""

    product: Positional[str] = "motor_unit"
    """A name in models/products, or a product file."""

    states: Annotated[Path | None, arg(metavar="DIR")] = None
    """Where the start states are kept. Default: "states" in the folder for the results."""

    history: Annotated[Path | None, arg(metavar="FILE")] = None
    """Ratios of each run, one line each. Default: "history.jsonl" in the folder for the results."""

    phase: Annotated[str | None, arg(metavar="NAME")] = None
    """Measure every phase with this in its name instead, and leave all but speed.json as it is."""

    window: Annotated[float, arg(metavar="SECONDS")] = 0.1
    """How much of a phase is run, in simulated seconds."""

    repeats: int = 3
    """How often it is run; the fastest counts."""

    remake: bool = False
    """Make the start states anew in any case."""

    common: OmitArgPrefixes[Common] = field(default_factory=lambda: Common(out=Path("out/speed")))


def run(options: SpeedOptions) -> int:
    """Measure, and write and print what was found; return 0.

    Raises:
        InputError: An option or a value is invalid.
        RunFailure: The whole run failed.
    """
    if not options.window > 0.0:
        raise BadUsage(f"--window must be above 0, not {options.window:g}.")
    check_counts(options, "repeats")
    product = load_product(options.product)
    product.check_simulable()
    todo = planned_steps(product, options)
    console = Console(quiet=options.common.quiet, highlight=False)
    with output_folder(options.common.out) as out:
        history = options.history or out / "history.jsonl"
        earlier = latest_entry(history, product.name)
        folder = options.states or out / "states"
        whole, measured = measure(options, product, todo, folder, console)
        found = summary(whole.phases, measured)
        about = {
            "product": product.name,
            "seed": options.common.seed,
            "window_seconds": options.window,
            "kernel_cpu_seconds": min(one.cost.kernel for one in measured),
            "versions": versions(),
        }
        write_json(out / "speed.json", _result(options, about, found, measured))
        if options.phase is not None:
            console.print(phase_table(measured))
            return 0
        with whole_file(out / "speed.png") as temporary:
            temporary.write_bytes(plot_classes(found))
        date = datetime.now(UTC).isoformat(timespec="seconds")
        append_entry(history, {"date": date} | about | {"ratios": totals(found)})
        console.print(operation_table(found))
        console.print(class_table(found, {} if earlier is None else earlier["ratios"]))
        if earlier is not None:
            console.print(f"Change against {earlier['date']}.", markup=False)
    return 0


def _result(
    options: SpeedOptions,
    about: dict[str, Any],
    found: dict[str, Any],
    measured: Sequence[Measured],
) -> dict[str, Any]:
    return {
        "command": "speed_benchmark",
        **about,
        "repeats": options.repeats,
        "phase": options.phase,
        **found,
        "phases": [phase_row(one) for one in measured],
        "config": finite(options.common.load_config().to_dict()),
    }


def planned_steps(product: Product, options: SpeedOptions) -> list[Step]:
    """Return the steps of the product's plan.

    Raises:
        InputError: It has none.
    """
    fixing = plan(product, None, config=options.common.load_config())
    if fixing.stop is not None:
        raise InputError(stop_text(fixing))
    return steps(product, fixing)


def measure(
    options: SpeedOptions,
    product: Product,
    todo: Sequence[Step],
    folder: Path,
    console: Console,
) -> tuple[WholeRun, list[Measured]]:
    """Return the whole run and the measured phases of it; make the start states if need be."""
    config, seed = options.common.load_config(), options.common.seed
    if not options.remake:
        try:
            running = RunningCell(product, config, seed)
            whole = read_whole_run(folder, running)
            return whole, measured_phases(options, whole, running, todo)
        except Outdated as reason:
            console.print(f"The whole assembly is run: {reason}", markup=False, soft_wrap=True)
    running = RunningCell(product, config, seed)
    with output_folder(folder), console.status("the whole assembly") as status:

        def show(phase: PhaseRun) -> None:
            status.update(f"the whole assembly: {phase.name} done")

        whole = make_whole_run(folder, running, todo, show)
    return whole, measured_phases(options, whole, running, todo)


def measured_phases(
    options: SpeedOptions,
    whole: WholeRun,
    running: RunningCell,
    todo: Sequence[Step],
) -> list[Measured]:
    """Measure the phases that the options ask for.

    Raises:
        InputError: There is none.
        Outdated: The start states do not fit.
    """
    wanted = dict(chosen(whole.phases, options.phase))
    kernel, found = Kernel(), []
    for number, step in enumerate(todo):
        own = [phase for phase in wanted if phase.step == number]
        if not own:
            continue
        running.switch(step.operation)
        simulation = running.simulation
        monitor = TimedMonitor(simulation.cell.monitor)
        simulation.simulator.set_monitor(monitor)
        for kept, phase in resumed(whole, running, step, own):
            state, window = whole.state(kept.number), options.window
            cost = measure_phase(simulation, monitor, state, phase, window, options.repeats, kernel)
            found.append(Measured(kept, cost, wanted[kept]))
    return found


def chosen(phases: Sequence[PhaseRun], part: str | None) -> list[tuple[PhaseRun, float]]:
    """Return the phases to measure, each with the simulated time that it stands for [s].

    Args:
        phases: Of the whole run.
        part: Of the names of the phases to measure; None: the middle phase of each kind, which
            stands for all of the same kind and class in the same operation.

    Raises:
        InputError: No phase has such a name.
    """
    if part is not None:
        found = [(phase, phase.sim_seconds) for phase in phases if part in phase.name]
        if not found:
            known = ", ".join(dict.fromkeys(phase.kind for phase in phases))
            raise InputError(f"No phase has '{part}' in its name. Kinds of phases: {known}.")
        return found
    kinds: dict[tuple[str, str, PhaseClass], list[PhaseRun]] = {}
    for phase in phases:
        kinds.setdefault((phase.operation, phase.kind, phase.phase_class), []).append(phase)
    return [
        (own[(len(own) - 1) // 2], sum(phase.sim_seconds for phase in own))
        for own in kinds.values()
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 if the assembly failed, or 2 for bad input."""
    options = tyro.cli(
        SpeedOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("speed_benchmark", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
