"""Parts that are screwed in by their shape, while nothing says how: no operation drives them."""

from __future__ import annotations

from collections.abc import Collection

from planning.assembly_plan.planner import FixingPlan

DRIVEN = "what is driven has a round head, socket cap or pan, over a part that its shank passes"


def unknown_screws(fixing: FixingPlan, screws: Collection[str]) -> dict[str, str]:
    """Return, by name of a part, what is said of it.

    Args:
        fixing: A plan, with the threads that were recognised in the meshes.
        screws: Names of the parts that are known as screws.
    """
    threads = fixing.evidence.threads if fixing.evidence else ()
    return {
        thread.bolt: f"by its shape it is screwed into '{thread.nut}', but it is no screw that is "
        f"known: {DRIVEN}"
        for thread in threads
        if thread.bolt not in screws
    }
