"""How often a body on the jig bears the loads of an operation: by the formula, and by the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.fixtures.soft_jig import JigParameters
from planning.fixture_analysis.capacity import sideways_capacity, turning_capacity
from planning.fixture_analysis.held_body import HeldBody
from planning.fixture_analysis.imprint import Imprint
from planning.fixture_analysis.loads import OperationLoad

MOST = 5.0  # Multiple of a load at which the map ends; more would hardly change a score.


@dataclass(frozen=True)
class Margin:
    """What a body bears, relative to the loads of an operation.

    Attributes:
        across: Multiple of the sideways force that it bears, the smallest over loads and ways.
        turning: Multiple of the torque; infinite if there is none.
        load: With the smallest multiple across.
        criterion: Of the map, what fails first under it; "" by the formula.
    """

    across: float
    turning: float
    load: OperationLoad
    criterion: str = ""


def margin_by_formula(
    imprint: Imprint,
    jig: JigParameters,
    weight: float,
    p_G: np.ndarray,
    loads: Sequence[OperationLoad],
) -> Margin:
    """Return the margin by statics of the imprint; quick, within a factor of 2 of the map [M].

    Args:
        imprint: With an outline.
        jig: For friction, vacuum and beads.
        weight: Of the body [N].
        p_G: (2,) its centre of gravity in the imprint's plane [m].
        loads: Of the operation.
    """
    across = [sideways_capacity(imprint, jig, weight, p_G, load) / load.sideways for load in loads]
    worst = int(np.argmin(across))
    load = loads[worst]
    bears = turning_capacity(imprint, jig, weight, load)
    return Margin(across[worst], bears / load.torque if load.torque else np.inf, load)


def margin_by_map(body: HeldBody, p_JMiddle: np.ndarray, loads: Sequence[OperationLoad]) -> Margin:
    """Return the margin by the holding map: how often the body bears the whole of each load.

    Args:
        body: On its fixture.
        p_JMiddle: (3,) where the plane of the loads has its origin, at the body's lowest point [m].
        loads: Of the operation.
    """
    down = [(load, np.array([0.0, 0.0, -load.down])) for load in loads]
    pushes = [
        (load, _wrench(body, p_JMiddle, load, force + [*(load.sideways * way), 0.0]))
        for load, force in down
        for way in load.directions
    ]
    turns = [
        _wrench(body, p_JMiddle, load, force) + np.array([0.0, 0.0, load.torque, 0.0, 0.0, 0.0])
        for load, force in down[:1]
        if load.torque
    ]
    wrenches = np.array([wrench for _, wrench in pushes] + turns)
    found = body.bears(wrenches, MOST)
    turning = found[-1].load if turns else np.inf
    worst = int(np.argmin([bearing.load for bearing in found[: len(pushes)]]))
    bearing = found[worst]
    return Margin(bearing.load, turning, pushes[worst][0], bearing.criterion)


def _wrench(
    body: HeldBody, p_JMiddle: np.ndarray, load: OperationLoad, force: np.ndarray
) -> np.ndarray:
    """Return the wrench (6,) about the centre of gravity of a force (3,) at a load's point."""
    p_JQ = p_JMiddle + np.array([*load.p_Q, load.height])
    return np.concatenate([np.cross(p_JQ - body.p_JG, force), force])
