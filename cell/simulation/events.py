"""Events at the start of a phase: what the cell does besides moving its arms."""

from __future__ import annotations

from collections.abc import Callable

from cell.fixtures.soft_jig import SurfaceSamples
from cell.simulation.simulation import Simulation

Event = Callable[[Simulation], None]


def inflate_jig(simulation: Simulation) -> None:
    """Blow the bag up: every imprint is gone."""
    simulation.cell.soft_jig.inflate(simulation.root)


def soften_jig(part: str) -> Event:
    """Let the bag go soft and carry a part that will be pressed into it."""

    def event(simulation: Simulation) -> None:
        simulation.cell.soft_jig.soften(simulation.root)
        press_into_bed(simulation, part)

    return event


def press_into_bed(simulation: Simulation, part: str) -> None:
    """Let the soft bed carry a part by its real surface."""
    cell = simulation.cell
    samples = SurfaceSamples.of(part, cell.product.parts[part].mesh)
    cell.soft_jig.press_with(cell.parts[part].body, samples)


def release_from_jig(part: str) -> Event:
    """Let the bed forget a part that has been lifted off it."""

    def event(simulation: Simulation) -> None:
        simulation.cell.soft_jig.release(simulation.cell.parts[part].body)

    return event


def evacuate_jig(simulation: Simulation) -> None:
    """Start the vacuum pump, unless the configured vacuum is none at all: the bag stays soft."""
    jig = simulation.cell.soft_jig
    if jig.params.vacuum.pressure > 0:
        jig.evacuate(simulation.root)


def rest_jig(simulation: Simulation) -> None:
    """Let the jig's base sleep where it stands."""
    simulation.cell.jig_base.sleep(simulation.root)


def wake_jig(simulation: Simulation) -> None:
    """Let the jig's base move again."""
    simulation.cell.jig_base.wake(simulation.root)
