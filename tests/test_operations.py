"""The registry: every operation is a folder, and its name is written nowhere else."""

from __future__ import annotations

import ast
import io
import tokenize
from dataclasses import asdict, replace
from pathlib import Path

import pytest

import planning.operations
from cell.products.joints import JOINT_TYPES, Press
from cell.products.loading import load_product
from planning.assembly_plan.planner import plan
from planning.operations.limits import Limit
from planning.operations.operation import Operation, Role, Scene, Step
from planning.operations.press import PRESS
from planning.operations.registry import OPERATIONS
from planning.operations.sequence import steps

FOLDER = Path(planning.operations.__file__).parent
ROOT = FOLDER.parent.parent
FOLDERS = sorted(path.parent for path in FOLDER.glob("*/__init__.py"))
SOURCES = sorted(
    path
    for package in ("cell", "planning", "experiments")
    for path in (ROOT / package).rglob("*.py")
    if path.parent not in FOLDERS
)


def test_every_folder_is_registered() -> None:
    modules = {operation.carry_out.__module__.split(".")[2] for operation in OPERATIONS.values()}
    assert modules == {folder.name for folder in FOLDERS}


def words_of(path: Path) -> set[str]:
    """Return the texts written in a source file, documentation apart."""
    texts = set()
    for token in tokenize.generate_tokens(io.StringIO(path.read_text()).readline):
        if token.type == tokenize.STRING and not token.string.endswith('"""'):
            text = ast.literal_eval(token.string) if token.string[0] in "\"'" else token.string
            texts.add(str(text))
    return texts


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_name_of_an_operation_is_written_in_its_folder_only(path: Path) -> None:
    """But for the scripts, which are called as their operations are."""
    # An experiment, and joints, are called these, too.
    named = words_of(path) & set(OPERATIONS) - {"push", "rest", "press"}
    if path.parent == ROOT / "experiments":
        named -= {path.stem}
    assert not named


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_limits_have_reasons_and_joints_are_of_the_products(operation: Operation) -> None:
    assert all(limit.reason and limit.limit > 0 for limit in operation.limits)
    assert operation.joint is None or operation.joint in JOINT_TYPES.values()


def test_every_role_is_taken() -> None:
    assert {operation.role for operation in OPERATIONS.values()} >= set(Role)


def test_operation_that_is_added_takes_the_steps_of_its_joint(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All it takes is an entry in the registry: here one that presses a plate onto a motor."""
    product = load_product("motor_unit")
    press = Press(**asdict(product.fits[0]), force=200.0)
    pressed = replace(product, joints=(press, *product.screws.values()))

    def offer(scene: Scene, parts: tuple[str, ...], riders: tuple[str, ...]) -> Step | None:
        joints = [joint for joint in scene.product.joints if isinstance(joint, Press)]
        meant = [j for j in joints if parts == (j.hole,) and j.shaft in scene.standing]
        return Step(f"press {meant[0].hole}", added, parts, meant[0]) if meant else None

    added = Operation(
        name="press_in",
        carry_out=lambda station, step: iter(()),
        measure=lambda cell, record, log: {},
        limits=(Limit("gap_m", 1e-4, "it is seated"),),
        role=Role.BRING,
        joint=Press,
        plan=offer,
    )
    monkeypatch.delitem(OPERATIONS, PRESS.name)
    monkeypatch.setitem(OPERATIONS, added.name, added)
    todo = steps(pressed, plan(pressed, ("motor", "plate", "bolts")))
    assert [step.name for step in todo] == [
        "place motor", "press plate", "place bolts", "tighten bolts",
    ]  # fmt: skip
    assert [check.quantity for check in todo[1].failed_checks({})] == ["gap_m"]
    assert todo[1].fixed_after(pressed, ("motor",)) == ("motor", "plate")
