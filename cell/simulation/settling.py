"""Parts come to rest where they lie before a run begins.

A product file says where a part touches its tray; what bears its weight is a contact that is some
10 nm deep. In its first step a part falls by g dt^2 before it meets metal with metal: with steps of
1 ms a bolt of 1.2 g is at rest afterwards, with 2 ms it bounces by 1.5 mm, and Drake's solver may
fail [M].
"""

from __future__ import annotations

from pydrake.systems.analysis import Simulator

from cell.simulation.simulation import Simulation

SETTLE_TIME = 0.02  # After it, what is left of motion is below 1 nm in 20 ms [s] [M].


def settle(simulation: Simulation) -> None:
    """Put all parts, which sleep, where they come to rest.

    They settle in a copy of the Context: time does not go on, and nothing else moves.

    Args:
        simulation: Before its first step, with a fine time step.
    """
    cell, context = simulation.cell, simulation.context
    assert cell.diagram is not None
    settling = Simulator(cell.diagram, simulation.root.Clone())
    settling.set_monitor(cell.monitor)
    root = settling.get_mutable_context()
    cell.parts.sleep_all_but(root, cell.parts.by_name)
    settling.Initialize()
    settling.AdvanceTo(root.get_time() + SETTLE_TIME)
    settled = cell.plant.GetMyContextFromRoot(root)
    for part in cell.parts:
        instance = part.body.model_instance()
        cell.plant.SetPositions(context, instance, cell.plant.GetPositions(settled, instance))
