"""A run as a program: written, read back, and carried out again without planning, bit by bit."""

from __future__ import annotations

import json
import shutil
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from urscript_grammar import Refused, Script

from cell import Cell, CellConfig, load_product
from cell.errors import InputError, UnknownName
from cell.machines.gripper import GripperReading
from cell.simulation.conditions import All, Either, FirstOf, Height, LostGrasp, PushesBack, Steady
from cell.simulation.events import fix_part, receive_part
from cell.simulation.phase import Jaw, Phase, Spin, after, motion_finished
from cell.simulation.vocabulary import NotInWords, from_data, in_programs, to_data
from experiments import run_program
from experiments.assembly.assemble import run_job
from experiments.assembly.job import Job
from experiments.assembly.prepare import Disturbance
from planning.motion.timing import JointMotion
from planning.operations import station as station_module
from planning.operations.operation import Step
from planning.operations.pick_place import PICK_PLACE
from planning.operations.pick_place.phases import PlacePhase
from planning.operations.program import Program, Transcript
from planning.operations.targets import Descent

IDLER = load_product("idler")


class MadeUp(Enum):
    """A kind of phase that no program knows."""

    ANY = "any"


# Words.


def test_values_keep_every_bit_through_json(motor_unit_cell: Cell) -> None:
    plant, frame = motor_unit_cell.plant, motor_unit_cell.holder.frame("tip")
    X = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), np.array([1 / 3, 2 / 7, -1e-17]))
    height = Height(frame, X)
    values = [
        JointMotion(np.array([0.0, 1 / 3]), np.eye(2, 6) / 7, np.zeros((2, 6))),
        All((motion_finished, Steady(height, 1e-4, 0.1), after(1 / 3))),
        FirstOf((LostGrasp("left_gripper", 0.1), LostGrasp("left_gripper", 1 / 9))),
        Descent(X, np.array([0.0, 1.0]), np.array([0.1, 0.0])),
        receive_part("motor"),
        fix_part,
        PlacePhase.PRESS,
        Jaw(0.03, 20.0),
        Spin(-1.5),
        (),
        None,
    ]
    for value in values:
        data = json.loads(json.dumps(to_data(value)))
        again = from_data(data, plant)
        assert type(again) is type(value)
        assert to_data(again) == data
    assert from_data(to_data(fix_part), plant) is fix_part
    assert from_data(to_data(height), plant).X_FQ.IsExactlyEqualTo(X)
    assert from_data(to_data(frame), plant) is frame


def test_function_made_on_the_spot_has_no_word(motor_unit_cell: Cell) -> None:
    with pytest.raises(NotInWords, match="lambda"):
        to_data(lambda sensed: True)
    with pytest.raises(NotInWords, match="MadeUp"):
        to_data(MadeUp.ANY)
    with pytest.raises(UnknownName, match="Levitate"):
        from_data({"is": "Levitate"}, motor_unit_cell.plant)
    with pytest.raises(InputError, match="no part of a program"):
        from_data({"is": "Jaw", "speed": 3}, motor_unit_cell.plant)


def test_two_words_of_one_name_are_refused() -> None:
    class Steady:  # noqa: F811
        """Another one."""

    with pytest.raises(InputError, match="have a word 'Steady'"):
        in_programs(Steady)


def sensed(up: float, finished: bool = False):
    """Return a reading with a force upwards."""
    from cell.simulation.phase import Sensed

    return Sensed(
        time=0.1,
        step=1,
        wrench={"left": np.array([0.0, 0.0, 0.0, 0.0, 0.0, up])},
        grippers={"hand": GripperReading(0.02, 0.0)},
        drivers={},
        finished=finished,
        X_WF=lambda frame: RigidTransform(),
    )


def test_later_conditions_are_asked_only_once_the_earlier_hold() -> None:
    """So that what has to be steady is steady from then on."""
    asked: list[str] = []

    def says(name: str, answer: bool):
        return lambda sensed: asked.append(name) or answer

    assert not All((says("a", False), says("b", True)))(sensed(0.0))
    assert Either((says("c", True), says("d", True)))(sensed(0.0))
    assert asked == ["a", "c"]
    assert PushesBack("left", 5.0)(sensed(5.0))
    assert not PushesBack("left", 5.0)(sensed(4.9))


def test_phase_without_words_is_named_and_does_not_stop_the_run() -> None:
    transcript = Transcript(IDLER)
    phase = Phase(MadeUp.ANY, after(1.0), 2.0, subject="post")
    own = transcript._begin(Step("place post", PICK_PLACE, ("post",)))

    class Planner:
        in_hand = ()
        origins = placements = {}

    transcript._take_down(own, phase, Planner())  # type: ignore[arg-type]
    assert transcript.problem is not None
    assert "post: any" in transcript.problem


# Whole programs.


@pytest.fixture(scope="module")
def placed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the result and the program of a post that was placed."""
    out = tmp_path_factory.mktemp("placed")
    job = Job(IDLER, None, CellConfig(), 0, out, quiet=True, last=PICK_PLACE, program=out / "p")
    (out / "p").mkdir()
    assert run_job(job) == 0
    return out


def no_planning(*_: object, **__: object) -> None:
    raise AssertionError("a program plans nothing")


def test_program_is_carried_out_to_the_same_last_bit_without_planning(
    placed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(station_module, "plan_path", no_planning)
    monkeypatch.setattr(station_module, "plan_line", no_planning)
    assert run_program.main([str(placed / "p"), "--out", str(tmp_path), "--quiet"]) == 0
    one, two = (np.load(folder / "log.npz") for folder in (placed, tmp_path))
    assert one.files == two.files
    assert all(np.array_equal(one[name], two[name]) for name in one.files)
    first, second = (
        json.loads((folder / "result.json").read_text()) for folder in (placed, tmp_path)
    )
    for result in (first, second):
        assert result["verdict"] == "success"
    assert first["steps"][0]["measured"] == second["steps"][0]["measured"]


def test_guards_of_a_program_are_watched(placed: Path, tmp_path: Path) -> None:
    """A program whose jaws have to stay further apart than they do fails where they close."""
    shutil.copytree(placed / "p", tmp_path / "p")
    file = tmp_path / "p" / "program.json"
    data = json.loads(file.read_text())
    for phase in data["steps"][0]["phases"]:
        if phase["name"] == "post: lift":
            phase["guard"]["least"] = 0.2
    file.write_text(json.dumps(data))
    assert run_program.main([str(tmp_path / "p"), "--out", str(tmp_path), "--quiet"]) == 1
    failure = json.loads((tmp_path / "result.json").read_text())["failure"]
    assert failure["phase"] == "post: lift"
    assert "lost grasp" in failure["evidence"]


def test_program_whose_tray_is_50_mm_off_loses_its_grasp_at_the_grip(
    placed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It does not look: the jaws close on nothing, and that is what the verdict says."""
    off = Disturbance(0.05, 0.0, 0.0)
    monkeypatch.setattr(Disturbance, "draw", staticmethod(lambda config, seed: off))
    assert run_program.main([str(placed / "p"), "--out", str(tmp_path), "--quiet"]) == 1
    failure = json.loads((tmp_path / "result.json").read_text())["failure"]
    assert failure["phase"] == "post: grip"
    assert "lost grasp: jaws at" in failure["evidence"]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"format": "something else"}, "not a program of the form"),
        ({"product": "motor_unit"}, "moves 'post'"),
        ({"identity": "idler 0"}, "of another product"),
        ({"steps": [{"name": "x"}]}, "not whole"),
    ],
)
def test_program_that_cannot_be_used_is_bad_input(
    placed: Path, tmp_path: Path, capsys: pytest.CaptureFixture, change: dict, complaint: str
) -> None:
    shutil.copytree(placed / "p", tmp_path / "p")
    file = tmp_path / "p" / "program.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    out = tmp_path / "out"
    assert run_program.main([str(tmp_path / "p"), "--out", str(out), "--quiet"]) == 2
    assert complaint in capsys.readouterr().err
    assert not out.exists()


def test_operation_that_does_not_exist_is_named(placed: Path) -> None:
    data = json.loads((placed / "p" / "program.json").read_text())
    data["steps"][0]["operation"] = "juggle"
    with pytest.raises(UnknownName, match="juggle"):
        Program(IDLER, data).steps()


def test_scripts_of_both_arms_are_urscript(placed: Path) -> None:
    """Each meets the other at every phase; the holder moves, the driver has nothing to do yet."""
    count = len(json.loads((placed / "p" / "program.json").read_text())["steps"][0]["phases"])
    left, right = (Script((placed / "p" / f"{n}.script").read_text()) for n in ("left", "right"))
    assert left.called["meet"] == right.called["meet"] == count
    assert left.called["servoj"] > 100
    assert "servoj" not in right.called
    assert left.called["jaw"] == 3  # Open around the part, grip, let go.
    text = (placed / "p" / "left.script").read_text()
    assert "felt(2) >= 20.000" in text
    assert 'give_up("post: lift: lost grasp")' in text


@pytest.mark.parametrize(
    "script",
    [
        "def f():\n  servoj([1.0], 0, 0)\nend",
        "def f():\n  x = 1\nend",
        "def f():\n  g()\nend",
        "def f():\n  if True:\n  sync()\nend",
        "def f():\n  global a = p[1, 2, 3]\nend",
        "end",
        "def f():\n  sync() sync()\nend",
    ],
)
def test_grammar_refuses_what_is_no_urscript(script: str) -> None:
    with pytest.raises(Refused):
        Script(script)


@pytest.mark.slow
def test_program_of_a_whole_assembly_gives_the_same_verdict(tmp_path: Path) -> None:
    """Insertion, bolts and tightening included; the scripts of both arms are URScript."""
    job = Job(IDLER, None, CellConfig(), 0, tmp_path, quiet=True, program=tmp_path / "p")
    (tmp_path / "p").mkdir()
    assert run_job(job) == 0
    again = tmp_path / "again"
    assert run_program.main([str(tmp_path / "p"), "--out", str(again), "--quiet"]) == 0
    one, two = (np.load(folder / "log.npz") for folder in (tmp_path, again))
    assert all(np.array_equal(one[name], two[name]) for name in one.files)
    for name in ("left", "right"):
        script = Script((tmp_path / "p" / f"{name}.script").read_text())
        assert script.called["force_mode"] >= 1
