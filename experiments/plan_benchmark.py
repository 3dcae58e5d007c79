"""Benchmark of the planner: ``python -m experiments.plan_benchmark``.

Products of 5 to 500 parts, CPU seconds after import and without reading files. "Matrices" is
everything from meshes to C, M_j and their margins, with the overlap check; "contact" is the share
of the distances; "cached" is the same read from the cache, with its content check. ``--rule`` adds
the orders, the general rule and the page, ``--profile`` the functions that take longest,
``--large`` shows 500 parts, products of 1.6 million triangles, one of them with an overlap, and
the memory. Set OPENBLAS_NUM_THREADS=1 for strictly one core: a few matrix products may use
more.
"""

from __future__ import annotations

import cProfile
import pstats
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
import tyro
from manifold3d import CrossSection, Manifold, Mesh64, OpType
from pydrake.math import RigidTransform
from rich.console import Console
from rich.table import Table

from cell.configuration.config import CellConfig
from cell.products.loading import load_product
from cell.products.product import Part, Product
from experiments.plan.gear_line import gear_line
from experiments.plan.page import write_page
from planning.assembly_plan.planner import plan
from planning.assembly_plan.verdict import verdict_of
from planning.feasibility.cache import cached_matrices
from planning.feasibility.contact import gap_matrix
from planning.feasibility.matrices import matrices_of
from planning.feasibility.solids import solids_of
from planning.fixture_analysis.candidate import FixtureSetup
from planning.fixture_analysis.rule import general_rule

STATION = 30.0  # [mm] Pitch of the stations of the bench assemblies.


def motor_unit() -> Product:
    """The paper's product: motor, plate, six bolts."""
    return load_product("motor_unit")


def perforated() -> Product:
    """Two perforated plates with a spacer between them, a shaft through all, and a collar."""
    plate = _perforated_plate(0)
    shapes = {
        "plate_1": plate,
        "plate_2": plate.translate([0, 0, 20]),
        "spacer": _perforated_plate(5, depth=15),
        "shaft": _rod(12, -20, 60, 256),
        "collar": _rod(24, 25, 35, 200) - _rod(12, 20, 40, 200),
    }
    return _product("perforated", shapes)


def bench(stations: int) -> Product:
    """A base plate with rows of stations of four: bush, bracket, headed pin, cap; one cap left out.

    All fits are line to line, with facets that do not match.
    """
    side = int(np.ceil(np.sqrt(stations)))
    base = Manifold.cube([side * STATION, side * STATION, 10]).translate([-15, -15, -10])
    shapes: dict[str, Manifold] = {}
    for number in range(stations):
        place = [STATION * (number % side), STATION * (number // side), 0]
        base -= _rod(8, -8, 1, 48).translate(place)
        for name, shape in _station().items():
            shapes[f"{name}_{number + 1}"] = shape.translate(place)
    shapes.popitem()
    return _product(f"bench_{stations}", {"base": base} | shapes)


def freeform(cells: int = 70) -> Product:
    """Six layers that lie on each other on wavy surfaces, each tessellated differently."""
    shapes = {f"layer_{k}": _layer(k, cells + 3 * (k % 3)) for k in range(6)}
    return _product("freeform", shapes)


def real_threads() -> Product:
    """Nine screws in a plate, their threads drawn as helices."""
    plate = Manifold.cube([60, 60, 12]).translate([-30, -30, 0])
    screws: dict[str, Manifold] = {}
    for place in ([x, y, 0.0] for x in (-15.0, 0.0, 15.0) for y in (-15.0, 0.0, 15.0)):
        plate -= _helix(3.62).translate(place)
        screw = _helix(3.6) + _rod(12, 12, 16, 96)
        screws[f"screw_{len(screws) + 1}"] = screw.translate(place)
    return _product("real_threads", {"plate": plate} | screws)


def gears(stations: int, fineness: float, overlap: float = 0.0) -> Product:
    """A machine with some 5000 to 12000 triangles a part; see ``gear_line``."""
    return _product(f"gear_line_{stations}", gear_line(stations, fineness, overlap))


CASES: dict[str, tuple[Callable[[], Product], float]] = {
    "motor unit": (motor_unit, 0.1),
    "perforated plates": (perforated, 0.15),
    "bench, 5 stations": (lambda: bench(5), 0.3),
    "bench, 25 stations": (lambda: bench(25), 2.0),
    "wavy layers": (freeform, 1.0),
    "gear line, 7 stations": (lambda: gears(7, 0.87), 6.0),
}
"""Product and target in CPU seconds, by name."""

LARGE: dict[str, tuple[Callable[[], Product], float]] = {
    "bench, 125 stations": (lambda: bench(125), 20.0),
    "gear line, 15 stations": (lambda: gears(15, 1.1), 15.0),
    "real threads": (real_threads, 15.0),
}
"""The same for products as large as are planned."""

FUNCTIONS = 15  # Listed in a profile.


def main(rule: bool = False, profile: bool = False, large: bool = False) -> None:
    """Time every case and print the table.

    Args:
        rule: Also time the search for orders, the general rule and the page.
        profile: Also print where the time goes.
        large: Only the products of most parts and most triangles.
    """
    cases = LARGE if large else CASES
    table = Table(title="CPU seconds of the planner", title_justify="left")
    headings = ["product", "parts", "triangles", "contact", "matrices", "target", "cached"]
    for heading in headings + (["orders", "general rule", "page"] if rule else []):
        table.add_column(heading, justify="left" if heading == "product" else "right")
    for name, (make, target) in cases.items():
        product = make()
        triangles = sum(len(part.mesh.faces) for part in product.parts.values())
        contact, first, again = (f"{seconds:.3f}" for seconds in timed(product))
        further = [f"{seconds:.2f}" for seconds in timed_rule(product)] if rule else []
        count = f"{len(product.parts)}"
        table.add_row(name, count, f"{triangles}", contact, first, f"{target:g}", again, *further)
        if profile:
            print(f"{name}:")
            print_profile(product)
    Console().print(table)
    if large:
        print(f"Gear line with an overlap: {timed_refusal():.2f} s.")
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"Largest memory of this process: {most:.0f} MB.")


def print_profile(product: Product) -> None:
    """Print the functions in which a product's matrices spend most time."""
    profiler = cProfile.Profile()
    profiler.runcall(matrices_of, product)
    pstats.Stats(profiler).sort_stats("tottime").print_stats(FUNCTIONS)


def timed_rule(product: Product) -> tuple[float, float, float]:
    """Return CPU seconds for the orders, with cached matrices, the general rule, and the page."""
    config = CellConfig.load()
    with tempfile.TemporaryDirectory() as folder:
        cached_matrices(product, None, Path(folder))
        marks = [time.process_time()]
        fixing = plan(product, config=config, cache=Path(folder))
    assert fixing.matrices is not None
    marks.append(time.process_time())
    setup = FixtureSetup.of(config)
    choices = general_rule(product, fixing.order, fixing.steps, fixing.matrices, setup)
    marks.append(time.process_time())
    with tempfile.TemporaryDirectory() as folder:
        verdict = verdict_of(fixing, choices)
        write_page(Path(folder) / "plan.html", product, fixing, choices, verdict, setup)
    orders, chosen, page = np.diff([*marks, time.process_time()])
    return orders, chosen, page


def timed_refusal() -> float:
    """Return CPU seconds of the largest product's matrices with an overlap in it, all found."""
    product = gears(15, 1.1, overlap=0.3)
    started = time.process_time()
    found = matrices_of(product).errors
    seconds = time.process_time() - started
    if not found:
        raise RuntimeError("the overlap was not found")
    return seconds


def timed(product: Product) -> tuple[float, float, float]:
    """Return CPU seconds for distances, for all matrices, and for reading them from the cache."""
    with tempfile.TemporaryDirectory() as folder:
        marks = [time.process_time()]
        gap_matrix(list(solids_of(product).values()), 7e-5)
        marks.append(time.process_time())
        cached_matrices(product, None, Path(folder))
        marks.append(time.process_time())
        cached_matrices(product, None, Path(folder))
        marks.append(time.process_time())
    contact, first, again = np.diff(marks)
    return contact, first, again


def _perforated_plate(z: float, depth: float = 5.0) -> Manifold:
    holes = [
        _rod(6, z - 1, z + depth + 1, 64).translate([15 * i - 67.5, 15 * k - 37.5, 0])
        for i in range(10)
        for k in range(6)
    ]
    body = Manifold.cube([160, 100, depth]).translate([-80, -50, z]) - _rod(12, z - 1, z + 30, 96)
    return body - Manifold.batch_boolean(holes, OpType.Add)


def _station() -> dict[str, Manifold]:
    bush = _rod(8, -8, 12, 96) - _rod(5, -8, 12, 64)
    bracket = Manifold.cube([24, 24, 8]).translate([-12, -12, 0]) - _rod(8, -1, 9, 80)
    for x in (-9, 9):
        for y in (-9, 9):
            bracket -= _rod(3, -1, 9, 24).translate([x, y, 0])
    pin = _rod(5, -8, 14, 100) + _rod(10, 12, 16, 100)
    cap = _rod(14, 8, 20, 80) - _rod(10, 7, 16, 80)
    return {"bush": bush, "bracket": bracket, "pin": pin, "cap": cap}


def _layer(level: int, cells: int) -> Manifold:
    """A slab between two wavy surfaces, 12 mm apart, 100 mm square."""
    u = np.linspace(-50, 50, cells + 1)
    x, y = (grid.ravel() for grid in np.meshgrid(u, u, indexing="ij"))
    low = 12.0 * level + 3.0 * np.sin(x / 9.0) * np.cos(y / 11.0) + 0.02 * x
    vertices = np.concatenate([np.c_[x, y, low], np.c_[x, y, low + 12.0]])
    index = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (index[i : i + cells, k : k + cells].ravel() for i in (0, 1) for k in (0, 1))
    top = np.concatenate([np.c_[a, c, d], np.c_[a, d, b]])
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    after, above = np.roll(rim, -1), len(x)
    walls = np.concatenate(
        [np.c_[rim, after, after + above], np.c_[rim, after + above, rim + above]]
    )
    faces = np.concatenate([top + above, top[:, ::-1], walls])
    return Manifold(Mesh64(vertices, faces.astype(np.uint64)))


def _helix(radius: float) -> Manifold:
    """A thread 12 long, of pitch 1.25: a circle that is twisted about a point beside its centre."""
    outline = CrossSection.circle(radius, 96).translate([0.4, 0])
    return Manifold.extrude(outline, 12, 460, 360 * 12 / 1.25)


def _rod(diameter: float, low: float, high: float, facets: int) -> Manifold:
    radius = diameter / 2
    return Manifold.cylinder(high - low, radius, radius, facets).translate([0, 0, low])


def _product(name: str, shapes: dict[str, Manifold]) -> Product:
    parts = {}
    for part, shape in shapes.items():
        data = shape.to_mesh64()
        vertices = np.array(data.vert_properties)[:, :3] * 1e-3
        mesh = trimesh.Trimesh(vertices, np.array(data.tri_verts, int), process=False)
        parts[part] = Part(part, mesh, 2700.0 * float(mesh.volume), RigidTransform())
    return Product(name, parts)


if __name__ == "__main__":
    tyro.cli(main)
