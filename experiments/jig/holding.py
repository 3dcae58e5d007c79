"""The experiment "hold": what a part that is frozen in the bed resists when it is pushed over."""

from __future__ import annotations

import numpy as np

from cell import load_product
from cell.errors import UnknownName
from experiments.campaigns.trial import Outcome, Task
from experiments.jig.element_rig import ElementRig
from experiments.jig.element_tests import PUSH_HEIGHT, SIDEWAYS
from experiments.jig.specimens import Prism, ProductPart, Specimen

SPECIMENS = ("standing", "lying", "plate/P2")
"""A cylinder of 0.2 kg upright and on its side, and the motor unit's plate on its foot."""

DEPTH = 0.010  # To which a part is pressed in [m] [A].
SPEED = 0.020  # Of the drag [m/s] [A].


def specimen_named(name: str) -> Specimen:
    """Return one of `SPECIMENS`.

    Raises:
        UnknownName: There is none of this name.
    """
    if name not in SPECIMENS:
        raise UnknownName("specimen", name, SPECIMENS)
    if name == "plate/P2":
        return ProductPart(load_product("motor_unit").parts["plate"], (0, 1, 0))
    return Prism(lying=name == "lying")


def hold(
    task: Task, *, specimen: str = "standing", speed: float = SPEED, depth: float = DEPTH
) -> Outcome:
    """Measure the resistance to a push near the top of a part, across its least stable side.

    Args:
        task: With the settings; nothing in it is random.
        specimen: Name of the part, one of `SPECIMENS`.
        speed: Of the drag [m/s].
        depth: To which the part is pressed in [m].
    """
    part, steps = specimen_named(specimen), task.config.simulation
    rig = ElementRig(
        task.config.jig,
        part,
        time_step=steps.time_step,
        approximation=steps.contact_approximation,
    )
    rig.lower_to(depth, speed=0.04)
    rig.jam()
    rig.let_go(0.2)
    top = rig.X_JP.inverse() @ np.array([0.0, 0.0, rig.params.bag.cap_height + lever(part)])
    # A cylinder lying along x is pushed across its axis, the plate out of its plane.
    direction = SIDEWAYS if isinstance(part, Prism) and not part.lying else across(rig)
    return Outcome(True, {"holding_N": rig.drag(top, direction, speed=speed).holding_force})


def lever(specimen: Specimen) -> float:
    """Return the height of the push over the apex [m]: `PUSH_HEIGHT` if the part is that tall."""
    height = np.ptp(specimen.mesh().vertices @ specimen.X_CP.rotation().matrix()[2])
    return float(min(PUSH_HEIGHT, height - DEPTH - 0.005))


def across(rig: ElementRig) -> np.ndarray:
    """Return the horizontal axis (3,) of J along which the part is thinnest."""
    corners = rig.part.mesh().vertices @ rig.X_JP.rotation().matrix().T
    return np.eye(3)[int(np.argmin(np.ptp(corners, axis=0)[:2]))]
