"""What turns a screw: the kinds and sizes of drive that there are bits for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cell.errors import UnknownName
from cell.products.screw_table import SIZES

POSITIONS: Mapping[str, int] = {"hex": 6, "cross": 4}
"""In how many ways about the axis a bit fits, by the kind of drive."""

BITS: tuple[str, ...] = tuple(dict.fromkeys(head.drive for size in SIZES for head in size.heads))
"""One for every head of the table of screws."""


@dataclass(frozen=True)
class Drive:
    """A drive as it is written, for example "hex 2.5": its kind and its size."""

    name: str

    @property
    def positions(self) -> int:
        """In how many ways about the axis the bit fits.

        Raises:
            UnknownName: There is no such kind of drive.
        """
        kind = self.name.partition(" ")[0]
        if kind not in POSITIONS:
            raise UnknownName("drive", self.name, BITS)
        return POSITIONS[kind]

    @property
    def has_bit(self) -> bool:
        """Whether there is a bit of this kind and size."""
        return self.name in BITS
