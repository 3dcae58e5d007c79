"""Where a campaign takes its trials: grids, Sobol and Latin-hypercube samples, seeds."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cell.configuration.config import CellConfig
from cell.configuration.sections import entries
from cell.errors import InputError, UnknownName
from cell.yaml_text import parse_yaml
from experiments.campaigns.catalogue import Experiment, Function, experiment_named, name_of
from experiments.campaigns.code_version import code_digest, trial_key
from experiments.campaigns.trial import Trial

Point = Mapping[str, Any]
"""Value by name: a path in the configuration, or an option of the experiment."""

DESIGNS = ("sobol", "lhs")
MOST = 1_000_000  # [A] Trials of a campaign: their list still fits into memory.


def grid(axes: Mapping[str, Sequence[Any]]) -> list[Point]:
    """Return every combination of the values of some names; one empty point for no names."""
    for name, values in axes.items():
        if not values:
            raise InputError(f"--grid {name}: it needs at least one value.")
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def sample(
    ranges: Mapping[str, tuple[float, float]], number: int, design: str = "sobol", seed: int = 0
) -> list[Point]:
    """Return points that fill a box evenly; one empty point for no names.

    Args:
        ranges: Lower and upper end by name.
        number: Of points; a power of 2 for Sobol's, whose balance holds for those only.
        design: "sobol" (scrambled) or "lhs" (Latin hypercube).
        seed: Of the scrambling, or of the hypercube.
    """
    if not ranges:
        return [{}]
    if design not in DESIGNS:
        raise UnknownName("design", design, DESIGNS)
    for name, (low, high) in ranges.items():
        if not low < high:
            raise InputError(f"--sample {name}={low:g}:{high:g}: the first end must be smaller.")
    if number < 1:
        raise InputError(f"--samples must be at least 1, not {number}.")
    if design == "sobol" and number & (number - 1):
        raise InputError(
            f"--samples {number}: Sobol's points are balanced for powers of 2 only; take "
            f"{1 << (number.bit_length() - 1)} or {1 << number.bit_length()}, or --design lhs."
        )
    from scipy.stats import qmc  # Half a second that workers can do without.

    engine = qmc.Sobol if design == "sobol" else qmc.LatinHypercube
    unit = engine(len(ranges), rng=seed).random(number)
    lows, highs = zip(*ranges.values(), strict=True)
    scaled = qmc.scale(unit, lows, highs)
    return [dict(zip(ranges, row, strict=True)) for row in scaled.tolist()]


def combined(*designs: Sequence[Point]) -> list[Point]:
    """Return every combination of the points of several designs.

    Raises:
        InputError: Two of them give the same name.
    """
    points = []
    for chosen in itertools.product(*designs):
        names = [name for point in chosen for name in point]
        if twice := {name for name in names if names.count(name) > 1}:
            raise InputError(f"'{min(twice)}' is both in a grid and sampled.")
        points.append({name: value for point in chosen for name, value in point.items()})
    return points


def parse_grid(texts: Sequence[str]) -> dict[str, list[Any]]:
    """Return the values by name of texts "key=a,b,c", each value written as in YAML."""
    axes: dict[str, list[Any]] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        try:
            axes[name.strip()] = parse_yaml(f"[{values}]", "It") if equals else []
        except InputError:
            axes[name.strip()] = []
        if not name.strip() or not axes[name.strip()]:
            raise InputError(f"--grid {text}: write it like jig.vacuum.pressure=30e3,60e3,90e3.")
    return axes


def parse_sample(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the range by name of texts "key=lo:hi"."""
    ranges = {}
    for text in texts:
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        try:
            ranges[name.strip()] = float(low), float(high)
        except ValueError:
            raise InputError(f"--sample {text}: write it like push.speed=0.1:0.3.") from None
    return ranges


def trials(
    experiment: str | Function,
    points: Sequence[Point] = ({},),
    *,
    product: str = "motor_unit",
    config: CellConfig | None = None,
    seeds: Sequence[int] = (0,),
) -> list[Trial]:
    """Return the trials of a campaign, one per point and seed; what is the same is there once.

    Args:
        experiment: Its name, or its function, at the top of a file.
        points: Values of settings and options; ``product`` is one, too.
        product: A name in ``models/products``, or a file.
        config: Of what the points do not give; None for the defaults.
        seeds: Of each point.

    Raises:
        InputError: A name is unknown, or a value impossible. Nothing has run yet.
    """
    if len(points) * len(seeds) > MOST:
        raise InputError(f"{len(points)} points with {len(seeds)} seeds: {MOST} trials at most.")
    found = experiment_named(experiment if isinstance(experiment, str) else name_of(experiment))
    code = code_digest(found.script)
    config = config or CellConfig.load()
    each = (_trial(found, code, product, config, p, s) for p in points for s in seeds)
    return list({trial.key: trial for trial in each}.values())


def _trial(
    experiment: Experiment, code: str, product: str, config: CellConfig, point: Point, seed: int
) -> Trial:
    options = dict(experiment.options)
    own = {name: value for name, value in point.items() if name in options}
    settings = {k: v for k, v in point.items() if k not in options and k != "product"}
    for name, value in own.items():
        options[name] = _as_declared(experiment, name, value)
    product = str(point.get("product", product))
    for name in settings:
        if "." not in name:  # A path is looked up in the configuration, which knows its sections.
            raise UnknownName(f"option of '{experiment.label}'", name, [*options, "product"])
    config = config.with_changes(settings)
    values = {entry.path: entry.value for entry in entries(config)} | options
    varied = {name: values.get(name, product) for name in point}
    key = trial_key(experiment.label, product, config, seed, options, code)
    return Trial(experiment.name, product, config, seed, options, varied, code, key)


def _as_declared(experiment: Experiment, name: str, value: Any) -> Any:
    """Return the value of an option as the type of its default."""
    default = experiment.options[name]
    if default is None or isinstance(default, bool) and isinstance(value, bool):
        return value
    try:
        return type(default)(value)
    except (TypeError, ValueError):
        kind = type(default).__name__
        raise InputError(f"Option '{name}' must be a {kind}, not {value!r}.") from None


def settings_of(config: CellConfig) -> Iterator[tuple[str, Any]]:
    """Yield path and value of every setting that differs from the defaults."""
    usual = {entry.path: entry.value for entry in entries(CellConfig())}
    for entry in entries(config):
        if entry.path not in usual or entry.value != usual[entry.path]:
            yield entry.path, entry.value
