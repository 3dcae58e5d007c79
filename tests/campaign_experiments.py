"""Experiments that take no time, for the laws of campaigns: run by worker processes, by name."""

import os
import signal
import time
from pathlib import Path

from cell.errors import MachineError, RunFailure
from experiments.campaigns.trial import Outcome, Task


def tiny(task: Task, *, hardness: float = 1.0, pause: float = 0.0) -> Outcome:
    """Succeed unless the speed is too high for the hardness; measure the product of both."""
    time.sleep(pause)
    load = task.config.push.speed * hardness + 0.001 * task.seed
    measured = {"load_N": load, "odd": float("nan") if task.seed % 2 else 1.0}
    if load > 1.0:
        task.file("failed_state.npz").write_bytes(b"state")
        return Outcome(False, measured, "press", f"{load:.3f} N is too much")
    return Outcome(True, measured)


def deadly(task: Task, *, once: str = "") -> Outcome:
    """Be killed for seed 1; with a file given, only until that exists."""
    if task.seed == 1 and not (once and Path(once).exists()):
        if once:
            Path(once).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return Outcome(True, {"seed_squared": task.seed**2})


def faulty(task: Task) -> Outcome:
    """Fail in three ways, by seed."""
    if task.seed == 0:
        raise RunFailure("no path was found")
    if task.seed == 1:
        raise ValueError("a bug [of ours]")
    return Outcome(False, phase="grip", evidence="lost")


def on_a_full_disk(task: Task, *, full: str = "") -> Outcome:
    """Be refused by the machine, from seed 1 on, as long as a file exists."""
    if task.seed > 0 and Path(full).exists():
        raise MachineError("Cannot write 'log.npz': No space left on device.")
    return Outcome(True)


def counting(task: Task, *, folder: str = "") -> Outcome:
    """Leave a file for each call, to count how often a trial was run."""
    with (Path(folder) / str(task.seed)).open("a") as file:
        file.write("x")
    time.sleep(0.05)
    return Outcome(True, {"pid": 0.0})


def with_positional_option(task: Task, option: int) -> Outcome:
    """Not an experiment: its option cannot be left out."""
    return Outcome(True)
