"""Runs with one fault each: the verdict names the phase, and evidence of what is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import pytest
from teleport import carry_out, phases_of, sensed_in

from cell import CellConfig, load_product
from cell.simulation.phase import Impedance, Phase, what_is_missing
from experiments.assembly.prepare import Disturbance, RunningCell
from experiments.assembly.run import Run
from planning.assembly_plan.planner import plan
from planning.operations.grasping import raised
from planning.operations.sequence import steps
from planning.operations.soft_hand import MatePhase
from planning.operations.targets import Descent


def test_shaft_that_does_not_enter_is_named_by_the_search() -> None:
    """The part stops at the mouth of the hole: what is sought then is said, and what was tried."""
    product = load_product("idler")
    running = RunningCell(product, CellConfig(), 0)
    place, insert = steps(product, plan(product))[:2]
    for _ in phases_of(running, [place]):
        pass
    pending = cast(Any, insert.phases(running.station))
    phase: Phase = next(pending)
    while phase.kind is not MatePhase.INSERT:
        phase = pending.send(carry_out(running, phase))
    search: Phase = pending.send(carry_out(running, stopped(phase, 0.006)))
    assert search.name == "arm: search"
    evidence = what_is_missing(search.until, sensed_in(running))
    assert evidence.startswith("arm does not slide onto post, tried up to 1.5 mm aside: the ")
    assert evidence.endswith(" 1.00 mm too high")  # It has to sink by 1 mm to count as found.


def stopped(phase: Phase, height: float) -> Phase:
    """Return a soft phase whose motion ends above its seat [m]."""
    ((arm, command),) = phase.commands.items()
    assert isinstance(command, Impedance)
    descent = cast(Descent, command.X_WD)
    descent = replace(descent, X_WSeat=raised(descent.X_WSeat, height))
    return replace(phase, commands={arm: replace(command, X_WD=descent)})


@pytest.mark.slow
def test_tray_50_mm_off_does_not_matter_to_a_part_that_is_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The planner knows only where the tray should be; the part is fetched from where it is."""
    off = Disturbance(0.05, 0.0, 0.0)
    monkeypatch.setattr(Disturbance, "draw", staticmethod(lambda config, seed: off))
    product = load_product("idler")
    run = Run(RunningCell(product, CellConfig(), 0))
    run.run(steps(product, plan(product))[:1])
    assert (run.failure, run.verdict) == (None, "success")
