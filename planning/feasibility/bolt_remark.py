"""The paper's remark on bolts under the plate, checked.

The paper says that the plate with the bolts under it was not chosen because its centre of gravity
is higher than upside down. Its own Algorithm 1 never compares the two where only one direction is
open (which is so for bolts with heads), so the remark is checked beside it. The answer depends on
the side that the plate's foot is on: with the foot on the motor's side, as on the real unit and in
``motor_unit``, the plate lies lower on its bolts' heads (7.3 mm) than on its foot (15.7 mm), and
the remark does not hold; with the foot on the shaft's side it does.
"""

from __future__ import annotations

from dataclasses import dataclass

from cell.products.product import Product
from planning.feasibility.algorithm import Geometry
from planning.feasibility.directions import opposite
from planning.feasibility.solids import cog_height


@dataclass(frozen=True)
class BoltRemark:
    """Heights of a part with its bolts, above the lowest point.

    Attributes:
        part: Name of the part under the heads.
        bolts: How many bolts it carries.
        heads_up: Height of the common centre of gravity with ``up`` up [m].
        turned_over: The same upside down, the bolts under the part [m].
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


def bolt_remarks(product: Product, geometry: Geometry) -> list[BoltRemark]:
    """Return the check for every part that lies under bolt heads."""
    carried: dict[str, list[str]] = {}
    for name, fastener in product.fasteners.items():
        carried.setdefault(fastener.clamps, []).append(name)
    return [
        BoltRemark(
            part,
            len(bolts),
            cog_height(geometry.solids, (part, *bolts), product.up),
            cog_height(geometry.solids, (part, *bolts), opposite(product.up)),
        )
        for part, bolts in carried.items()
    ]
