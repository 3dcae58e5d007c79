"""Whether what is drawn bears each part from below: what hangs in the air comes to rest lower."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
from manifold3d import Manifold

from cell.cad.convex_pieces import to_manifold
from cell.products.joints import Press
from cell.products.product import Product
from planning.feasibility.directions import unit_vector
from planning.product_check.finding import Finding, fails

MOST_GAP = 0.3  # [A] The limit of a seated part's gap, 0.2 mm, and facets [mm].
LOWER = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 40.0)  # Where it is looked for what stops it [mm].
HIT = 0.05  # [A] Volume that parts share when they have met, beyond what they share as drawn [mm3].


def support_findings(
    product: Product, order: tuple[str, ...], fixed: Collection[str]
) -> Iterator[Finding]:
    """Yield what is wrong with parts under which nothing is when they come.

    Args:
        product: Its parts in assembled poses.
        order: Items in the order of assembly.
        fixed: Names of the parts that the fixture bears when they come.
    """
    up = unit_vector(product.up)
    pressed = {name for joint in product.joints if isinstance(joint, Press) for name in joint.parts}
    there: Manifold | None = None
    for name in (name for item in order for name in product.members(item)):
        part = product.parts[name]
        mesh = part.mesh.copy()
        mesh.apply_transform(np.asarray(part.X_AP.GetAsMatrix4()))
        solid = to_manifold(mesh.apply_scale(1e3))
        borne = name in product.screws or name in pressed or name in fixed
        lower = None if there is None or borne else _falls(solid, there, up)
        if lower is not None:
            yield fails(name, f"nothing is under it where it is drawn: {lower}")
        there = solid if there is None else there + solid


def _falls(part: Manifold, others: Manifold, up: np.ndarray) -> str | None:
    """Return how far a part goes down from where it is drawn, None if it stays there."""
    shared = (part ^ others).volume()

    def hits(depth: float) -> bool:
        return bool((part.translate((-depth * up).tolist()) ^ others).volume() > shared + HIT)

    if hits(MOST_GAP):
        return None
    stopped = next((depth for depth in LOWER if hits(depth)), None)
    if stopped is None:
        return "it falls past what is there"
    low, high = 0.0, stopped
    while high - low > 0.05:
        middle = (low + high) / 2.0
        low, high = (low, middle) if hits(middle) else (middle, high)
    return f"it comes to rest {low:.2g} mm lower"
