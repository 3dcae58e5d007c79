"""Advice on orders as text for a terminal, and as plain values for ``plan.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from planning.ordering.advice import Built, OrderAdvice, RankedOrder
from planning.ordering.precedence import Precedence
from planning.ordering.separation import Interlock

OBJECTIVE = (
    "fewest unstable stages, then fewest re-fixings, then the lowest mean height of the centre of "
    "gravity over all stages"
)


def advice_text(advice: OrderAdvice) -> str:
    """Return the best orders and the nearest one, or why there is none."""
    if not advice.ranked:
        return f"No order is feasible: {advice.reason}."
    best = advice.ranked[0]
    claim = "the best found"
    if advice.exact:
        claim = "proved: there is no better one"
    elif best.unstable_stages == best.refixings == 0:
        claim = "none is more stable or has fewer re-fixings; the lowest found"
    lines = [
        f"Built first, as one item: {built.name}, in the order {','.join(built.order)}."
        for built in advice.subassemblies
    ]
    if advice.interlock:
        listed = ", ".join(advice.interlock.items)
        lines.insert(0, f"No order of single items is feasible: {listed} lock each other.")
    lines.append(f"Best orders ({claim}): {OBJECTIVE}.")
    for number, ranked in enumerate(advice.ranked, start=1):
        stages = (
            "1 unstable stage"
            if ranked.unstable_stages == 1
            else (f"{ranked.unstable_stages} unstable stages")
        )
        unstable = f", {stages}" if ranked.unstable_stages else ""
        refixings = "1 re-fixing" if ranked.refixings == 1 else f"{ranked.refixings} re-fixings"
        lines.append(
            f"  {number}. {','.join(ranked.order)}: {refixings}{unstable}, "
            f"mean CoG height {1e3 * ranked.mean_cog_height:.1f} mm"
        )
    if advice.nearest:
        pairs = "pair" if advice.exchanged == 1 else "pairs"
        lines.append(
            f"Nearest feasible order: {','.join(advice.nearest)} "
            f"({advice.exchanged} {pairs} of items exchanged)."
        )
    return "\n".join(lines)


def precedence_text(advice: OrderAdvice) -> str:
    """Return which item has to precede which, one line per constraint."""
    first = advice.ranked[0].order[0]
    if not advice.precedence:
        return f"Precedence, beginning with {first}: none."
    using = " and contains these sub-assemblies" if advice.subassemblies else ""
    along = ", along the six directions and those slanted ones" if advice.slanted else ""
    lines = [f"Precedence, in every order that begins with {first}{using}{along}:"]
    lines += [f"  {constraint_text(constraint)}" for constraint in advice.precedence]
    return "\n".join(lines)


def constraint_text(constraint: Precedence) -> str:
    """Return one precedence constraint as a sentence."""
    if constraint.reason == "blocking":
        why = f"{constraint.before} would be blocked later"
    else:
        why = f"nothing else connects {constraint.after}"
    return f"{constraint.before} before {constraint.after}: {why}"


def advice_to_dict(advice: OrderAdvice) -> dict[str, Any]:
    """Return the advice as plain lists, numbers and strings; lengths in metres."""
    data: dict[str, Any] = {**asdict(advice), "objective": OBJECTIVE}
    for ranked in data["ranked"]:
        ranked["mean_cog_height_m"] = ranked.pop("mean_cog_height")
    return _with_lists(data)


def _with_lists(value: Any) -> Any:
    """Return nested values with lists for tuples, as JSON returns them."""
    if isinstance(value, dict):
        return {key: _with_lists(item) for key, item in value.items()}
    return [_with_lists(item) for item in value] if isinstance(value, list | tuple) else value


def advice_from_dict(data: Mapping[str, Any]) -> OrderAdvice:
    """Return the advice that ``advice_to_dict`` described."""
    interlock = data["interlock"]
    return OrderAdvice(
        tuple(
            RankedOrder(
                tuple(ranked["order"]),
                ranked["unstable_stages"],
                ranked["refixings"],
                ranked["mean_cog_height_m"],
            )
            for ranked in data["ranked"]
        ),
        data["exact"],
        tuple(Precedence(**constraint) for constraint in data["precedence"]),
        tuple(data["nearest"]),
        data["exchanged"],
        Interlock(
            tuple(interlock["items"]),
            tuple(interlock["subassembly"]),
            interlock["direction"],
            tuple(interlock["stuck"]),
            interlock["slanted"],
        )
        if interlock
        else None,
        data["reason"],
        data["seconds"],
        tuple(
            Built(built["name"], tuple(built["parts"]), tuple(built["order"]))
            for built in data["subassemblies"]
        ),
        data["slanted"],
    )
