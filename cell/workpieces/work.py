"""What a fixture that is made for one part is made for: the configuration's part, and the hand."""

from __future__ import annotations

import numpy as np

from cell.configuration.config import CellConfig
from cell.errors import UnknownName
from cell.fixtures import fixture_class
from cell.fixtures.custom.work import Work
from cell.machines.grippers import GRIPPER_MODELS, GripperModel
from cell.machines.hand_space import hand_pieces
from cell.products.product import Grasp, Product
from cell.vectors import rotation_with_up

OPENED = 0.005  # The jaws open this much wider than the part, or less [m] [A].
MARGIN = 0.001  # Around the hand [m] [A].
WAY = 0.1  # Up from its place, and back from it, that the hand is in [m] [A].
FROM_BELOW = 0.1  # Cosine to the vertical: a hand that points up further never brings the part.


def fixture_work(
    config: CellConfig, product: Product, hand: GripperModel | None = None
) -> Work | None:
    """Return what the configured fixture is made for; None: it takes any part, or there is none.

    Args:
        config: Of the cell.
        product: With the part.
        hand: That brings the part; None: that of the first arm with a gripper.

    Raises:
        UnknownName: The product has no such part.
    """
    if not fixture_class(config.workcell.fixture).custom:
        return None
    name = config.custom.held.part or _first(product)
    if not name:
        return None
    if name not in product.parts:
        raise UnknownName("part to hold (custom.held.part)", name, product.parts)
    part = product.parts[name]
    up = config.custom.held.up or product.up
    R_DP = rotation_with_up(up) @ part.X_AP.rotation()
    tools = [arm.tool for arm in config.arms.values() if arm.tool in GRIPPER_MODELS]
    model = hand or GRIPPER_MODELS[tools[0]]
    hands = [
        hull
        for grasp in part.grasps
        if (R_DP @ grasp.X_PJaw.rotation()).matrix()[2, 2] < FROM_BELOW
        for hull in _room(model, grasp, R_DP.inverse() @ np.array([0.0, 0.0, WAY]))
    ]
    return Work(name, up, part.mesh, R_DP, config.custom, tuple(hands))


def _first(product: Product) -> str:
    """Return the first part of the first order, or of the product."""
    items = product.orders[0] if product.orders else tuple(product.parts)
    return product.members(items[0])[0] if items else ""


def _room(model: GripperModel, grasp: Grasp, up: np.ndarray) -> list[np.ndarray]:
    """Return hulls (n, 3), in P, of what the hand fills: closed and open, coming and leaving.

    Args:
        model: Type of the hand.
        grasp: How it holds the part.
        up: (3,) how far up it comes from, in P [m].
    """
    closed = max(0.0, grasp.width - model.setback[grasp.jaw])
    openings = (closed, min(closed + OPENED, model.stroke))
    box = MARGIN * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    back = grasp.X_PJaw.rotation() @ np.array([0.0, 0.0, -WAY])
    hulls = []
    for both in zip(*(hand_pieces(model, grasp.jaw, wide) for wide in openings), strict=True):
        corners = (grasp.X_PJaw @ np.concatenate(both).T).T
        wide = (corners[:, None] + box).reshape(-1, 3)
        hulls += [np.concatenate([wide, wide + way]) for way in (up, back)]
    return hulls
