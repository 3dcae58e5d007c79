"""Small products drawn at random: a block with plates, pegs, pins, bosses, caps and screws.

All in assembled pose, in millimetres, z up, the block's upper face at z = 0. They are drawn as a
designer would: holes with clearance, screws of standard sizes with thread enough, heads with room.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from manifold3d import Manifold

from cell.cad.shapes import boss, box, cylinder, hexagon_prism, to_trimesh
from cell.products.screw_table import SIZES, Head, ScrewSize

FACETS = 64
LENGTHS = (6, 8, 10, 12, 16, 20, 25, 30)  # [R] Of the shanks of screws, ISO 4762 [mm].
ENGAGED = 1.5  # [A] Length of thread in the block at least, in diameters.
FLOOR = 5.0  # [A] Left below a hole in the block [mm].
BESIDE_HEAD = 1.0  # [A] From a screw's head to the plate's edge [mm].


def screw(size: ScrewSize, head: Head, length: float) -> Manifold:
    """Return a screw with the underside of its head at the origin, its shank down."""
    shape = cylinder(size.diameter / 2, -length, 0.0, FACETS)
    shape += cylinder(head.diameter / 2, 0.0, head.height, FACETS)
    bottom = head.height - head.engagement
    kind, _, number = head.drive.partition(" ")
    if kind == "hex":
        return shape - hexagon_prism(float(number), bottom, head.height + 1)
    half, wing = 0.3 * head.diameter, 0.08 * head.diameter
    slot = box((-half, -wing, bottom), (half, wing, head.height + 1))
    return shape - slot - slot.rotate([0, 0, 90])


@dataclass
class Drawing:
    """A product as it is drawn.

    Attributes:
        text: What it is.
        parts: By name.
        top: Height of what lies highest over the whole block [mm].
    """

    text: list[str] = field(default_factory=list)
    parts: dict[str, Manifold] = field(default_factory=dict)
    top: float = 0.0


def draw(rng: np.random.Generator) -> Drawing:
    """Return a product; the same random state draws the same one."""
    drawing = Drawing()
    size = np.round(rng.uniform(34.0, 46.0, 2))
    height = float(np.round(rng.uniform(30.0, 42.0)))
    drawing.parts["block"] = box((*-size / 2, -height), (*size / 2, 0))
    core = str(rng.choice(["none", "boss", "pin", "pegs"]))
    drawing.text.append(f"block {size[0]:g} x {size[1]:g} x {height:g}")
    holes = {"none": _no_core, "boss": _boss, "pin": _pin, "pegs": _pegs}[core](drawing, rng, size)
    for number in range(1, int(rng.integers(1, 3)) + 1):
        _plate(drawing, rng, size, holes, f"plate_{number}")
    if core == "boss" and rng.random() < 0.5:
        _cap(drawing, rng, holes[0])
    elif rng.random() < 0.8:
        _screws(drawing, rng, size, holes)
    return drawing


def write_cad(parts: Mapping[str, Manifold], folder: Path) -> Path:
    """Write parts, drawn in millimetres, as STL files; return their folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, solid in parts.items():
        to_trimesh(solid).export(folder / f"{name}.stl")
    return folder


@dataclass(frozen=True)
class Core:
    """Something upright that plates go over.

    Attributes:
        x, y: Where.
        radius: [mm].
        top: Its height over the block [mm].
        clearance: Radial, of what goes over it [mm].
    """

    x: float
    y: float
    radius: float
    top: float
    clearance: float


def _no_core(drawing: Drawing, rng: np.random.Generator, size: np.ndarray) -> list[Core]:
    return []


def _boss(drawing: Drawing, rng: np.random.Generator, size: np.ndarray) -> list[Core]:
    radius, top = np.round(rng.uniform(4.0, 7.0), 1), np.round(rng.uniform(14.0, 26.0))
    drawing.parts["block"] += boss(radius, -1.0, top, 0.5, FACETS)
    drawing.text.append(f"boss {2 * radius:g}")
    return [Core(0.0, 0.0, radius, top, np.round(rng.uniform(0.05, 0.25), 2))]


def _pin(drawing: Drawing, rng: np.random.Generator, size: np.ndarray) -> list[Core]:
    """Add a flanged pin in a blind hole."""
    radius, depth = np.round(rng.uniform(4.0, 7.0), 1), np.round(rng.uniform(10.0, 16.0))
    clearance = np.round(rng.uniform(0.03, 0.2), 2)
    wide, thick = radius + np.round(rng.uniform(2.0, 4.0), 1), np.round(rng.uniform(4.0, 7.0))
    drawing.parts["block"] -= cylinder(radius + clearance, -depth - 2.0, 1.0, FACETS)
    pin = boss(radius, 0.0, depth, 0.5, FACETS).rotate([180, 0, 0])
    drawing.parts["pin"] = pin + boss(wide, 0.0, thick, 0.5, FACETS)
    drawing.text.append(f"flanged pin {2 * radius:g}")
    return [Core(0.0, 0.0, wide, thick, np.round(rng.uniform(0.2, 0.5), 2))]


def _pegs(drawing: Drawing, rng: np.random.Generator, size: np.ndarray) -> list[Core]:
    """Add two dowels that stand in blind holes."""
    radius = float(rng.choice([2.5, 3.0, 4.0]))
    depth, top = np.round(rng.uniform(10.0, 14.0)), np.round(rng.uniform(14.0, 20.0))
    clearance = np.round(rng.uniform(0.03, 0.1), 2)
    found = []
    for number, x in enumerate((-1.0, 1.0), start=1):
        x *= float(np.round(0.25 * size[0]))
        hole = cylinder(radius + clearance, -depth, 1.0, FACETS)
        peg = boss(radius, 0.0, top, 0.5, FACETS) + boss(radius, 0.0, depth, 0.5, FACETS).rotate(
            [180, 0, 0]
        )
        drawing.parts["block"] -= hole.translate([x, 0, 0])
        drawing.parts[f"peg_{number}"] = peg.translate([x, 0, 0])
        found.append(Core(x, 0.0, radius, top, np.round(rng.uniform(0.1, 0.25), 2)))
    drawing.text.append(f"two pegs {2 * radius:g}")
    return found


def _plate(
    drawing: Drawing, rng: np.random.Generator, size: np.ndarray, cores: list[Core], name: str
) -> None:
    """Add a plate on what is there, of about the block's outline."""
    thick = float(np.round(rng.uniform(4.0, 9.0)))
    if any(0.0 < core.top - drawing.top < 1.0 for core in cores):
        thick += 1.0
    half = (size + np.round(rng.uniform(-2.0, 2.0))) / 2
    low, high = drawing.top, drawing.top + thick
    plate = box((*-half, low), (*half, high))
    for core in cores:
        if core.top > low:
            wide = core.radius + core.clearance
            plate -= cylinder(wide, low - 1, high + 1, FACETS).translate([core.x, core.y, 0])
    drawing.parts[name] = plate
    drawing.top = high
    drawing.text.append(f"plate {thick:g}")


def _cap(drawing: Drawing, rng: np.random.Generator, core: Core) -> None:
    """Add a ring over what still stands out of the plates."""
    if core.top - drawing.top < 3.0:
        return
    wide, thick = core.radius + float(np.round(rng.uniform(4.0, 7.0))), core.top - drawing.top + 4.0
    ring = boss(wide, 0.0, thick, 0.5, FACETS)
    ring -= cylinder(core.radius + core.clearance, -1.0, thick - 2.0, FACETS)
    drawing.parts["cap"] = ring.translate([core.x, core.y, drawing.top])
    drawing.text.append(f"cap {2 * wide:g}")


def _screws(
    drawing: Drawing, rng: np.random.Generator, size: np.ndarray, cores: list[Core]
) -> None:
    """Add two or four screws through all plates into the block, where there is room for them."""
    screw_size = SIZES[int(rng.integers(2, 5))]
    head = screw_size.heads[int(rng.integers(2))]
    x, y = np.floor(size / 2 - 1.0 - BESIDE_HEAD - head.diameter / 2)
    places = [(x, y), (-x, -y), (x, -y), (-x, y)][: int(rng.choice([2, 4]))]
    if any(np.hypot(x - abs(core.x), y) < core.radius + head.diameter / 2 + 1.0 for core in cores):
        return
    deep = drawing.top + ENGAGED * screw_size.diameter
    room = float(-drawing.parts["block"].bounding_box()[2]) - FLOOR
    length = next((n for n in LENGTHS if n >= deep), None)
    if length is None or length - drawing.top > room:
        return
    drawn = screw(screw_size, head, length)
    for number, place in enumerate(places, start=1):
        at = [*place, 0.0]
        tapped = cylinder(screw_size.tap_drill / 2, -(length - drawing.top) - 1.0, 1.0, FACETS)
        drawing.parts["block"] -= tapped.translate(at)
        passed = cylinder(screw_size.clearance_hole / 2, -1.0, drawing.top + 1.0, FACETS)
        for name in drawing.parts:
            if name.startswith("plate"):
                drawing.parts[name] -= passed.translate(at)
        drawing.parts[f"screw_{number}"] = drawn.translate([*place, drawing.top])
    drawing.text.append(f"{len(places)} {screw_size.name} x {length} {head.kind}")
