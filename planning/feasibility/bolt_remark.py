"""Check of the paper's remark on bolts under the plate.

The paper says that the plate with the bolts under it was not chosen because its centre of gravity
is higher than upside down. Algorithm 1 never compares the two if only one direction is open, which
is the case for bolts with heads, so the remark is checked separately. The answer depends on the
side of the plate's foot: with the foot on the motor's side, as on the real unit and in
``motor_unit``, the centre of gravity is lower with the plate on the bolt heads (7.3 mm) than on its
foot (15.7 mm), and the remark does not hold; with the foot on the shaft's side it does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cell.products.product import Product
from planning.feasibility.directions import opposite
from planning.feasibility.solids import Solid, cog_height


@dataclass(frozen=True)
class BoltRemark:
    """Height of the centre of gravity of a part with its bolts, upright and upside down.

    Attributes:
        part: Name of the part under the heads.
        bolts: How many bolts it carries.
        heads_up: Height above the lowest point with ``up`` up [m].
        turned_over: The same upside down, with the bolts under the part [m].
    """

    part: str
    bolts: int
    heads_up: float
    turned_over: float

    @property
    def holds(self) -> bool:
        """Whether the centre of gravity is higher with the bolts under the part."""
        return self.turned_over > self.heads_up

    def text(self) -> str:
        """Return the check as a sentence."""
        return (
            f"Bolts under the part: the centre of gravity of {self.part} with {self.bolts} bolts "
            f"is {1e3 * self.turned_over:.1f} mm above the lowest point with the bolts under it, "
            f"{1e3 * self.heads_up:.1f} mm with the bolts on top: the paper's remark, that it is "
            f"higher with the bolts below, {'holds' if self.holds else 'does not hold'} here."
        )


def bolt_remarks(product: Product, solids: Mapping[str, Solid]) -> list[BoltRemark]:
    """Return the check for every part that is clamped by bolts."""
    carried: dict[str, list[str]] = {}
    for name, screw in product.screws.items():
        carried.setdefault(screw.clamps, []).append(name)
    return [
        BoltRemark(
            part,
            len(bolts),
            cog_height(solids, (part, *bolts), product.up),
            cog_height(solids, (part, *bolts), opposite(product.up)),
        )
        for part, bolts in carried.items()
    ]
