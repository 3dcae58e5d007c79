"""The charts and plots of a run, with captions that say what is to be seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.assembly.run import Run
from experiments.assembly.timeline import fixture_bars
from experiments.reporting.gantt import plot_bars
from experiments.reporting.html_page import Picture
from experiments.reporting.plots import draw, plot_forces
from planning.operations.operation import Arrays
from planning.operations.phase_class import PhaseClass

ASLEEP = "a part that rests while nothing touches it sleeps and is not felt"
TARED = "each arm's wrist reads zero at the start of a phase; an arm that carries feels the weight"
CLASSES = (
    "free: nothing is touched. carrying: a part moves through free space. dwell: everything waits. "
    "contact: jaws close, a part meets another, the driver turns, the fixture acts on a part"
)
NOTABLE = 1.0  # A step whose force stays below this gets no number [N] [A].


def timeline(run: Run, log: Arrays) -> list[Picture]:
    """Return the chart of who did what when."""
    bars = run.timeline.bars
    if not bars:
        return []
    bars = [*bars, *fixture_bars(log, bars)]
    caption = f"Arms and fixture. {CLASSES}."
    return [(caption, plot_bars(bars, [kind.value for kind in PhaseClass]))]


def plots(run: Run, log: Arrays) -> list[Picture]:
    """Return forces under the jig and at the wrists, and what each operation draws of its steps."""
    if "time" not in log:
        return []
    plate = log["force_plate"][:, 3:] - log["force_plate"][0, 3:]
    under = {"normal": np.abs(plate[:, 2]), "shear": np.hypot(plate[:, 0], plate[:, 1])}
    wrists = {
        f"{name} arm": np.linalg.norm(log[f"{name}_wrench"][:, 3:], axis=1)
        for name in run.simulation.cell.arms
    }
    pictures = [
        forces(f"Force on the plate under the jig; {ASLEEP}", under, run, log),
        forces(f"Force at the wrists; {TARED}", wrists, run, log),
    ]
    for record in run.records:
        for plot in record.step.operation.plots(run.simulation.cell, record, log):
            pictures.append((f"{plot.caption}.", draw(plot)))
    return pictures


def forces(caption: str, curves: Mapping[str, np.ndarray], run: Run, log: Arrays) -> Picture:
    """Return a plot of forces over time, with the peak of each step numbered and named."""
    starts = [(record.step.name, record.start.time) for record in run.records]
    time, highest = log["time"], np.max(list(curves.values()), axis=0)
    peaks = step_peaks(time, highest, [start for _, start in starts])
    named = [
        f"{number}: {highest[row]:.1f} N, {phase_at(log, time[row])}"
        for number, row in enumerate(peaks, start=1)
    ]
    marks = [(float(time[row]), float(highest[row])) for row in peaks]
    picture = plot_forces(time, curves, starts, marks)
    return f"{caption}. Peaks: {'; '.join(named) or 'none'}.", picture


def step_peaks(time: np.ndarray, force: np.ndarray, starts: Sequence[float]) -> list[int]:
    """Return the row of the largest force in each step, where there is one worth a number.

    Args:
        time: (n,) [s].
        force: (n,) [N].
        starts: Of the steps [s], rising.
    """
    rows = []
    for start, end in zip(starts, [*starts[1:], np.inf], strict=True):
        inside = np.flatnonzero((time > start) & (time <= end))
        if len(inside):
            row = int(inside[np.argmax(force[inside])])
            rows += [row] if force[row] >= NOTABLE else []
    return rows


def phase_at(log: Arrays, time: float) -> str:
    """Return the name of the phase at a time [s]."""
    row = int(np.searchsorted(log["phase_start"], time - 1e-9, side="right")) - 1
    return str(log["phase_name"][max(row, 0)])


def phases(log: Arrays) -> list[dict[str, Any]]:
    """Return name, begin and duration of each phase."""
    if "time" not in log or not len(log["time"]):
        return []
    starts = log["phase_start"]
    lasts = np.diff([*starts, max(log["time"][-1], starts[-1])])
    return [
        {"phase": str(name), "begins_s": float(start), "lasts_s": float(duration)}
        for name, start, duration in zip(log["phase_name"], starts, lasts, strict=True)
    ]
