"""The command line: what it accepts, what it refuses, and how."""

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from cell.errors import BadOrder
from cell.products.read_options import ReadOptions
from experiments.cli.main import main, one_line, parse
from experiments.plan.options import PlanOptions


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    """Put stand-ins in the place of the two commands; return the calls that they get."""
    calls = []

    def run_plan(product, order, options, explain, out, *, config, html):
        if order == ("unknown",):
            raise BadOrder("No such part.")
        print("a table")
        calls.append(
            dict(product=product, order=order, options=options, explain=explain, html=html)
        )
        (out / "plan.json").write_text("{}")
        return 1 if product == "stuck" else 0

    def run_job(job):
        calls.append(vars(job))
        return 0

    for name, function in (("plan.command", run_plan), ("assembly.assemble", run_job)):
        module = ModuleType(f"experiments.{name}")
        setattr(module, function.__name__, function)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return calls


def test_plan_gets_its_options(calls: list[dict], tmp_path: Path) -> None:
    options = ["--order", "a,b", "--units", "in", "--explain", "--out", str(tmp_path)]
    options += [
        "--density",
        "7850",
        "--density",
        "a=1000",
        "--group",
        "--tolerance-mm",
        "0.02",
        "--up=-z",
    ]
    options += ["--split", "--depth", "2", "--leave-out", "b", "--leave-out", "c/d"]
    assert main(["plan", "folder", *options, "--no-cache", "--no-html"]) == 0
    read = ReadOptions(
        units="in",
        densities={"": 7850.0, "a": 1000.0},
        group=True,
        split=True,
        leave_out=("b", "c/d"),
        depth=2,
        tolerance=1e-3 * 0.02,
    )
    expected = PlanOptions(read, 1e-3 * 0.02, up="-z")
    (call,) = calls
    assert call == dict(
        product="folder", order=("a", "b"), options=expected, explain=True, html=False
    )
    assert main(["plan", "folder", "--out", str(tmp_path)]) == 0
    assert calls[1]["html"] is True
    assert (tmp_path / "plan.json").exists()


def test_matrices_are_kept_in_the_users_cache(calls, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert main(["plan", "folder", "--out", str(tmp_path)]) == 0
    assert calls[0]["options"] == PlanOptions(cache=tmp_path / "cache" / "soft-jig")


def test_assemble_gets_its_options(calls: list[dict], tmp_path: Path) -> None:
    replay = tmp_path / "replay" / "run.html"
    options = ["--order", "plate, motor,bolts", "--replay", str(replay), "--view", "--seed", "3"]
    options += ["--set", "simulation.time_step=5e-4", "--out", str(tmp_path / "out")]
    assert main(["assemble", *options]) == 0
    (call,) = calls
    assert call["product"].name == "motor_unit"
    assert call["order"] == ("plate", "motor", "bolts")
    assert call["config"].simulation.time_step == 5e-4
    assert (call["seed"], call["view"], call["quiet"]) == (3, True, False)
    assert call["out"].is_dir()
    assert call["replay"] == replay
    assert replay.parent.is_dir()


def test_options_are_the_same_for_every_command(tmp_path: Path) -> None:
    options = ["--seed", "7", "--out", str(tmp_path), "--config", "c.yaml", "--quiet"]
    options += ["--set", "simulation.time_step=2e-3", "--set", "a.b=[1, 2]"]
    plan, assemble = parse(["plan", "x", *options]), parse(["assemble", *options])
    assert plan.common == assemble.common
    assert plan.common.seed == 7
    assert plan.common.overrides == ("simulation.time_step=2e-3", "a.b=[1, 2]")


def test_verdict_becomes_the_exit_code(calls: list[dict], tmp_path: Path) -> None:
    assert main(["plan", "stuck", "--out", str(tmp_path)]) == 1


def test_quiet_prints_nothing(
    calls: list[dict], tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    main(["plan", "x", "--out", str(tmp_path)])
    assert capsys.readouterr().out == "a table\n"
    main(["plan", "x", "--out", str(tmp_path), "--quiet"])
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "A command is missing. Known: plan, assemble, init, check, place, push, regress,"),
        ("asemble", "No command 'asemble'. Did you mean 'assemble'? Known: assemble,"),
        ("plan", "Missing from soft-jig plan: PRODUCT"),
        ("plan a b", "Unrecognized options: b"),
        ("plan a --explan", "Unrecognized options: --explan. Did you mean '--explain'?"),
        ("plan a --seed x", "Error parsing --seed"),
        ("plan a --seed -1", "--seed must be >= 0, not -1."),
        ("plan a --set", "Missing value for argument '--set'"),
        ("plan a --set simulation.time_stp=1", "Did you mean 'simulation.time_step'?"),
        ("plan a --set simulation.time_step=1", "must be > 0 and <= 0.005 s, not 1."),
        ("plan a --config nowhere.yaml", "'nowhere.yaml'"),
        ("plan a --order unknown", "No such part."),
        ("assemble no_such_product", "no_such_product"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    line: str, message: str, calls: list[dict], tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "deep" / "out"
    arguments = line.split()
    assert main([*arguments, "--out", str(out)] if arguments else []) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.startswith("soft-jig: ")
    assert printed.err.count("\n") == 1
    assert "Traceback" not in printed.err
    assert not list(tmp_path.iterdir())
    assert not calls


def test_folder_that_cannot_be_written_is_found_before_the_work(
    calls: list[dict], tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    occupied = tmp_path / "file"
    occupied.write_text("kept")
    for out in (occupied, occupied / "below"):
        assert main(["plan", "x", "--out", str(out)]) == 2
        assert str(out) in capsys.readouterr().err
    assert not calls
    assert occupied.read_text() == "kept"


@pytest.mark.parametrize("command", [[], ["plan"], ["assemble"]])
def test_help_succeeds(command: list[str], capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as stop:
        main([*command, "--help"])
    assert not stop.value.code
    assert "soft-jig" in capsys.readouterr().out


BOXED = """\
╭─ Unrecognized options ─────╮
│ Unrecognized options: --a  │
│ ────────────────────────── │
│ Perhaps you meant:         │
│     --about                │
╰────────────────────────────╯
"""
UNBOXED = """\
 Unrecognized options
 ----------------------------
  Unrecognized options: --a
  ---------------------------
  Perhaps you meant:
      --about
"""


@pytest.mark.parametrize("complaint", [BOXED, UNBOXED])
def test_complaint_becomes_one_line(complaint: str) -> None:
    """With Unicode on the terminal and without."""
    line = "Unrecognized options: --a. Did you mean '--about'? See soft-jig --help."
    assert one_line(complaint) == line


def test_complaint_of_another_shape_keeps_its_text() -> None:
    """A change of tyro's layout may cost polish, never the message."""
    assert one_line("plain text\nin two lines.") == "plain text in two lines. See soft-jig --help."


def test_error_that_is_not_ours_is_one_line_with_its_traceback_in_a_file(
    calls: list[dict],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("cell.configuration.config.CellConfig.load", lambda *_: 1 / 0)
    assert main(["plan", "x", "--out", str(tmp_path / "out")]) == 3
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "ZeroDivisionError: division by zero" in line
    (file,) = tmp_path.glob("soft-jig-*.txt")
    assert file.name in line
    assert "Traceback" in file.read_text()


def test_module_runs_like_the_console_script() -> None:
    command = [sys.executable, "-m", "experiments", "bogus"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
