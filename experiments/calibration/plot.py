"""The picture of a calibration: records over what the twin predicts, and the marginals."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.calibration.free_numbers import FreeNumber
from experiments.calibration.posterior import Array, Observation, Posterior

COLUMNS = 4
DRAWS = 2000  # For the bands.
BINS = 40


def plot(observations: Sequence[Observation], posterior: Posterior, seed: int) -> Figure:
    """Return a figure with a field per record and one per number."""
    rng = np.random.default_rng(seed)
    rows = [math.ceil(len(items) / COLUMNS) for items in (observations, posterior.numbers)]
    figure = Figure(figsize=(4 * COLUMNS, 3.2 * sum(rows)), layout="constrained")
    axes = figure.subplots(sum(rows), COLUMNS, squeeze=False)
    drawn = posterior.shares[rng.integers(len(posterior.shares), size=DRAWS)]
    flat = rng.random((DRAWS, len(posterior.numbers)))
    upper, lower = axes[: rows[0]].ravel(), axes[rows[0] :].ravel()
    for axis, observation in zip(upper, observations, strict=False):
        _plot_record(axis, observation, observation.predicted(drawn, rng), flat)
    for k, axis in enumerate(lower[: len(posterior.numbers)]):
        _plot_marginal(axis, posterior.numbers[k], posterior.shares[:, k])
    for axis in (*upper[len(observations) :], *lower[len(posterior.numbers) :]):
        axis.set_axis_off()
    return figure


def _plot_record(axis: Axes, observation: Observation, drawn: Array, flat: Array) -> None:
    edges = np.array([[float(x) for x in n.split("_")[1:4:2]] for n in observation.names])
    prior = np.exp(observation.emulator.predict(flat[:, observation.columns]))
    for forces, colour, name in ((prior, "0.85", "prior"), (drawn, "C0", "posterior")):
        low, high = np.quantile(forces, (0.025, 0.975), axis=0)
        alpha = 1.0 if name == "prior" else 0.5
        for k, (left, right) in enumerate(edges):
            label = f"{name}, 95 %" if k == 0 else None
            axis.fill_between(
                [left, right], low[k], high[k], color=colour, alpha=alpha, lw=0, label=label
            )
    for record in observation.records:
        curve = record.curve.until(edges[-1, 1] / 1e3)
        axis.plot(curve.displacement * 1e3, curve.force, "k", lw=0.6, label=record.name)
    axis.hlines(observation.forces, *edges.T, colors="C3", lw=1.5, label="mean forces")
    name = observation.records[0].test.name
    axis.set(xlabel="displacement [mm]", ylabel="force [N]", title=name)
    axis.set_ylim(0, 2 * max(observation.forces.max(), np.quantile(drawn, 0.975)))
    axis.legend(fontsize="x-small")


def _plot_marginal(axis: Axes, number: FreeNumber, shares: Array) -> None:
    edges = np.linspace(0, 1, BINS + 1)
    heights, _ = np.histogram(shares, edges, density=True)
    axis.stairs(heights, number.value(edges), fill=True, color="C0", alpha=0.5, label="posterior")
    axis.hlines(1.0, number.low, number.high, colors="0.5", label="prior")
    for end in np.quantile(shares, (0.025, 0.975)):
        axis.axvline(float(number.value(end)), color="C0", ls="--", lw=1)
    axis.set_xscale("log" if number.log else "linear")
    axis.set(xlabel=f"{number.path} {number.unit and '[' + number.unit + ']'}".rstrip(), yticks=[])
    axis.legend(fontsize="x-small")
