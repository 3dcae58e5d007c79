"""A trial of a product variant: its plan, what the jig holds of it and, if wanted, its assembly."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cell.errors import InputError, RunFailure
from cell.products.loading import is_product_file, load_product
from experiments.campaigns.assembly import assemble
from experiments.campaigns.store import trial_folder
from experiments.campaigns.trial import Outcome, Row, Task
from experiments.compare.comparison import Value, Values
from experiments.compare.plans import plan_values
from experiments.product.init import PRODUCT_FILE, Wanted, run_init
from planning.assembly_plan.plan_file import save_plan
from planning.assembly_plan.planner import plan
from planning.assembly_plan.verdict import verdict_of
from planning.fixture_analysis.candidate import Candidate, Choice, FixtureSetup
from planning.fixture_analysis.rule import choices_to_list, general_rule

PLAN = "plan.json"
RULE = "general_rule"  # Section of the plan's file.


def variant(task: Task, *, order: str = "", run: bool = False) -> Outcome:
    """Plan a product, evaluate what the jig holds in each step and, if wanted, assemble it.

    Succeeds if the plan is feasible, the jig can hold something of it, and the assembly succeeds.
    The plan is kept as ``plan.json``. CAD that is to be assembled is drafted first, as by
    ``soft-jig init``.

    Args:
        task: Product (also CAD that states its units), configuration, seed.
        order: Parts or groups, separated by commas; "" for the product's own, or the best one.
        run: Whether to assemble it in the twin.
    """
    product, config = load_product(task.product), task.config
    wanted = tuple(item.strip() for item in order.split(",")) if order else None
    fixing = plan(product, wanted, config=config)
    assert fixing.matrices is not None
    setup = FixtureSetup.of(config)
    choices = tuple(
        choice
        for line in fixing.lines
        for choice in general_rule(product, line.order, line.steps, fixing.matrices, setup)
    )
    save_plan(fixing, task.file(PLAN), **{RULE: choices_to_list(choices)})
    verdict, measured = verdict_of(fixing, choices), dict(_figures(choices))
    if not verdict.good:
        return Outcome(False, measured, "plan", verdict.text)
    if not run:
        return Outcome(True, measured)
    if not is_product_file(task.product):
        try:
            task = replace(task, product=str(_drafted(task, wanted)))
        except (InputError, RunFailure) as reason:
            return Outcome(False, measured, "init", str(reason))
    outcome = assemble(task, order=order)
    return replace(outcome, measured={**measured, **outcome.measured})


def _drafted(task: Task, order: tuple[str, ...] | None) -> Path:
    folder = task.folder / "draft"
    source = Wanted(Path(task.product), None, (), "8.8", None, order, None, False, ())
    run_init(source, folder, task.config, quiet=True)
    return folder / PRODUCT_FILE


def _figures(choices: tuple[Choice, ...]) -> Iterator[tuple[str, float]]:
    """Yield what the general rule computed of the posture that Algorithm 1 takes, by step."""
    for choice in choices:
        chosen: Candidate = choice.candidates[choice.paper]
        for name, value in chosen.figures.items():
            yield f"hold for {choice.item}/{name}", value


def values_of(row: Row, out: Path) -> Values:
    """Return all that is compared of a variant: its verdict, plan, holding and measures.

    Args:
        row: Of a trial that has come to a verdict.
        out: Folder of the campaign.
    """
    texts = {"verdict": row.verdict, "failed phase": row.phase or "none"}
    found: dict[str, Mapping[str, Value]] = {"variant": texts}
    file = trial_folder(out, row.key) / PLAN
    data: Mapping[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    found |= plan_values(data)
    for choice in data[RULE]:
        ranked = choice["candidates"]
        taken = ranked[choice["algorithm_1"]]
        found[f"hold for {choice['item']}"] = {
            "jig can hold it": "no" if taken["rejected"] else "yes",
            "best posture": "none"
            if ranked[0]["rejected"]
            else f"{ranked[0]['name']} {ranked[0]['up']}",
        }
    for name, value in row.measured.items():
        if value is not None:
            place, _, quantity = name.partition("/")
            found[place] = {**found.get(place, {}), quantity: float(value)}
    return found
