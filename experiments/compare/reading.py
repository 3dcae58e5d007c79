"""What can be compared: results, summaries, campaigns, plans and baselines, read from files."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cell.errors import InputError
from experiments.campaigns.store import INDEX, read_trial, trial_file
from experiments.compare.comparison import Mean, Value, Values
from experiments.compare.plans import plan_values
from experiments.reporting.statistics import wilson

# What a folder is taken for: the first of these files that it has.
FILES = ("result.json", INDEX, "summary.json", "plan.json")


@dataclass(frozen=True)
class Content:
    """Something that can be compared.

    Attributes:
        kind: Two contents can be compared if it is the same.
        values: By place and quantity.
        given: Settings and versions with which it was made, by path.
    """

    kind: str
    values: Values
    given: Mapping[str, Any] = field(default_factory=dict)


def read_content(path: Path) -> Content:
    """Return what is in a file, or in the folder of a command.

    Raises:
        InputError: It cannot be read, or is nothing that can be compared.
    """
    file = path
    if path.is_dir():
        there = [path / name for name in FILES if (path / name).exists()]
        if not there:
            raise InputError(f"Folder '{path}' has none of the files {', '.join(FILES)}.")
        file = there[0]
    try:
        return _campaign(file) if file.name == INDEX else _content(_read_json(file))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OSError) as error:
        reason = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(f"Cannot compare '{file}': {reason}.") from error


def _read_json(file: Path) -> Mapping[str, Any]:
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"'{file}' is no JSON file: {error}.") from error
    except OSError as error:
        raise InputError(f"Cannot read '{file}': {error.strerror}.") from error
    if not isinstance(data, dict):
        raise InputError(f"'{file}' is no result, summary, campaign or plan.")
    return data


def _content(data: Mapping[str, Any]) -> Content:
    """Return the content of a JSON file, told apart by what is in it."""
    given = dict(_flat({name: data.get(name, {}) for name in ("config", "versions")}))
    if "contact" in data and "free" in data:
        return Content("a plan", plan_values(data))
    if "metrics" in data:
        metrics: dict[str, dict[str, Value]] = {}
        for row in data["metrics"]:
            if row["now"] is not None:
                metrics.setdefault(row["case"], {})[row["metric"]] = float(row["now"])
        return Content("metrics of regress", metrics, given)
    if isinstance(data.get("cases"), dict):
        return Content("metrics of regress", {k: _numbers(v) for k, v in data["cases"].items()})
    if "cases" in data:
        return Content(f"a result of {data['command']}", _cases(data), given)
    if "steps" in data and "verdict" in data:
        return Content(f"a result of {data['command']}", _steps(data), given)
    if "points" in data and "ended" in data:
        return Content("a summary of a campaign", _summary(data), given)
    raise ValueError("it is no result, summary, campaign or plan")


def _steps(data: Mapping[str, Any]) -> Values:
    """Return the values of an assembly; CPU time is that of the machine and is left out."""
    values: dict[str, Mapping[str, Value]] = {"run": _run(data)}
    for step in data["steps"]:
        text = {name: str(step[name]) for name in ("operation", "verdict")}
        numbers = {"sim_seconds": step["sim_seconds"], **step["measured"]}
        values[step["name"]] = text | _numbers(numbers)
    return values


def _run(data: Mapping[str, Any]) -> Mapping[str, Value]:
    failure = data.get("failure", {"phase": "none"})
    texts = {"verdict": data["verdict"], "failed phase": failure["phase"]}
    return texts | {"product": data["product"], "order": ", ".join(data["order"])}


def _cases(data: Mapping[str, Any]) -> Values:
    values: dict[str, Mapping[str, Value]] = {"run": {"verdict": str(data["verdict"])}}
    for case in data["cases"]:
        label = [data["command"], case["part"], case["posture"], case.get("direction")]
        rate = {"success_rate": case["successes"] / case["trials"]}
        values["/".join(filter(None, label))] = _numbers(rate | case["measured"])
    return values


def _summary(data: Mapping[str, Any]) -> Values:
    """Return rates and means over the trials, with half of their 95 % intervals."""
    values: dict[str, Mapping[str, Value]] = {
        "campaign": {
            "verdict": str(data["verdict"]),
            "trials": str(data["trials"]),
            **_rate(data["success"], data["success"] + data["failure"]),
            **{name: _mean(found) for name, found in data["measured"].items()},
        }
    }
    if len(data["points"]) > 1:
        for point in data["points"]:
            values[_label(point["parameters"])] = _rate(point["successes"], point["trials"])
    return values


def _rate(successes: int, trials: int) -> dict[str, Value]:
    if trials == 0:
        return {}
    low, high = wilson(successes, trials)
    return {"success_rate": Mean(successes / trials, (high - low) / 2)}


def _mean(found: Mapping[str, float]) -> Mean:
    # The deviation of the mean, for many trials.
    return Mean(found["mean"], 1.96 * found["deviation"] / math.sqrt(found["trials"]))


def _campaign(index: Path) -> Content:
    """Return the trials of a campaign one by one, matched by what varies and by their seeds."""
    import pyarrow as pa
    import pyarrow.parquet as parquet

    out = index.parent
    try:
        keys = parquet.read_table(index, columns=["key"])["key"].to_pylist()
    except pa.ArrowException as error:
        raise ValueError(f"it is no index of a campaign: {error}") from error
    values: dict[str, Mapping[str, Value]] = {}
    experiments, given = set(), {}
    for key in keys:
        row = read_trial(trial_file(out, key))
        place = _label(dict(row.varied) | {"seed": row.seed})
        text = {"verdict": row.verdict, "failed phase": row.phase or "none"}
        values[place] = text | _numbers(row.measured)
        experiments.add(row.experiment)
    if (out / "summary.json").exists():
        summary = _read_json(out / "summary.json")
        given = dict(_flat({name: summary.get(name, {}) for name in ("config", "versions")}))
    return Content(f"a campaign of {', '.join(sorted(experiments))}", values, given)


def _label(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value}" for name, value in parameters.items()) or "all"


def _numbers(values: Mapping[str, Any]) -> dict[str, Value]:
    """Return what is a finite number."""
    found = {name: float(value) for name, value in values.items() if value is not None}
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _flat(tree: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(tree, dict):
        for name, value in tree.items():
            yield from _flat(value, f"{path}.{name}" if path else name)
    else:
        yield path, tree
