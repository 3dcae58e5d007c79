"""Phases: commands that hold until something sensed says so, saved and continued bit by bit.

The left hand goes down onto the inflated bag as a servo until the wrist feels 5 N. A state that is
saved on the way there and restored in another simulation leads to the same end, to the last bit.
"""

from enum import Enum
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from cell import (
    CellConfig,
    Follow,
    Jaw,
    Phase,
    Product,
    Simulation,
    after,
    build_cell,
    events,
    read_state,
    restore_state,
    save_state,
    write_state,
)

DOWN = 0.02  # [m/s]
TOUCH = 5.0  # [N]


class Feel(Enum):
    """The phases, by the names that log and verdict give them."""

    CLOSE = "close"
    DESCEND = "descend"


cell = build_cell(CellConfig.load(), Product())
arm = cell.arms["left"]
X_WTop = cell.X_WJ @ RigidTransform([0.0, 0.0, cell.fixture.entry_height])


def reach(z):
    """Return joint angles near home with the jaws pointing down, z above the top of the bag."""
    X_TopF = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0, 0, z + arm.tool.model.tip_z])
    found = arm.model.inverse(arm.config.X_WB.inverse() @ X_WTop @ X_TopF, arm.home)
    return min(found, key=lambda q: np.abs(np.sin((q - arm.home) / 2)).sum())


def close():
    """Close the jaws."""
    yield Phase(Feel.CLOSE, after(0.1), timeout=1.0, commands={arm.tool.name: Jaw(0.002)})


def descend(z):
    """Go down from a height [m]; the generator gets the outcome of its phase back."""

    def lower(sensed):
        return reach(z - DOWN * sensed.time), np.zeros(arm.dof)

    outcome = yield Phase(
        Feel.DESCEND,
        until=lambda sensed: sensed.wrench[arm.name][5] > TOUCH,
        timeout=3.0,
        commands={arm.name: Follow(lower)},
        start=(events.prepare_fixture,),
    )
    X_WTip = outcome.sensed.X_WF(arm.frame("tip"))
    height = (X_WTop.inverse() @ X_WTip.translation())[2]
    peak = outcome.peak_force[arm.name]
    print(f"at {peak:.2f} N after {outcome.sensed.time:.3f} s: tip {1e3 * height:.3f} mm high")


first = Simulation(cell)
cell.plant.SetPositions(first.context, arm.instance, reach(0.04))
arm.hold_here(first.root)
first.run(close())
write_state(Path("closed.npz"), save_state(first))
second = Simulation(cell)
restore_state(second, read_state(Path("closed.npz")))
ends = []
for simulation in (first, second):
    simulation.run(descend(0.04))
    ends.append(cell.plant.GetPositions(simulation.context))
print(f"identical: {np.array_equal(*ends)}")
assert np.array_equal(*ends)
