"""The state that a run can go on from: of the cell, of the planner, and what was done by then.

A run that goes on from it ends as if it had never been interrupted: the same results of every step,
the same log, bit for bit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform

from cell.errors import InputError
from cell.simulation.state import State, read_state
from experiments.assembly.run import Run, StepResult
from planning.operations.limits import FailedCheck
from planning.operations.operation import Step
from planning.operations.snapshot import Snapshot

DONE = "operations_done"  # In a saved state: names of the steps before it,
RESULTS = "operations_results"  # what was measured of them, as JSON,
SEED = "operations_seed"
BEGAN, SPENT = "operations_began", "operations_stepping_cpu"
LOG, PLACED = "log/", "placed/"  # and the log, and where the parts were when the base was placed.
FAILED = "failed/"  # In the state of a failed run: the state at the start of the phase that failed.


def resumable_state(run: Run) -> State:
    """Return the state of a run between two steps, for `go_on`."""
    steps = [asdict(step) for step in run.steps]
    state = {
        **run.running.save(),
        DONE: np.array([step.name for step in run.steps], dtype=str),
        RESULTS: np.array(json.dumps(steps)),
        SEED: np.array(run.running.seed),
        BEGAN: np.array(run.began),
        SPENT: np.array(run.simulation.stepping_cpu),
    }
    state |= {LOG + name: column for name, column in run.simulation.log.arrays().items()}
    placed = run.latest_placed()
    if placed is not None:
        state[f"{PLACED}time"] = np.array(placed.time)
        state[f"{PLACED}X_WJ"] = placed.X_WJ.GetAsMatrix4()
        for name, X_WP in placed.X_WP.items():
            state[f"{PLACED}X_WP/{name}"] = X_WP.GetAsMatrix4()
    return state


def failed_state(before: State, run: Run) -> State:
    """Return the state of a run that has failed.

    Args:
        before: From which its last step is run again: `resumable_state` before that step.
        run: The run.
    """
    assert run.failure is not None
    return before | {FAILED + name: value for name, value in run.failure.state.items()}


def go_on(run: Run, steps: Sequence[Step], state: State) -> list[Step]:
    """Put a fresh run where an earlier one was; return the steps that are left.

    Args:
        run: Of the same product, with the same configuration and seed.
        steps: All steps of the plan.
        state: As `resumable_state` or `failed_state` returned it.

    Raises:
        InputError: The state is of a run with another seed or cell, or not after the first steps.
    """
    done = [str(name) for name in state[DONE]]
    if done != [step.name for step in steps[: len(done)]]:
        raise InputError(
            f"The saved state is after {', '.join(done) or 'no operation'}; "
            f"the plan begins with {', '.join(step.name for step in steps)}."
        )
    if int(state[SEED]) != run.running.seed:
        raise InputError(f"The saved state is of --seed {int(state[SEED])}.")
    run.running.resume(state)
    run.steps = [_result(**result) for result in json.loads(str(state[RESULTS]))]
    run.began = float(state[BEGAN])
    run.simulation.stepping_cpu = float(state[SPENT])
    run.simulation.log.restore(_below(state, LOG))
    run.placed = _placed(_below(state, PLACED))
    return list(steps[len(done) :])


def read_resumable(path: Path) -> State:
    """Read a state that a run can go on from.

    Raises:
        InputError: It cannot be read, or is something else.
    """
    state = read_state(path)
    if not {DONE, RESULTS, SEED, BEGAN, SPENT} <= set(state):
        raise InputError(f"'{path}' is not the state.npz or failed_state.npz of a run.")
    return state


def _result(failed_checks: list[dict], **others) -> StepResult:
    return StepResult(failed_checks=tuple(FailedCheck(**each) for each in failed_checks), **others)


def _placed(state: Mapping[str, np.ndarray]) -> Snapshot | None:
    """Return where the parts were; of the rest nothing is asked later on."""
    if not state:
        return None
    X_WP = {name: RigidTransform(X) for name, X in _below(state, "X_WP/").items()}
    X_WJ = RigidTransform(state["X_WJ"])
    return Snapshot(float(state["time"]), X_WJ, X_WP, {}, {}, {}, {}, 0.0, {}, {})


def _below(state: Mapping[str, np.ndarray], prefix: str) -> State:
    """Return the entries whose names begin with a prefix, without it."""
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
