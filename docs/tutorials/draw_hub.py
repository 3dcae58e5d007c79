"""Draw a small product as somebody's CAD would export it: four STL files, in millimetres.

A flange sits on the stub of a base and is clamped by two M4 screws. Every part is drawn in its
assembled pose. A threaded hole has the diameter of the tap drill, one that a screw passes is wider.
"""

from pathlib import Path

from trimesh import Trimesh
from trimesh.creation import box, cylinder


def disc(radius: float, low: float, high: float, x: float = 0.0) -> Trimesh:
    """Return an upright cylinder between two heights."""
    shape = cylinder(radius, high - low, sections=64)
    shape.apply_translation([x, 0.0, (low + high) / 2])
    return shape


def block(width: float, low: float, high: float) -> Trimesh:
    """Return a square block between two heights."""
    shape = box((width, width, high - low))
    shape.apply_translation([0.0, 0.0, (low + high) / 2])
    return shape


def screw(x: float, seat: float) -> Trimesh:
    """Return a cap screw M4 x 12, its head on a face at a height."""
    return disc(2.0, seat - 12.0, seat, x).union(disc(3.5, seat, seat + 4.0, x))


base = block(44.0, -40.0, 0.0).union(disc(6.0, -1.0, 12.0))
flange = block(44.0, 0.0, 6.0).difference(disc(6.05, -1.0, 7.0))
parts = {}
for number, x in enumerate((-15.0, 15.0), start=1):
    base = base.difference(disc(1.65, -12.0, 1.0, x))
    flange = flange.difference(disc(2.25, -1.0, 7.0, x))
    parts[f"screw_{number}"] = screw(x, 6.0)
parts |= {"base": base, "flange": flange}

folder = Path("hub")
folder.mkdir()
for name, shape in parts.items():
    shape.export(folder / f"{name}.stl")
    print(f"{name}: {len(shape.faces)} triangles, closed: {shape.is_watertight}")
