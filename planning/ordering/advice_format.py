"""Advice about orders as text for a terminal."""

from __future__ import annotations

from planning.ordering.advice import OBJECTIVE, OrderAdvice, RankedOrder
from planning.ordering.precedence import Precedence


def advice_text(advice: OrderAdvice) -> str:
    """Return the best orders and the nearest one, or why there is none."""
    if not advice.ranked:
        return f"No order is feasible: {advice.reason}."
    lines = [f"Best orders ({_claim(advice)}): {OBJECTIVE}."]
    lines += [
        f"  {number}. {ranked_text(ranked)}" for number, ranked in enumerate(advice.ranked, start=1)
    ]
    if advice.nearest:
        pairs = "pair" if advice.exchanged == 1 else "pairs"
        lines.append(
            f"Nearest feasible order: {','.join(advice.nearest)} "
            f"({advice.exchanged} {pairs} of items exchanged)."
        )
    return "\n".join(lines)


def _claim(advice: OrderAdvice) -> str:
    if advice.exact:
        return "there is no better one"
    best = advice.ranked[0]
    if best.unstable_stages == best.refixings == 0:
        return "none is more stable or has fewer re-fixings; the lowest found"
    return "the best found"


def ranked_text(ranked: RankedOrder) -> str:
    """Return one order with what it is compared by."""
    unstable = f", {ranked.unstable_stages} unstable stages" if ranked.unstable_stages else ""
    return (
        f"{','.join(ranked.order)}: {ranked.refixings} re-fixings{unstable}, "
        f"mean CoG height {1e3 * ranked.mean_cog_height:.1f} mm"
    )


def precedence_text(advice: OrderAdvice) -> str:
    """Return what has to come before what, one line per item that others wait for."""
    first = advice.ranked[0].order[0]
    if not advice.precedence:
        return f"Precedence, beginning with {first}: none."
    lines = [f"Precedence, in every order that begins with {first}:"]
    lines += [f"  {arrow_text(arrow)}" for arrow in advice.precedence]
    return "\n".join(lines)


def arrow_text(arrow: Precedence) -> str:
    """Return one arrow as a sentence."""
    if arrow.reason == "blocking":
        return f"{arrow.before} before {arrow.after}: later it could not come in"
    return f"{arrow.before} before {arrow.after}: nothing else carries {arrow.after}"
