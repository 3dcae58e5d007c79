"""Recordings: what Foxglove needs, read back with the public reader; the video shows the run."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from PIL import Image
from pydrake.systems.framework import Context

from cell import Cell, Simulation
from cell.fixtures.soft_jig import SoftJig
from cell.fixtures.soft_jig.visual import membrane_mesh
from cell.machines.cameras.rendering import rendering_problem
from cell.simulation.phase import Phase, after
from experiments.assembly import recording, video
from experiments.assembly.film import SURFACE_PERIOD, Film
from experiments.assembly.recording import POSE_PERIOD, write_recording
from planning.operations.soft_hand import MatePhase

needs_rendering = pytest.mark.skipif(
    rendering_problem() is not None, reason=str(rendering_problem())
)
Messages = dict[str, list[tuple[float, dict[str, Any]]]]  # By topic: time [s] and content.


@pytest.fixture(scope="module")
def run(motor_unit_cell: Cell) -> tuple[Simulation, Film]:
    """Everything waits; the bag sinks by 8 mm from one moment to the next."""
    simulation, film = Simulation(motor_unit_cell), Film()
    watch = film.follow(simulation)
    assert watch is not None
    assert isinstance(motor_unit_cell.fixture, SoftJig)
    bed = motor_unit_cell.fixture.memory(simulation.root).bed
    wait = Phase(MatePhase.HOVER, after(1.5 * SURFACE_PERIOD), 1.0)
    simulation.run_phase(wait)
    watch(simulation.root)
    bed.heights -= 8e-3
    simulation.run_phase(wait)
    watch(simulation.root)
    simulation.run_phase(wait)
    bed.heights += 8e-3
    return simulation, film


@pytest.fixture(scope="module")
def file(run: tuple[Simulation, Film], tmp_path_factory: pytest.TempPathFactory) -> Path:
    simulation, film = run
    path = tmp_path_factory.mktemp("recording") / "run.mcap"
    about = {"product": "motor_unit", "verdict": "success"}
    write_recording(path, simulation.cell, simulation.log.arrays(), film, about)
    return path


@pytest.fixture(scope="module")
def messages(file: Path) -> Messages:
    found: Messages = {}
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append(
                (message.log_time * 1e-9, json.loads(message.data))
            )
    return found


def test_schemas_have_the_names_that_foxglove_knows(file: Path) -> None:
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    names = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
    assert names["/tf"] == "foxglove.FrameTransforms"
    assert names["/scene"] == names["/jig/surface"] == "foxglove.SceneUpdate"
    assert names["/left/joint_states"] == "foxglove.JointStates"
    assert names["/phase"] == "foxglove.Log"
    assert {schema.encoding for schema in summary.schemas.values()} == {"jsonschema"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"json"}


def test_messages_have_the_fields_of_their_schemas(file: Path) -> None:
    def check(schema: dict[str, Any], value: Any) -> None:
        if schema["type"] == "object":
            assert set(value) == set(schema["properties"]), schema.get("title")
            for key, item in schema["properties"].items():
                check(item, value[key])
        elif schema["type"] == "array":
            for item in value[:20]:
                check(schema["items"], item)
        else:
            kinds = {"number": float | int, "integer": int, "string": str, "boolean": bool}
            assert isinstance(value, kinds[schema["type"]])

    with file.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages():
            assert schema is not None
            check(json.loads(schema.data), json.loads(message.data))


def test_run_is_described(file: Path) -> None:
    with file.open("rb") as stream:
        (about,) = make_reader(stream).iter_metadata()
    assert about.metadata == {"product": "motor_unit", "verdict": "success"}


def test_joints_and_wrenches_are_those_of_the_log(
    run: tuple[Simulation, Film], messages: Messages
) -> None:
    simulation, _ = run
    log, arm = simulation.log.arrays(), simulation.cell.arms["left"]
    states = messages["/left/joint_states"]
    assert [time for time, _ in states] == pytest.approx(log["time"], abs=1e-9)
    joints = {state["name"]: state for state in states[-1][1]["joints"]}
    q = log["q"][-1][[joint.position_start() for joint in arm.joints]]
    assert [joints[joint.name()]["position"] for joint in arm.joints] == pytest.approx(q)
    _, wrench = messages["/force_plate/wrench"][-1]
    assert list(wrench["force"].values()) == pytest.approx(log["force_plate"][-1][3:])
    assert "pressure" in messages["/jig"][0][1]
    assert "opening" in messages["/left_gripper"][0][1]
    assert "torque" in messages["/spindle"][0][1]
    assert {"turns", "clamp"} < set(messages["/thread/bolt_1"][0][1])


def test_poses_are_those_of_the_bodies(run: tuple[Simulation, Film], messages: Messages) -> None:
    simulation, _ = run
    times = [time for time, _ in messages["/tf"]]
    assert np.diff(times).min() >= POSE_PERIOD - 1e-6
    poses = {pose["child_frame_id"]: pose for pose in messages["/tf"][-1][1]["transforms"]}
    X_WP = simulation.cell.parts["motor"].X_WP(simulation.context)
    (motor,) = [pose for name, pose in poses.items() if name.startswith("motor::")]
    assert list(motor["translation"].values()) == pytest.approx(X_WP.translation(), abs=1e-6)
    assert sum(value**2 for value in motor["rotation"].values()) == pytest.approx(1.0)


def test_everything_visible_hangs_on_a_frame_that_has_a_pose(messages: Messages) -> None:
    ((_, update),) = messages["/scene"]
    frames = {pose["child_frame_id"] for pose in messages["/tf"][0][1]["transforms"]} | {"world"}
    assert {entity["frame_id"] for entity in update["entities"]} <= frames
    assert all(entity["frame_locked"] for entity in update["entities"])
    kinds = {kind for entity in update["entities"] for kind in ("cubes", "cylinders", "triangles")
             if entity[kind]}  # fmt: skip
    assert kinds == {"cubes", "cylinders", "triangles"}


def test_bag_is_shown_as_it_changes(run: tuple[Simulation, Film], messages: Messages) -> None:
    _, film = run
    surfaces = messages["/jig/surface"]
    assert len(surfaces) == len(film.surfaces) == 2
    tops = []
    for (_, update), (_, bed) in zip(surfaces, film.surfaces, strict=True):
        (entity,) = update["entities"]
        (surface,) = entity["triangles"]
        points, faces = membrane_mesh(bed)
        tops.append(max(point["z"] for point in surface["points"]))
        assert tops[-1] == pytest.approx(points[:, 2].max(), abs=1e-6)
        assert surface["indices"] == faces.ravel().tolist()
    assert tops[0] - tops[1] == pytest.approx(8e-3, abs=1e-3)
    assert surfaces[0][0] == 0.0


def test_membrane_is_closed_but_for_its_rim(run: tuple[Simulation, Film]) -> None:
    _, film = run
    points, faces = membrane_mesh(film.surfaces[0][1])
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    rim = unique[count == 1]
    assert set(count) == {1, 2}
    assert np.all(points[np.unique(rim), 2] == 0.0)
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert np.all(normals[:, 2] >= -1e-15), "they look up"


def test_film_forgets_what_is_carried_out_again(run: tuple[Simulation, Film]) -> None:
    _, film = run
    bed, again = film.surfaces[0][1], Film()
    for number, time in enumerate((0.0, 0.5, 1.0, 0.7)):
        deeper = SimpleNamespace(heights=bed.heights - 1e-3 * number)
        again._keep(time, deeper)  # type: ignore[arg-type]
    assert [time for time, _ in again.surfaces] == [0.0, 0.5, 0.7]


def test_missing_package_is_named_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(recording.InputError, match="pip install mcap"):
        recording.check_recordable()


def test_pictures_are_evenly_spaced_up_to_the_end() -> None:
    time = np.arange(0.01, 10.0, 0.01)
    rows = video.picture_rows(time)
    assert np.diff(time[rows])[:-1] == pytest.approx(video.PACE / video.RATE, abs=0.011)
    assert rows[-1] == len(time) - 1


@needs_rendering
def test_video_shows_the_bag_sink(
    run: tuple[Simulation, Film], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation, film = run
    monkeypatch.setattr(video, "PACE", 1.0)
    before = context_of(simulation)
    video.write_video(tmp_path / "run.gif", simulation.cell, simulation.log.arrays(), film)
    with Image.open(tmp_path / "run.gif") as gif:
        assert gif.size == (video.VIEW.width, video.VIEW.height)
        assert gif.n_frames >= 2  # type: ignore[attr-defined]
        first = np.array(gif.convert("RGB"), dtype=float)
        gif.seek(gif.n_frames - 1)  # type: ignore[attr-defined]
        last = np.array(gif.convert("RGB"), dtype=float)
    assert 50 < np.sum(np.abs(first - last).max(axis=2) > 30.0) < first[..., 0].size / 4
    assert np.array_equal(context_of(simulation), before), "the run itself is not touched"


def context_of(simulation: Simulation) -> np.ndarray:
    context: Context = simulation.context
    return simulation.cell.plant.GetPositionsAndVelocities(context)
