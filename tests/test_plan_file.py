"""plan.json, the terminal's text, and the command that writes and prints them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_products import (
    box,
    interlocked_links,
    peg_in_hole,
    product_of,
    stack_of_three,
    tube_and_pins,
)

import experiments.plan.command as plan_command
from cell import CellConfig
from cell.errors import CellError
from experiments.plan.command import run_plan
from experiments.plan.options import PlanOptions
from planning import FixingPlan, load_plan, plan, save_plan
from planning.assembly_plan.explain import explanation, stop_text
from planning.assembly_plan.plan_file import plan_to_dict
from planning.feasibility.directions import DIRECTIONS

PRODUCTS = [peg_in_hole, interlocked_links, stack_of_three, tube_and_pins]


@pytest.mark.parametrize("make", PRODUCTS)
def test_a_plan_survives_a_round_trip(make, tmp_path):
    """Every number and name, feasible or not."""
    before = plan(make())
    save_plan(before, tmp_path / "plan.json")
    after = load_plan(tmp_path / "plan.json")
    assert plan_to_dict(after) == plan_to_dict(before)
    assert after.steps == before.steps and after.stop == before.stop
    assert after.blockers == before.blockers and after.orders == before.orders
    np.testing.assert_array_equal(after.contact, before.contact)
    assert [file.name for file in tmp_path.iterdir()] == ["plan.json"]


def test_file_has_the_agreed_keys(tmp_path):
    save_plan(plan(tube_and_pins()), tmp_path / "plan.json")
    data = json.loads((tmp_path / "plan.json").read_text())
    assert data["parts"] == ["plate", "pin_1", "pin_2"]
    assert data["contact"] == [[0, 1, 1], [0, 0, 0], [0, 0, 0]]
    assert list(data["free"]) == list(data["reachable"]) == list(DIRECTIONS)
    (step,) = data["steps"]
    assert step["target"] == ["plate"] and step["incoming"] == ["pin_1", "pin_2"]
    assert step["directions"] == {"+x": 0, "-x": 0, "+y": 0, "-y": 0, "+z": 1, "-z": 1}
    assert (step["posture"], step["fixed_part"], step["up"]) == ("+z", "plate", "+z")
    assert step["cog_height_m"] == pytest.approx(5.9e-3, abs=5e-5)
    assert step["reason"] and data["reading"] and data["seconds"] > 0.0


def test_planning_twice_gives_the_same_file_but_for_the_time():
    first, second = (plan_to_dict(plan(tube_and_pins())) for _ in range(2))
    for data in (first, second):
        assert data.pop("seconds") > 0.0 and data["orders"].pop("seconds") > 0.0
    assert first == second


@pytest.mark.parametrize(
    ("text", "message"), [("[", "not a plan"), ("[]", "not a plan"), ('{"product": "a"}', "lacks")]
)
def test_other_files_are_refused(text, message, tmp_path):
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(CellError, match=message):
        load_plan(tmp_path / "plan.json")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(CellError, match="cannot be read"):
        load_plan(tmp_path / "plan.json")


def test_explanation_names_pair_direction_and_point():
    fixing = plan(interlocked_links())
    assert fixing.stop is not None
    for text in (explanation(fixing), stop_text(fixing)):
        assert "-x: link_2 hits link_1 at (15.00," in text
        assert "mm after 15.00 mm" in text


def test_explanation_shows_every_matrix():
    text = explanation(plan(peg_in_hole()))
    assert all(f"M_{j}:" in text and f"W_{j}:" in text for j in DIRECTIONS)
    assert "Reading: " in text


def run(monkeypatch, capsys, product, folder: Path, **options) -> tuple[int, str, FixingPlan]:
    """Run the command on a product built in code."""
    monkeypatch.setattr(plan_command, "load_product", lambda *_, **__: product)
    arguments = {"order": None, "options": PlanOptions(), "explain": False} | options
    code = run_plan("tiny", out=folder, **arguments)
    return code, capsys.readouterr().out, load_plan(folder / "plan.json")


@pytest.mark.parametrize(("press_force", "unstable"), [(20.0, 0), (1.0, 1)])
def test_command_plans_for_the_configured_cell(
    monkeypatch, capsys, tmp_path, press_force, unstable
):
    """An eccentric foot of 10 mm: the plate on it is stable only if 20 N press it into the bed."""
    base = box((10, 10, 10), (-5, -5, 0)) + box((60, 40, 10), (-5, -20, 10))
    product = product_of({"base": base, "lid": box((20, 20, 5), (10, -10, 20))})
    config = CellConfig()
    config = replace(config, placement=replace(config.placement, press_force=press_force))
    _, _, fixing = run(monkeypatch, capsys, product, tmp_path, config=config)
    assert fixing.orders is not None
    assert fixing.orders.ranked[0].unstable_stages == unstable


def test_command_writes_and_prints_a_feasible_plan(monkeypatch, capsys, tmp_path):
    folder = tmp_path / "new" / "folder"
    code, text, fixing = run(monkeypatch, capsys, peg_in_hole(), folder)
    assert code == 0 and fixing.feasible
    assert "+z / block" in text and "peg can leave the target only along +z" in text


def test_command_reports_an_infeasible_order_with_exit_1(monkeypatch, capsys, tmp_path):
    code, text, fixing = run(monkeypatch, capsys, interlocked_links(), tmp_path)
    assert code == 1 and not fixing.feasible
    assert "Infeasible: link_2 cannot be added to link_1" in text
    assert "No order is feasible: none of link_1, link_2 can leave" in text


def test_command_explains_on_request(monkeypatch, capsys, tmp_path):
    _, text, _ = run(monkeypatch, capsys, peg_in_hole(), tmp_path, explain=True)
    assert "Interference-free" in text and "peg hits block" in text


def test_nothing_is_written_for_bad_input(monkeypatch, capsys, tmp_path):
    with pytest.raises(CellError):
        run(monkeypatch, capsys, peg_in_hole(), tmp_path / "new", order=("peg", "hole"))
    assert not (tmp_path / "new").exists()


def test_command_plans_the_motor_unit(capsys, tmp_path):
    assert run_plan("motor_unit", ("plate", "bolts", "motor"), PlanOptions(), False, tmp_path) == 0
    assert "-z / motor" in capsys.readouterr().out


def test_command_names_the_nearest_order(capsys, tmp_path):
    assert run_plan("motor_unit", ("motor", "bolts", "plate"), PlanOptions(), False, tmp_path) == 1
    text = capsys.readouterr().out
    assert "Infeasible: plate cannot be added to motor + bolts" in text
    assert "+z: plate hits bolt_1 at (" in text
    assert "Nearest feasible order: motor,plate,bolts (1 pair of items exchanged)." in text


def test_command_writes_candidates_and_matrices_beside_the_plan(monkeypatch, capsys, tmp_path):
    (tmp_path / "plan.html").write_text("of an earlier plan")
    run(monkeypatch, capsys, tube_and_pins(), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"plan.json", "matrices.npz"}
    (choice,) = json.loads((tmp_path / "plan.json").read_text())["general_rule"]
    assert choice["item"] == "pins" and choice["agrees"] is True
    assert len(choice["candidates"]) == 12
    chosen = choice["candidates"][choice["algorithm_1"]]
    assert (chosen["body"], chosen["up"]) == (["plate"], "+z")
    assert all(one["rejected"] or one["scores"] for one in choice["candidates"])


def test_command_prints_every_candidate_on_request(monkeypatch, capsys, tmp_path):
    _, text, _ = run(monkeypatch, capsys, tube_and_pins(), tmp_path, explain=True)
    assert "Candidates, by the general rule:" in text
    assert "pins with -z up: no, " in text and "holding 0." in text
