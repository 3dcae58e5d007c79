"""End conditions and guards as expressions of URScript."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import singledispatch
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import Frame

from cell.builder import Cell
from cell.errors import InputError
from cell.machines.arm import Arm
from cell.simulation.conditions import (
    All,
    Below,
    BitPushedIn,
    Either,
    FirstOf,
    Height,
    JawOpening,
    LostGrasp,
    PushesBack,
    Signal,
    Steady,
    TooMuchForce,
    WristForce,
)
from cell.simulation.phase import After, Finished


@dataclass(frozen=True)
class Dialect:
    """How one arm's script names things; the arm's tool centre point is the flange.

    Attributes:
        cell: That the arm is in.
        arm: Whose script it is.
    """

    cell: Cell
    arm: Arm

    @property
    def devices(self) -> set[str]:
        """Names of the arm and its tool."""
        return {self.arm.name, self.arm.tool.name}

    def reads(self, condition: Any) -> bool:
        """Return whether a condition looks at the arm or its tool."""
        if isinstance(condition, Frame):
            return condition.model_instance() == self.arm.tool_instance
        if isinstance(condition, tuple):
            return any(self.reads(item) for item in condition)
        if is_dataclass(condition):
            return any(self.reads(getattr(condition, field.name)) for field in fields(condition))
        return condition in self.devices

    def is_anothers(self, condition: Any) -> bool:
        """Return whether a condition looks at another arm or its tool only."""
        others = [Dialect(self.cell, a) for a in self.cell.arms.values() if a is not self.arm]
        return not self.reads(condition) and any(other.reads(condition) for other in others)

    def point(self, height: Height) -> str:
        """Return where in the frame of the flange a point of the tool is."""
        plant = self.arm.plant
        context = plant.CreateDefaultContext()
        flange = plant.GetFrameByName(self.arm.model.flange_frame, self.arm.instance)
        return pose_text(height.frame.CalcPose(context, flange) @ height.X_FQ)


def ends(dialect: Dialect, condition: Any) -> str:
    """Return an end condition as an expression."""
    if isinstance(condition, All | Either):
        word = " and " if isinstance(condition, All) else " or "
        return f"({word.join(ends(dialect, each) for each in condition.conditions)})"
    # What the other arm watches for holds when it comes to the next phase.
    return "True" if dialect.is_anothers(condition) else _ends(condition, dialect)


def pose_text(X: RigidTransform) -> str:
    """Return a pose in URScript: position [m] and rotation vector [rad]."""
    turn = X.rotation().ToAngleAxis()
    return f"p{numbers([*X.translation(), *(turn.angle() * turn.axis())])}"


def numbers(values: Sequence[float] | np.ndarray) -> str:
    """Return a list of numbers in URScript, to a micrometre or microradian."""
    return "[" + ", ".join(f"{value:.6f}" for value in values) + "]"


def fails(dialect: Dialect, guard: Any) -> Iterator[tuple[str, str]]:
    """Yield each reason to give up: an expression, and what to say."""
    if isinstance(guard, FirstOf):
        for each in guard.guards:
            yield from fails(dialect, each)
    elif isinstance(guard, LostGrasp):
        if dialect.reads(guard):
            yield f"jaw_opening() < {guard.least:.6f}", "lost grasp"
    elif isinstance(guard, TooMuchForce):
        if dialect.reads(guard):
            yield f"felt_force() > {guard.limit:.3f}", guard.what
    elif guard is not None:
        raise InputError(f"URScript has no words for the guard {type(guard).__name__}.")


@singledispatch
def _ends(condition: Any, dialect: Dialect) -> str:
    """A condition without words of its own is one that the spindle's controller decides."""
    if hasattr(condition, "torque"):
        return f"spindle_torque() >= {condition.torque:.4f}"
    raise InputError(f"URScript has no words for the condition {type(condition).__name__}.")


@_ends.register
def _(condition: Finished, dialect: Dialect) -> str:
    return "finished"


@_ends.register
def _(condition: After, dialect: Dialect) -> str:
    return f"clock >= {condition.seconds:.4f}"


@_ends.register
def _(condition: Steady, dialect: Dialect) -> str:
    read = condition.read
    if isinstance(read, WristForce):
        value = "[felt(0), felt(1), felt(2)]"
    elif isinstance(read, JawOpening):
        value = "[jaw_opening(), 0.0, 0.0]"
    elif isinstance(read, Height):
        value = f"[height({dialect.point(read)}), 0.0, 0.0]"
    else:
        raise InputError(f"URScript has no words for the reading {type(read).__name__}.")
    return f"steady({value}, {condition.band:.6f}, {condition.duration:.4f})"


@_ends.register
def _(condition: PushesBack, dialect: Dialect) -> str:
    return f"felt(2) >= {condition.force:.3f}"


@_ends.register
def _(condition: BitPushedIn, dialect: Dialect) -> str:
    return f"spindle_push() >= {condition.force:.3f}"


@_ends.register
def _(condition: Below, dialect: Dialect) -> str:
    return f"height({dialect.point(condition.point)}) < {condition.height:.6f}"


@_ends.register
def _(condition: Signal, dialect: Dialect) -> str:
    return f'signal("{condition.name}")'
