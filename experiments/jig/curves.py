"""Force over displacement: what is read from a curve, and how it is compared with the reference.

`element_curves.yaml` holds the curves of the discrete elements, several packings for a test: their
scatter is the band that a comparison is judged by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
import yaml
from numpy.typing import NDArray

Array = NDArray[np.float64]

STIFFNESS_AT = (0.5e-3, 1.0e-3)  # [m]


@dataclass(frozen=True)
class Curve:
    """A force (n,) [N] over a growing displacement (n,) [m]."""

    displacement: Array
    force: Array

    @property
    def span(self) -> tuple[float, float]:
        """First and last displacement [m]."""
        return float(self.displacement[0]), float(self.displacement[-1])

    def at(self, displacement: float) -> float:
        """Return the force at a displacement [m]; NaN beyond the curve [N]."""
        first, last = self.span
        within = first <= displacement <= last
        return float(np.interp(displacement, self.displacement, self.force)) if within else np.nan

    def sampled(self, other: Curve) -> Curve:
        """Return this curve at the displacements of another one, means over the intervals there."""
        edges = (other.displacement[1:] + other.displacement[:-1]) / 2
        owner = np.searchsorted(edges, self.displacement)
        last = other.displacement[-1] + (other.displacement[-1] - edges[-1])
        force = [
            self.force[(owner == k) & (self.displacement <= last)].mean()
            if np.any((owner == k) & (self.displacement <= last))
            else self.at(float(x))
            for k, x in enumerate(other.displacement)
        ]
        return Curve(other.displacement, np.array(force))

    def until(self, last: float) -> Curve:
        """Return the part up to a displacement [m]."""
        kept = self.displacement <= last * (1 + 1e-9)
        return Curve(self.displacement[kept], self.force[kept])

    @property
    def work(self) -> float:
        """Work from the first to the last displacement [J]."""
        return float(np.trapezoid(self.force, self.displacement))


@dataclass(frozen=True)
class Measure:
    """One number read from a curve, here and in the runs of the reference.

    Attributes:
        name: What it is, with its unit.
        ours: Here.
        known: (k,) in each run of the reference that has it.
    """

    name: str
    ours: float
    known: Array

    @property
    def ratio(self) -> float:
        """Ours over the mean of the reference."""
        return self.ours / float(self.known.mean()) if len(self.known) else np.nan

    @property
    def within(self) -> bool:
        """Whether it lies in the range of the reference."""
        return bool(len(self.known) and self.known.min() <= self.ours <= self.known.max())


def reference_curves(test: str, bed: str) -> list[Curve]:
    """Return the reference's curves of a test, such as "push, sealed, 15 mm".

    Args:
        test: As named in `element_curves.yaml`.
        bed: "dome" or "cup".
    """
    text = files("experiments.jig").joinpath("element_curves.yaml").read_text(encoding="utf-8")
    data = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    grid, curves = np.array(data["displacement_mm"], dtype=float) / 1e3, []
    for run in data["runs"]:
        if (run["test"], run["bed"]) == (test, bed):
            force = np.array([np.nan if f is None else f for f in run["force_N"]])
            known = np.isfinite(force)
            curves.append(Curve(grid[known], force[known]))
    return curves


def compare(ours: Curve, known: Sequence[Curve]) -> list[Measure]:
    """Compare peak, force at 0.5 and 1 mm, and work.

    All curves are read on the grid of the reference and as far as its shortest run. Runs whose
    beginning is missing are left out of the work.
    """
    if not known:
        return []
    last = min(curve.span[1] for curve in known)
    cut = [curve.until(last) for curve in known]
    longest = max(cut, key=lambda curve: len(curve.force))
    read = ours.sampled(longest)
    rows = [Measure("peak [N]", float(read.force.max()), np.array([c.force.max() for c in cut]))]
    for x in STIFFNESS_AT:
        forces = np.array([curve.at(x) for curve in cut])
        name = f"force at {x * 1e3:g} mm [N]"
        rows.append(Measure(name, read.at(x), forces[np.isfinite(forces)]))
    whole = [curve.work for curve in cut if len(curve.force) == len(longest.force)]
    rows.append(Measure("work [mJ]", read.work * 1e3, np.array(whole) * 1e3))
    return rows
