"""Events at the start of a phase: what the cell does besides moving its arms."""

from __future__ import annotations

from dataclasses import dataclass

from cell.simulation.phase import Event, Running
from cell.simulation.vocabulary import in_programs


@in_programs
def prepare_fixture(running: Running) -> None:
    """Make the fixture ready for a new part: what an earlier one has left is gone."""
    running.cell.fixture.prepare(running.root)


@in_programs
@dataclass(frozen=True)
class ReceivePart:
    """Let a part be put onto the fixture."""

    part: str

    def __call__(self, running: Running) -> None:
        """Do it."""
        loose = running.cell.parts[self.part]
        running.cell.fixture.receive(running.root, loose.body, loose.part.mesh)


def receive_part(part: str) -> Event:
    """Return the event that lets a part be put onto the fixture."""
    return ReceivePart(part)


@in_programs
def fix_part(running: Running) -> None:
    """Let the fixture begin to hold what it has received."""
    running.cell.fixture.fix(running.root)


@in_programs
def free_part(running: Running) -> None:
    """Let the fixture begin to let go."""
    running.cell.fixture.free(running.root)


@in_programs
@dataclass(frozen=True)
class ReleasePart:
    """Let the fixture forget a part that has been lifted off it."""

    part: str

    def __call__(self, running: Running) -> None:
        """Do it."""
        running.cell.fixture.release(running.root, running.cell.parts[self.part].body)


def release_part(part: str) -> Event:
    """Return the event that lets the fixture forget a part that has been lifted off it."""
    return ReleasePart(part)


@in_programs
def rest_jig(running: Running) -> None:
    """Let the jig's base sleep where it stands."""
    running.cell.jig_base.sleep(running.root)


@in_programs
def wake_jig(running: Running) -> None:
    """Let the jig's base move again."""
    running.cell.jig_base.wake(running.root)
