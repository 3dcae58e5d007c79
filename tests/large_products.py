"""Assemblies of many parts whose orders are known from how they are made. Lengths in mm."""

from __future__ import annotations

from manifold3d import Manifold
from tiny_products import box, product_of

from cell.products.product import Product

PITCH = 6.0  # Height of a layer: a plate of 4 and a gap of 2 that its pin lies in.


def tray_of_plates(plates: int, pinned: bool = False) -> Product:
    """A tray with walls all around, plates stacked in it, and a lid.

    Upwards is the only way out for all but the tray, so 0 re-fixings leave one order: tray, plate_0
    and so on, lid. With pins, each plate carries ribs on which the next lies, and a pin through the
    tray's wall lies on it, between the ribs: pin k goes in sideways, any time after plate k.
    """
    height = PITCH * plates
    tray = box((60, 60, height + 5), (-30, -30, -5)) - box((40, 40, height + 1), (-20, -20, 0))
    parts: dict[str, Manifold] = {}
    for k in range(plates):
        low = PITCH * k
        ribs = box((40, 8, 2), (-20, -20, low + 4)) + box((40, 8, 2), (-20, 12, low + 4))
        parts[f"plate_{k}"] = box((40, 40, 4), (-20, -20, low)) + ribs
        if pinned:
            tray -= box((15, 4, 2), (18, -2, low + 4))
            parts[f"pin_{k}"] = box((30, 4, 2), (10, -2, low + 4))
    lid = box((60, 60, 4), (-30, -30, height))
    return product_of({"tray": tray, **parts, "lid": lid})


def star(bolts: int) -> Product:
    """A base plate with pegs in a row of blind holes: they can come in any order."""
    base = box((10 * bolts + 10, 20, 10), (-5, -10, -10))
    pegs = {}
    for k in range(bolts):
        peg = box((4, 4, 15), (10 * k + 3, -2, -5))
        base -= peg
        pegs[f"peg_{k}"] = peg
    return product_of({"base": base, **pegs})


def reciprocal_ring(bars: int = 4) -> Product:
    """Four bars in a square, each lapped over the next: any two come apart, the ring does not.

    Bars 0 and 2 lie along x, 1 and 3 along y, all between z = 0 and 10. Where two cross, the first
    fills the upper half and the next the lower half.
    """
    along_x, along_y = box((100, 10, 10), (-50, -5, 0)), box((10, 100, 10), (-5, -50, 0))
    places = [(along_x, (0, -30, 0)), (along_y, (30, 0, 0)), (along_x, (0, 30, 0)),
              (along_y, (-30, 0, 0))]  # fmt: skip
    crossings = [(30, -30), (30, 30), (-30, 30), (-30, -30)]
    shapes = [bar.translate(list(at)) for bar, at in places]
    for k, (x, y) in enumerate(crossings):
        shapes[k] -= box((10, 10, 5), (x - 5, y - 5, 0))
        shapes[(k + 1) % 4] -= box((10, 10, 5), (x - 5, y - 5, 5))
    return product_of({f"bar_{k}": shapes[k] for k in range(bars)})
