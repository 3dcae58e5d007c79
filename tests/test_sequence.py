"""From plans to operations: one code for every order and product."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cell.products.loading import load_product
from cell.products.product import Product
from planning.assembly_plan.planner import plan
from planning.operations.sequence import NoOperation, Operation, fixed_after, operations

MOTOR_UNIT, IDLER = load_product("motor_unit"), load_product("idler")
SIX = tuple(f"bolt_{k}" for k in range(1, 7))


def kinds_and_names(product: Product, *order: str) -> list[tuple[str, str]]:
    return [(o.kind, o.name) for o in operations(product, plan(product, order))]


def test_one_part_stays_on_the_jig() -> None:
    assert kinds_and_names(MOTOR_UNIT, "motor", "plate", "bolts") == [
        ("pick_place", "place motor"),
        ("insert_shaft", "insert plate"),
        ("place_bolts", "place bolts"),
        ("tighten_bolts", "tighten bolts"),
    ]


@pytest.mark.parametrize(
    ("product", "upper", "lower", "bolts"),
    [
        (MOTOR_UNIT, "plate", "motor", SIX),
        (IDLER, "arm", "post", ("bolt_1", "bolt_2")),
    ],
)
def test_another_part_is_fixed_and_the_first_comes_back_with_its_bolts(
    product: Product, upper: str, lower: str, bolts: tuple[str, ...]
) -> None:
    todo = operations(product, plan(product, (upper, "bolts", lower)))
    assert [(o.kind, o.parts, o.riders) for o in todo] == [
        ("pick_place", (upper,), ()),
        ("place_loose_bolts", bolts, ()),
        ("set_aside", (upper,), bolts),
        ("pick_place", (lower,), ()),
        ("insert_shaft", (upper,), bolts),
        ("tighten_bolts", bolts, ()),
    ]


def test_lower_part_that_comes_second_is_placed_first() -> None:
    """Nothing is assembled yet: there is nothing to set aside."""
    assert kinds_and_names(MOTOR_UNIT, "plate", "motor", "bolts") == kinds_and_names(
        MOTOR_UNIT, "motor", "plate", "bolts"
    )


def test_bolts_before_what_they_clamp_cannot_be_placed() -> None:
    todo = plan(MOTOR_UNIT, ("motor", "plate", "bolts"))
    step = replace(todo.steps[1], target=("motor",))
    with pytest.raises(NoOperation, match="what it clamps, 'plate', is not there yet"):
        operations(MOTOR_UNIT, replace(todo, steps=(replace(step, fixed_part="motor"),)))


def test_group_cannot_be_fixed_on_the_jig() -> None:
    todo = plan(MOTOR_UNIT, ("motor", "plate", "bolts"))
    with pytest.raises(NoOperation, match="'bolts'"):
        operations(MOTOR_UNIT, replace(todo, steps=(replace(todo.steps[0], fixed_part="bolts"),)))


def test_what_is_fixed_follows_from_the_operations() -> None:
    """Loose bolts do not count: they sleep while nothing touches them."""
    fixed: tuple[str, ...] = ()
    seen = []
    for operation in operations(MOTOR_UNIT, plan(MOTOR_UNIT, ("plate", "bolts", "motor"))):
        fixed = fixed_after(MOTOR_UNIT, fixed, operation)
        seen.append(fixed)
    assert seen == [("plate",), ("plate",), (), ("motor",), ("motor", "plate"), ("motor", "plate")]


def test_part_that_rides_along_is_fixed_with_the_one_it_rides_on() -> None:
    back = Operation("insert a", "insert_shaft", ("plate",), None, ("cover", "bolt_1"))
    assert fixed_after(MOTOR_UNIT, ("motor",), back) == ("motor", "plate", "cover")
