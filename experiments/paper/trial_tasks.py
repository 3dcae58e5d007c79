"""The paper's experiments as tasks of a campaign: one trial of one case."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform

from cell.errors import UnknownName
from cell.machines.cameras.rendering import rendering_problem
from cell.products.loading import load_product
from cell.whole_file import whole_file
from experiments.campaigns.trial import Outcome, Task
from experiments.paper.cases import case_named, case_seed, judged
from experiments.paper.rig.stage import Observer
from experiments.paper.rig_hand import RigBench
from experiments.paper.robot_hand import RobotBench
from experiments.paper.trial import (
    Bench,
    TrialDisturbance,
    TrialRecord,
    check_fits,
    ignore,
    run_trial,
)
from experiments.paper.trial_metrics import place_fault
from experiments.reporting.output import write_arrays
from experiments.reporting.render import View, take_picture
from experiments.speed.calibration import Kernel
from experiments.speed.meter import Meter, Spent
from planning.operations.phase_class import PhaseClass

HANDS = ("rig", "robot")
LOG, FAILED_STATE = "log.npz", "failed_state.npz"
PICTURES = {"place": ("placed", "end"), "push": ("before", "after", "end")}
CRITERION = "criterion"
"""The phase in which a trial failed that ran to its end."""
FIT = "fit"
"""The phase in which a trial failed whose part the fixture cannot hold at all."""

Arrays = dict[str, np.ndarray]


def place(
    task: Task, *, case: str = "motor/P2", hand: str = "rig", number: int = 0, timed: bool = False
) -> Outcome:
    """Place a part on the jig; success is upright and at rest, and seated where there is a seat.

    Args:
        task: Product, configuration, seed.
        case: Label of a posture.
        hand: "rig" or "robot".
        number: Of the trial: another disturbance, with the same seed.
        timed: Whether to time the calibration kernel, to compare CPU times.
    """
    return _trial("place", task, case, hand, number, timed)


def push(
    task: Task, *, case: str = "motor/P2/a", hand: str = "rig", number: int = 0, timed: bool = False
) -> Outcome:
    """Place a part and push it; success is that the jig goes along. See `place`."""
    return _trial("push", task, case, hand, number, timed)


def _trial(command: str, task: Task, label: str, hand: str, number: int, timed: bool) -> Outcome:
    case = case_named(command, label)
    if hand not in HANDS:
        raise UnknownName("hand", hand, HANDS)
    product = load_product(task.product)
    if case.posture.part not in product.parts:
        raise UnknownName("part", case.posture.part, product.parts)
    check_fits(task.config, product, case.posture)
    bench: Bench
    if hand == "robot":
        bench = RobotBench.build(task.config, product, case.posture, case.push)
    else:
        bench = RigBench.build(task.config, product, case.posture)
    kernel = Kernel() if timed else None
    before = kernel.time() if kernel else 0.0
    disturbance = TrialDisturbance.draw(task.config, case_seed(task.seed, case.label, number))
    watch = _photographer(command, task) if number == 0 else ignore
    trial = run_trial(bench.begin(disturbance), case.push, watch)
    after = kernel.time() if kernel else 0.0
    write_arrays(task.file(LOG), to_arrays(trial, (before + after) / 2))
    result = judged(case, trial)
    if not result.success:
        write_arrays(task.file(FAILED_STATE), trial.state)
    phase, evidence = trial.failure or ("", "")
    if not result.success and trial.failure is None:
        phase, evidence = CRITERION, "it ran to its end, but not as the criterion of success asks"
        if case.push is None:
            evidence = place_fault(trial, result.measured)
    return Outcome(result.success, result.measured, phase, evidence)


def _photographer(command: str, task: Task) -> Callable[[str, Observer], None]:
    """Return what takes a picture of each event, where the machine can render."""
    if rendering_problem() is not None:
        return ignore
    *usual, last = PICTURES[command]
    taken: list[str] = []

    def take(event: str, observer: Observer) -> None:
        # The end is worth a picture only if the trial stopped early.
        if event not in usual and (event != last or taken == usual):
            return
        view = view_of(observer.stage.config.workcell.X_WJ)
        png = take_picture(observer.stage.scene_graph, observer.root, view)
        with whole_file(task.file(f"{event}.png")) as temporary:
            temporary.write_bytes(png)
        taken.append(event)

    return take


def view_of(X_WJ: RigidTransform) -> View:
    """Return a camera that sees the jig and 70 mm to each side."""
    p_WJ = X_WJ.translation()
    target = tuple(p_WJ + [0.0, 0.0, 0.05])
    return View(p_WC=tuple(p_WJ + [0.35, -0.45, 0.28]), p_WTarget=target, width=720, height=480)


def to_arrays(trial: TrialRecord, kernel: float) -> Arrays:
    """Return what is kept of a trial beside its row: its log, and the times that it took.

    Args:
        trial: That has ended.
        kernel: CPU time of an iteration of the calibration kernel [s]; 0: not timed.
    """
    spent = trial.meter.spent
    return trial.log | {
        "sim_seconds": np.array(trial.sim_seconds),
        "cpu_seconds": np.array(trial.cpu_seconds),
        "class_name": np.array([kind.value for kind in spent], dtype=str),
        "class_sim": np.array([each.simulated for each in spent.values()]),
        "class_cpu": np.array([each.cpu for each in spent.values()]),
        "kernel_cpu": np.array(kernel),
    }


def from_arrays(arrays: Arrays) -> tuple[TrialRecord, float]:
    """Return what `to_arrays` was given; poses are not kept."""
    kinds = [PhaseClass(str(name)) for name in arrays["class_name"]]
    spent = zip(arrays["class_cpu"], arrays["class_sim"], strict=True)
    meter = Meter({kind: Spent(*map(float, each)) for kind, each in zip(kinds, spent, strict=True)})
    trial = TrialRecord(
        planned=RigidTransform(),
        log=arrays,
        sim_seconds=float(arrays["sim_seconds"]),
        cpu_seconds=float(arrays["cpu_seconds"]),
        meter=meter,
    )
    return trial, float(arrays["kernel_cpu"])
