"""The soft jig: a bag of beads that conforms to a part while soft and freezes under vacuum."""

from cell.soft_jig.drake_values import JigError
from cell.soft_jig.jig import JigState, SoftJig
from cell.soft_jig.parameters import (
    BagParameters,
    JammedParameters,
    JigParameters,
    SoilParameters,
    SuctionParameters,
    VacuumParameters,
)
from cell.soft_jig.samples import SurfaceSamples

__all__ = [
    "BagParameters",
    "JammedParameters",
    "JigError",
    "JigParameters",
    "JigState",
    "SoftJig",
    "SoilParameters",
    "SuctionParameters",
    "SurfaceSamples",
    "VacuumParameters",
]
