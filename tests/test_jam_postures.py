"""Freezing around the real parts, in the six postures of the placement experiment."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from cell import load_product
from cell.fixtures.soft_jig import JigState, SurfaceSamples
from experiments.jig.element_rig import ElementRig
from experiments.jig.specimens import ProductPart

# Axis of the part frame that points up, by part and posture.
POSTURES = {
    "motor P1": ("motor", (0, -1, 0)),
    "motor P2": ("motor", (0, 0, 1)),
    "plate P1": ("plate", (0, 0, -1)),
    "plate P2": ("plate", (0, 1, 0)),
    "plate P3": ("plate", (1, 0, 0)),
    "plate P4": ("plate", (0, 0, 1)),
}
PRESS_FORCE = 20.0


@pytest.fixture(scope="module", params=POSTURES)
def held(request):
    """Return the rig after letting go, how far the part moved since, and its peak speed."""
    name, up = POSTURES[request.param]
    specimen = ProductPart(load_product("motor_unit").parts[name], up)
    rig = ElementRig(part=specimen, press_force=PRESS_FORCE)
    rig.lower_to(0.030, speed=0.04)  # The drive reaches its force before it gets there.
    rig.jam()
    before, speeds = rig.X_JP, []
    rig.let_go(0)
    for _ in range(500):
        rig.step()
        speeds.append(rig.speed)
    moved = before.InvertAndCompose(rig.X_JP)
    return rig, np.linalg.norm(moved.translation()), max(speeds), speeds[-1]


def test_part_is_let_go_without_a_kick(held) -> None:
    """Freezing and letting go move a part by less than 0.3 mm and 20 mm/s, and it comes to rest."""
    rig, kick, fastest, last = held
    assert rig.jig.memory(rig.root).state is JigState.JAMMED
    assert kick < 0.3e-3
    assert fastest < 20e-3
    assert last < 1e-3


def test_imprint_is_the_parts_surface(held) -> None:
    """Where they touch, the bed is within 1 mm RMS of the real mesh (pins, boss, foot)."""
    rig, *_ = held
    samples = SurfaceSamples.of("surface", rig.part.mesh(), spacing=0.0005)
    surface = (rig.X_JP @ samples.points.T).T
    memory = rig.jig.memory(rig.root)
    bed, (name,) = memory.bed, memory.pressing
    touching = np.isfinite(bed.underside_over_bed(name))
    touching &= bed.underside_over_bed(name) < bed.heights + 1e-4
    touched = np.column_stack([bed.x[touching], bed.y[touching], bed.heights[touching]])
    assert len(touched) * bed.bag.cell**2 > 1e-4
    distance, _ = KDTree(surface).query(touched)
    assert np.sqrt(np.mean(distance**2)) < 1e-3


def test_part_rests_in_the_imprint(held) -> None:
    """Under its weight no contact polygon lies more than 0.3 mm below the frozen bed's surface."""
    rig, *_ = held
    mesh = rig.jig.memory(rig.root).mesh
    surface = mesh.vertices[mesh.boundary()]
    results = rig.plant.get_contact_results_output_port().Eval(rig.context)
    depths = []
    for i in range(results.num_hydroelastic_contacts()):
        polygons = results.hydroelastic_contact_info(i).contact_surface().poly_mesh_W()
        for face in range(polygons.num_faces()):
            centroid = np.tile(polygons.element_centroid(face), (len(surface), 1))
            nearest = trimesh.triangles.closest_point(surface, centroid)
            depths.append(np.linalg.norm(nearest - centroid, axis=1).min())
    assert 0 < max(depths) < 0.3e-3


def test_only_what_the_hulls_leave_out_is_a_pin(held) -> None:
    """Standing, 97 mm2 of rear boss and 77 of terminals; lying, what is buried beyond its ends."""
    rig, *_ = held
    (pins,) = rig.jig.memory(rig.root).holding.pins.values()
    name, up = rig.part.part.name, rig.part.up
    if name == "plate":
        assert len(pins.areas) == 0
        return
    radius, z = np.hypot(pins.p_PS[:, 0], pins.p_PS[:, 1]), pins.p_PS[:, 2]
    if up == (0, 0, 1):
        assert pins.areas[radius < 0.0077].sum() == pytest.approx(97e-6, abs=8e-6)
        assert pins.areas[np.abs(radius - 0.0112) < 0.0016].sum() == pytest.approx(77e-6, abs=8e-6)
        assert np.all(z < -0.053)
    else:
        assert pins.areas.sum() < 80e-6
        assert np.all((z < -0.053) | (z > 0))
    # Seen from above its slot is open.
    assert np.all(pins.normals[:, 2] < 0.1)
