"""Records of a test bench: a CSV file with a header, checked to the last row.

# test: push vented
# depth_mm: 10
# vacuum_kPa: 90
displacement_mm,force_N
0.000,0.02
...
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from cell.errors import InputError, UnknownName
from experiments.calibration.bench import TESTS, BenchTest, force_name, mean_forces
from experiments.jig.curves import Curve
from experiments.jig.element_tests import PUSH_HEIGHT
from experiments.jig.specimens import Prism

FEWEST_ROWS = 20
# By how much a displacement may fall behind the largest before: the play of a gauge [m] [A].
GAUGE_PLAY = 0.02e-3

LENGTH = {"mm": 1e-3, "um": 1e-6, "m": 1.0}
FORCE = {"N": 1.0, "kN": 1e3, "mN": 1e-3}
COLUMNS = {"displacement": LENGTH, "force": FORCE}


class BadRecord(InputError):
    """A record that cannot be used, with file and culprit."""


@dataclass(frozen=True)
class Entry:
    """What a line of the header may say.

    Attributes:
        units: Factor to SI by unit; empty for a plain number.
        low: Least value, in SI.
        high: Largest value, in SI.
        default: Value if there is no such line; None if there must be one.
    """

    units: Mapping[str, float]
    low: float
    high: float
    default: float | None = None


ENTRIES = {
    "depth": Entry(LENGTH, 1e-3, 0.05),
    "vacuum": Entry({"kPa": 1e3, "Pa": 1.0, "mbar": 100.0}, 1e3, 101.325e3, 90e3),
    "height": Entry(LENGTH, 1e-3, 0.3, PUSH_HEIGHT),
    "radius": Entry(LENGTH, 2e-3, 0.05, Prism.radius),
    "length": Entry(LENGTH, 5e-3, 0.3, Prism.length),
    "mass": Entry({"g": 1e-3, "kg": 1.0}, 1e-3, 5.0, Prism.mass),
    "friction": Entry({}, 0.05, 2.0, Prism.friction),
}


@dataclass(frozen=True)
class MeanForce:
    """The mean force between two displacements.

    Attributes:
        mean: [N].
        noise: Its standard deviation [N].
        slope: Of the force there [N/m].
    """

    mean: float
    noise: float
    slope: float


@dataclass(frozen=True)
class Record:
    """A record.

    Attributes:
        name: Of its file.
        test: Which test it is of.
        options: Of the experiment "bench", in SI, the bag among them.
        vacuum: Under which the bag was frozen [Pa].
        curve: Force over displacement, which does not fall.
        noise: Standard deviation of single forces [N].
    """

    name: str
    test: BenchTest
    options: Mapping[str, str | float]
    vacuum: float
    curve: Curve
    noise: float

    @property
    def mean_forces(self) -> dict[str, MeanForce]:
        """Mean forces by their names in the experiment."""
        means, found = mean_forces(self.test, self.curve), {}
        way = self.curve.displacement
        for low, high in pairwise(self.test.edges):
            if (name := force_name(self.test.action, low, high)) in means:
                count = np.count_nonzero((way >= low) & (way <= high))
                slope = (self.curve.at(high) - self.curve.at(low)) / (high - low)
                noise = self.noise / math.sqrt(max(count, 1))
                found[name] = MeanForce(means[name], noise, slope)
        return found


def read_record(path: Path) -> Record:
    """Read a record.

    Raises:
        BadRecord: Header, columns or rows cannot be used.
        UnknownName: There is no such test.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        raise BadRecord(f"Cannot read '{path}': {error}.") from error
    header = [line[1:] for line in lines if line.lstrip().startswith("#")]
    rows = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    test, values = _header(path.name, header)
    curve = _curve(path.name, rows)
    vacuum = values.pop("vacuum")
    options: dict[str, str | float] = {"bag": test.bag, **values}
    _check(path.name, test, values, curve)
    return Record(path.name, test, options, vacuum, curve, noise_of(curve))


def repeats(records: Sequence[Record]) -> list[list[Record]]:
    """Return records in groups of the same test, in the order of their first."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        same = repr((record.test.name, sorted(record.options.items()), record.vacuum))
        groups.setdefault(same, []).append(record)
    return list(groups.values())


def noise_of(curve: Curve) -> float:
    """Return the standard deviation of single forces [N], from their second differences.

    The median leaves out the few where the force drops.
    """
    bends = curve.force[2:] - 2 * curve.force[1:-1] + curve.force[:-2]
    return float(np.median(np.abs(bends)) / (0.6745 * math.sqrt(6.0)))


def _header(file: str, lines: list[str]) -> tuple[BenchTest, dict[str, float]]:
    said: dict[str, str] = {}
    for key, _, value in (line.partition(":") for line in lines if ":" in line):
        said[key.strip()] = value.strip()
    if "test" not in said:
        raise BadRecord(f"{file}: the header lacks a line like '# test: push vented'.")
    if (name := said.pop("test")) not in TESTS:
        raise UnknownName(f"test, as in {file},", name, TESTS)
    values: dict[str, float] = {}
    for key, text in said.items():
        quantity, _, unit = key.partition("_")
        if quantity not in ENTRIES:
            raise UnknownName(f"header entry of {file}", key, map(_example, ENTRIES))
        entry = ENTRIES[quantity]
        if unit not in (entry.units or {"": 1.0}):
            raise BadRecord(f"{file}: write '{key}' as {_spelled(quantity, entry.units)}.")
        value = _number(file, key, text) * entry.units.get(unit, 1.0)
        if not entry.low <= value <= entry.high:
            factor = entry.units.get(unit, 1.0)
            ends = f"{entry.low / factor:g} and {entry.high / factor:g}"
            raise BadRecord(f"{file}: {key} must be between {ends}, not {text}.")
        values[quantity] = value
    for quantity, entry in ENTRIES.items():
        if quantity not in values and entry.default is None:
            raise BadRecord(f"{file}: the header lacks '{_example(quantity)}'.")
        values.setdefault(quantity, entry.default or 0.0)
    return TESTS[name], values


def _example(quantity: str) -> str:
    return "_".join([quantity, *list(ENTRIES[quantity].units)[:1]])


def _spelled(quantity: str, units: Mapping[str, float]) -> str:
    return " or ".join(f"{quantity}_{unit}" for unit in units) or quantity


def _number(file: str, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadRecord(f"{file}: {name} is '{text}', not a number.")
    return value


def _curve(file: str, lines: list[str]) -> Curve:
    """Return the columns in SI, sorted where the gauge has played."""
    rows = list(csv.reader(lines, skipinitialspace=True))
    if not rows:
        raise BadRecord(f"{file} is empty: it needs the columns displacement_mm,force_N.")
    names = [name.strip() for name in rows[0]]
    factors, places = {}, {}
    for quantity, units in COLUMNS.items():
        found = [name for name in names if name.partition("_")[0] == quantity]
        if len(found) != 1 or found[0].partition("_")[2] not in units:
            raise BadRecord(
                f"{file}: it needs one column {_spelled(quantity, units)}; its columns are "
                f"{', '.join(names)}."
            )
        factors[quantity] = units[found[0].partition("_")[2]]
        places[quantity] = names.index(found[0])
    if len(rows) - 1 < FEWEST_ROWS:
        raise BadRecord(f"{file} has {len(rows) - 1} rows below its columns, not {FEWEST_ROWS}.")
    values: dict[str, list[float]] = {quantity: [] for quantity in COLUMNS}
    for number, row in enumerate(rows[1:], start=1):
        if len(row) != len(names):
            raise BadRecord(f"{file}: row {number} has {len(row)} values, not {len(names)}.")
        for quantity, place in places.items():
            value = _number(file, f"{quantity} in row {number}", row[place])
            values[quantity].append(value * factors[quantity])
    way, force = np.array(values["displacement"]), np.array(values["force"])
    behind = np.maximum.accumulate(way) - way
    if behind.max() > GAUGE_PLAY:
        number = int(np.argmax(behind > GAUGE_PLAY)) + 1
        raise BadRecord(
            f"{file}: the displacement falls by {behind[number - 1] * 1e3:.3g} mm in row {number}; "
            f"up to {GAUGE_PLAY * 1e3:g} mm is taken as play. Cut the record there."
        )
    order = np.argsort(way, kind="stable")
    return Curve(way[order], force[order])


def _check(file: str, test: BenchTest, values: Mapping[str, float], curve: Curve) -> None:
    if values["length"] <= values["depth"]:
        raise BadRecord(f"{file}: depth {values['depth']:g} m is the specimen's whole length.")
    if test.action == "push" and values["height"] + values["depth"] > values["length"]:
        raise BadRecord(
            f"{file}: a push {values['height']:g} m above the bag, on a specimen of "
            f"{values['length']:g} m that is {values['depth']:g} m deep, meets nothing."
        )
    first, second = test.edges[:2]
    if not mean_forces(test, curve):
        ends = " to ".join(f"{x * 1e3:.3g}" for x in curve.span)
        wanted = f"{first * 1e3:g} to {second * 1e3:g} mm"
        raise BadRecord(f"{file} reaches from {ends} mm; a {test.action} needs {wanted} at least.")
    if np.mean(curve.force) <= 0:
        raise BadRecord(
            f"{file}: the mean force is {np.mean(curve.force):.3g} N; give it positive."
        )
