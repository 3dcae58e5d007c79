"""``plan.json``: a fixing plan as a file, for other programs and for later stages."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from cell.errors import InputError
from cell.whole_file import whole_file
from planning.assembly_plan.order_search import AssemblyLine
from planning.assembly_plan.planner import FixingPlan
from planning.feasibility.algorithm import READING, FixingStep, Stop
from planning.feasibility.directions import DIRECTIONS
from planning.feasibility.evidence_format import evidence_from_dict, evidence_to_dict
from planning.feasibility.interference import Blocker
from planning.feasibility.slanted import Slanted
from planning.ordering.advice_format import advice_from_dict, advice_to_dict
from planning.ordering.unplanned import Unplanned


def plan_to_dict(plan: FixingPlan) -> dict[str, Any]:
    """Return the plan as plain lists, numbers and strings; lengths in metres."""
    return {
        "product": plan.product,
        "order": list(plan.order),
        "feasible": plan.feasible,
        "reading": READING,
        "parts": list(plan.parts),
        "contact": plan.contact.tolist(),
        "free": {j: plan.free[j].tolist() for j in DIRECTIONS},
        "reachable": {j: plan.reachable[j].tolist() for j in DIRECTIONS},
        "slanted": [_slanted_to_dict(way, plan.contact) for way in plan.slanted],
        "steps": [_step_to_dict(step) for step in plan.steps],
        "subassemblies": [_subassembly_to_dict(built) for built in plan.subassemblies],
        "unplanned": [asdict(item) for item in plan.unplanned],
        "likely_cause": plan.likely_cause,
        "stopped": _stop_to_dict(plan.stop) if plan.stop else None,
        "blockers": [_blocker_to_dict(blocker) for blocker in plan.blockers],
        "orders": advice_to_dict(plan.orders) if plan.orders else None,
        "seconds": plan.seconds,
        "evidence": evidence_to_dict(plan.evidence) if plan.evidence else None,
    }


def plan_from_dict(data: Mapping[str, Any]) -> FixingPlan:
    """Return the plan that ``plan_to_dict`` described."""
    return FixingPlan(
        product=data["product"],
        order=tuple(data["order"]),
        parts=tuple(data["parts"]),
        contact=np.array(data["contact"], int),
        free={j: np.array(data["free"][j], int) for j in DIRECTIONS},
        reachable={j: np.array(data["reachable"][j], int) for j in DIRECTIONS},
        blockers=tuple(_blocker_from_dict(blocker) for blocker in data["blockers"]),
        steps=tuple(_step_from_dict(step) for step in data["steps"]),
        stop=_stop_from_dict(data["stopped"]) if data["stopped"] else None,
        seconds=data["seconds"],
        orders=advice_from_dict(data["orders"]) if data["orders"] else None,
        evidence=evidence_from_dict(data["evidence"]) if data["evidence"] else None,
        slanted=tuple(_slanted_from_dict(way) for way in data["slanted"]),
        subassemblies=tuple(_subassembly_from_dict(built) for built in data["subassemblies"]),
        unplanned=tuple(Unplanned(**item) for item in data["unplanned"]),
        likely_cause=data["likely_cause"],
    )


def save_plan(plan: FixingPlan, file: Path, **sections: Any) -> None:
    """Write a plan; the file appears whole or not at all.

    Args:
        plan: The plan.
        file: ``plan.json``.
        sections: Further sections of the file, plain values by name, which ``load_plan`` ignores.
    """
    # One line per key: a matrix row on a line each would run to 100 000 lines for 100 parts.
    data = plan_to_dict(plan) | sections
    lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in data.items()]
    with whole_file(file) as temporary:
        temporary.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def load_plan(file: Path) -> FixingPlan:
    """Read a plan that ``save_plan`` wrote.

    Raises:
        InputError: The file cannot be read, or is not a plan.
    """
    try:
        return plan_from_dict(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError(f"Plan file '{file}' cannot be read: {error.strerror}.") from error
    except KeyError as error:
        raise InputError(f"'{file}' is not a complete plan file: it lacks {error}.") from error
    except (ValueError, TypeError) as error:
        raise InputError(f"'{file}' is not a plan file: {error}.") from error


def _step_to_dict(step: FixingStep) -> dict[str, Any]:
    data = asdict(step) | {"target": list(step.target), "incoming": list(step.incoming)}
    data["leaves_along"] = list(step.leaves_along)
    data["slanted"] = [list(way) for way in step.slanted]
    data["cog_height_m"] = data.pop("cog_height")
    return data


def _step_from_dict(data: Mapping[str, Any]) -> FixingStep:
    fields: dict[str, Any] = dict(data)
    fields["target"], fields["incoming"] = tuple(data["target"]), tuple(data["incoming"])
    fields["leaves_along"] = tuple(data["leaves_along"])
    fields["slanted"] = tuple(tuple(way) for way in data["slanted"])
    fields["cog_height"] = fields.pop("cog_height_m")
    return FixingStep(**fields)


def _slanted_to_dict(way: Slanted, contact: np.ndarray) -> dict[str, Any]:
    return {
        "direction": list(way.direction),
        "free": way.free.tolist(),
        "reachable": ((contact + contact.T) * way.free).tolist(),
        "blockers": [_blocker_to_dict(blocker) for blocker in way.blockers],
    }


def _slanted_from_dict(data: Mapping[str, Any]) -> Slanted:
    x, y, z = data["direction"]
    blockers = tuple(_blocker_from_dict(blocker) for blocker in data["blockers"])
    return Slanted((x, y, z), np.array(data["free"], int), None, blockers)


def _subassembly_to_dict(built: AssemblyLine) -> dict[str, Any]:
    return {
        "name": built.name,
        "parts": list(built.parts),
        "order": list(built.order),
        "steps": [_step_to_dict(step) for step in built.steps],
    }


def _subassembly_from_dict(data: Mapping[str, Any]) -> AssemblyLine:
    return AssemblyLine(
        data["name"],
        tuple(data["parts"]),
        tuple(data["order"]),
        tuple(_step_from_dict(step) for step in data["steps"]),
    )


def _stop_to_dict(stop: Stop) -> dict[str, Any]:
    return {
        "item": stop.item,
        "target": list(stop.target),
        "incoming": list(stop.incoming),
        "reason": stop.reason,
        "blockers": [_blocker_to_dict(blocker) for blocker in stop.blockers],
    }


def _stop_from_dict(data: Mapping[str, Any]) -> Stop:
    return Stop(
        data["item"],
        tuple(data["target"]),
        tuple(data["incoming"]),
        data["reason"],
        tuple(_blocker_from_dict(blocker) for blocker in data["blockers"]),
    )


def _blocker_to_dict(blocker: Blocker) -> dict[str, Any]:
    return {
        "moving": blocker.moving,
        "staying": blocker.staying,
        "direction": blocker.direction,
        "point_m": list(blocker.p_AoQ),
        "travel_m": blocker.travel,
    }


def _blocker_from_dict(data: Mapping[str, Any]) -> Blocker:
    x, y, z = data["point_m"]
    return Blocker(data["moving"], data["staying"], data["direction"], (x, y, z), data["travel_m"])
