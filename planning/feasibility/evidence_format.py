"""Evidence as text for a terminal, and as plain values for ``plan.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from planning.feasibility.cad_threads import CadThread
from planning.feasibility.evidence import Evidence, FragileDecision, ItemFreedom
from planning.feasibility.freedom import Freedom
from planning.feasibility.overlaps import Overlap
from planning.feasibility.tolerance import Tolerances
from planning.feasibility.undercut import Undercut

MOST_SMALL = 5  # Parts listed with a tolerance of their own.


def evidence_to_dict(evidence: Evidence) -> dict[str, Any]:
    """Return the evidence as plain lists, numbers and strings; lengths in metres."""
    data: dict[str, Any] = asdict(evidence)
    tolerances = data.pop("tolerances")
    data["tolerance_m"] = tolerances["overlap"]
    data["contact_tolerance_m"] = tolerances["contact"]
    data["tolerance_source"] = tolerances["source"]
    data["small_parts_m"] = tolerances["small"]
    data["overlaps"] = [
        {
            "parts": [one.part, one.other],
            "depth_m": one.depth,
            "point_m": list(one.p_AoD),
            "volume_m3": one.volume,
            "kind": one.kind,
            "press_fit": one.press_fit,
        }
        for one in evidence.overlaps
    ]
    data["undercuts"] = [{**asdict(one), "width_m": one.width} for one in evidence.undercuts]
    for one in data["undercuts"]:
        del one["width"]
    for thread in data["threads"]:
        for name in ("diameter", "height", "length"):
            thread[f"{name}_m"] = thread.pop(name)
        thread["pitch_m"] = thread.pop("pitch")
        thread["middle_m"] = list(thread.pop("p_AoT"))
        thread["axis"] = list(thread["axis"])
    for decision in data["fragile"]:
        decision["margin_m"] = decision.pop("margin")
    data["motions"] = [
        {
            "item": motion.item,
            "direction": list(motion.freedom.direction),
            "travel_m": None if motion.freedom.leaves else motion.freedom.travel,
            "hits": motion.freedom.hits,
        }
        for motion in evidence.motions
    ]
    return data | {key: list(data[key]) for key in ("threads", "fragile", "remarks")}


def evidence_from_dict(data: Mapping[str, Any]) -> Evidence:
    """Return the evidence that ``evidence_to_dict`` described."""
    threads = [
        CadThread(
            bolt=thread["bolt"],
            nut=thread["nut"],
            axis=tuple(thread["axis"]),
            p_AoT=tuple(thread["middle_m"]),
            diameter=thread["diameter_m"],
            height=thread["height_m"],
            length=thread["length_m"],
            pitch=thread["pitch_m"],
            starts=thread["starts"],
            both_ways=thread["both_ways"],
        )
        for thread in data["threads"]
    ]
    names = ("part", "other", "direction", "value", "decides")
    fragile = [
        FragileDecision(margin=decision["margin_m"], **{name: decision[name] for name in names})
        for decision in data["fragile"]
    ]
    motions = []
    for motion in data["motions"]:
        x, y, z = motion["direction"]
        travel = float("inf") if motion["travel_m"] is None else motion["travel_m"]
        motions.append(ItemFreedom(motion["item"], Freedom((x, y, z), travel, motion["hits"])))
    overlaps = []
    for one in data["overlaps"]:
        (part, other), (x, y, z) = one["parts"], one["point_m"]
        place = (x, y, z)
        lengths = one["depth_m"], place, one["volume_m3"]
        overlaps.append(Overlap(part, other, *lengths, one["kind"], one["press_fit"]))
    undercuts = [
        Undercut(one["part"], one["other"], one["direction"], one["width_m"], one["kind"])
        for one in data["undercuts"]
    ]
    return Evidence(
        Tolerances(
            data["contact_tolerance_m"],
            data["tolerance_m"],
            data["tolerance_source"],
            data["small_parts_m"],
        ),
        tuple(threads),
        tuple(overlaps),
        tuple(undercuts),
        tuple(fragile),
        tuple(data["remarks"]),
        tuple(motions),
    )


def evidence_text(evidence: Evidence) -> str:
    """Return the evidence in lines for a terminal."""
    tolerances = evidence.tolerances
    lines = [f"Tolerance {1e3 * tolerances.overlap:.3g} mm, {tolerances.source}."]
    if tolerances.contact != tolerances.overlap:
        lines.append(f"Gaps of up to {1e3 * tolerances.contact:.3g} mm count as contact.")
    if tolerances.small:
        lines.append(f"Less for small or thin parts: {_small_text(tolerances.small)}.")
    lines += [f"Note: {remark}" for remark in evidence.remarks]
    lines += [_thread_text(thread) for thread in evidence.threads]
    lines += [_explained_text(one) for one in evidence.overlaps if one.kind]
    lines += [
        f"Declared {one.kind}: {one.part} leaves along {one.direction} over an undercut of "
        f"{1e3 * one.width:.3g} mm in {one.other}."
        for one in evidence.undercuts
    ]
    lines += [_fragile_text(decision) for decision in evidence.fragile if decision.decides]
    for motion in evidence.motions:
        along = f"{motion.item} along {_vector_text(motion.freedom.direction)}"
        travel = f"{1e3 * motion.freedom.travel:.3g} mm, then {motion.freedom.hits}"
        leaves = motion.freedom.leaves
        lines.append(f"Free: {along} to infinity." if leaves else f"Local: {along} by {travel}.")
    return "\n".join(lines)


def _thread_text(thread: CadThread) -> str:
    text = f"Fastener: {thread.bolt} in {thread.nut}, diameter {1e3 * thread.diameter:.3g} mm"
    if thread.pitch is not None:
        hand = "left-hand" if thread.pitch < 0.0 else "right-hand"
        starts = f" with {thread.starts} starts" if thread.starts > 1 else ""
        text += f", pitch {1e3 * abs(thread.pitch):.3g} mm {hand}{starts}"
    text += f", {1e3 * thread.length:.3g} mm engaged, axis {_vector_text(thread.axis)}"
    return text + ("." if thread.pitch is None else ", free along its axis by turning.")


def _small_text(small: Mapping[str, float]) -> str:
    """Return the smallest tolerances with their parts, in millimetres."""
    order = sorted(small, key=small.__getitem__)
    listed = ", ".join(f"{1e3 * small[name]:.3g} mm for {name}" for name in order[:MOST_SMALL])
    more = len(order) - MOST_SMALL
    return f"{listed}, and {more} more" if more > 0 else listed


def _explained_text(one: Overlap) -> str:
    """Return an overlap that is no error as a sentence."""
    pair, depth = f"{one.part}, {one.other}", f"{1e3 * one.depth:.3g} mm"
    if one.kind == "facets":
        return f"Line to line: {pair} overlap by {depth}, as far as their facets are coarse."
    what = "interference" if one.kind == "press" else "overlap"
    return f"Declared {one.kind}: {pair}, {what} of {depth} at {point_text(one.p_AoD)}."


def _vector_text(vector: Sequence[float]) -> str:
    x, y, z = (round(value, 6) + 0.0 for value in vector)  # Adding zero turns -0 into 0.
    return f"({x:.3g}, {y:.3g}, {z:.3g})"


def _fragile_text(decision: FragileDecision) -> str:
    if decision.direction == "contact":
        what = "touch" if decision.value else "do not touch"
        claim = f"{decision.part} and {decision.other} {what}"
    else:
        what = "leaves" if decision.value else "does not leave"
        claim = f"{decision.part} {what} {decision.other} along {decision.direction}"
    return f"Warning: the plan depends on {1e3 * decision.margin:.2g} mm of tolerance: {claim}."


def point_text(p_A: Sequence[float]) -> str:
    """Return a point of the product frame in millimetres."""
    x, y, z = (1e3 * value + 0.0 for value in p_A)  # Adding zero turns -0 into 0.
    return f"({x:.2f}, {y:.2f}, {z:.2f}) mm"
