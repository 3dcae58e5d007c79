"""Events at the start of a phase: what the cell does besides moving its arms."""

from __future__ import annotations

from cell.simulation.phase import Event
from cell.simulation.simulation import Simulation


def prepare_fixture(simulation: Simulation) -> None:
    """Make the fixture ready for a new part: what an earlier one has left is gone."""
    simulation.cell.fixture.prepare(simulation.root)


def receive_part(part: str) -> Event:
    """Let a part be put onto the fixture."""

    def event(simulation: Simulation) -> None:
        loose = simulation.cell.parts[part]
        simulation.cell.fixture.receive(simulation.root, loose.body, loose.part.mesh)

    return event


def fix_part(simulation: Simulation) -> None:
    """Let the fixture begin to hold what it has received."""
    simulation.cell.fixture.fix(simulation.root)


def free_part(simulation: Simulation) -> None:
    """Let the fixture begin to let go."""
    simulation.cell.fixture.free(simulation.root)


def release_part(part: str) -> Event:
    """Let the fixture forget a part that has been lifted off it."""

    def event(simulation: Simulation) -> None:
        simulation.cell.fixture.release(simulation.root, simulation.cell.parts[part].body)

    return event


def rest_jig(simulation: Simulation) -> None:
    """Let the jig's base sleep where it stands."""
    simulation.cell.jig_base.sleep(simulation.root)


def wake_jig(simulation: Simulation) -> None:
    """Let the jig's base move again."""
    simulation.cell.jig_base.wake(simulation.root)
