"""Drawn products over seeds: what is kept, what is not run, and what the table says."""

import json
from pathlib import Path

import pytest

from experiments.campaigns.trial import Row
from experiments.product.drafting import DRAFT, Draft
from experiments.product.drawings import KINDS
from experiments.product_seeds import TABLE, line_of, main

KIND = "bar puzzle"


def row(seed: int, verdict: str, measured: dict[str, float | None]) -> Row:
    return Row(
        key=f"{seed}",
        experiment="assemble",
        product="product.yaml",
        seed=seed,
        varied={},
        options={},
        settings={},
        verdict=verdict,
        phase="" if verdict == "success" else "insert bar_2: search",
        evidence="" if verdict == "success" else "no hole within 1.5 mm",
        measured=measured,
        cpu_seconds=60.0 + seed,
    )


def test_unknown_kind_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--kind", "clock", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "clock" in said
    assert all(kind in said for kind in KINDS)


def test_what_the_check_refuses_is_not_run(tmp_path: Path) -> None:
    """A draft that is there is kept: it is neither drawn nor checked again."""
    folder = tmp_path / "bar_puzzle"
    folder.mkdir()
    draft = {"file": "none.yaml", "seconds": [1.0, 2.0], "against": ["bar_4: no grasp is reached"]}
    (folder / DRAFT).write_text(json.dumps(draft))
    assert main(["--kind", KIND, "--seeds", "2", "--out", str(tmp_path), "--quiet"]) == 1
    (line,) = json.loads((tmp_path / TABLE).read_text())["products"]
    assert line["against"] == draft["against"]
    assert (line["runs"], line["succeeded"]) == (0, 0)


def test_a_line_has_the_extremes_over_runs_and_steps() -> None:
    rows = [
        row(0, "success", {"insert bar_2/insertion_force_peak_N": 12.0, "x/torque_N_m": 99.0}),
        row(
            1, "failure", {"press bush/press_force_peak_N": 31.0, "a/insertion_force_peak_N": None}
        ),
        row(2, "success", {"insert bar_3/base_moved_since_placed_m": 2e-5}),
    ]
    line = line_of(KIND, Draft("product.yaml", (8.0, 5.0), []), rows)
    assert line["force_peak_N"] == 31.0
    assert line["fixed_part_moved_m"] == 2e-5
    assert (line["runs"], line["succeeded"]) == (3, 2)
    assert line["failures"] == ["seed 1: insert bar_2: search: no hole within 1.5 mm"]


@pytest.mark.slow
def test_a_puzzle_is_assembled_from_its_drawing(tmp_path: Path) -> None:
    assert main(["--kind", KIND, "--seeds", "1", "--out", str(tmp_path), "--quiet"]) == 0
