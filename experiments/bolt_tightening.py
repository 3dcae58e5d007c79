"""Operations place_bolts and tighten_bolts: bolts into their holes, then driven home in star order.

    python -m experiments.bolt_tightening --out out/bolts
    python -m experiments.bolt_tightening --start out/insertion/state.npz --out out/bolts

The first line runs the whole assembly up to there; the second goes on from a seated plate.
"""

import sys

from experiments.single import run_operation

if __name__ == "__main__":
    sys.exit(run_operation("bolt_tightening", __doc__, last="tighten_bolts"))
