"""From plans to steps: one code for every order and product."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cell.products.loading import load_product
from cell.products.product import Product
from planning.assembly_plan.planner import plan
from planning.operations.insert_shaft import INSERT_SHAFT
from planning.operations.operation import NoOperation, Step
from planning.operations.sequence import steps

MOTOR_UNIT, IDLER = load_product("motor_unit"), load_product("idler")
SIX = tuple(f"bolt_{k}" for k in range(1, 7))


def kinds_and_names(product: Product, *order: str) -> list[tuple[str, str]]:
    return [(s.operation.name, s.name) for s in steps(product, plan(product, order))]


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
    todo = steps(product, plan(product, (upper, "bolts", lower)))
    assert [(step.operation.name, step.parts, step.riders) for step in todo] == [
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
        steps(MOTOR_UNIT, replace(todo, steps=(replace(step, fixed_part="motor"),)))


def test_group_cannot_be_fixed_on_the_jig() -> None:
    todo = plan(MOTOR_UNIT, ("motor", "plate", "bolts"))
    with pytest.raises(NoOperation, match="'bolts'"):
        steps(MOTOR_UNIT, replace(todo, steps=(replace(todo.steps[0], fixed_part="bolts"),)))


def test_what_is_fixed_follows_from_the_operations() -> None:
    """Loose bolts do not count: they sleep while nothing touches them."""
    fixed: tuple[str, ...] = ()
    seen = []
    for step in steps(MOTOR_UNIT, plan(MOTOR_UNIT, ("plate", "bolts", "motor"))):
        fixed = step.fixed_after(MOTOR_UNIT, fixed)
        seen.append(fixed)
    assert seen == [("plate",), ("plate",), (), ("motor",), ("motor", "plate"), ("motor", "plate")]


def test_part_that_rides_along_is_fixed_with_the_one_it_rides_on() -> None:
    back = Step("insert a", INSERT_SHAFT, ("plate",), None, ("cover", "bolt_1"))
    assert back.fixed_after(MOTOR_UNIT, ("motor",)) == ("motor", "plate", "cover")


def test_part_without_a_joint_to_what_stands_there_is_not_brought() -> None:
    """The message says which joints there are operations for."""
    bare = replace(MOTOR_UNIT, joints=tuple(MOTOR_UNIT.screws.values()))
    with pytest.raises(NoOperation, match=r"brings 'plate' to motor.*fit by insert_shaft"):
        steps(bare, plan(bare, ("motor", "plate", "bolts")))
