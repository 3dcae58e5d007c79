"""A process for tests of faults: ``assemble``, with three short steps in the place of its own.

    python tests/short_run.py --out DIR [--start STATE.npz] [--seed N] ...

The environment variable ``KILL_AT=REPLACE:3`` ends it by SIGKILL when it is about to replace a file
for the third time, ``SYNC:3`` when it is about to make its content safe; ``FAIL=STEP`` lets a step
fail.
"""

import os
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from enum import Enum

import numpy as np

from cell.builder import Cell
from cell.simulation.phase import Phase, Running, after
from experiments.assembly import assemble
from experiments.cli.single import run_script
from planning.operations.operation import Arrays, Operation, Step, StepRecord
from planning.operations.pick_place import PICK_PLACE
from planning.operations.station import Station


class Hold(Enum):
    """The phases."""

    LOOK = "look"
    HOLD = "hold"


def hold(station: Station, step: Step) -> Iterator[Phase]:
    """Look, with noise, and hold still while the motor stands in the tray, awake."""
    awake = frozenset(["motor"])

    def look(running: Running) -> None:
        station.look("motor")

    yield Phase(Hold.LOOK, after(0.1), 1.0, subject="motor", awake=awake, start=(look,))
    timeout = 0.05 if os.environ.get("FAIL") == step.name else 9.0
    yield Phase(Hold.HOLD, after(0.2), timeout, subject="motor", awake=awake)


def measure(cell: Cell, record: StepRecord, log: Arrays) -> dict[str, float]:
    """Return numbers in which every bit of the run counts."""
    assert record.end is not None
    p_WP = record.end.X_WP["motor"].translation()
    return {"height_m": float(p_WP[2]), "sum_m": float(np.sum(log["q"]) + p_WP.sum())}


HOLD = Operation("hold", hold, measure)
STEPS = [
    Step("one", HOLD, ("motor",)),
    Step("two", replace(HOLD, coarse=True), ("motor",)),
    Step("three", replace(HOLD, coarse=True), ("motor",)),
]


def die_at(name: str, call: int) -> None:
    """Let the process be killed at a call of a function of the operating system."""
    attribute = {"REPLACE": "replace", "SYNC": "fsync"}[name]
    original, calls = getattr(os, attribute), []

    def counted(*arguments: object) -> None:
        calls.append(1)
        if len(calls) == call:
            os.kill(os.getpid(), signal.SIGKILL)
        original(*arguments)

    setattr(os, attribute, counted)


if __name__ == "__main__":
    assemble._steps = lambda job, fixing: STEPS
    if "KILL_AT" in os.environ:
        where, count = os.environ["KILL_AT"].split(":")
        die_at(where, int(count))
    sys.exit(run_script(PICK_PLACE, "short_run", __doc__))
