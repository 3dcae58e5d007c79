"""Pictures of a run: the cell and the jig after every step."""

from __future__ import annotations

from cell.machines.cameras.rendering import rendering_problem
from experiments.assembly.prepare import RunningCell
from experiments.assembly.run import StepResult
from experiments.reporting.html_page import Picture
from experiments.reporting.render import CELL_VIEW, JIG_VIEW, take_pictures

VIEWS = {"cell": CELL_VIEW, "jig": JIG_VIEW}


class Pictures:
    """Takes pictures where the machine can render.

    Attributes:
        taken: Caption and PNG each.
        videos: Caption and GIF each, made after the run.
        problem: Why there are none, or None.
    """

    def __init__(self, running: RunningCell) -> None:
        self.running = running
        self.problem = rendering_problem()
        self.taken: list[Picture] = []
        self.videos: list[Picture] = []

    def phase(self, name: str) -> None:
        """Phases are too many to picture."""

    def step(self, step: StepResult) -> None:
        """Take one picture per view."""
        if self.problem is None:
            simulation = self.running.simulation
            root, graph = simulation.root, simulation.cell.scene_graph
            pictures = take_pictures(graph, root, VIEWS.values())
            captions = [f"{step.name} ({name})" for name in VIEWS]
            self.taken += zip(captions, pictures, strict=True)
