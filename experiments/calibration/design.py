"""The design: the tests of the records simulated over the prior, once, as a campaign.

A frozen specimen is pushed and pulled in one simulation, so that two records of one bag share it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from cell.configuration.config import CellConfig
from cell.errors import RunFailure
from experiments.calibration.bench import BenchTest
from experiments.calibration.free_numbers import FreeNumber, shown_in
from experiments.calibration.record import Record
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import sample, trials
from experiments.campaigns.trial import Trial

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Design:
    """What the twin does in the test of a record, over the prior.

    Attributes:
        numbers: (d,) that the test depends on.
        shares: (n, d) of their priors, 0 to 1.
        names: (k,) of the mean forces.
        forces: (n, k) [N].
    """

    numbers: list[FreeNumber]
    shares: Array
    names: list[str]
    forces: Array


def design_points(test: BenchTest, samples: int, seed: int) -> tuple[list[FreeNumber], Array]:
    """Return the numbers (d,) that a test depends on, and where to simulate it (n, d)."""
    numbers = shown_in([test])
    points = sample({number.path: (0.0, 1.0) for number in numbers}, samples, seed=seed)
    return numbers, np.array([list(point.values()) for point in points])


def trials_at(
    record: Record, numbers: Sequence[FreeNumber], shares: Array, config: CellConfig
) -> list[Trial]:
    """Return the trials of a record's test at shares (n, d) of the prior."""
    points = [
        {number.path: float(value) for number, value in zip(numbers, row, strict=True)}
        | dict(record.options)
        | {"jig.vacuum.pressure": record.vacuum}
        for row in np.column_stack([n.value(shares[:, k]) for k, n in enumerate(numbers)])
    ]
    return trials("bench", points, config=config)


def run_designs(
    records: Sequence[Record],
    config: CellConfig,
    out: Path,
    *,
    samples: int,
    seed: int,
    workers: int,
    console: Console,
) -> list[Design]:
    """Simulate what is missing in a folder; return the design of each record.

    Raises:
        RunFailure: A simulation came to no result.
    """
    designs = [design_points(record.test, samples, seed) for record in records]
    wanted = [trials_at(r, *design, config) for r, design in zip(records, designs, strict=True)]
    every = {trial.key: trial for own in wanted for trial in own}
    rows = run_campaign(
        list(every.values()),
        out,
        workers=workers,
        about={"command": "calibrate_jig"},
        console=console,
        report=False,
    )
    measured = {}
    for row in rows:
        if row.verdict != "success":
            raise RunFailure(f"The twin failed with the bag {row.options['bag']}: {row.evidence}")
        measured[row.key] = row.measured
    found = []
    for record, (numbers, shares), own in zip(records, designs, wanted, strict=True):
        action = record.test.action
        each = [measured[trial.key] for trial in own]
        # A simulation that ends early lacks the last ones.
        names = [
            name
            for name in each[0]
            if name.startswith(action) and all(row.get(name) is not None for row in each)
        ]
        forces = np.array([[row[name] for name in names] for row in each], dtype=float)
        found.append(Design(numbers, shares, names, forces))
    return found
