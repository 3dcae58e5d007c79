"""Operations without simulating them: each phase puts everything where it would have brought it.

Plans are real, and so are conditions and guards; of the physics there is nothing but that the part
in the hand goes along. So every phase of an operation is there in seconds, to be looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import numpy as np

from cell.machines.driver import DriverReading
from cell.machines.gripper import GripperReading
from cell.simulation.conditions import PushesBack
from cell.simulation.phase import Follow, Impedance, Jaw, Outcome, Phase, Sensed
from experiments.assembly.prepare import RunningCell
from planning.motion.timing import JointMotion
from planning.operations.operation import Step

PRESSED = 0.4  # Share of a motion after which something pushes back.


def phases_of(running: RunningCell, steps: list[Step]) -> Iterator[tuple[Phase, tuple[str, ...]]]:
    """Yield every phase of some steps, with the names of the parts in the hand at its start."""
    station = running.station
    for step in steps:
        pending = cast(Any, step.phases(station))
        outcome: Outcome | None = None
        while True:
            try:
                phase = pending.send(outcome)
            except StopIteration:
                break
            yield phase, station.in_hand
            outcome = carry_out(running, phase)


def carry_out(running: RunningCell, phase: Phase) -> Outcome:
    """Put arms, jaws and the parts in the hand where a phase brings them."""
    station, cell, context = running.station, running.simulation.cell, running.simulation.context
    hand = cell.holder.frame("tip")
    X_HandW = hand.CalcPoseInWorld(context).inverse()
    X_HandP = {name: X_HandW @ cell.parts[name].X_WP(context) for name in station.in_hand}
    for device, command in phase.commands.items():
        if isinstance(command, Jaw):
            finger = cell.gripper.instance
            cell.plant.SetPositions(context, finger, np.full(2, command.opening / 2))
        elif device in cell.arms:
            q = _joints(running, device, phase, command)
            cell.plant.SetPositions(context, cell.arms[device].instance, q)
    for name, X in X_HandP.items():
        pose = hand.CalcPoseInWorld(context) @ X
        cell.plant.SetFreeBodyPose(context, cell.parts[name].body, pose)
    ended_well = sensed_in(running, signal=lambda name: True)
    return Outcome(ended_well, dict.fromkeys(cell.arms, 0.0))


def _joints(running: RunningCell, device: str, phase: Phase, command: Any) -> np.ndarray:
    arm, context = running.simulation.cell.arms[device], running.simulation.context
    if isinstance(command, JointMotion):
        share = PRESSED if isinstance(phase.until, PushesBack) else 1.0
        return command.at(share * command.duration)[0]
    if isinstance(command, Follow):
        line = cast(Any, command.target).line
        return line.q[-1]
    assert isinstance(command, Impedance)
    X_WSeat = getattr(command.X_WD, "X_WSeat", None)
    if X_WSeat is None:
        return arm.positions(context)
    X_WF = X_WSeat @ command.X_FC.inverse()
    return arm.configurations(context, command.frame, X_WF, arm.positions(context))[0]


def sensed_in(running: RunningCell, **changes: Any) -> Sensed:
    """Return what is sensed where nothing is felt; some readings may be others."""
    cell, context = running.simulation.cell, running.simulation.context
    opening = float(2 * cell.gripper.finger.GetOnePosition(context))
    readings: dict[str, Any] = dict(
        time=1.0,
        step=1000,
        wrench={name: np.zeros(6) for name in cell.arms},
        grippers={cell.gripper.name: GripperReading(opening, 0.0)},
        drivers={cell.screwdriver.name: DriverReading(0.0, 0.0, 0.0)},
        finished=True,
        X_WF=lambda frame: frame.CalcPoseInWorld(context),
    )
    return Sensed(**(readings | changes))
