"""Calibration: records are read or refused, the inference is right, hidden numbers are found."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from rich.console import Console

from cell import CellConfig
from experiments.calibrate_jig import main
from experiments.calibration.bench import TESTS, BenchTest, force_name, mean_forces, simulate
from experiments.calibration.design import Design, design_points, run_designs, trials_at
from experiments.calibration.emulator import Emulator, error_covariance
from experiments.calibration.free_numbers import FREE, shown_in
from experiments.calibration.plot import plot
from experiments.calibration.posterior import Observation, Posterior, sample_posterior
from experiments.calibration.record import GAUGE_PLAY, Record, noise_of, read_record, repeats
from experiments.calibration.summary import configuration, number_rows, result
from experiments.campaigns.campaign import run_campaign
from experiments.jig.curves import Curve
from experiments.jig.element_rig import ElementRig
from experiments.jig.element_tests import UP, parameters
from experiments.jig.specimens import Prism

NOISE = 0.05  # Of a force plate [N].
HEADER = "# test: push sealed\n# depth_mm: 10\n# vacuum_kPa: 80\n# friction: 0.8\n"


def text_of(curve: Curve, header: str = HEADER) -> str:
    rows = zip(curve.displacement * 1e3, curve.force, strict=True)
    return header + "displacement_mm,force_N\n" + "".join(f"{x:.4f},{f:.4f}\n" for x, f in rows)


def measured(curve: Curve, rng: np.random.Generator) -> Curve:
    """Return a curve as a gauge with play and an unknown zero and a noisy plate record it."""
    way = np.linspace(curve.displacement[0], curve.displacement[-1], 400)
    force = np.interp(way, np.maximum.accumulate(curve.displacement), curve.force)
    shown = way + 0.01e-3 * rng.standard_normal() + 0.001e-3 * rng.standard_normal(len(way))
    order = np.argsort(shown)
    return Curve(shown[order], (force + NOISE * rng.standard_normal(len(way)))[order])


def stand_in(test: BenchTest, shares: np.ndarray) -> np.ndarray:
    """Return mean forces (n, k) of a made-up jig: powers of its numbers, and a bend."""
    edges = np.array(test.edges[:6])
    middle = (edges[1:] + edges[:-1]) / 2 / edges[-1]
    logs = 1.0 + np.log(middle) * (0.2 + 0.3 * shares[:, :1]) + 1.5 * shares[:, 1:2]
    return np.exp(logs + (0.4 * shares[:, 2:3] ** 2 if shares.shape[1] > 2 else 0.0))


def record_of(test: BenchTest, forces: np.ndarray, rng: np.random.Generator) -> Record:
    """Return a record whose mean forces are those given, and noise of the plate."""
    edges = np.array(test.edges[:6])
    way = np.linspace(edges[0], edges[-1], 500)
    force = forces[np.minimum(np.searchsorted(edges, way, side="right") - 1, 4)]
    curve = Curve(way, force + NOISE * rng.standard_normal(500))
    return Record("made up", test, {"bag": test.bag}, 90e3, curve, NOISE)


def design_of(test: BenchTest) -> Design:
    numbers, shares = design_points(test, 32, 0)
    names = [force_name(test.action, a, b) for a, b in pairwise(test.edges[:6])]
    return Design(numbers, shares, names, stand_in(test, shares))


def test_mean_forces_are_the_work_over_the_way() -> None:
    way = np.linspace(0.0, 3e-3, 31)
    for name, force in mean_forces(TESTS["push vented"], Curve(way, 2e3 * way)).items():
        low, high = (float(x) for x in name.split("_")[1:4:2])
        assert force == pytest.approx(low + high, rel=1e-9)


def test_pull_after_a_restored_push_is_a_pull() -> None:
    """Nothing of the push is left when the state before it is taken again."""
    part = Prism()
    curve = simulate(parameters(), "vented", part, 0.010)["pull"]
    params = parameters()
    params = replace(params, vacuum=replace(params.vacuum, time_constant=0.05))
    rig = ElementRig(params, part)
    rig.lower_to(0.010, speed=0.04)
    rig.jam(0.1)
    rig.let_go(0.05)
    alone = rig.drag(np.array([0.0, 0.0, part.length]), UP, 0.001, 0.02)
    assert curve.force[: len(alone.force)] == pytest.approx(alone.force, abs=1e-9)
    assert alone.force.max() > 2.0


def test_record_is_read_with_units_and_noise(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    way = np.linspace(0, 3e-3, 600)
    curve = Curve(way, 5 + 1e3 * way + NOISE * rng.standard_normal(600))
    (file := tmp_path / "a.csv").write_text(text_of(curve))
    record = read_record(file)
    assert record.vacuum == 80e3
    assert record.options["depth"] == pytest.approx(0.010)
    assert record.options["friction"] == 0.8
    assert record.noise == pytest.approx(NOISE, rel=0.15)
    assert noise_of(curve) == pytest.approx(NOISE, rel=0.15)
    assert record.curve.displacement == pytest.approx(way, abs=1e-7)
    other = text_of(Curve(way * 1e-3, curve.force / 1e3)).replace("force_N", "force_kN")
    file.write_text(other.replace("displacement_mm", "displacement_m"))
    # Four decimals of a kN are coarse; units are what is tested.
    assert read_record(file).curve.force == pytest.approx(curve.force, abs=0.06)


GOOD = text_of(Curve(np.linspace(0, 3e-3, 50), np.full(50, 4.0)))
BAD = {
    "columns": (GOOD.replace("force_N", "load_N"), "force_N or force_kN"),
    "unit": (GOOD.replace("displacement_mm", "displacement_in"), "displacement_mm"),
    "no rows": (HEADER, "empty"),
    "columns only": (HEADER + "displacement_mm,force_N\n", "0 rows"),
    "backwards": (GOOD.replace("2.9388,", "2.5,"), "displacement falls"),
    "test": (GOOD.replace("push sealed", "push seald"), "Did you mean 'push sealed'"),
    "no test": (GOOD.replace("# test", "# tset"), "push vented"),
    "entry": (GOOD.replace("friction", "fricton"), "Did you mean 'friction'"),
    "entry's unit": (GOOD.replace("vacuum_kPa", "vacuum_psi"), "vacuum_kPa"),
    "range": (GOOD.replace("depth_mm: 10", "depth_mm: 0.01"), "depth_mm"),
    "no depth": (GOOD.replace("# depth_mm: 10\n", ""), "depth_mm"),
    "text": (GOOD.replace("2.9388,4.0000", "2.9388,four"), "'four'"),
    "infinite": (GOOD.replace("2.9388,4.0000", "2.9388,nan"), "not a number"),
    "short": (text_of(Curve(np.linspace(0, 1e-4, 50), np.full(50, 4.0))), "0.05 to 0.15 mm"),
    "sign": (GOOD.replace(",4.0000", ",-4.0000"), "positive"),
    "height": (GOOD.replace("depth_mm: 10", "depth_mm: 30"), "meets nothing"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_record_is_one_line_with_the_alternatives(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, culprit = BAD[name]
    (file := tmp_path / "log.csv").write_text(text)
    assert main([str(file), "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert culprit in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        ("--samples 31", "--samples"),
        ("--samples 8", "--samples"),
        ("--model-error 2", "--model-error"),
        ("--workers 0", "--workers"),
    ],
)
def test_bad_usage_is_named(
    arguments: str, culprit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file := tmp_path / "log.csv").write_text(GOOD)
    assert main([str(file), *arguments.split(), "--out", str(tmp_path / "out")]) == 2
    assert culprit in capsys.readouterr().err


def test_play_of_the_gauge_is_no_fault(tmp_path: Path) -> None:
    way = np.linspace(0, 3e-3, 50)
    way[20:30] -= way[20] - way[19] + 0.5 * GAUGE_PLAY
    (file := tmp_path / "log.csv").write_text(text_of(Curve(way, np.full(50, 4.0))))
    assert np.all(np.diff(read_record(file).curve.displacement) >= 0)


@pytest.mark.parametrize("number", FREE, ids=lambda number: number.path)
def test_priors_are_valid_settings_around_the_default(number) -> None:
    for share in (0.0, 1.0):
        CellConfig.load("default", {number.path: float(number.value(np.array(share)))})
    assert number.share(number.value(np.array(0.3))) == pytest.approx(0.3)


def test_emulator_states_its_own_error() -> None:
    """Left out, simulations are predicted as well as new points are."""
    test = TESTS["push vented"]
    design, rng = design_of(test), np.random.default_rng(1)
    emulator = Emulator.fit(design.shares, design.forces)
    new = rng.random((500, 4))
    off = emulator.predict(new) - np.log(stand_in(test, new))
    actual = np.sqrt(np.mean(off**2, axis=0))
    assert np.all(emulator.relative_error < 0.02)
    assert np.all(actual < 3 * emulator.relative_error + 1e-4)


def test_covariance_of_few_errors_is_widened() -> None:
    """Of ten errors of four forces, its inverse is (10 - 4 - 2) / (10 - 4 - 1) on average: safe."""
    rng = np.random.default_rng(10)
    inverses = [np.linalg.inv(error_covariance(rng.standard_normal((4, 10)))) for _ in range(2000)]
    assert np.mean(inverses, axis=0) == pytest.approx(0.8 * np.eye(4), abs=0.1)


def test_posterior_of_a_straight_line_is_that_of_least_squares() -> None:
    """Logarithms that are linear in the numbers: mean and covariance are known."""
    test, rng = TESTS["press"], np.random.default_rng(2)
    design = design_of(test)
    truth = np.array([[0.5, 0.4]])
    record = record_of(test, stand_in(test, truth)[0], rng)
    observed = Observation.of([record], design, design.numbers, model_error=0.05)
    found = sample_posterior([observed], design.numbers, seed=0, steps=1500)
    slopes = np.log(stand_in(test, np.eye(2)) / stand_in(test, np.zeros((1, 2)))).T
    weights = np.linalg.inv(observed.covariance)
    covariance = np.linalg.inv(slopes.T @ weights @ slopes)
    off = np.log(observed.forces / stand_in(test, np.zeros((1, 2)))[0])
    mean = covariance @ slopes.T @ weights @ off
    assert found.shares.mean(axis=0) == pytest.approx(mean, abs=0.02)
    assert np.cov(found.shares.T) == pytest.approx(covariance, rel=0.15)
    assert found.effective > 500


def test_scatter_of_repeats_counts() -> None:
    """Three that agree leave the twin's 5 %; three that scatter by 22 % add 13 %."""
    test, rng = TESTS["press"], np.random.default_rng(8)
    design, forces = design_of(test), stand_in(TESTS["press"], np.full((1, 2), 0.5))[0]
    same, apart = (
        Observation.of([record_of(test, k * forces, rng) for k in factors], design, FREE, 0.05)
        for factors in ((1.0, 1.0, 1.0), (0.8, 1.0, 1.25))
    )
    assert np.sqrt(np.diag(same.covariance)) == pytest.approx(0.05, rel=0.02)
    assert np.sqrt(np.diag(apart.covariance)) == pytest.approx(np.hypot(0.05, 0.129), rel=0.05)
    assert apart.forces == pytest.approx(forces, rel=0.02)


def test_records_of_one_test_are_its_repeats() -> None:
    rng = np.random.default_rng(9)
    a, b = (record_of(TESTS[name], np.ones(5), rng) for name in ("push vented", "pull vented"))
    assert [len(group) for group in repeats([a, b, a])] == [2, 1]


def test_same_seed_gives_the_same_draws() -> None:
    test, rng = TESTS["press"], np.random.default_rng(3)
    design = design_of(test)
    record = record_of(test, stand_in(test, np.full((1, 2), 0.5))[0], rng)
    observed = Observation.of([record], design, design.numbers, 0.05)
    draws = [sample_posterior([observed], design.numbers, seed=4, steps=50) for _ in range(2)]
    assert np.array_equal(draws[0].shares, draws[1].shares)


def test_intervals_of_the_stand_in_hold_its_hidden_numbers() -> None:
    """Of 20 jigs drawn from the prior, 95 % intervals hold all but a few numbers."""
    test, rng = TESTS["press"], np.random.default_rng(5)
    design = design_of(test)
    held = widths = 0.0
    for truth in rng.random((20, 1, 2)):
        record = record_of(test, stand_in(test, truth)[0], rng)
        observed = Observation.of([record], design, design.numbers, model_error=0.0)
        found = sample_posterior([observed], design.numbers, seed=6, steps=200)
        low, high = np.quantile(found.shares, (0.025, 0.975), axis=0)
        held += np.mean((low <= truth[0]) & (truth[0] <= high)) / 20
        widths += found.width.mean() / 20
    assert held >= 0.85
    assert widths < 0.3


def some_posterior() -> tuple[list[Observation], Posterior]:
    test, rng = TESTS["push sealed"], np.random.default_rng(7)
    design = design_of(test)
    record = record_of(test, stand_in(test, np.full((1, 5), 0.5))[0], rng)
    observed = [Observation.of([record], design, design.numbers, 0.05)]
    return observed, sample_posterior(observed, design.numbers, seed=0, steps=300)


def test_what_no_record_shows_is_called_undecided() -> None:
    """The stand-in does not depend on its last two numbers: their intervals are the prior's."""
    observed, posterior = some_posterior()
    rows = number_rows(posterior)
    assert [row["decided"] for row in rows[:2]] == [True, True]
    assert not any(row["decided"] for row in rows[3:])
    assert all(row["width_of_prior"] > 0.9 for row in rows[3:])
    assert result(observed, posterior)["verdict"] == "success"


def test_record_that_the_twin_cannot_follow_is_a_failure() -> None:
    observed, posterior = some_posterior()
    wild = replace(observed[0], forces=observed[0].forces * np.array([1, 3, 0.3, 3, 0.3]))
    assert result([wild], posterior)["verdict"] == "failure"


def test_configuration_can_be_loaded(tmp_path: Path) -> None:
    _, posterior = some_posterior()
    (file := tmp_path / "calibrated.yaml").write_text(configuration(posterior))
    config = CellConfig.load(str(file))
    values = dict(zip([n.path for n in posterior.numbers], posterior.point, strict=True))
    assert config.jig.jammed.modulus == pytest.approx(values["jig.jammed.modulus"], rel=1e-3)
    assert config.jig.suction.strength == pytest.approx(values["jig.suction.strength"], rel=1e-3)
    assert set(yaml.safe_load(file.read_text())) == {"jig"}


def test_picture_has_a_field_per_record_and_number() -> None:
    observed, posterior = some_posterior()
    axes = plot(observed, posterior, seed=0).axes
    assert sum(axis.axison for axis in axes) == 1 + 5


# Coarser in time than the default, half as dear; records and design alike.
SLOW_CONFIG = {"simulation.time_step": 2e-3}
HIDDEN_JIGS = 10


def hidden_records(folder: Path) -> list[list[Record]]:
    """Return the five records of each of ten jigs, whose numbers are drawn from the prior."""
    rng, config = np.random.default_rng(2026), CellConfig.load("default", SLOW_CONFIG)
    shares, found = hidden_shares(), [[] for _ in range(HIDDEN_JIGS)]
    for test in TESTS.values():
        depth = 15 if test.action == "press" else 10
        header = f"# test: {test.name}\n# depth_mm: {depth}\n# friction: 0.8\n"
        blank = Curve(np.linspace(0, 0.02, 50), np.ones(50))
        (file := folder / "log.csv").write_text(text_of(blank, header))
        numbers = shown_in([test])
        columns = [FREE.index(number) for number in numbers]
        planned = trials_at(read_record(file), numbers, shares[:, columns], config)
        rows = run_campaign(planned, folder / "hidden", report=False)
        for k, row in enumerate(rows):
            (curves,) = (folder / "hidden" / name for name in row.files)
            curve = Curve(*np.load(curves)[test.action].T)
            file.write_text(text_of(measured(curve, rng), header))
            found[k].append(read_record(file))
    return found


def hidden_shares() -> np.ndarray:
    return np.random.default_rng(2026).random((HIDDEN_JIGS, len(FREE)))


@pytest.mark.slow
def test_hidden_numbers_of_the_twin_are_recovered(tmp_path: Path) -> None:
    """Of ten jigs by five records: 95 % intervals hold at least 90 % of the hidden numbers."""
    jigs, truth = hidden_records(tmp_path), hidden_shares()
    config = CellConfig.load("default", SLOW_CONFIG)
    designs = run_designs(
        jigs[0], config, tmp_path, samples=64, seed=0, workers=1, console=Console(quiet=True)
    )
    held, widths = np.zeros((HIDDEN_JIGS, len(FREE))), np.zeros((HIDDEN_JIGS, len(FREE)))
    for k, records in enumerate(jigs):
        numbers = list(FREE)
        pairs = zip(records, designs, strict=True)
        observed = [Observation.of([record], design, numbers, 0.05) for record, design in pairs]
        posterior = sample_posterior(observed, numbers, seed=k, steps=1000)
        low, high = np.quantile(posterior.shares, (0.025, 0.975), axis=0)
        held[k] = (low <= truth[k]) & (truth[k] <= high)
        widths[k] = posterior.width
    assert held.mean() >= 0.9
    assert np.all(held.sum(axis=0) >= 8)
    widest = dict(zip([number.path for number in FREE], np.median(widths, axis=0), strict=True))
    assert widest["jig.soil.membrane_modulus"] < 0.3
    assert widest["jig.suction.strength"] < 0.6
