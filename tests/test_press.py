"""A flanged bush that is pressed into a block: drafted from meshes, checked, and assembled."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_products import capped_post, pressed_block
from manifold3d import Manifold
from pydrake.math import RigidTransform

from cell import CellConfig, Simulation, build_cell
from cell.products.joints import Press
from cell.products.loading import load_product
from cell.products.product import Product
from cell.simulation.state import restore_state, save_state
from cell.workpieces.press_fit import FitState
from experiments.cli.main import main
from experiments.product.random_drawing import write_cad
from planning.assembly_plan.planner import plan
from planning.operations.press import PRESS
from planning.operations.sequence import steps
from planning.product_check.check import fixture_choices, press_findings
from planning.product_check.finding import Level


def drafted(folder: Path, drawn: Mapping[str, Manifold], *materials: str) -> Path:
    """Return the product file that is drafted from what is drawn."""
    source, out = write_cad(drawn, folder / "cad"), folder / "own"
    given = [word for material in materials for word in ("--material", material)]
    assert main(["init", str(source), "--units", "mm", *given, "--out", str(out), "--quiet"]) == 0
    return out / "product.yaml"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drafted(tmp_path_factory.mktemp("pressed"), pressed_block(), "pom")


@pytest.fixture(scope="module")
def product(file: Path) -> Product:
    return load_product(file)


def test_light_plastic_passes(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What it takes, 19 N and 10 N for the seat, is within payload, grip and bed."""
    assert main(["check", str(file)]) == 0
    printed = capsys.readouterr().out
    assert "press bush: every pose is reached" in printed
    assert "block: pressed down with 29 N, of" in printed


def test_its_joint_and_its_grip_are_drafted(product: Product) -> None:
    (press,) = product.presses
    assert press.force == pytest.approx(19.0, rel=0.05)
    # Pads that do not slip under the whole force.
    assert all(grasp.force > 50.0 for grasp in product.parts["bush"].grasps)
    todo = steps(product, plan(product))
    assert [(step.name, step.operation.name) for step in todo][1:] == [("press bush", PRESS.name)]


def test_steel_in_aluminium_is_refused_with_its_force(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """10 um radially are kilonewtons."""
    file = drafted(tmp_path, pressed_block(0.01), "bush=steel", "block=aluminium")
    capsys.readouterr()
    assert main(["check", str(file)]) == 1
    lines = capsys.readouterr().out.splitlines()
    (line,) = [line for line in lines if line.startswith("fails    press bush")]
    force = load_product(file).presses[0].force
    assert force > 1000.0
    assert f"'bush' is pressed together with 'block' by {force:.0f} N" in line
    assert "slip beyond 33 N" in line


def test_a_force_beyond_the_fixture_is_refused(product: Product) -> None:
    """The bed would yield under what no arm here pushes with."""
    (press,) = product.presses
    strong = replace(product, joints=(replace(press, force=2000.0),))
    fixing = plan(strong)
    choices = fixture_choices(strong, fixing, CellConfig())
    (finding,) = press_findings(fixing, choices)
    assert finding.level is Level.FAILS
    assert "pressed down with 2010 N, of" in finding.text


def in_the_mouth(product: Product) -> Simulation:
    """Return a run with the bush in the mouth of its hole, on its way down."""
    simulation = Simulation(build_cell(CellConfig(), product))
    cell, context = simulation.cell, simulation.context
    X_WBlock = cell.parts["block"].X_WP(context)
    cell.parts.sleep_all_but(simulation.root, ["bush"])
    X_WBush = X_WBlock @ RigidTransform([0.0, 0.0, product.presses[0].depth - 1e-4])
    cell.plant.SetFreeBodyPose(context, cell.parts["bush"].body, X_WBush)
    return simulation


def states(simulation: Simulation) -> list[FitState]:
    """Return the states of the fits."""
    return [grip.state for grip in simulation.cell.press_fits.grips(simulation.root)]


def test_nothing_happens_to_parts_that_sleep(product: Product) -> None:
    """The block in the tray does: it is caught when both are awake."""
    simulation = in_the_mouth(product)
    simulation.step()
    assert states(simulation) == [FitState.FREE]
    simulation.cell.parts.sleep_all_but(simulation.root, ["bush", "block"])
    simulation.step()
    assert states(simulation) == [FitState.STUCK]


def test_a_run_with_a_caught_bush_is_restored_to_the_last_bit(product: Product) -> None:
    simulation = in_the_mouth(product)
    simulation.cell.parts.sleep_all_but(simulation.root, ["bush", "block"])
    for _ in range(5):
        simulation.step()
    state = save_state(simulation)
    again = Simulation(build_cell(CellConfig(), product))
    restore_state(again, state)
    assert states(again) == states(simulation) != [FitState.FREE]
    for _ in range(50):
        simulation.step()
        again.step()
    for one, other in zip(
        *(
            (s.cell.plant.GetPositionsAndVelocities(s.context), s.cell.press_fits.save(s.root)["0"])
            for s in (simulation, again)
        ),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


def test_press_joints_know_which_way_the_shaft_leaves(product: Product) -> None:
    """The block has the hole and lies below its mouth; upside down it comes from above."""
    (press,) = product.presses
    assert product.enters_from_above(press)
    assert not replace(product, up="-z").enters_from_above(press)
    assert isinstance(press, Press)


@pytest.mark.slow
@pytest.mark.parametrize("time_step", [1e-3, 5e-4])
def test_the_bush_is_pressed_home(file: Path, tmp_path: Path, time_step: float) -> None:
    """The force over depth is the joint's within 5 %, at half the step, too."""
    step = f"simulation.time_step={time_step:g}"
    arguments = ["assemble", str(file), "--out", str(tmp_path), "--set", step, "--quiet"]
    assert main(arguments) == 0
    check_pressed_home(tmp_path)


@pytest.mark.slow
def test_a_cap_is_pressed_onto_its_post(tmp_path: Path) -> None:
    """The part with the hole is in the hand."""
    file, out = drafted(tmp_path, capped_post(), "pom"), tmp_path / "run"
    assert main(["assemble", str(file), "--out", str(out), "--quiet"]) == 0
    check_pressed_home(out)


def check_pressed_home(out: Path) -> None:
    """Check force and seat of the second step of a run."""
    measured = json.loads((out / "result.json").read_text())["steps"][1]["measured"]
    assert abs(measured["press_force_deviation"]) < 0.05
    assert abs(measured["gap_m"]) < 2e-5
