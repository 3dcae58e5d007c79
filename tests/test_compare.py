"""``soft-jig compare``: what is equal, what differs, and what cannot be compared."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from cell.products.loading import load_product
from experiments.campaigns.store import write_index, write_trial
from experiments.campaigns.trial import Row
from experiments.cli.main import main
from experiments.compare.comparison import Mean, compared
from experiments.compare.tolerances import BY_UNIT, EXACT, NAMED, Tolerance, tolerance_of
from planning.assembly_plan.plan_file import save_plan
from planning.assembly_plan.planner import plan

PAGE = Path(__file__).resolve().parent.parent / "docs" / "guide" / "compare.md"
RESULT: dict[str, Any] = {
    "command": "assemble",
    "product": "motor_unit",
    "order": ["motor", "plate"],
    "verdict": "success",
    "config": {"push": {"speed": 0.2}},
    "versions": {"drake": "1.58.0"},
    "steps": [
        {
            "name": "insert plate",
            "operation": "insert_shaft",
            "verdict": "success",
            "sim_seconds": 7.6,
            "cpu_seconds": 4.0,
            "measured": {"insertion_force_peak_N": 12.0, "gap_m": -6e-6},
        }
    ],
}
PLACED: dict[str, Any] = {
    "command": "place",
    "verdict": "success",
    "cases": [
        {
            "part": "motor",
            "posture": "P2",
            "trials": 10,
            "successes": 10,
            "measured": {"depth_m": 0.0176},
        }
    ],
}
SUMMARY: dict[str, Any] = {
    "verdict": "failure",
    "trials": 20,
    "ended": 20,
    "success": 16,
    "failure": 4,
    "points": [],
    "measured": {"depth_m": {"trials": 20, "mean": 0.0100, "deviation": 0.002}},
}


def compare(a: Path, b: Path, *options: str) -> int:
    return main(["compare", str(a), str(b), "--quiet", "--out", str(a.parent / "out"), *options])


def written(file: Path, data: Any) -> Path:
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(data))
    return file


def outcome(tmp_path: Path, a: Any, b: Any, *options: str) -> tuple[int, dict[str, Any]]:
    code = compare(written(tmp_path / "a.json", a), written(tmp_path / "b.json", b), *options)
    file = tmp_path / "out" / "compare.json"
    return code, json.loads(file.read_text()) if file.exists() else {}


def changed(data: dict[str, Any], change: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    other = deepcopy(data)
    change(other)
    return other


# ---- Laws


@pytest.mark.parametrize("data", [RESULT, PLACED, SUMMARY])
def test_everything_equals_itself(data: dict[str, Any], tmp_path: Path) -> None:
    code, found = outcome(tmp_path, data, data)
    assert (code, found["verdict"], found["differences"]) == (0, "success", [])
    assert found["compared"] > 0


def test_number_may_drift_up_to_its_tolerance_and_no_further() -> None:
    before = {"step": {"depth_m": 0.010}}
    allowed = tolerance_of("depth_m").allowed(0.010)
    assert allowed == pytest.approx(5e-4)
    for sign in (-1, 1):
        inside = {"step": {"depth_m": 0.010 + sign * 0.999 * allowed}}
        outside = {"step": {"depth_m": 0.010 + sign * 1.001 * allowed}}
        assert compared(before, inside)[0].ok
        assert not compared(before, outside)[0].ok


def test_larger_of_two_tolerances_applies() -> None:
    """5 N in 100 by the relative one, 1 N in 0 by the absolute one."""
    force = Tolerance("force_N", 1.0, 0.05, "")
    assert force.allowed(-100.0) == 5.0
    assert force.allowed(0.0) == 1.0


def test_what_only_one_has_differs_whichever_it_is() -> None:
    whole = {"step": {"depth_m": 0.01, "verdict": "success"}, "other": {"turns": 1.0}}
    part = {"step": {"depth_m": 0.01}}
    for rows in (compared(whole, part), compared(part, whole)):
        assert sorted((row.place, row.quantity) for row in rows if not row.ok) == [
            ("other", "everything"),
            ("step", "verdict"),
        ]


def test_text_is_not_a_number_even_if_it_looks_like_one() -> None:
    assert not compared({"a": {"x": "1"}}, {"a": {"x": 1.0}})[0].ok


def test_means_may_differ_by_what_chance_does() -> None:
    """Half intervals add as independent errors do: 3 and 4 make 5."""
    (row,) = compared({"all": {"turns": Mean(100.0, 3.0)}}, {"all": {"turns": Mean(107.0, 4.0)}})
    assert row.allowed == pytest.approx(5.0)
    assert not row.ok
    (row,) = compared({"all": {"turns": Mean(100.0, 3.0)}}, {"all": {"turns": Mean(104.9, 4.0)}})
    assert row.ok


def test_every_tolerance_is_bounded_and_has_a_reason_that_the_guide_shows() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for tolerance in (*NAMED, *BY_UNIT):
        name = tolerance.quantity.replace("*", "\\*")
        assert f"| `{tolerance.quantity}` | {tolerance} | {tolerance.reason} |" in page, name
        assert tolerance.relative <= 0.2
    assert EXACT.reason in page


# ---- Results


@pytest.mark.parametrize(
    ("change", "quantity"),
    [
        (lambda r: r.update(verdict="failure"), "verdict"),
        (lambda r: r.update(order=["plate", "motor"]), "order"),
        (lambda r: r.update(failure={"phase": "insert plate: push"}), "failed phase"),
        (lambda r: r["steps"][0].update(verdict="failure"), "verdict"),
        (lambda r: r["steps"][0].update(sim_seconds=9.0), "sim_seconds"),
        (lambda r: r["steps"][0]["measured"].update(gap_m=4e-4), "gap_m"),
        (lambda r: r["steps"][0]["measured"].pop("gap_m"), "gap_m"),
        (lambda r: r["steps"].clear(), "everything"),
    ],
)
def test_change_of_a_result_is_named(change: Any, quantity: str, tmp_path: Path) -> None:
    code, found = outcome(tmp_path, RESULT, changed(RESULT, change))
    assert code == 1
    assert [row["quantity"] for row in found["differences"]] == [quantity]
    assert found["differences"][0]["reason"]


def test_times_of_the_machine_and_settings_are_no_differences(tmp_path: Path) -> None:
    """Settings that differ are named nevertheless: they may be the cause."""

    def change(result: dict[str, Any]) -> None:
        result["steps"][0]["cpu_seconds"] = 40.0
        result["config"]["push"]["speed"] = 0.1

    code, found = outcome(tmp_path, RESULT, changed(RESULT, change))
    assert code == 0
    assert found["given"] == {"config.push.speed": [0.2, 0.1]}


def test_cases_are_compared_by_label(tmp_path: Path) -> None:
    code, found = outcome(
        tmp_path, PLACED, changed(PLACED, lambda r: r["cases"][0].update(successes=9))
    )
    assert code == 1
    (row,) = found["differences"]
    assert (row["where"], row["quantity"], row["a"], row["b"]) == (
        "place/motor/P2", "success_rate", 1.0, 0.9,
    )  # fmt: skip


def test_table_junit_and_json_agree(tmp_path: Path) -> None:
    worse = changed(RESULT, lambda r: r["steps"][0]["measured"].update(gap_m=4e-4))
    worse["steps"][0]["name"] = RESULT["steps"][0]["name"]
    files = ["--csv", str(tmp_path / "t.csv"), "--junit", str(tmp_path / "t.xml")]
    code, found = outcome(tmp_path, RESULT, worse, *files)
    assert code == 1
    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == found["compared"]
    assert [row["quantity"] for row in rows if row["ok"] == "False"] == ["gap_m"]
    root = ElementTree.parse(tmp_path / "t.xml").getroot()
    assert root.attrib == {"tests": "2", "failures": "1", "errors": "0"}
    (failure,) = root.iter("failure")
    assert failure.attrib["message"] == "gap_m"
    assert "-6e-06 -> 0.0004" in (failure.text or "")


def test_names_with_markup_and_control_characters_do_no_harm(tmp_path: Path) -> None:
    """In the table as in JUnit's XML."""
    name = "[red]\x1b[31m<a&b>\x00"
    odd = changed(RESULT, lambda r: r["steps"][0].update(name=name))
    worse = changed(odd, lambda r: r["steps"][0]["measured"].update(gap_m=4e-4))
    a, b = written(tmp_path / "a.json", odd), written(tmp_path / "b.json", worse)
    junit = ["--junit", str(tmp_path / "t.xml"), "--out", str(tmp_path / "out")]
    assert main(["compare", str(a), str(b), *junit]) == 1
    names = [case.attrib["name"] for case in ElementTree.parse(junit[1]).iter("testcase")]
    assert "[red]\\x1b[31m<a&b>\\x00" in names


# ---- Summaries and campaigns


def test_rates_of_other_seeds_differ_only_beyond_chance(tmp_path: Path) -> None:
    fewer = changed(SUMMARY, lambda s: s.update(success=14, failure=6))
    assert outcome(tmp_path, SUMMARY, fewer)[0] == 0
    none = changed(SUMMARY, lambda s: s.update(success=4, failure=16))
    code, found = outcome(tmp_path, SUMMARY, none)
    assert (code, [row["quantity"] for row in found["differences"]]) == (1, ["success_rate"])


def test_one_trial_that_flips_is_no_chance(tmp_path: Path) -> None:
    once = changed(SUMMARY, lambda s: s.update(success=1, failure=0, measured={}))
    never = changed(SUMMARY, lambda s: s.update(success=0, failure=1, measured={}))
    assert outcome(tmp_path, once, never)[0] == 1


def campaign(out: Path, speeds: list[float], load: float, key: str) -> Path:
    """Write the folder of a campaign: two seeds at each speed. Keys differ as those of code do."""
    rows = [
        Row(f"{key}{k}{seed}", "push", "motor_unit", seed, {"push.speed": speed}, {}, {}, "success",
            measured={"load_N": load + seed, "odd": None})
        for k, speed in enumerate(speeds)
        for seed in range(2)
    ]  # fmt: skip
    for each in rows:
        write_trial(out, each)
    write_index(out, rows)
    return out


def test_campaigns_are_compared_trial_by_trial(tmp_path: Path) -> None:
    """Matched by what varies in them and by seed."""
    a = campaign(tmp_path / "a", [0.1, 0.2], 10.0, "x")
    assert compare(a, campaign(tmp_path / "b", [0.1, 0.2], 10.5, "y")) == 0
    assert compare(a, campaign(tmp_path / "c", [0.1], 10.0, "x")) == 1
    rows = json.loads((tmp_path / "out" / "compare.json").read_text())["differences"]
    assert [row["where"] for row in rows] == ["push.speed=0.2, seed=0", "push.speed=0.2, seed=1"]
    assert compare(a, campaign(tmp_path / "d", [0.1, 0.2], 14.0, "x")) == 1
    rows = json.loads((tmp_path / "out" / "compare.json").read_text())["differences"]
    assert [row["quantity"] for row in rows] == ["load_N"] * 4
    assert compare(a, campaign(tmp_path / "e", [0.3], 10.0, "x")) == 2  # Nothing in common.


def test_damaged_trial_and_index_are_named(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    a = campaign(tmp_path / "a", [0.1], 10.0, "x")
    (a / "trials" / "x00.json").write_text("{}")
    assert compare(a, a) == 2
    assert "x00.json' is damaged" in capsys.readouterr().err
    (a / "trials" / "x00.json").unlink()
    assert compare(a, a) == 2
    assert "x00.json" in capsys.readouterr().err
    (a / "trials.parquet").write_text("no index")
    assert compare(a, a) == 2
    assert "it is no index of a campaign" in capsys.readouterr().err


# ---- Plans


def test_plans_of_two_orders_differ_in_steps_and_not_in_matrices(tmp_path: Path) -> None:
    product = load_product("motor_unit")
    first = tmp_path / "plan.json"
    save_plan(plan(product), first)
    assert compare(first, first) == 0
    other = tmp_path / "other.json"
    save_plan(plan(product, ("plate", "bolts", "motor")), other)
    assert compare(first, other) == 1
    rows = json.loads((tmp_path / "out" / "compare.json").read_text())["differences"]
    places = {row["where"] for row in rows}
    assert "plan" in places
    assert all(place == "plan" or place.startswith("add ") for place in places)
    data = json.loads(first.read_text())
    data["contact"][0][1] = 1 - data["contact"][0][1]
    assert compare(first, written(tmp_path / "third.json", data)) == 1
    (row,) = json.loads((tmp_path / "out" / "compare.json").read_text())["differences"]
    assert row["quantity"] == "contact"


# ---- Bad input


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "Cannot read"),
        ("no json", "is no JSON file"),
        ("[" * 100_000, "is no JSON file"),
        ("[]", "is no result, summary, campaign or plan"),
        ('{"verdict": "success"}', "it is no result, summary, campaign or plan"),
        ('{"steps": 5, "verdict": "x", "command": "assemble"}', "Cannot compare"),
        (json.dumps(RESULT | {"steps": [{"name": "x"}]}), "it lacks 'operation'"),
        (json.dumps(PLACED), "compare like with like"),
        (json.dumps(RESULT | {"command": "place"}), "compare like with like"),
    ],
)
def test_what_cannot_be_compared_is_named_in_one_line(
    content: str | None, said: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    a, b = written(tmp_path / "a.json", RESULT), tmp_path / "b.json"
    if content is not None:
        b.write_text(content)
    assert compare(a, b) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert said in line
    assert "b.json" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["--junit", "--csv"])
def test_file_that_cannot_be_written_is_noticed_first(option: str, tmp_path: Path) -> None:
    a = written(tmp_path / "a.json", RESULT)
    assert compare(a, a, option, str(tmp_path)) == 2
    assert compare(a, a, option, str(a / "file")) == 2
    assert not (tmp_path / "out").exists()


def test_empty_folder_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "empty").mkdir()
    assert compare(written(tmp_path / "a.json", RESULT), tmp_path / "empty") == 2
    assert "has none of the files result.json" in capsys.readouterr().err
