"""What the scripts of single operations share: their command line."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, arg

from cell.errors import CellError
from cell.loading import load_product
from experiments.assemble import run_job
from experiments.cli import Assemble, split_order
from experiments.job import Job
from experiments.output import output_folder


@dataclass(frozen=True)
class Options:
    """Options of `soft-jig assemble`, and where to begin."""

    assemble: OmitArgPrefixes[Assemble] = field(default_factory=Assemble)

    start: Annotated[Path | None, arg(metavar="STATE.npz")] = None
    """Go on from the state.npz of an earlier run with the same product, order and seed."""


def run_operation(kind: str, description: str | None, last: str | None = None) -> int:
    """Run the plan of a product up to an operation; return the exit code.

    Args:
        kind: Name of the script, recorded as the command.
        description: For ``--help``.
        last: Kind of the last operation to run; None: ``kind`` itself.
    """
    try:
        options = tyro.cli(Options, description=description, config=(FlagCreatePairsOff,))
        return run_job(job(options, kind, last or kind))
    except CellError as error:
        print(f"{kind}: {error}", file=sys.stderr)
        return 2


def job(options: Options, command: str, last: str) -> Job:
    """Return what the options ask for."""
    wanted = options.assemble
    common = wanted.common
    config = common.load_config()
    with output_folder(common.out) as out:
        return Job(
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
