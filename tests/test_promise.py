"""What is true in the project's own loop is true in a caller's: with one line, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Integrator, ZeroOrderHold
from stories import (
    BOX_STORY,
    JIG_STEPS,
    JIG_STORY,
    QUICK,
    Command,
    Player,
    Snapshot,
    Story,
    add_box,
    assert_same,
    catch_bolt,
    free,
    move_arm,
    play_ours,
    press_motor,
    relax_arm,
    small_product,
    snapshot,
    stiffen_arm,
)

from cell import Cell, add_cell, build_cell
from cell.errors import InputError
from cell.fixtures.soft_jig import JigState
from cell.fixtures.soft_jig.mesh.tet_mesh import BadMesh
from cell.workpieces.thread import ThreadState

PRODUCT = small_product("motor", "plate", "bolt_1")
ARM_STORY: Story = {0: relax_arm, 60: stiffen_arm, 80: relax_arm}
BOLT_STORY: Story = {0: move_arm, 20: catch_bolt}


@pytest.fixture(scope="module", params=["full", "linked"])
def cell(request: pytest.FixtureRequest) -> Cell:
    return build_cell(QUICK.with_changes({"simulation.contact": request.param}), PRODUCT)


@pytest.fixture(scope="module")
def pressed(cell: Cell) -> Snapshot:
    """Return what the story of the jig comes to with nothing else about."""
    return snapshot(cell, Player(cell, JIG_STORY).play(JIG_STEPS).root)


def with_other_systems(builder: DiagramBuilder) -> None:
    """Add systems of a caller's that make the simulator step at other times than the plant."""
    source = builder.AddSystem(ConstantVectorSource(np.ones(1)))
    hold = builder.AddSystem(ZeroOrderHold(0.0003, 1))
    builder.Connect(source.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), builder.AddSystem(Integrator(1)).get_input_port())


def test_callers_diagram_and_simulator_are_the_projects_loop() -> None:
    """A box of the caller's is pressed, jammed, put to sleep, woken and vented; not a bit differs.

    Beside the cell are systems that make the simulator take other steps than the plant's.
    """
    builder = DiagramBuilder()
    with_other_systems(builder)
    theirs = add_cell(builder, QUICK, small_product("motor"), name="mine", extend=add_box)
    theirs = theirs.with_diagram(builder.Build())
    ours = build_cell(QUICK, small_product("motor"), extend=add_box)
    simulation = play_ours(ours, BOX_STORY, JIG_STEPS)
    player = Player(theirs, BOX_STORY).play(JIG_STEPS)
    assert_same(snapshot(theirs, player.root), snapshot(ours, simulation.root))
    assert simulation.time == player.root.get_time()


def test_the_story_is_one(cell: Cell) -> None:
    """Pressed in by millimetres, jammed, asleep, vented: what is compared elsewhere happens."""
    player, motor = Player(cell, JIG_STORY), cell.parts["motor"]
    start = cell.fixture.entry_height + 0.0534 - 0.002
    seen = {}
    for step in (200, 400, 460, 600, JIG_STEPS):
        root = player.play(step - player.step).root
        context = cell.plant.GetMyContextFromRoot(root)
        X_JP = cell.fixture.pose(context).InvertAndCompose(motor.X_WP(context))
        seen[step] = (cell.fixture.reading(root), start - X_JP.translation()[2], motor.asleep(root))
    assert seen[200][1] > 3e-3
    states = [list(JigState)[int(reading["state"])] for reading, *_ in seen.values()]
    assert states == [
        JigState.SOFT,
        JigState.JAMMED,
        JigState.JAMMED,
        JigState.JAMMED,
        JigState.SOFT,
    ]
    assert [asleep for *_, asleep in seen.values()] == [False, False, True, False, False]
    assert seen[JIG_STEPS][0]["pressure"] < 0.1 * seen[600][0]["pressure"]


def test_two_cells_in_one_diagram_do_not_meet(cell: Cell, pressed: Snapshot) -> None:
    """Each does what it does alone, the jig of one and the arms of the other."""
    builder = DiagramBuilder()
    cells = [add_cell(builder, cell.config, PRODUCT, name=name) for name in ("one", "other")]
    diagram = builder.Build()
    one, other = (each.with_diagram(diagram) for each in cells)
    simulator = Simulator(diagram)

    def both(root: Context) -> None:
        one.monitor(root)
        other.monitor(root)

    simulator.set_monitor(both)
    other.monitor.initialize(simulator.get_mutable_context())
    other.parts.sleep_all_but(simulator.get_mutable_context(), ())

    def act(step: int) -> Command:
        def command(_: Cell, root: Context) -> None:
            for each, story in ((one, JIG_STORY), (other, ARM_STORY)):
                if step in story:
                    story[step](each, root)

        return command

    together = {step: act(step) for step in JIG_STORY | ARM_STORY}
    root = Player(one, together, simulator).play(JIG_STEPS).root
    assert_same(snapshot(one, root), pressed)
    alone = Player(cell, ARM_STORY).play(JIG_STEPS)
    assert_same(snapshot(other, root), snapshot(cell, alone.root))


def test_contexts_of_one_diagram_do_not_meet(cell: Cell, pressed: Snapshot) -> None:
    """Three runs in turns: motor jammed or asleep, arm in torque or position drive, bolt caught."""
    stories = (JIG_STORY, ARM_STORY, BOLT_STORY)
    steps = (JIG_STEPS, 200, 200)
    alone = [pressed] + [
        snapshot(cell, Player(cell, story).play(200).root) for story in stories[1:]
    ]
    players = [Player(cell, story) for story in stories]
    for stride in [1] * 100 + [7] * 93:
        for player, end in zip(players, steps, strict=True):
            player.play(min(stride, end - player.step))
    for player, expected in zip(players, alone, strict=True):
        assert_same(snapshot(cell, player.root), expected)
    roots = [player.root for player in players]
    assert [cell.holder.drive.uses_torque(root) for root in roots] == [False, True, False]
    assert [cell.parts["motor"].asleep(root) for root in roots] == [False, True, True]
    states = [cell.threads.state(root, "bolt_1") for root in roots]
    assert states == [ThreadState.FREE, ThreadState.FREE, ThreadState.CAUGHT]


@pytest.mark.parametrize("at", [150, 380, 470])
def test_a_cloned_context_goes_on_alike(cell: Cell, pressed: Snapshot, at: int) -> None:
    """While pressing, jammed, and asleep; what the original does after it does not matter."""
    original = Player(cell, JIG_STORY).play(at)
    simulator = Simulator(cell.diagram, original.root.Clone())
    simulator.set_monitor(cell.monitor)
    clone = Player(cell, JIG_STORY, simulator)
    free(cell, original.root)
    original.play(30)
    assert_same(snapshot(cell, clone.play(JIG_STEPS - at).root), pressed)


def test_a_context_that_is_reset_begins_anew(cell: Cell, pressed: Snapshot) -> None:
    player = Player(cell, JIG_STORY | {20: relax_arm, 30: catch_bolt}).play(470)
    assert cell.diagram is not None
    cell.diagram.SetDefaultContext(player.root)
    player.root.SetTime(0.0)
    again = Player(cell, JIG_STORY, player.simulator).play(JIG_STEPS)
    assert_same(snapshot(cell, again.root), pressed)


@pytest.mark.parametrize("time", [-0.02, 0.0004, 3.0])
def test_a_run_may_begin_at_any_time(cell: Cell, time: float) -> None:
    """The jig's clock is the plant's, whose first step is at 0 s or later."""
    pressures = []
    for start in (0.0, time):
        simulator = Simulator(cell.diagram)
        simulator.set_monitor(cell.monitor)
        root = simulator.get_mutable_context()
        root.SetTime(start)
        simulator.Initialize()
        cell.parts.sleep_all_but(root, ())
        cell.fixture.fix(root)
        simulator.AdvanceTo(max(round(start, 3), 0.0) + 0.05)
        pressures.append(cell.fixture.reading(root)["pressure"])
    assert pressures[0] > 0.0
    assert pressures[1] == pressures[0]


def test_time_that_is_set_back_is_followed(cell: Cell) -> None:
    player = Player(cell, {}).play(30)
    player.root.SetTime(0.0)
    player.simulator.Initialize()
    cell.fixture.fix(player.root)
    player.simulator.AdvanceTo(0.02)
    assert cell.fixture.reading(player.root)["pressure"] > 1e4


def test_commands_before_the_first_step_hold(cell: Cell) -> None:
    """A caller need not know when the monitor comes first."""
    simulator = Simulator(cell.diagram)
    simulator.set_monitor(cell.monitor)
    root = simulator.get_mutable_context()
    cell.parts.sleep_all_but(root, ())
    for command in (press_motor, relax_arm, catch_bolt):
        command(cell, root)
    simulator.AdvanceTo(0.01)
    assert cell.fixture.holds(root, cell.parts["motor"].body)
    assert cell.holder.drive.uses_torque(root)
    assert cell.threads.state(root, "bolt_1") is ThreadState.CAUGHT
    assert [part.asleep(root) for part in cell.parts] == [False, True, False]


def test_stepping_without_the_monitor_is_an_error(cell: Cell) -> None:
    simulator = Simulator(cell.diagram)
    with pytest.raises(InputError, match="^The cell is stepped without its monitor.*set_monitor"):
        simulator.AdvanceTo(0.01)


@pytest.mark.parametrize("before", [0.0, 0.02])
def test_so_is_a_monitor_that_is_taken_away(cell: Cell, before: float) -> None:
    simulator = Simulator(cell.diagram)
    simulator.set_monitor(cell.monitor)
    simulator.Initialize()
    simulator.AdvanceTo(before)
    simulator.clear_monitor()
    with pytest.raises(InputError, match="without its monitor"):
        simulator.AdvanceTo(before + 0.01)


def test_errors_in_the_monitor_keep_their_type(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    """The bed cannot be meshed while it jams, deep inside Drake's simulator."""

    def hole(*_: object) -> None:
        raise BadMesh("The part touches the bed around a hole.")

    monkeypatch.setattr("cell.fixtures.soft_jig.frozen.freezing.imprint_mesh", hole)
    with pytest.raises(BadMesh, match=r"^The part touches the bed around a hole\.$"):
        Player(cell, JIG_STORY).play(400)
