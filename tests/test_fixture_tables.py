"""The tables of the comparison of fixtures say what its trials say."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from cell import CellConfig
from experiments.campaigns.run_trial import row_of
from experiments.campaigns.trial import Outcome
from experiments.fixtures.bearing import quantity_of
from experiments.fixtures.found import Found, found_of
from experiments.fixtures.plan import Extent, Line, lines_of
from experiments.fixtures.table_one import entries_of
from experiments.fixtures.table_one_text import cells_of, least_text, needs_text
from experiments.paper.holding import LOADS
from experiments.paper.trial_tasks import CRITERION, FIT
from experiments.reporting.statistics import median_interval, wilson


def lines(**extent: Any) -> list[Line]:
    extent = {"case": "plate/P1", "trials": 2} | extent
    return lines_of({"unit": "motor_unit"}, CellConfig.load(), Extent(**extent))


def ended(
    line: Line, outcomes: Mapping[str, Outcome], verdicts: Mapping[str, str] | None = None
) -> Found:
    """Return what is found of a line whose trials ended so, by kind and number: "accuracy 1"."""
    rows = {}
    for kind in ("effort", "accuracy", "bearing", "assembly"):
        for number, trial in enumerate(getattr(line, kind)):
            if (outcome := outcomes.get(f"{kind} {number}")) is not None:
                told = (verdicts or {}).get(f"{kind} {number}")
                verdict = told or ("success" if outcome.success else "failure")
                rows[trial.key] = row_of(trial, verdict, outcome, 2.0, "", Path("nowhere"))
    return found_of(line, rows)


def stood(error: float, success: bool = True) -> Outcome:
    measured = {"upright": 1.0, "position_error_m": error, "orientation_error_rad": 2 * error}
    return Outcome(success, measured, "" if success else CRITERION, "" if success else "wedged")


def test_line_counts_what_was_placed_upright_and_seated() -> None:
    line = lines(trials=4)[1]
    outcomes = {
        "effort 0": Outcome(True, {"posts_to_set": 5.0, "fixing_s": 3.0, "step_cpu_s": 2e-3}),
        "accuracy 0": stood(1e-4),
        "accuracy 1": stood(9e-4, success=False),
        "accuracy 2": Outcome(False, {"upright": 0.0}, "press", "no resistance"),
        "accuracy 3": Outcome(False, {}, evidence="killed"),
    }
    found = ended(line, outcomes, {"accuracy 3": "killed"})
    assert (found.trials, found.upright, found.successes, found.no_verdict) == (3, 2, 1, 2)
    assert found.interval == wilson(1, 3)
    assert found.position_errors_m == [1e-4, 9e-4]
    assert found.orientation_errors_rad == [2e-4, 18e-4]
    assert (found.needs, found.fixing_s, found.step_cpu_s) == ({"posts_to_set": 5.0}, 3.0, 2e-3)
    assert found.failures == {CRITERION: 1, "press": 1}
    assert found.fixed is True and found.refused == ""


def test_refused_posture_counts_as_no_placement() -> None:
    soft, posts, *_ = lines()
    no = Outcome(False, phase=FIT, evidence="it has no datum faces")
    refused = ended(posts, {"effort 0": no, "accuracy 0": no, "accuracy 1": no, "bearing 0": no})
    assert (refused.refused, refused.fixed) == ("it has no datum faces", False)
    assert (refused.trials, refused.interval, refused.failures) == (0, None, {})
    taken = ended(soft, {"effort 0": Outcome(True, {"air_cycles": 1.0}), "accuracy 0": stood(1e-3)})
    soft_entry, posts_entry = entries_of([taken, refused])
    assert (soft_entry.fixed, soft_entry.postures) == (1, 1)
    assert (posts_entry.fixed, posts_entry.postures) == (0, 1)
    assert posts_entry.seated == {0.0: (0, 0)}
    assert cells_of(posts_entry) == ("-", "0 of 1 postures; disturbed grasps -", "-; -")


def test_what_is_borne_says_whether_the_part_moved() -> None:
    measured = {quantity_of(load): 40.0 for load in LOADS}
    measured |= {f"{load.replace(' ', '_')}_moved": 0.0 for load in LOADS}
    outcome = Outcome(True, measured | {"force_+z_N": 1.2, "force_+z_moved": 1.0})
    bears = ended(lines()[0], {"bearing 0": outcome}).bears
    assert set(bears) == set(LOADS)
    assert (bears["force +z"].load, bears["force +z"].moved) == (1.2, True)
    assert (bears["moment z"].load, bears["moment z"].moved) == (40.0, False)


def test_table_sets_the_papers_marks_beside_rates_and_medians() -> None:
    """Of six placements, the median and its interval are those of the ordered errors."""
    soft, posts, larger, *_ = lines(trials=6, assemblies=1)
    errors = [1e-3, 6e-3, 2e-3, 5e-3, 3e-3, 4e-3]
    found = [
        ended(line, {f"accuracy {k}": stood(e, k < 4) for k, e in enumerate(errors)})
        for line in (soft, posts, larger)
    ]
    whole = lines(trials=6, assemblies=1)[-1]
    found.append(ended(whole, {"assembly 0": Outcome(False, {}, "insert plate: checks", "late")}))
    soft_entry, posts_entry, nest_entry = entries_of(found)
    assert [mark.good for mark in soft_entry.marks or ()] == [True, True, False]
    assert [mark.good for mark in posts_entry.marks or ()] == [False, True, True]
    assert nest_entry.marks is None  # The paper marks no custom-made jig.
    assert soft_entry.position_error_m == pytest.approx(3.5e-3)
    assert soft_entry.position_interval_m == (1e-3, 6e-3)
    assert posts_entry.seated == {0.0: (4, 6), 1e-4: (4, 6)}
    assert cells_of(posts_entry)[1].endswith(
        "disturbed grasps 4 of 6 (30 to 90 %); parts 0.1 mm larger 4 of 6 (30 to 90 %)"
    )
    assert cells_of(soft_entry)[2].startswith("3.50 (1.00 to 6.00) mm")
    assert (nest_entry.assembled, nest_entry.assemblies) == (0, 1)


def test_needs_and_loads_are_those_of_the_least_and_the_most_demanding_posture() -> None:
    first, second = lines()[1], lines(case="plate/P4")[1]
    loads = {quantity_of(load): 9.0 for load in LOADS}
    loads |= {f"{load.replace(' ', '_')}_moved": 1.0 for load in LOADS}
    few, many = (
        {"supports_to_set": 3.0, "posts_to_set": posts, "fixing_s": 1.0, "step_cpu_s": 1.0}
        for posts in (1.0, 4.0)
    )
    one = ended(first, {"effort 0": Outcome(True, few), "bearing 0": Outcome(True, loads)})
    loads = loads | {"force_-y_N": 2.0, "force_+z_N": 1.5}
    two = ended(second, {"effort 0": Outcome(True, many), "bearing 0": Outcome(True, loads)})
    (entry,) = entries_of([one, two])
    assert needs_text(entry.needs) == "3 supports to set, 1 to 4 posts to set"
    (alone,) = entries_of([one])
    assert needs_text(alone.needs) == "3 supports to set, 1 post to set"
    assert least_text(entry.least) == "sideways 2 N, up 1.5 N, moment z 9 N m"
    assert needs_text({}) == "nothing" and least_text({}) == "-"


@pytest.mark.parametrize(
    ("number", "ranks"), [(0, None), (5, None), (6, (1, 6)), (10, (2, 9)), (100, (40, 61))]
)
def test_interval_of_a_median_is_that_of_the_tables(
    number: int, ranks: tuple[int, int] | None
) -> None:
    """Ranks from tables of the sign test, two-sided 5 %."""
    assert median_interval([float(k) for k in range(number, 0, -1)]) == ranks
