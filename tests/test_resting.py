"""Parts fall asleep once they rest: not on the way, and not apart from what bears them."""

from dataclasses import replace
from enum import Enum

import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity

from cell import CellConfig, build_cell, load_product
from cell.simulation.phase import Phase, after
from cell.simulation.resting import AT_REST, WINDOW, Resting
from cell.simulation.simulation import Simulation
from cell.simulation.vocabulary import in_programs


@in_programs
class MadeUp(Enum):
    WAIT = "wait"
    REST = "rest"


NOBODY = frozenset[str]()


@pytest.fixture
def simulation() -> Simulation:
    """The motor unit with the plate in the tray and the motor beside it."""
    product = load_product("motor_unit")
    parts = {name: product.parts[name] for name in ("motor", "plate")}
    product = replace(product, parts=parts, joints=(), groups={}, orders=())
    return Simulation(build_cell(CellConfig(), product))


def tip(simulation: Simulation, part: str, angle: float) -> RigidTransform:
    """Lift a part in the tray by 3 mm and tilt it, awake; return its pose there before."""
    loose, context = simulation.cell.parts[part], simulation.context
    simulation.cell.parts.wake(simulation.root, part)
    X_WP = loose.X_WP(context)
    R_WP = RollPitchYaw(angle, 0.0, 0.0).ToRotationMatrix() @ X_WP.rotation()
    lifted = X_WP.translation() + [0.0, 0.0, 0.003]
    loose.joint.SetPose(context, RigidTransform(R_WP, lifted))
    return X_WP


def test_a_part_that_was_let_go_of_falls_before_it_sleeps(simulation: Simulation) -> None:
    before = tip(simulation, "motor", 0.02)
    motor = simulation.cell.parts["motor"]
    simulation.run_phase(Phase(MadeUp.WAIT, after(0.01), 1.0, awake=frozenset(["motor"])))
    simulation.run_phase(Phase(MadeUp.REST, after(0.005), 1.0))
    assert not motor.asleep(simulation.root)
    simulation.run_phase(Phase(MadeUp.REST, after(1.0), 2.0))
    assert motor.asleep(simulation.root)
    X_WP = motor.X_WP(simulation.context)
    assert abs(X_WP.translation()[2] - before.translation()[2]) < 5e-4, "it lies in its nest"
    turned = (before.rotation().inverse() @ X_WP.rotation()).ToAngleAxis().angle()
    assert turned < 0.005


def test_what_bears_a_moving_part_stays_awake_with_it(simulation: Simulation) -> None:
    parts, root = simulation.cell.parts, simulation.root
    parts.sleep_all_but(root, ["motor", "plate"])
    simulation.cell.plant.SetFreeBodySpatialVelocity(
        simulation.context, parts["motor"].body, SpatialVelocity([0.0] * 3, [0.0, 0.0, 0.1])
    )
    Resting(parts, root, NOBODY, simulation.time_step)
    assert not parts["plate"].asleep(root)


def test_a_part_at_rest_sleeps_at_once(simulation: Simulation) -> None:
    parts, root = simulation.cell.parts, simulation.root
    parts.sleep_all_but(root, ["motor", "plate"])
    Resting(parts, root, frozenset(["plate"]), simulation.time_step)
    assert parts["motor"].asleep(root)
    assert not parts["plate"].asleep(root)


def test_a_part_that_shivers_from_step_to_step_rests(simulation: Simulation) -> None:
    """Its velocity changes sign with each step: it never is slow, and goes nowhere."""
    parts, root, body = simulation.cell.parts, simulation.root, simulation.cell.parts["motor"].body
    context, plant = simulation.context, simulation.cell.plant
    parts.wake(root, "motor")
    V_WP = SpatialVelocity([0.3, 0.0, 0.0], [0.0, 5 * AT_REST, 0.0])
    plant.SetFreeBodySpatialVelocity(context, body, V_WP)
    resting = Resting(parts, root, NOBODY, simulation.time_step)
    for _ in range(round(WINDOW / simulation.time_step)):
        assert not parts["motor"].asleep(root)
        resting.step()
    assert parts["motor"].asleep(root)
