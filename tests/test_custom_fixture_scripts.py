"""Assembly on a fixture made for a part, and the scripts about such fixtures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Box, ProximityProperties, Role
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from cell import CellConfig, load_product
from cell.errors import InputError
from cell.fixtures.base import FixtureError
from cell.fixtures.custom.work import Work
from cell.fixtures.rigid_jig import RigidJig
from cell.vectors import rotation_with_up
from experiments.assembly.custom_fixture import with_fixture_for
from experiments.custom_fixture import main as write_fixture
from experiments.paper.larger_part import larger
from experiments.paper.postures import POSTURES
from experiments.paper.product_postures import postures_of
from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import TrialDisturbance, check_fits, run_trial
from experiments.paper.trial_metrics import measure_place
from planning.assembly_plan.planner import plan
from planning.operations.sequence import steps

EXACT = [
    "push.grasp_position_sigma=0",
    "push.grasp_angle_sigma_deg=0",
    "push.jig_position_sigma=0",
]


NEST = CellConfig.load(overrides=["workcell.fixture=rigid_jig"])


def test_assembly_has_its_fixture_made_for_what_the_plan_fixes() -> None:
    product, turned = load_product("motor_unit"), NEST.with_changes({"custom.held.yaw_deg": 45.0})
    todo = steps(product, plan(product))
    held = with_fixture_for(turned, product, 0, todo).custom.held
    assert (held.part, held.up, held.yaw_deg) == ("motor", "+z", 45.0)
    soft = CellConfig()
    assert with_fixture_for(soft, product, 0, todo) is soft


def test_plan_that_fixes_two_parts_is_refused() -> None:
    product = load_product("motor_unit")
    todo = steps(product, plan(product, ("plate", "bolts", "motor")))
    with pytest.raises(InputError, match="fixes plate, then motor, and a rigid_jig holds one part"):
        with_fixture_for(NEST, product, 0, todo)


def test_posture_that_a_fixture_cannot_hold_is_refused_before_any_trial() -> None:
    with pytest.raises(FixtureError, match="'motor' with -y up has no datum faces"):
        check_fits(NEST, load_product("motor_unit"), POSTURES["motor/P1"])


@pytest.mark.parametrize(
    ("fixture", "case"), [("rigid_jig", "plate/P1"), ("support_jig", "plate/P1")]
)
def test_exact_grasp_seats_the_part_to_within_its_play(fixture: str, case: str) -> None:
    config = CellConfig.load(overrides=[f"workcell.fixture={fixture}", *EXACT])
    bench = RigBench.build(config, load_product("motor_unit"), POSTURES[case])
    trial = run_trial(bench.begin(TrialDisturbance.draw(config, np.random.default_rng(0))), None)
    measured = measure_place(trial)
    assert trial.failure is None
    assert measured["seat_error_m"] < 1e-4
    assert measured["seat_error_rad"] < 1e-3


@pytest.mark.parametrize("pieces", [1, 2, 3])
def test_part_of_any_number_of_contact_pieces_meets_the_nest_with_its_surface_alone(
    pieces: int,
) -> None:
    """The plant's list of them grows when the surface is added to it."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    mesh = trimesh.creation.box((0.05, 0.04, 0.02))
    work = Work("box", "+z", mesh, rotation_with_up("+z"), CellConfig().custom)
    nest = RigidJig(plant, scene_graph, plant.AddRigidBody("base"), work)
    part = plant.AddRigidBody("body", plant.AddModelInstance("box"))
    own = [
        plant.RegisterCollisionGeometry(
            part, RigidTransform(), Box(0.05, 0.04, 0.02), f"piece_{k}", ProximityProperties()
        )
        for k in range(pieces)
    ]
    nest.add_part(plant, part, mesh)
    inspector = scene_graph.model_inspector()
    names = {inspector.GetName(i): i for i in inspector.GetAllGeometryIds(Role.kProximity)}
    wall = next(i for name, i in names.items() if name.endswith("wall_0"))
    assert all(inspector.CollisionFiltered(wall, piece) for piece in own)
    assert not inspector.CollisionFiltered(wall, names["box::surface"])


def test_script_writes_what_has_to_be_made(tmp_path: Path) -> None:
    arguments = ["--part", "plate", "--up=-z", "--quiet", "--out", str(tmp_path)]
    assert write_fixture([*arguments, "--fixture", "support_jig"]) == 0
    found = json.loads((tmp_path / "fixture.json").read_text())
    assert (found["part"], len(found["supports_mm"])) == ("plate", 3)
    assert {post["side"] for post in found["posts"]} == {"+x", "-x", "+y", "-y"}
    assert write_fixture(arguments) == 0
    block = trimesh.load_mesh(tmp_path / "rigid_jig.stl")
    assert block.is_watertight
    assert 80.0 < block.extents.max() < 160.0  # In mm.


def test_scripts_refuse_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path / "new")]
    assert write_fixture(["--fixture", "soft_jig", *out]) == 2
    assert "takes any part" in capsys.readouterr().err
    assert write_fixture(["--part", "wheel", *out]) == 2
    assert "Known: bolt_1" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_larger_part_has_every_face_moved_outward() -> None:
    mesh = load_product("motor_unit").parts["plate"].mesh
    grown = larger(mesh, 3e-4)
    np.testing.assert_allclose(grown.extents - mesh.extents, 3e-4, atol=1e-7)
    assert grown.is_watertight
    offset = (grown.volume - mesh.volume) / mesh.area
    assert offset == pytest.approx(1.5e-4, rel=0.02)


def test_postures_of_another_product_are_those_that_a_grasp_brings() -> None:
    """The idler's post is gripped from above when upright; hanging upside down it is not."""
    postures = {posture.label: posture for posture in postures_of(load_product("idler"))}
    assert "post/+z" in postures
    assert "post/-z" not in postures
    for posture in postures.values():
        R_JJaw = rotation_with_up(posture.up) @ posture.grasp.X_PJaw.rotation()
        assert R_JJaw.matrix()[2, 2] < 0.05
        assert abs(R_JJaw.matrix()[2, 0]) < 0.05
