"""``soft-jig sweep`` and its options."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, UseAppendAction, arg

from experiments.cli.common import Common, check_counts
from experiments.reporting.output import output_folder


@dataclass(frozen=True)
class Sweep:
    """Run an experiment over values and seeds; run again, it goes on where it was stopped.

    Exit code 0: every trial succeeded. 1: one failed. 3: one came to no verdict.
    """

    experiment: Annotated[Positional[str], arg(metavar="EXPERIMENT")]
    """assemble, place, push, or a function of your own: FILE.py:FUNCTION."""

    product: Annotated[str, arg(metavar="PRODUCT")] = "motor_unit"
    """A name in models/products, or a YAML file."""

    grid: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="KEY=A,B,C")] = ()
    """Values of a setting, of an option of the experiment, or of product. Repeatable."""

    sample: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="KEY=LO:HI")] = ()
    """Range of a setting that is sampled, with all other samples at once. Repeatable."""

    samples: Annotated[int, arg(metavar="N")] = 16
    """Number of sampled points."""

    design: Literal["sobol", "lhs"] = "sobol"
    """How they fill the ranges: Sobol's sequence, scrambled, or a Latin hypercube."""

    seeds: Annotated[int, arg(metavar="N")] = 1
    """Trials of each point, with consecutive seeds from --seed."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Processes at a time on this machine; a cluster has its own."""

    executor: Annotated[str, arg(metavar="local|dask://HOST:PORT")] = "local"
    """Where trials run: on this machine, or on the workers of a Dask scheduler."""

    resume: bool = False
    """Go on with what is in the folder: this is what happens without it, too."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write the files of the trials, index, summary and report; return the exit code."""
        check_counts(self, "seeds", "samples", "workers")
        config = self.common.load_config()
        from experiments.campaigns.command import run_sweep
        from experiments.campaigns.points import (
            combined,
            grid,
            parse_grid,
            parse_sample,
            sample,
            trials,
        )

        seed = self.common.seed
        ranges = parse_sample(self.sample)
        points = combined(
            grid(parse_grid(self.grid)), sample(ranges, self.samples, self.design, seed)
        )
        seeds = range(seed, seed + self.seeds)
        wanted = trials(self.experiment, points, product=self.product, config=config, seeds=seeds)
        with output_folder(self.common.out) as out:
            return run_sweep(wanted, out, config, self.workers, self.executor, self.common.quiet)
