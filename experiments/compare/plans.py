"""The values of a plan: what was decided, and the matrices that it follows from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.compare.comparison import Value, Values

STEP_TEXTS = ("posture", "up", "fixed_part")


def plan_values(plan: Mapping[str, Any]) -> Values:
    """Return the values of ``plan.json``.

    Parts are matched by name, steps by what is added. Reachable directions follow from contact and
    free directions and are left out, as are words, evidence and times.
    """
    found: dict[str, Mapping[str, Value]] = {
        "plan": {
            "feasible": str(plan["feasible"]),
            "order": _listed(plan["order"]),
            "parts": _listed(sorted(plan["parts"])),
            "stopped at": plan["stopped"]["item"] if plan["stopped"] else "nothing",
            "not planned": _listed(sorted(item["name"] for item in plan["unplanned"])),
        }
    }
    for step in plan["steps"]:
        found[f"add {_listed(step['incoming'])}"] = _step(step)
    for built in plan["subassemblies"]:
        for step in built["steps"]:
            found[f"{built['name']}: add {_listed(step['incoming'])}"] = _step(step)
    matrices = {"contact": plan["contact"]} | {f"free {j}": m for j, m in plan["free"].items()}
    parts = plan["parts"]
    for i, moving in enumerate(parts):
        for k, staying in enumerate(parts):
            if i != k:
                pair = {name: str(matrix[i][k]) for name, matrix in matrices.items()}
                found[f"{moving}, {staying}"] = pair
    return found


def _step(step: Mapping[str, Any]) -> Mapping[str, Value]:
    return {
        "onto": _listed(sorted(step["target"])),
        "leaves along": _listed(j for j, free in step["directions"].items() if free),
        **{name: str(step[name]) for name in STEP_TEXTS},
        "cog_height_m": float(step["cog_height_m"]),
    }


def _listed(names) -> str:
    return ", ".join(names) or "none"
