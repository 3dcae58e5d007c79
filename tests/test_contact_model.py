"""Contact models of any mesh: round features found, volumes kept, clearances exact."""

import numpy as np
import pytest
import trimesh
from drawn_products import covered_block, meshes, pinned_block
from manifold3d import Manifold

from cell.cad import motor_unit as mu
from cell.cad.contact_model import ContactModel, Use, contact_model
from cell.cad.convex_pieces import convex_pieces, error_of
from cell.cad.round_features import Cylinder, cylinders_of
from cell.cad.sdf import Piece
from cell.cad.shapes import box, cylinder

MM = 1e-3
PLATE = mu.mesh(mu.plate_solid())
MOTOR = mu.mesh(mu.motor_solids()["shaft"])


def hole(mesh: trimesh.Trimesh, radius: float) -> tuple[int, Cylinder]:
    """Return number and shape of the first hole of a radius [mm]."""
    found = enumerate(cylinders_of(mesh))
    return next((n, c) for n, c in found if c.hole and abs(c.radius - radius * MM) < 1e-5)


def surfaces(model: ContactModel, prefix: str) -> list[trimesh.Trimesh]:
    """Return the surfaces of some pieces."""
    chosen = [piece.shape for piece in model.pieces if piece.name.startswith(prefix)]
    assert all(isinstance(shape, trimesh.Trimesh) for shape in chosen)
    return chosen  # pyright: ignore[reportReturnType]


def about(piece: Piece, drawn: Cylinder) -> np.ndarray:
    """Return the distances of a piece's corners from an axis [m]."""
    assert isinstance(piece.shape, trimesh.Trimesh)
    return np.linalg.norm(np.cross(piece.shape.vertices - drawn.point, drawn.axis), axis=1)


@pytest.mark.parametrize("facets", [12, 32, 96])
@pytest.mark.parametrize("turned", [(0, 0, 0), (90, 0, 0), (30, 40, 50)])
def test_a_hole_is_found_whatever_its_facets_and_direction(
    facets: int, turned: tuple[float, float, float]
) -> None:
    solid = box((-10, -10, 0), (10, 10, 8)) - cylinder(3.0, -1, 9, facets)
    (found,) = cylinders_of(mu.mesh(solid.rotate(list(turned))))
    assert found.hole
    assert found.facets == facets
    assert found.radius == pytest.approx(3.0 * MM, rel=1e-6)
    assert found.length == pytest.approx(8.0 * MM, rel=1e-6)


def test_chamfers_at_both_ends_of_a_bore_are_found() -> None:
    _, bore = hole(PLATE, mu.BORE_RADIUS)
    wide, thickness = mu.BORE_RADIUS + mu.EDGE_BREAK, mu.PLATE_THICKNESS
    assert np.allclose(bore.flare_low, (wide * MM, 0.0), atol=1e-7)
    assert np.allclose(bore.flare_high, (wide * MM, thickness * MM), atol=1e-7)
    assert np.allclose(bore.point, (0.0, mu.SHAFT_Y * MM, 0.0), atol=1e-7)


def test_a_half_round_wall_and_a_square_hole_are_no_cylinders() -> None:
    groove = box((-10, -10, 0), (10, 10, 8)) - cylinder(3.0, -1, 9).translate([10, 0, 0])
    window = box((-10, -10, 0), (10, 10, 8)) - box((-3, -3, -1), (3, 3, 9))
    assert cylinders_of(mu.mesh(groove)) == []
    assert cylinders_of(mu.mesh(window)) == []


def test_pieces_of_an_angle_fill_it_and_are_convex() -> None:
    angle = box((0, 0, 0), (30, 20, 4)) + box((0, 0, 0), (4, 20, 30))
    pieces = convex_pieces(angle)
    assert len(pieces) == 2
    error = error_of(pieces, angle, Manifold())
    assert error.more < 1e-6
    assert error.less < 1e-4
    for piece in pieces:
        assert piece.hull().volume() == pytest.approx(piece.volume(), rel=1e-9)


def test_a_rounded_inner_corner_is_cut_along_its_facets() -> None:
    corner = box((0, 0, 0), (20, 20, 5)) - cylinder(15.0, -1, 6, 64).translate([20, 20, 0])
    error = error_of(convex_pieces(corner), corner, Manifold())
    assert error.more < 1e-6
    assert error.less < 1e-3


def test_a_dimple_is_filled_and_said() -> None:
    """What no cut makes convex is taken for its hull: the error says by how much."""
    dimple = box((0, 0, 0), (30, 30, 15)) - Manifold.sphere(10, 32).translate([15, 15, 15])
    pieces = convex_pieces(dimple)
    error = error_of(pieces, dimple, Manifold())
    filled = sum(pieces, Manifold())
    assert error.more == pytest.approx((filled - dimple).volume() / dimple.volume(), rel=1e-3)
    assert error.more > 0.1
    assert error.surface > 5.0


def test_clearance_of_a_fit_is_exact() -> None:
    """The wall is the drawn circle on average, and all else stays behind it."""
    number, bore = hole(PLATE, mu.BORE_RADIUS)
    model = contact_model(PLATE, cylinders_of(PLATE), {number: Use("fit", 7.5e-5)}, fixed=False)
    (wall,) = [piece for piece in model.pieces if piece.name.startswith("wall")]
    least, most = about(wall, bore).min(), bore.radius
    facets = mu.BORE_FACETS
    assert least == pytest.approx(most, rel=1e-3)
    assert least * (1 + np.cos(np.pi / facets)) / 2 == pytest.approx(bore.mean_radius, rel=1e-4)
    assert wall.contact.modulus is None
    # No other piece reaches into the hole.
    core = cylinder(mu.BORE_RADIUS - 1e-3, -1, 6, 256).translate([0, mu.SHAFT_Y, 0])
    for body in surfaces(model, "body"):
        vertices = np.asarray(body.vertices) / MM
        assert (core ^ Manifold.hull_points(vertices)).volume() < 1e-6


def test_a_boss_has_its_mean_radius_and_the_chamfer_that_is_drawn() -> None:
    cylinders = cylinders_of(MOTOR)
    number = next(n for n, c in enumerate(cylinders) if abs(c.radius - 5.975 * MM) < 1e-5)
    model = contact_model(MOTOR, cylinders, {}, fixed=True)
    (nose,) = [piece for piece in model.pieces if piece.name == f"boss_{number}"]
    radii = np.sort(about(nose, cylinders[number]))
    assert radii[-1] * (1 + np.cos(np.pi / 32)) / 2 == pytest.approx(
        cylinders[number].mean_radius, rel=1e-5
    )
    assert radii[0] == pytest.approx((mu.BOSS_RADIUS - mu.EDGE_BREAK) * MM, rel=1e-2)


def test_a_sharp_edge_is_broken() -> None:
    peg = mu.mesh(cylinder(5.0, 0.0, 20.0))
    model = contact_model(peg, cylinders_of(peg), {}, fixed=False)
    (shape,) = surfaces(model, "boss")
    at_end = shape.vertices[shape.vertices[:, 2] > 20 * MM - 1e-6]
    assert np.linalg.norm(at_end[:, :2], axis=1).max() == pytest.approx(4.7 * MM, rel=1e-2)


def test_threaded_holes_are_filled_and_the_bolt_has_its_washer() -> None:
    parts = meshes(covered_block())
    block, cover = parts["block"], parts["cover"]
    filled = contact_model(block, cylinders_of(block), {}, fixed=True)
    assert [piece.name for piece in filled.pieces] == ["bed_0"]
    uses = {n: Use("clearance", bearing=3.2 * MM) for n, _ in enumerate(cylinders_of(cover))}
    model = contact_model(cover, cylinders_of(cover), uses, fixed=False)
    assert set(model.friction_radius) == {0, 1}
    washer = surfaces(model, "washer")[0]
    assert washer.bounds[1][2] == pytest.approx(5 * MM)
    assert model.error.more < 1e-6
    assert model.error.less < 1e-3


@pytest.mark.parametrize("head_up", [True, False])
def test_what_a_screw_clamps_bears_under_its_head(head_up: bool) -> None:
    """On the face away from the head, around the hole, where no other piece of it is."""
    cover = meshes(covered_block())["cover"]
    number, drawn = next((n, c) for n, c in enumerate(cylinders_of(cover)) if c.hole)
    uses = {number: Use("clearance", bearing=3.2 * MM, head_up=head_up)}
    model = contact_model(cover, cylinders_of(cover), uses, fixed=False)
    height = drawn.flare_low[1] if head_up else drawn.flare_high[1]
    seats = [piece for piece in model.pieces if piece.name.startswith(f"seat_{number}_")]
    ends = [(s.shape.vertices - drawn.point) @ drawn.axis for s in seats]
    assert all(np.abs(h - height).min() < 1e-9 for h in ends)
    assert all(np.abs(h - height).max() < 0.45 * drawn.length for h in ends)
    radii = np.concatenate([about(seat, drawn) for seat in seats])
    assert drawn.radius < radii.min() < 3.2 * MM * 2**0.5 < radii.max()
    middle = np.mean([seat.shape.center_mass for seat in seats], axis=0) - drawn.point
    assert np.linalg.norm(np.cross(middle, drawn.axis)) < 1e-5
    fixed = contact_model(cover, cylinders_of(cover), uses, fixed=True)
    assert not any(piece.name.startswith("seat") for piece in fixed.pieces)


def test_friction_radius_is_that_of_the_parts_drawn_by_hand() -> None:
    number, _ = hole(PLATE, mu.BOLT_HOLE_RADIUS)
    uses = {number: Use("clearance", bearing=mu.BEARING_RADIUS * MM)}
    model = contact_model(PLATE, cylinders_of(PLATE), uses, fixed=False)
    assert model.friction_radius[number] == pytest.approx(2.16373 * MM, rel=1e-5)


def test_two_rigid_parts_never_meet() -> None:
    """They would touch as their convex hulls: only the fixed part has rigid solids."""
    parts = meshes(pinned_block())
    for name, fixed in (("block", True), ("pin", False)):
        model = contact_model(parts[name], cylinders_of(parts[name]), {0: Use("fit")}, fixed=fixed)
        for piece in model.pieces:
            rigid = piece.contact.modulus is None
            assert rigid == piece.name.startswith(("bed", "wall"))
