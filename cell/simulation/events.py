"""Events at the start of a phase: what the cell does besides moving its arms."""

from __future__ import annotations

from cell.simulation.phase import Event, Running


def prepare_fixture(running: Running) -> None:
    """Make the fixture ready for a new part: what an earlier one has left is gone."""
    running.cell.fixture.prepare(running.root)


def receive_part(part: str) -> Event:
    """Let a part be put onto the fixture."""

    def event(running: Running) -> None:
        loose = running.cell.parts[part]
        running.cell.fixture.receive(running.root, loose.body, loose.part.mesh)

    return event


def fix_part(running: Running) -> None:
    """Let the fixture begin to hold what it has received."""
    running.cell.fixture.fix(running.root)


def free_part(running: Running) -> None:
    """Let the fixture begin to let go."""
    running.cell.fixture.free(running.root)


def release_part(part: str) -> Event:
    """Let the fixture forget a part that has been lifted off it."""

    def event(running: Running) -> None:
        running.cell.fixture.release(running.root, running.cell.parts[part].body)

    return event


def rest_jig(running: Running) -> None:
    """Let the jig's base sleep where it stands."""
    running.cell.jig_base.sleep(running.root)


def wake_jig(running: Running) -> None:
    """Let the jig's base move again."""
    running.cell.jig_base.wake(running.root)
