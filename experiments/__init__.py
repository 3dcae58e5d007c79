"""Run, measure, report. Each file in this folder is a script: ``python -m experiments.NAME``.

What is named in `__all__` is for experiments of your own: a function that takes a `Task` and
returns an `Outcome`, `trials` of it over a `grid`, a `sample` and seeds, and `run_campaign`.

The folders are what the scripts share, from the lowest up:

- `reporting`: files, pages, plots, pictures.
- `plan`, `assembly`: ``soft-jig plan`` and ``soft-jig assemble``.
- `campaigns`: many trials of an experiment, ``soft-jig sweep``.
- `speed`: what a simulated second costs.
- `jig`: element tests of the soft jig alone, and what it holds.
- `paper`: its experiments, ``soft-jig place`` and ``push``.
- `fixtures`: soft jig, jig with supports and custom jig side by side, for `fixture_comparison`.
- `compare`: what differs between two results beyond its tolerance, ``soft-jig compare``.
- `regress`: experiments against stored metrics, ``soft-jig regress``.
- `studies`: what `pose_error_study`, `jig_design_study` and `product_variants` share.
- `cli`: the command line.

A test keeps their imports pointing down.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from experiments.campaigns.campaign import run_campaign
    from experiments.campaigns.points import combined, grid, sample, trials
    from experiments.campaigns.trial import Outcome, Row, Task, Trial

__all__ = [
    "Outcome",
    "Row",
    "Task",
    "Trial",
    "combined",
    "grid",
    "run_campaign",
    "sample",
    "trials",
]

# Looked up on first use: `soft-jig --help` can do without.
_HOME = {
    "Outcome": "experiments.campaigns.trial",
    "Row": "experiments.campaigns.trial",
    "Task": "experiments.campaigns.trial",
    "Trial": "experiments.campaigns.trial",
    "combined": "experiments.campaigns.points",
    "grid": "experiments.campaigns.points",
    "run_campaign": "experiments.campaigns.campaign",
    "sample": "experiments.campaigns.points",
    "trials": "experiments.campaigns.points",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'experiments' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
