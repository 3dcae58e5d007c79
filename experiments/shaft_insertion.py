"""Operation insert_shaft: a part with a hole onto the shaft of the part that the jig holds.

    python -m experiments.shaft_insertion --out out/insertion
    python -m experiments.shaft_insertion --start out/pick_place/state.npz --out out/insertion

The first line places the part on the jig before; the second goes on from where it is placed.
"""

import sys
from collections.abc import Sequence

from experiments.cli.single import run_script
from planning.operations.insert_shaft import INSERT_SHAFT


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    return run_script(INSERT_SHAFT, "shaft_insertion", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
