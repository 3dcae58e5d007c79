"""Operation pick_place: the part that the jig holds, from the tray into the bed, and frozen there.

    python -m experiments.pick_place --out out/pick_place

The planner says which part that is and which side is up.
"""

import sys

from experiments.single import run_operation

if __name__ == "__main__":
    sys.exit(run_operation("pick_place", __doc__))
