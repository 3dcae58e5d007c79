"""Calibrate the twin to a real jig, from records of a bench.

    python -m experiments.calibrate_jig press.csv push_vented.csv pull_sealed.csv --out out/jig

A record is force over displacement as CSV; its header names test, depth, vacuum and specimen, and
the columns name their units (docs/guide/calibrate.md). Each test is simulated over the plausible
range of the numbers that it depends on, as a campaign that is kept in the folder: a second call
with the same tests simulates nothing. Writes `result.json`, `calibrated.yaml` (a partial
configuration for --config), `calibration.png` and `posterior.npz`.

Exit code 1: the twin cannot follow a record, whatever its numbers.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from matplotlib.backends.backend_agg import FigureCanvasAgg
from rich.console import Console
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from experiments.calibration.design import run_designs
from experiments.calibration.free_numbers import NOT_DECIDED, shown_in
from experiments.calibration.plot import plot
from experiments.calibration.posterior import Observation, Posterior, sample_posterior
from experiments.calibration.record import read_record, repeats
from experiments.calibration.summary import configuration, number_table, record_table, result
from experiments.cli.common import BadUsage, Common, check_counts
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder, write_arrays, write_json, write_text
from experiments.reporting.provenance import finite, versions

MOST_ERROR = 1.0  # Of the twin, relative; beyond it records say nothing.


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of the script."""

    records: Annotated[Positional[tuple[Path, ...]], arg(metavar="LOG.csv")]
    """Records, one test each; several of the same test are repeats."""

    samples: int = 64
    """Simulations for each state of the bag, a power of 2: about 2.5 s of CPU each, 0.7 s soft."""

    model_error: float = 0.05
    """Standard deviation of the twin's own error, relative to the force."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Simulations at a time."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


def run(options: CalibrationOptions) -> int:
    """Run the script; return the exit code.

    Raises:
        InputError: An option or a record cannot be used. Nothing has been simulated.
    """
    config, seed = options.common.load_config(), options.common.seed
    if not options.records:
        raise BadUsage("It needs at least one record, LOG.csv.")
    if not 0 <= options.model_error < MOST_ERROR:
        raise BadUsage(f"--model-error must be from 0 to below 1, not {options.model_error:g}.")
    check_counts(options, "samples", least=16)
    check_counts(options, "workers")
    tests = repeats([read_record(path) for path in options.records])
    console = Console(quiet=options.common.quiet, highlight=False, width=140)
    with output_folder(options.common.out, "result.json", "calibrated.yaml") as out:
        designs = run_designs(
            [records[0] for records in tests],
            config,
            out,
            samples=options.samples,
            seed=seed,
            workers=options.workers,
            console=console,
        )
        numbers = shown_in([records[0].test for records in tests])
        observations = [
            Observation.of(records, design, numbers, options.model_error)
            for records, design in zip(tests, designs, strict=True)
        ]
        posterior = sample_posterior(observations, numbers, seed)
        found = result(observations, posterior)
        about = {"command": "calibrate_jig", "seed": seed, "model_error": options.model_error}
        about |= {"samples": options.samples, "config": finite(config.to_dict())}
        write_json(out / "result.json", about | found | {"versions": versions()})
        write_text(out / "calibrated.yaml", configuration(posterior))
        write_files(out, observations, posterior, seed)
    console.print(record_table(observations, posterior))
    console.print(number_table(posterior))
    for path, reason in NOT_DECIDED.items():
        console.print(f"{path}: {reason}.", markup=False)
    return 0 if found["verdict"] == "success" else 1


def write_files(
    out: Path, observations: Sequence[Observation], posterior: Posterior, seed: int
) -> None:
    """Write the picture, and the draws by path, in SI."""
    FigureCanvasAgg(figure := plot(observations, posterior, seed))
    figure.savefig(out / "calibration.png", dpi=100)
    draws = {n.path: n.value(posterior.shares[:, k]) for k, n in enumerate(posterior.numbers)}
    write_arrays(out / "posterior.npz", draws)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return 0, 1 if the twin cannot follow a record, or 2 for bad input."""
    options = tyro.cli(
        CalibrationOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("calibrate_jig", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
