"""What the scripts of single operations share: their command line."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.errors import InputError
from cell.products.loading import load_product
from experiments.assembly.assemble import run_job
from experiments.assembly.job import Job
from experiments.cli.assemble import Assemble
from experiments.cli.common import split_order
from experiments.reporting.output import output_folder
from planning.operations.operation import Operation


@dataclass(frozen=True)
class Options:
    """Options of `soft-jig assemble`, and where to begin."""

    assemble: OmitArgPrefixes[Assemble] = field(default_factory=Assemble)

    start: Annotated[Path | None, arg(metavar="STATE.npz")] = None
    """Go on from the state.npz of an earlier run with the same product, order and seed."""


def run_script(
    last: Operation,
    command: str,
    description: str | None,
    arguments: Sequence[str] | None = None,
) -> int:
    """Run the script of an operation: the plan of a product up to it; return the exit code.

    Args:
        last: The operation after whose first step to stop.
        command: Name of the script, for the record.
        description: For ``--help``.
        arguments: Command line; None: that of the process.
    """
    options = tyro.cli(
        Options, args=arguments, description=description, config=(FlagCreatePairsOff,)
    )
    try:
        return run_up_to(last, command, options)
    except InputError as error:
        print(f"{command}: {error}", file=sys.stderr)
        return 2


def run_up_to(last: Operation, command: str, options: Options) -> int:
    """Run the plan of a product up to an operation; return 0 for success, else 1.

    Raises:
        InputError: Something that was given cannot be used.
    """
    wanted, common = options.assemble, options.assemble.common
    config = common.load_config()
    with contextlib.ExitStack() as folders:
        out = folders.enter_context(output_folder(common.out))
        if wanted.replay is not None:
            folders.enter_context(output_folder(wanted.replay.absolute().parent))
        job = Job(
            product=load_product(wanted.product),
            order=split_order(wanted.order),
            config=config,
            seed=common.seed,
            out=out,
            view=wanted.view,
            replay=wanted.replay,
            quiet=common.quiet,
            command=command,
            last=last,
            start=options.start,
        )
        return run_job(job)
