"""Operation pick_place: the part that the fixture holds, from the tray into it, and fixed there.

    python -m experiments.pick_place --out out/pick_place

The planner says which part that is and which side is up.
"""

import sys
from collections.abc import Sequence

from experiments.cli.single import run_script
from planning.operations.pick_place import PICK_PLACE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    return run_script(PICK_PLACE, "pick_place", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
