"""The drawn parts have the measured dimensions, and the contact pieces the declared fits."""

import filecmp
from collections.abc import Callable
from functools import reduce
from operator import add
from pathlib import Path

import numpy as np
import pytest
import trimesh
from solids import assert_same_solid

from cell.cad import idler, tray
from cell.cad import motor_unit as mu
from cell.cad.sdf import Model
from cell.cad.shapes import revolved_surface, vertex_radius
from cell.paths import MODELS
from cell.products.loading import load_product

MM3 = 1e-9
OWN_MODELS = ("motor", "motor_plate", "bolt_m3x10", "motor_unit_tray")
OWN_MODELS += ("idler_post", "idler_arm", "idler_tray")
PART_MODELS = (mu.motor_model(), mu.plate_model(), mu.bolt_model())
PART_MODELS += (idler.post_model(), idler.arm_model())


def whole(model: Model) -> trimesh.Trimesh:
    assert model.whole is not None
    return model.whole


def surfaces(model: Model) -> dict[str, trimesh.Trimesh]:
    """Return the contact pieces that are surfaces, by name."""
    shapes = {piece.name: piece.shape for piece in model.pieces}
    return {name: s for name, s in shapes.items() if isinstance(s, trimesh.Trimesh)}


@pytest.mark.parametrize("model", PART_MODELS, ids=lambda model: model.name)
def test_parts_are_closed_solids(model: Model) -> None:
    assert whole(model).is_volume
    for piece in model.pieces:
        if isinstance(piece.shape, trimesh.Trimesh):
            assert piece.shape.is_winding_consistent
            assert piece.shape.is_volume or not piece.convex  # A rigid surface may be open.


def test_motor_has_the_measured_dimensions_and_inertia() -> None:
    model = mu.motor_model()
    low, high = whole(model).bounds * 1e3
    assert high[2] - low[2] == pytest.approx(81.7, abs=1e-6)  # Tip to tip.
    assert high[0] - low[0] == pytest.approx(36.8, abs=1e-6)
    assert model.inertia.mass == 0.195
    # Uniform density puts the measured CAD's centre at -25.7; it has gears, holes and a seam more.
    assert model.inertia.p_PCm[2] * 1e3 == pytest.approx(-25.7, abs=0.5)
    axial, transverse = model.inertia.I_Cm_P[2, 2], model.inertia.I_Cm_P[0, 0]
    # A plain cylinder, radius 18 and length 54 mm, has no boss and no shaft.
    assert axial == pytest.approx(3.2e-5, rel=0.1)
    assert transverse == pytest.approx(6.2e-5, rel=0.1)


def test_plate_has_the_measured_volume_and_centre() -> None:
    plate = whole(mu.plate_model())
    # Measured 25 228 with a sharp bore of 12.00; this one is 12.10 with two edge breaks.
    assert plate.volume / MM3 == pytest.approx(25_228, rel=1e-3)
    # Measured (35.0, 24.2, 4.5) from a corner of the foot's side, turned into A.
    np.testing.assert_allclose(plate.center_mass * 1e3, [0.0, 24.2 - 33.0, 5.0 - 4.5], atol=0.05)
    assert mu.plate_model().inertia.mass == pytest.approx(0.068, rel=5e-3)


def test_bolt_has_the_measured_volume_and_mass() -> None:
    bolt = mu.bolt_model()
    assert whole(bolt).volume / MM3 == pytest.approx(130.5, rel=5e-3)
    assert bolt.inertia.mass == pytest.approx(1.02e-3, rel=5e-3)


def test_assembled_parts_do_not_overlap() -> None:
    motor, plate = reduce(add, mu.motor_solids().values()), mu.plate_solid()
    bolt = mu.bolt_solid().translate([*mu.bolt_xy()[1], mu.PLATE_THICKNESS])
    for one, other in [(motor, plate), (plate, bolt), (motor, bolt)]:
        assert (one ^ other).volume() < 1e-6  # mm3; touching faces are exactly coincident.


def test_idler_overlaps_only_in_its_threads() -> None:
    """Each bolt shares a thin tube with its tap-drilled hole: nominal against drilled diameter."""
    post, arm = idler.post_solid(), idler.arm_solid()
    assert (post ^ arm).volume() < 1e-6  # mm3
    for x, y in idler.BOLT_XY:
        bolt = mu.bolt_solid().translate([x, y, mu.PLATE_THICKNESS])
        assert (arm ^ bolt).volume() < 1e-6
        tube = np.pi * (mu.THREAD_RADIUS**2 - idler.TAP_DRILL_RADIUS**2) * 5.0
        assert (post ^ bolt).volume() == pytest.approx(tube, rel=0.05)


def test_shank_and_threaded_hole_coincide() -> None:
    """The corners of the drawn thread are those of the motor's hole: contact all around."""
    parts = load_product("motor_unit").parts
    p_ABolt = parts["bolt_2"].X_AP.translation()
    shank = parts["bolt_2"].mesh.vertices
    shank = shank[np.isclose(shank[:, 2], 0.0) & (np.hypot(*shank[:, :2].T) < 1.6e-3)]
    face = parts["motor"].mesh.vertices - [*p_ABolt[:2], 0.0]
    rim = face[np.isclose(face[:, 2], 0.0) & (np.hypot(*face[:, :2].T) < 1.6e-3)]
    assert len(rim) == len(shank) == mu.THREAD_FACETS
    for corner in shank[:, :2]:
        assert np.linalg.norm(rim[:, :2] - corner, axis=1).min() < 2e-7


def test_boss_and_bore_keep_their_mean_clearance() -> None:
    pieces = surfaces(mu.motor_model()) | surfaces(mu.plate_model())
    boss, boss_flat = radii(pieces["boss"].vertices, max)
    bore, bore_flat = radii(pieces["bore"].vertices, min)
    clearance = (bore + bore_flat - boss - boss_flat) / 2
    assert clearance == pytest.approx(0.075e-3, abs=1e-9)
    assert bore_flat > boss  # Free in every angular position.


def radii(points: np.ndarray, choose: Callable[[np.ndarray], float]) -> tuple[float, float]:
    """Return the radius of the corners and of the flats of the fit's polygon about the shaft."""
    xy = points[:, :2] - [0.0, mu.SHAFT_Y * 1e-3]
    radius = np.linalg.norm(xy, axis=1)
    corner = choose(radius)
    angles = np.arctan2(*xy[np.isclose(radius, corner)].T)
    facets = len(np.unique(np.round(np.cos(angles) + 2 * np.sin(angles), 6)))
    return corner, corner * float(np.cos(np.pi / facets))


def test_can_has_16_flats_and_corners_between_the_axes() -> None:
    can = surfaces(mu.motor_model())["bed_can"].vertices
    angles = np.unique(np.round(np.rad2deg(np.arctan2(can[:, 1], can[:, 0])), 6))
    np.testing.assert_allclose(np.diff(angles), 22.5, atol=1e-5)
    assert angles[0] == pytest.approx(-168.75, abs=1e-5)
    assert np.linalg.norm(can[:, :2], axis=1).max() == pytest.approx(vertex_radius(0.0174, 16))


def test_plate_boxes_clear_the_gearbox() -> None:
    for piece in mu.plate_model().pieces:
        if piece.name.startswith("bed_edge"):
            half = np.asarray(piece.shape.size())[:2] / 2  # type: ignore[union-attr]
            nearest = np.maximum(np.abs(piece.X_PS.translation()[:2]) - half, 0.0)
            assert np.linalg.norm(nearest) > mu.GEARBOX_RADIUS * 1e-3


def test_head_friction_reproduces_the_nut_factor() -> None:
    """Friction integrated over the facets under the head: the torque per newton is K d."""
    washer = surfaces(mu.plate_model())["washer_0"]
    on_top = washer.triangles_center[:, 2] > 4.99e-3
    top = trimesh.Trimesh(washer.vertices, washer.faces[on_top])
    for _ in range(5):
        top = top.subdivide()
    from_axis = top.triangles_center[:, :2] - np.array(mu.bolt_xy()[0]) * 1e-3
    arm = np.average(np.linalg.norm(from_axis, axis=1), weights=top.area_faces) * 1e3
    torque = mu.lumped_head_friction() * arm + mu.THREAD_PITCH / (2 * np.pi)
    assert torque == pytest.approx(0.202 * 3.0, rel=1e-4)
    assert load_product("motor_unit").screws["bolt_1"].nut_factor == mu.NUT_FACTOR


def test_friction_radius_of_many_facets_is_that_of_a_round_ring() -> None:
    """The mean radius of a disc is two thirds of its radius."""
    assert mu.friction_radius(3.0, 0.0, 1000) == pytest.approx(2.0, rel=1e-5)


def test_shank_touches_the_wall_of_its_hole_before_any_edge_of_the_faces() -> None:
    washer = surfaces(mu.plate_model())["washer_0"]
    xy = washer.vertices[:, :2] - np.array(mu.bolt_xy()[0]) * 1e-3
    radius, on_wall = np.linalg.norm(xy, axis=1), washer.vertices[:, 2] % 5e-3 > 1e-6
    angles = np.arctan2(xy[on_wall, 1], xy[on_wall, 0])
    flat = radius[~on_wall].min() * np.cos(np.pi / mu.WASHER_FACETS)
    off_flat = (angles - np.pi / mu.WASHER_FACETS) % (2 * np.pi / mu.WASHER_FACETS)
    off_flat = np.minimum(off_flat, 2 * np.pi / mu.WASHER_FACETS - off_flat)
    assert on_wall.sum() == 2 * mu.HOLE_FACETS
    assert np.all(radius[on_wall] < flat / np.cos(off_flat))


def test_revolved_surface_has_the_volume_of_the_round_one() -> None:
    """Pappus: a square of 1 mm at radius 5.5 mm; facets at the mean radius keep it to 0.1 %."""
    square = [(5e-3, 0.0), (6e-3, 0.0), (6e-3, 1e-3), (5e-3, 1e-3)]
    ring = revolved_surface(square, 64, center=(0.1, -0.2), phase=0.25)
    assert ring.is_volume
    assert ring.volume == pytest.approx(2 * np.pi * 5.5e-3 * 1e-6, rel=2e-3)


def test_committed_models_are_what_the_code_writes(tmp_path: Path) -> None:
    for module in (mu, tray, idler):
        module.write_models(tmp_path)
    for name in OWN_MODELS:
        new, kept = tmp_path / name, MODELS / "sdf" / name
        files = sorted(f.name for f in new.iterdir())
        assert files == sorted(f.name for f in kept.iterdir())
        shown = [f for f in files if f.endswith("_visual.obj")]
        told = [f for f in files if f not in shown]
        _, different, errors = filecmp.cmpfiles(new, kept, told, shallow=False)
        assert (different, errors) == ([], []), 'run "python -m cell.cad" and commit'
        for file in shown:
            assert_same_solid(new / file, kept / file)
