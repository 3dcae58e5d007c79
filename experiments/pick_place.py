"""Operation pick_place: the part that the jig holds, from the tray into the bed, and frozen there.

    python -m experiments.pick_place --out out/pick_place

The planner says which part that is and which side is up.
"""

import sys
from collections.abc import Sequence

from experiments.cli.single import run_operation


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    return run_operation("pick_place", "pick_place", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
