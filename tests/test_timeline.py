"""The chart of a run: each arm's phases on its own lane, the fixture's from what it reads."""

from __future__ import annotations

import io
from enum import Enum

import numpy as np
import pytest
from matplotlib.image import imread

from cell import build_cell, load_product
from cell.configuration.config import CellConfig
from cell.simulation.phase import Jaw, Phase, Spin, motion_finished
from experiments.assembly.figures import phase_at, step_peaks
from experiments.assembly.timeline import Timeline, fixture_bars
from experiments.reporting.gantt import COLORS, Bar, plot_bars
from planning.motion.timing import JointMotion
from planning.operations.phase_class import PhaseClass

KINDS = [kind.value for kind in PhaseClass]


class MadeUp(Enum):
    """A phase made up for a test."""

    ANY = "any"


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    """Both arms move at once, then the hand alone carries a part, then all wait."""
    arms = build_cell(CellConfig(), load_product("motor_unit")).arms
    stays = {n: JointMotion(np.zeros(1), a.home[None], np.zeros((1, 6))) for n, a in arms.items()}
    left, right = arms.values()
    timeline = Timeline(arms)

    def add(commands: dict, span: tuple[float, float], **changes) -> None:
        phase = Phase(MadeUp.ANY, motion_finished, 9.0, commands=commands, **changes)
        timeline.add("step", phase, ("motor",), span)

    add({**stays, left.tool.name: Jaw(0.02), right.tool.name: Spin(0.0)}, (0.0, 1.0))
    add({left.name: stays[left.name]}, (1.0, 3.0), awake=frozenset(["motor"]))
    add({}, (3.0, 3.5), awake=frozenset(["motor"]))
    return timeline


def test_every_arm_that_is_commanded_gets_a_bar_and_the_last_to_move_waits(
    timeline: Timeline,
) -> None:
    assert timeline.bars == [
        Bar("left arm", 0.0, 1.0, "free", "step"),
        Bar("right arm", 0.0, 1.0, "free", "step"),
        Bar("left arm", 1.0, 3.0, "carrying", "step"),
        Bar("left arm", 3.0, 3.5, "dwell", "step"),
    ]


def test_fixture_acts_while_what_it_reads_changes(timeline: Timeline) -> None:
    time = np.arange(0.0, 3.5, 0.01)
    log = {"time": time, "jig_pressure": 9e4 * np.clip(time - 1.0, 0.0, 1.0)}
    (bar,) = fixture_bars(log, timeline.bars)
    assert (bar.start, bar.end) == pytest.approx((1.0, 2.0), abs=0.011)
    assert bar.step == "step"
    assert not list(fixture_bars({"time": time}, timeline.bars))


def test_peak_of_each_step_is_found_with_its_phase() -> None:
    time = np.arange(0.0, 4.0, 0.01)
    force = 9.0 * np.exp(-(((time - 1.5) / 0.1) ** 2)) + 5.0 * (time > 3.0)
    rows = step_peaks(time, force, [0.0, 2.0, 3.995])
    assert time[rows] == pytest.approx([1.5, 3.01])
    log = {
        "phase_name": np.array(["go", "press", "wait"]),
        "phase_start": np.array([0.0, 1.0, 2.0]),
    }
    assert [phase_at(log, float(time[row])) for row in rows] == ["press", "wait"]
    assert step_peaks(time, 0.01 * force, [0.0]) == [], "nothing worth a number"


def test_chart_shows_each_class_in_its_colour_on_its_lane(timeline: Timeline) -> None:
    picture = imread(io.BytesIO(plot_bars(timeline.bars, KINDS)), format="png")

    def rows(rgb: tuple[int, int, int]) -> np.ndarray:
        same = np.all(np.abs(picture[..., :3] - np.array(rgb) / 255) < 0.01, axis=2)
        return np.flatnonzero(same.sum(axis=1) > 100)

    free, carrying = rows((31, 119, 180)), rows((44, 160, 44))
    assert len(COLORS) == len(KINDS)
    assert free.max() > carrying.max(), "the right arm's lane is below the left arm's"
    assert set(carrying) <= set(free), "the left arm does both"
