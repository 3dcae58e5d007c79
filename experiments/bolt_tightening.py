"""Operations place_bolts and tighten_bolts: bolts into their holes, then driven home in star order.

    python -m experiments.bolt_tightening --out out/bolts
    python -m experiments.bolt_tightening --start out/insertion/state.npz --out out/bolts

The first line runs the whole assembly up to there; the second goes on from a seated plate.
"""

import sys
from collections.abc import Sequence

from experiments.cli.single import run_script
from planning.operations.tighten_bolts import TIGHTEN_BOLTS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    return run_script(TIGHTEN_BOLTS, "bolt_tightening", __doc__, arguments)


if __name__ == "__main__":
    sys.exit(main())
