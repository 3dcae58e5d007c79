"""A drafted product without the grasps that the arms cannot carry out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from cell.products.product import Grasp, Product
from planning.product_draft.guess import Guess


def within_reach(
    product: Product, reached: Mapping[str, Sequence[Grasp]]
) -> tuple[Product, list[Guess]]:
    """Return a product without the grasps that no step can use, and what is said of them.

    A part keeps all grasps if none is reached: `soft-jig check` says why.
    """
    parts, guesses = dict(product.parts), []
    for name, grasps in reached.items():
        drafted, kept = product.parts[name].grasps, {grasp.name for grasp in grasps}
        left_out = [grasp.name for grasp in drafted if grasp.name not in kept]
        if not kept:
            guesses.append(Guess(name, "no grasp is reached", "see soft-jig check", 0.9))
        elif left_out:
            parts[name] = replace(
                product.parts[name], grasps=tuple(g for g in drafted if g.name in kept)
            )
            what = f"{len(kept)} of {len(drafted)} grasps are reached"
            guesses.append(Guess(name, what, f"left out: {', '.join(left_out)}", 0.9))
    return replace(product, parts=parts), guesses
