"""``soft-jig place`` and ``soft-jig push``: the paper's experiments, with either hand."""

from __future__ import annotations

from pydrake.math import RigidTransform
from rich.console import Console
from rich.progress import Progress

from cell.configuration.config import CellConfig
from cell.errors import InputError
from cell.products.loading import load_product
from experiments.paper.case_results import Experiment, case_table, verdict, write_case_results
from experiments.paper.cases import Case, CaseResult, run_cases
from experiments.paper.postures import POSTURES, PUSHES, chosen
from experiments.paper.rig.stage import Observer
from experiments.reporting.render import View, rendering_problem, take_picture
from experiments.reporting.report import Picture

PICTURED = {"place": ("placed",), "push": ("before", "after", "end")}


def cases_of(command: str, label: str | None) -> list[Case]:
    """Return the cases of an experiment that a label selects; None selects all.

    Raises:
        UnknownName: No case has this label.
    """
    if command == "place":
        return [Case(posture) for posture in chosen("posture to place", POSTURES, label)]
    return [Case(push.posture, push) for push in chosen("case to push", PUSHES, label)]


def with_pressure(config: CellConfig, pressure_kpa: float | None) -> CellConfig:
    """Return the configuration with another vacuum [kPa]; None keeps it."""
    if pressure_kpa is None:
        return config
    return config.with_changes({"jig.vacuum.pressure": 1e3 * pressure_kpa})


def check_trials(trials: int) -> None:
    """Raise `InputError` unless the number of trials is positive."""
    if trials < 1:
        raise InputError(f"--trials must be at least 1, not {trials}.")


def run_experiment(experiment: Experiment, label: str | None) -> int:
    """Run the cases that a label selects; write result and report.

    Returns:
        0 if every case came out as expected, else 1.
    """
    cases = cases_of(experiment.command, label)
    console = Console(quiet=experiment.quiet, highlight=False)
    album = _Album(experiment)
    results: dict[str, CaseResult] = {}
    hidden = console.quiet or not console.is_terminal
    with Progress(console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task("", total=len(cases) * experiment.trials)
        done = run_cases(
            cases,
            product=load_product("motor_unit"),
            config=experiment.config,
            trials=experiment.trials,
            seed=experiment.seed,
            hand=experiment.hand,
            watch=album.take,
        )
        for result, trial in done:
            results[result.case.label] = result
            bar.update(task, advance=1, description=result.case.label)
            word = "success" if trial.success else "failure"
            console.print(f"{result.case.label} {len(result.trials)}: {word}", markup=False)
    found = list(results.values())
    write_case_results(experiment, found, album.pictures, album.notes)
    console.print(case_table(experiment.command, found))
    return 0 if verdict(found) == "success" else 1


class _Album:
    """Pictures of the first trial of each case, if the machine can render."""

    def __init__(self, experiment: Experiment) -> None:
        self.wanted = PICTURED[experiment.command]
        self.pictures: list[Picture] = []
        problem = rendering_problem()
        self.notes = [] if problem is None else [f"No pictures: {problem}."]

    def take(self, case: Case, event: str, observer: Observer) -> None:
        """Take the picture of an event, for the end only if the trial stopped early."""
        last = self.pictures[-1][0] if self.pictures else ""
        ended_early = event == "end" and last != f"{case.label}: after"
        if self.notes or event not in self.wanted or (event == "end" and not ended_early):
            return
        view = view_of(observer.stage.config.workcell.X_WJ)
        caption = f"{case.label}: {event}"
        scene = take_picture(observer.stage.scene_graph, observer.root, view)
        self.pictures.append((caption, scene))


def view_of(X_WJ: RigidTransform) -> View:
    """Return a camera that sees the jig and 70 mm to each side."""
    p_WJ = X_WJ.translation()
    target = tuple(p_WJ + [0.0, 0.0, 0.05])
    return View(p_WC=tuple(p_WJ + [0.35, -0.45, 0.28]), p_WTarget=target, width=720, height=480)
