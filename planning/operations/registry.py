"""The operations: whoever adds one adds its folder, and one line here."""

from __future__ import annotations

from cell.errors import UnknownName
from planning.operations.insert_shaft import INSERT_SHAFT
from planning.operations.operation import Operation
from planning.operations.pick_place import PICK_PLACE
from planning.operations.place_bolts import PLACE_BOLTS, PLACE_LOOSE_BOLTS
from planning.operations.press import PRESS
from planning.operations.push import PUSH
from planning.operations.rest import REST
from planning.operations.set_aside import SET_ASIDE
from planning.operations.tighten_bolts import TIGHTEN_BOLTS

# In this order they are asked whether they can take a step of a plan.
OPERATIONS: dict[str, Operation] = {
    operation.name: operation
    for operation in (
        PICK_PLACE,
        SET_ASIDE,
        PLACE_BOLTS,
        PLACE_LOOSE_BOLTS,
        INSERT_SHAFT,
        PRESS,
        REST,
        TIGHTEN_BOLTS,
        PUSH,
    )
}


def operation_named(name: str) -> Operation:
    """Return an operation by its name.

    Raises:
        UnknownName: There is none of that name.
    """
    if name not in OPERATIONS:
        raise UnknownName("operation", name, OPERATIONS)
    return OPERATIONS[name]
