"""What the scripts of single operations share: their command line."""

from __future__ import annotations

from collections.abc import Sequence

import tyro
from tyro.conf import FlagCreatePairsOff

from experiments.cli.assemble import Assemble
from experiments.cli.ending import exit_code
from planning.operations.operation import Operation


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
        Assemble, args=arguments, description=description, config=(FlagCreatePairsOff,)
    )
    return exit_code(command, lambda: options.run_as(command, last))
