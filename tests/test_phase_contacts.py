"""What the phases of an assembly say of contacts: which are mated, and which bolts only ride."""

import pytest
from teleport import phases_of

from cell import CellConfig, load_product
from cell.simulation.phase import Phase
from experiments.assembly.prepare import RunningCell
from planning.assembly_plan.planner import plan
from planning.operations.grasping import HandPhase
from planning.operations.sequence import steps
from planning.operations.set_aside.phases import AsidePhase
from planning.operations.soft_hand import SOFT, MatePhase
from planning.operations.tighten_bolts.phases import DrivePhase

ORDER = ("plate", "bolts", "motor")
PRODUCT = load_product("motor_unit")
BOLTS = frozenset(PRODUCT.screws)


@pytest.fixture(scope="module")
def phases() -> list[Phase]:
    """All phases of the order in which bolts ride in a plate."""
    running = RunningCell(PRODUCT, CellConfig(), seed=0)
    return [phase for phase, _ in phases_of(running, steps(PRODUCT, plan(PRODUCT, ORDER)))]


def test_seat_is_mated_while_the_first_bolt_is_run_down_and_each_is_tightened(
    phases: list[Phase],
) -> None:
    seat = frozenset([frozenset(["motor", "plate"])])
    run_down = [phase.mating for phase in phases if phase.kind is DrivePhase.RUN_DOWN]
    tightened = [phase.mating for phase in phases if phase.kind is DrivePhase.TIGHTEN]
    assert run_down == [seat] + [frozenset()] * (len(BOLTS) - 1)
    assert tightened == [seat] * len(BOLTS)


def test_bolts_ride_while_the_plate_is_carried_and_never_where_they_meet_anything(
    phases: list[Phase],
) -> None:
    for phase in phases:
        assert phase.riding <= phase.awake
        # A bolt that a phase is about does not ride, and none does on what is being mated.
        assert phase.subject not in phase.riding
        assert not (phase.riding and phase.mating)
    on_the_way = (HandPhase.LIFT, AsidePhase.TRANSFER, AsidePhase.SETTLE, MatePhase.TRANSFER)
    carried = [phase for phase in phases if phase.subject == "plate" and phase.awake >= BOLTS]
    for kind in on_the_way:
        assert [phase.riding for phase in carried if phase.kind is kind].count(BOLTS)
    # On the bed that goes soft, and on the mouths of the threads.
    for kind in (AsidePhase.FREE, *SOFT):
        assert all(not phase.riding for phase in carried if phase.kind is kind)
