"""Who did what when in a run: bars on lanes, one lane per arm and one for the fixture."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from cell.machines.arm import Arm
from cell.simulation.phase import Phase
from experiments.reporting.gantt import Bar
from planning.operations.phase_class import PhaseClass, class_of

FIXTURE = "fixture"


@dataclass
class Timeline:
    """Collects the bars of the arms, phase by phase.

    Attributes:
        arms: By name, with their tools.
        bars: So far, in the order of their ends.
    """

    arms: Mapping[str, Arm]
    bars: list[Bar] = field(default_factory=list)
    _waiting: tuple[str, ...] = ()

    def add(
        self, step: str, phase: Phase, in_hand: Collection[str], span: tuple[float, float]
    ) -> None:
        """Add a phase that has ended.

        Each arm that it commands, or whose tool, gets a bar. While nothing moves, those wait that
        have moved last.

        Args:
            step: Name of its step.
            phase: Which one.
            in_hand: Names of the parts in the hand at its start.
            span: Its start and end [s].
        """
        kinds = {}
        for name, arm in self.arms.items():
            own = {d: c for d, c in phase.commands.items() if d in (name, arm.tool.name)}
            if own:
                kinds[name] = class_of(replace(phase, commands=own), in_hand)
        if kinds:
            self._waiting = tuple(kinds)
        else:
            kinds = dict.fromkeys(self._waiting, PhaseClass.DWELL)
        self.bars += [Bar(f"{name} arm", *span, kind.value, step) for name, kind in kinds.items()]


def fixture_bars(log: Mapping[str, np.ndarray], bars: Collection[Bar]) -> Iterator[Bar]:
    """Yield a bar for each time in which a reading of the fixture changes: it acts on a part.

    Args:
        log: All columns of a run.
        bars: Of the arms: they tell which step it is.
    """
    readings = [values for name, values in log.items() if name.startswith("jig_")]
    if not readings:
        return
    # A pressure that creeps up to its end counts as there within 0.1 % of its range.
    within = [1e-3 * np.ptp(values) for values in readings]
    changes = np.any(
        [np.abs(np.diff(v)) > band for v, band in zip(readings, within, strict=True)], axis=0
    )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], changes, [False]]).astype(int)))
    for first, last in edges.reshape(-1, 2):
        start, end = float(log["time"][first]), float(log["time"][last])
        step = next((bar.step for bar in bars if bar.end > start), "")
        yield Bar(FIXTURE, start, end, PhaseClass.CONTACT.value, step)
