"""Carry out a robot program in the twin, as `soft-jig assemble --program DIR` has written it.

    python -m experiments.run_program DIR --out out/again

Nothing is planned: the commands, conditions and guards of the program are carried out as they are,
and the outcome is measured and judged like that of an assembly. Seed and configuration are those of
the program; with another seed the tray stands elsewhere, which the program does not know.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import FlagCreatePairsOff, Positional, UseAppendAction, arg

from cell.configuration.config import CellConfig
from cell.products.loading import load_product
from experiments.assembly.assemble import run_program
from experiments.assembly.job import Job
from experiments.assembly.program_files import read_program
from experiments.assembly.results import FILES
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder


@dataclass(frozen=True)
class ProgramOptions:
    """Options of the script."""

    program: Annotated[Positional[Path], arg(metavar="DIR")]
    """Folder with program.json and config.yaml."""

    product: Annotated[str | None, arg(metavar="PRODUCT")] = None
    """Product of the program: a name in models/products, or a YAML file. Default: by its name."""

    seed: int | None = None
    """Seed of the disturbance. Default: that of the program."""

    overrides: Annotated[
        UseAppendAction[tuple[str, ...]], arg(name="set", metavar="KEY=VALUE")
    ] = ()
    """Change one value of the configuration. Repeatable."""

    out: Annotated[Path, arg(metavar="DIR")] = Path("out")
    """Folder for the results; made if it does not exist."""

    quiet: bool = False
    """Print nothing but errors."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    options = tyro.cli(
        ProgramOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("run_program", lambda: carry_out(options))


def carry_out(options: ProgramOptions) -> int:
    """Carry out a program; return the exit code.

    Raises:
        InputError: It cannot be read, or is of another product.
    """
    data = read_program(options.program)
    with output_folder(options.out, *FILES) as out:
        job = Job(
            product=load_product(options.product or data["product"]),
            order=tuple(data["order"]),
            config=CellConfig.load(options.program / "config.yaml", options.overrides),
            seed=data["seed"] if options.seed is None else options.seed,
            out=out,
            quiet=options.quiet,
            command="run_program",
        )
        return run_program(job, data)


if __name__ == "__main__":
    sys.exit(main())
