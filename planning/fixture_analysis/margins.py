"""How often a body on the jig bears the loads of an operation: by the formula, and by the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.fixtures.soft_jig import JigParameters
from planning.fixture_analysis.capacity import sideways_capacity, turning_capacity
from planning.fixture_analysis.held_body import HeldBody, LoadCase
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
        cases: All loads that the map was asked for.
    """

    across: float
    turning: float
    load: OperationLoad
    criterion: str = ""
    cases: tuple[LoadCase, ...] = ()


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
    loaded = [
        (load, np.array([*(load.sideways * way), -load.down]), 0.0)
        for load in loads
        for way in load.directions
    ]
    pushes = len(loaded)
    loaded += [(o, np.array([0.0, 0.0, -o.down]), o.torque) for o in loads[:1] if o.torque]
    points = [p_JMiddle + np.array([*load.p_Q, load.height]) for load, *_ in loaded]
    wrenches = [
        np.concatenate([np.cross(p_JQ - body.p_JG, force) + [0.0, 0.0, torque], force])
        for p_JQ, (_, force, torque) in zip(points, loaded, strict=True)
    ]
    found = body.bears(np.array(wrenches), MOST)
    cases = tuple(
        LoadCase(force, torque, p_JQ, bearing)
        for (_, force, torque), p_JQ, bearing in zip(loaded, points, found, strict=True)
    )
    turning = found[pushes].load if len(found) > pushes else np.inf
    worst = int(np.argmin([bearing.load for bearing in found[:pushes]]))
    return Margin(found[worst].load, turning, loaded[worst][0], found[worst].criterion, cases)
