"""Random products: what is refused is not run, and every outcome is told with its reason."""

import json
from pathlib import Path

import numpy as np
import pytest

from cell.configuration.config import CellConfig
from experiments.campaigns.trial import Row
from experiments.product.drafting import DRAFT, Draft, drafted
from experiments.product.drawings import box
from experiments.product.random_drawing import draw
from experiments.random_products import TABLE, Line, main

GOOD = Draft("product.yaml", (20.0, 5.0), [])


def row(verdict: str) -> Row:
    return Row(
        "key", "assemble", "product.yaml", 3, {}, {}, {}, verdict, "insert", "jammed", {}, 60.0
    )


@pytest.mark.parametrize(
    ("draft", "ran", "outcome", "reason"),
    [
        (GOOD, row("success"), "assembled", ""),
        (GOOD, row("failure"), "failed", "insert: jammed"),
        (GOOD, None, "checked", ""),
        (Draft("", (1.0, 0.0), ["block: too wide"]), None, "refused", "block: too wide"),
    ],
)
def test_outcomes(draft: Draft, ran: Row | None, outcome: str, reason: str) -> None:
    line = Line.of(3, draw(np.random.default_rng(3)), draft, ran)
    assert (line.outcome, line.reason) == (outcome, reason)
    assert line.seconds[2] == (60.0 if ran else 0.0)


def test_what_is_refused_is_not_run(tmp_path: Path) -> None:
    """A draft that is there is kept: it is neither made nor checked again."""
    folder = tmp_path / "product_0"
    folder.mkdir()
    kept = {"file": "none.yaml", "seconds": [1.0, 2.0], "against": ["plate: no grasp"]}
    (folder / DRAFT).write_text(json.dumps(kept))
    assert main(["--count", "1", "--out", str(tmp_path), "--quiet"]) == 1
    (line,) = json.loads((tmp_path / TABLE).read_text())["products"]
    assert (line["outcome"], line["reason"]) == ("refused", "plate: no grasp")
    assert not list((tmp_path / "trials").glob("*.json"))


def test_a_product_that_init_refuses_is_a_draft_with_a_reason(tmp_path: Path) -> None:
    """Two boxes that fill each other, on top of what an interrupted draft has left."""
    parts = {"one": box((-10, -10, 0), (10, 10, 20)), "two": box((-10, -10, 0), (10, 10, 20))}
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "product.yaml").write_text("half a ")
    draft = drafted(parts, tmp_path, CellConfig())
    assert draft.against
    assert "exists" not in draft.against[0]
    assert drafted(parts, tmp_path, CellConfig()) == draft
