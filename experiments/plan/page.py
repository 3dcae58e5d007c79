"""``plan.html``: the whole plan on one self-contained page."""

from __future__ import annotations

import time
from collections.abc import Sequence
from html import escape
from pathlib import Path

from cell.machines.cameras.rendering import rendering_problem
from cell.products.product import Product
from experiments.plan.arrangement import exploded, step_arrangement
from experiments.plan.drawn import DrawnProduct
from experiments.plan.heatmaps import contact_map, direction_maps
from experiments.plan.holding_picture import holding_picture, load_table
from experiments.plan.scene import SceneItem, figure, picture
from experiments.reporting.html_page import page, pairs, section, table
from experiments.reporting.output import write_text
from planning.assembly_plan.explain import blocker_text, overlap_text, step_texts, stop_text
from planning.assembly_plan.order_search import AssemblyLine
from planning.assembly_plan.planner import FixingPlan
from planning.assembly_plan.verdict import Verdict
from planning.feasibility.algorithm import READING
from planning.feasibility.directions import opposite
from planning.feasibility.evidence_format import evidence_text
from planning.feasibility.order import subassembly_name
from planning.fixture_analysis.candidate import CRITERIA, Choice, FixtureSetup
from planning.fixture_analysis.footprint import USUAL_DEPTH
from planning.ordering.advice import OrderAdvice
from planning.ordering.advice_format import advice_text, constraint_text

MOST_STEPS_PICTURED = 12  # A picture takes 0.12 s of CPU and 70 kB; they are half of the page.
MOST_BLOCKERS = 400


def write_page(
    path: Path,
    product: Product,
    plan: FixingPlan,
    choices: Sequence[Choice],
    verdict: Verdict,
    setup: FixtureSetup,
    notes: Sequence[str] = (),
) -> float:
    """Write the page; return the time taken [s].

    Args:
        path: The HTML file; it appears whole or not at all.
        product: What was planned.
        plan: Its plan.
        choices: The general rule's ranking, per step of its lines.
        verdict: On the plan.
        setup: The cell's jig.
        notes: Further remarks for the reader.
    """
    started = time.perf_counter()
    problem = rendering_problem()
    evidence = evidence_text(plan.evidence) if plan.evidence else ""
    apart, drawn = "", None
    if plan.steps and problem is None:
        drawn = DrawnProduct.of(product, plan.matrices.solids if plan.matrices else None)
        shown = exploded(drawn, plan.steps)
        apart = _figure(shown, "Each item moved out against its mating direction")
    missing = [f"No pictures: {problem}."] if problem else []
    sections = [
        _summary(plan, verdict, [*notes, *missing]),
        section("Orders", _orders(plan.orders)),
        section("Steps", _steps(drawn, plan, choices, setup)),
        section("Exploded view", apart),
        section("Matrices", _matrices(plan)),
        section("Evidence", f"<pre>{escape(evidence)}</pre>" if evidence else ""),
        section("Blocked motions", _blockers(plan)),
    ]
    body = "\n".join(filter(None, sections))
    write_text(path, page(f"{plan.product}: plan", body))
    return time.perf_counter() - started


def _summary(plan: FixingPlan, verdict: Verdict, notes: Sequence[str]) -> str:
    facts = {
        "order": ", ".join(plan.order),
        "parts": f"{len(plan.parts)}",
        "up on the jig": plan.steps[0].up if plan.steps else "",
        "planned in": f"{plan.seconds:.3f} s",
    }
    words, _, why = verdict.text.partition(":" if not verdict.good else ";")
    kind = "failure" if not verdict.feasible else "success" if verdict.held else "warning"
    evidence = [stop_text(plan), overlap_text(plan)]
    reasons = "\n".join(filter(None, [why.strip() if verdict.feasible else "", *evidence]))
    stop = f"<pre>{escape(reasons)}</pre>" if reasons else ""
    paragraphs = "".join(f"<p>{escape(note)}</p>\n" for note in notes)
    return (
        f"<h1>{escape(plan.product)}: plan</h1>\n"
        f'<p><span class="verdict {kind}">{escape(words)}</span></p>\n{stop}'
        f"{paragraphs}{pairs(facts)}"
    )


def _orders(advice: OrderAdvice | None) -> str:
    if advice is None:
        return ""
    text = f"<pre>{escape(advice_text(advice))}</pre>"
    if not advice.ranked:
        return text
    first = escape(advice.ranked[0].order[0])
    lines = "".join(f"<li>{escape(constraint_text(one))}</li>" for one in advice.precedence)
    listed = f"<ul>{lines}</ul>" if lines else "<p>None.</p>"
    return f"{text}<h3>Precedence, in every order that begins with {first}</h3>{listed}"


def _steps(
    drawn: DrawnProduct | None, plan: FixingPlan, choices: Sequence[Choice], setup: FixtureSetup
) -> str:
    scores = f"<details><summary>What the scores mean</summary>{pairs(CRITERIA)}</details>"
    parts = [f"<p>{escape(READING)}</p>{scores if choices else ''}"]
    built = {line.name for line in plan.subassemblies}
    waiting, pictured = iter(choices), 0
    fixed, up = set[str](), ""
    for line in plan.lines:
        parts.append(f"<h3>Sub-assembly {escape(line.name)}</h3>" if line.name in built else "")
        for number, (step, reason) in enumerate(zip(line.steps, step_texts(line), strict=True)):
            choice = next(waiting, None)
            parts.append(f"<h3>{number + 1}. {escape(step.item)}</h3>")
            if drawn and pictured < MOST_STEPS_PICTURED:
                parts.append(_picture(drawn, line, number, choice, setup))
                pictured += 1
            parts.append(
                f"<p><b>Algorithm 1: {escape(step.posture)} / {escape(step.fixed_part)}.</b> "
                f"{escape(reason.strip())}</p>"
            )
            parts.append(_choice(choice) if choice else "")
            if choice and choice.judged:
                chosen = choice.candidates[choice.paper]
                # What stands on the fixture already is drawn where it was fixed.
                if drawn and not (chosen.up == up and fixed <= set(chosen.body)):
                    parts.append(holding_picture(drawn, chosen, choice.judged))
                parts.append(load_table(choice.judged))
                fixed, up = set(chosen.body), chosen.up
    if drawn and pictured == MOST_STEPS_PICTURED:
        parts.append(f"<p>The first {MOST_STEPS_PICTURED} steps are pictured.</p>")
    return "\n".join(parts) if plan.steps else ""


def _picture(
    drawn: DrawnProduct, line: AssemblyLine, number: int, choice: Choice | None, setup: FixtureSetup
) -> str:
    step = line.steps[number]
    figured = choice.candidates[choice.paper].figures if choice else {}
    depth = figured.get("depth_m", USUAL_DEPTH)
    shown = step_arrangement(drawn, step, setup.jig.bag, depth)
    sides = [step.item, subassembly_name(line.order[: number + 1])]
    moved, held = sides[::-1] if step.posture == opposite(step.up) else sides
    return _figure(shown, f"Step {number + 1}: {moved} onto {held}, {step.up} up")


def _figure(shown: Sequence[SceneItem], caption: str) -> str:
    png, view = picture(shown)
    return figure(png, view, shown, caption)


def _choice(choice: Choice) -> str:
    """Return the general rule's ranking: a table of the scores, notes, and the rejected ones."""
    rows: list[dict[str, str]] = []
    notes, rejected = [], []
    for number, candidate in enumerate(choice.candidates):
        mark = " (Algorithm 1)" if number == choice.paper else ""
        notes += [(candidate.label + mark, note) for note in candidate.notes]
        if candidate.rejected:
            rejected.append((candidate.label + mark, candidate.rejected))
            continue
        figures = candidate.figures
        rows.append(
            {
                "": f"{number + 1}",
                "on the jig": candidate.name + mark,
                "up": candidate.up,
                "from": candidate.approach.removeprefix("the "),
                "score": f"{candidate.score:.2f}",
                **{name: f"{value:.2f}" for name, value in candidate.scores.items()},
                "withstands / operation sideways [N]": (
                    f"{figures['bears_across_N']:.1f} / {figures['pushed_across_N']:.1f}"
                ),
            }
        )
    kind = "agree" if choice.agrees else "differ"
    return (
        f'<p class="{kind}"><b>General rule:</b> {escape(choice.verdict)}</p>'
        f"{table(rows, list(rows[0])) if rows else ''}"
        f"{_listed(notes)}<details><summary>{len(rejected)} rejected</summary>"
        f"{_listed(rejected)}</details>"
    )


def _listed(remarks: Sequence[tuple[str, str]]) -> str:
    lines = "".join(f"<li>{escape(what)}: {escape(text)}</li>" for what, text in remarks)
    return f"<ul>{lines}</ul>" if lines else ""


def _matrices(plan: FixingPlan) -> str:
    contact = contact_map(plan.parts, plan.contact)
    free = direction_maps(plan.parts, plan.free, "M")
    reachable = direction_maps(plan.parts, plan.reachable, "W")
    maps = {
        "C: blue where two parts touch": contact,
        "M: blue where the row's part leaves the column's part along the direction": free,
        "W: blue where they also touch: the row's part can be mated along it": reachable,
    }
    return "".join(
        f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>"
        for caption, svg in maps.items()
    )


def _blockers(plan: FixingPlan) -> str:
    lines = [blocker_text(blocker) for blocker in plan.blockers[:MOST_BLOCKERS]]
    more = len(plan.blockers) - len(lines)
    text = "\n".join(lines + ([f"... and {more} more in plan.json"] if more else []))
    return (
        f"<details><summary>{len(plan.blockers)} blocked motions</summary>"
        f"<pre>{escape(text)}</pre></details>"
        if lines
        else ""
    )
