"""Advice about orders as plain values, for ``plan.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from planning.ordering.advice import OBJECTIVE, OrderAdvice, RankedOrder
from planning.ordering.precedence import Precedence
from planning.ordering.separation import Interlock


def advice_to_dict(advice: OrderAdvice) -> dict[str, Any]:
    """Return the advice as plain lists, numbers and strings; lengths in metres."""
    data: dict[str, Any] = {**asdict(advice), "objective": OBJECTIVE}
    for ranked in data["ranked"]:
        ranked["mean_cog_height_m"] = ranked.pop("mean_cog_height")
    return _lists(data)


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
        tuple(Precedence(**arrow) for arrow in data["precedence"]),
        tuple(data["nearest"]),
        data["exchanged"],
        Interlock(**{key: _tuple(value) for key, value in interlock.items()})
        if interlock
        else None,
        data["reason"],
        data["seconds"],
    )


def _lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    return [_lists(item) for item in value] if isinstance(value, list | tuple) else value


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
