"""``soft-jig place``, ``soft-jig push``, and their options."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, arg

from experiments.cli.common import Common, check_counts
from experiments.reporting.output import output_folder


@dataclass(frozen=True)
class Place:
    """The paper's placement experiment: six postures, disturbed; upright and at rest counts.

    On a fixture that is made for the part it has to be seated as well.
    """

    case: Annotated[str | None, arg(metavar="motor/P2")] = None
    """A posture, or a part for all of its postures. Default: all six."""

    trials: int = 10
    """Trials of each case."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Trials at a time. What is done already is not run again."""

    hand: Literal["rig", "robot"] = "rig"
    """What carries the gripper: a position-controlled rig, or the arm, with planned motions."""

    pressure: Annotated[float | None, arg(metavar="KPA")] = None
    """Vacuum in the bag [kPa]; 0 leaves it soft. Default: jig.vacuum.pressure."""

    fixture: Annotated[str | None, arg(metavar="NAME")] = None
    """soft_jig, rigid_jig, support_jig or flat_plate. Default: workcell.fixture."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json`` and ``report.html``; return the exit code."""
        return _run_experiment("place", self)


@dataclass(frozen=True)
class Push:
    """The paper's push experiment: nine cases, 70 mm; the jig has to go along by 63 mm."""

    case: Annotated[str | None, arg(metavar="motor/P2/a")] = None
    """A case, or a part or posture for all of its cases. Default: all nine."""

    trials: int = 5
    """Trials of each case."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Trials at a time. What is done already is not run again."""

    hand: Literal["rig", "robot"] = "rig"
    """What carries the gripper: a position-controlled rig, or the arm, with planned motions."""

    pressure: Annotated[float | None, arg(metavar="KPA")] = None
    """Vacuum in the bag [kPa]; 0 leaves it soft. Default: jig.vacuum.pressure."""

    fixture: Annotated[str | None, arg(metavar="NAME")] = None
    """soft_jig, rigid_jig, support_jig or flat_plate. Default: workcell.fixture."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json`` and ``report.html``; return the exit code."""
        return _run_experiment("push", self)


def _run_experiment(command: str, options: Place | Push) -> int:
    """Check everything that was asked for, then run it."""
    from experiments.paper.case_results import Experiment
    from experiments.paper.cases import cases_of
    from experiments.paper.place_push import run_experiment, with_pressure

    common = options.common
    config = with_pressure(common.load_config(options.fixture), options.pressure)
    check_counts(options, "trials", "workers")
    cases_of(command, options.case)
    with output_folder(common.out) as out:
        experiment = Experiment(
            command,
            config,
            options.hand,
            options.trials,
            common.seed,
            out,
            common.quiet,
            options.workers,
        )
        return run_experiment(experiment, options.case)
