"""Any operation by its name: the assembly of a product up to its first step with it.

    python -m experiments.operation insert_shaft --out out/insertion

The names are those in ``result.json``.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import tyro
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from experiments.cli.assemble import Assemble
from experiments.cli.ending import exit_code
from planning.operations.registry import operation_named


@dataclass(frozen=True)
class OperationOptions:
    """Options of the script."""

    operation: Annotated[Positional[str], arg(metavar="OPERATION")]
    """Name of the operation to stop after."""

    assemble: OmitArgPrefixes[Assemble] = field(default_factory=Assemble)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    wanted = tyro.cli(
        OperationOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )

    def run() -> int:
        return wanted.assemble.run_as(wanted.operation, operation_named(wanted.operation))

    return exit_code(wanted.operation, run)


if __name__ == "__main__":
    sys.exit(main())
