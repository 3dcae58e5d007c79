"""Plots: a PNG each, that follows the data and nothing else."""

import io

import numpy as np
import pytest
from matplotlib.image import imread

from experiments.reporting.plots import DPI, SIZE, draw, plot_forces
from planning.operations.plot import Plot

N = 50
RAMP = np.linspace(0.0, 1.0, N)


def curves(scale: float) -> Plot:
    lines = {"bolt_1": (RAMP, scale * RAMP**4), "bolt_2": (RAMP, 0.5 * RAMP**4)}
    return Plot("torque", "angle [turns]", "torque [N m]", lines, ("target", 0.5))


PLOTS = {
    "curves": lambda scale: draw(curves(scale)),
    "forces": lambda scale: plot_forces(
        20.0 * RAMP,
        {"normal": scale * 10.0 * RAMP, "shear": RAMP},
        [("place", 0.0), ("insert", 5.0)],
        [(20.0, scale * 10.0)],
    ),
}


def pixels(png: bytes) -> np.ndarray:
    return imread(io.BytesIO(png), format="png")


@pytest.mark.parametrize("name", PLOTS)
def test_plot_is_a_picture_of_the_stated_size(name: str) -> None:
    width, height = (round(DPI * side) for side in SIZE)
    assert pixels(PLOTS[name](1.0)).shape[:2] == (height, width)


@pytest.mark.parametrize("name", PLOTS)
def test_plot_is_reproducible_and_follows_the_data(name: str) -> None:
    assert PLOTS[name](1.0) == PLOTS[name](1.0)
    assert PLOTS[name](1.0) != PLOTS[name](0.3)


def test_empty_run_still_gives_a_picture() -> None:
    """An assembly that failed before its first bolt has a report all the same."""
    nothing = np.zeros(0)
    assert pixels(draw(Plot("", "x", "y", {}))).size
    assert pixels(plot_forces(nothing, {"normal": nothing})).size
