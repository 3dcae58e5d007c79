"""What the general rule says, as plain values for ``plan.json``, and as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from planning.fixture_analysis.candidate import CRITERIA, Candidate, Choice


def choices_to_list(choices: Sequence[Choice]) -> list[dict[str, Any]]:
    """Return plain lists, numbers and strings, one entry per step; SI units in the names."""
    return [
        {
            "item": choice.item,
            "agrees": choice.agrees,
            "verdict": choice.verdict,
            "algorithm_1": choice.paper,
            "candidates": [_candidate(candidate) for candidate in choice.candidates],
        }
        for choice in choices
    ]


def _candidate(candidate: Candidate) -> dict[str, Any]:
    data: dict[str, Any] = asdict(candidate)
    for key in ("body", "moved", "notes"):
        data[key] = list(data[key])
    for key in ("figures", "scores"):
        data[key] = {name: float(value) for name, value in data[key].items()}
    return data | {"score": candidate.score}


def choices_text(choices: Sequence[Choice]) -> str:
    """Return every candidate with its score or the reason against it."""
    meaning = "; ".join(f"{name}: {text}" for name, text in CRITERIA.items())
    lines = [f"  Scores from 0 to 1: {meaning}."]
    for choice in choices:
        lines += [f"  {choice.item}: {choice.verdict}", *map(_line, choice.candidates)]
    return "\n".join(lines)


def _line(candidate: Candidate) -> str:
    if candidate.rejected:
        return f"    {candidate.label}: no, {candidate.rejected}"
    scores = ", ".join(f"{name} {value:.2f}" for name, value in candidate.scores.items())
    notes = "".join(f"; {note}" for note in candidate.notes)
    return f"    {candidate.label}: {candidate.score:.2f} ({scores}){notes}"
