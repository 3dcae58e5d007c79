"""A recording of a run in MCAP: all that moved and was felt, for Foxglove and other readers.

Written after the run from its log: the run itself does not know of it. Messages are JSON. Times
count from the start of the run.
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.tree import Joint

from cell.builder import Cell
from cell.errors import InputError
from cell.fixtures.soft_jig import SoftJig
from cell.whole_file import whole_file
from experiments.assembly import foxglove
from experiments.assembly.film import Film
from experiments.assembly.foxglove import Schema, Value, stamp, xyz
from experiments.assembly.scene import bag, bodies_of, frame_of, scene
from planning.operations.operation import Arrays

POSE_PERIOD = 0.05  # Between two messages with the poses of all bodies [s] [A].
Message = tuple[str, str, Schema, float, Value]  # Topic, name of the schema, schema, time, value.


def check_recordable() -> None:
    """Raise `InputError` unless recordings can be written here; before any work is lost."""
    if importlib.util.find_spec("mcap") is None:
        raise InputError("--record needs the Python package 'mcap': pip install mcap.")


def write_recording(
    path: Path, cell: Cell, log: Arrays, film: Film, about: Mapping[str, str]
) -> None:
    """Write a recording, whole or not at all.

    Args:
        path: Of the file.
        cell: That was run.
        log: All columns of the run.
        film: Surfaces of the jig.
        about: What is said of the run, for example its product and verdict.
    """
    from mcap.writer import Writer  # Only who records needs the package.

    messages = sorted(_messages(cell, log, film), key=lambda message: message[3])
    with whole_file(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="soft-jig")
        writer.add_metadata("run", dict(about))
        channels: dict[str, int] = {}
        for number, (topic, name, schema, time, value) in enumerate(messages):
            if topic not in channels:
                text = json.dumps(schema).encode()
                known = writer.register_schema(name, "jsonschema", text)
                channels[topic] = writer.register_channel(topic, "json", known)
            at = round(time * 1e9)
            data = json.dumps(value, allow_nan=False).encode()
            writer.add_message(channels[topic], at, data, at, number)
        writer.finish()


def _messages(cell: Cell, log: Arrays, film: Film) -> Iterator[Message]:
    yield _known("/scene", "SceneUpdate", 0.0, {"deletions": [], "entities": scene(cell)})
    if isinstance(cell.fixture, SoftJig):
        for number, (time, bed) in enumerate(film.surfaces):
            at = time if number else 0.0  # The first is there from the start.
            update = {"deletions": [], "entities": [bag(cell.fixture, at, bed)]}
            yield _known("/jig/surface", "SceneUpdate", at, update)
    for name, start in zip(log["phase_name"], log["phase_start"], strict=True):
        said = {"timestamp": stamp(start), "level": foxglove.INFO, "message": str(name)}
        yield _known("/phase", "Log", float(start), said | {"name": "", "file": "", "line": 0})
    if "time" in log:
        yield from _poses(cell, log)
        yield from _joints(cell, log)
        yield from _wrenches(cell, log)
        yield from _readings(log)
        yield from _threads(cell, log)


def _known(topic: str, kind: str, time: float, value: Value) -> Message:
    name = f"foxglove.{kind}"
    return topic, name, foxglove.KNOWN[name], time, value


def _poses(cell: Cell, log: Arrays) -> Iterator[Message]:
    """Yield the poses of all bodies from time to time."""
    context = cell.plant.CreateDefaultContext()
    bodies = [body for body in bodies_of(cell.plant) if frame_of(body) != "world"]
    shown = -np.inf
    for time, q in zip(log["time"], log["q"], strict=True):
        if time - shown < POSE_PERIOD - 1e-6:
            continue
        shown = time
        cell.plant.SetPositions(context, q)
        poses = [
            foxglove.transform(time, frame_of(body), body.EvalPoseInWorld(context))
            for body in bodies
        ]
        yield _known("/tf", "FrameTransforms", float(time), {"transforms": poses})


def _joints(cell: Cell, log: Arrays) -> Iterator[Message]:
    """Yield the states of the joints of each arm and its tool."""
    for arm in cell.arms.values():
        indices = [
            index
            for instance in (arm.instance, arm.tool_instance)
            for index in cell.plant.GetJointIndices(instance)
        ]
        joints = [cell.plant.get_joint(index) for index in indices]
        joints = [joint for joint in joints if joint.num_positions() == 1]
        for time, q, v in zip(log["time"], log["q"], log["v"], strict=True):
            states = [_state(joint, q, v) for joint in joints]
            value = {"timestamp": stamp(time), "joints": states}
            yield _known(f"/{arm.name}/joint_states", "JointStates", float(time), value)


def _state(joint: Joint, q: np.ndarray, v: np.ndarray) -> Value:
    position, velocity = q[joint.position_start()], v[joint.velocity_start()]
    return {"name": joint.name(), "position": float(position), "velocity": float(velocity)}


def _wrenches(cell: Cell, log: Arrays) -> Iterator[Message]:
    """Yield what wrists and force plate feel: torque and force in the axes of W."""
    columns = {f"/{name}/wrench": f"{name}_wrench" for name in cell.arms}
    for topic, column in {**columns, "/force_plate/wrench": "force_plate"}.items():
        for time, wrench in zip(log["time"], log[column], strict=True):
            value = {"torque": xyz(wrench[:3]), "force": xyz(wrench[3:]), "frame_id": "world"}
            value |= {"timestamp": stamp(time)}
            yield topic, "soft_jig.Wrench", foxglove.WRENCH, float(time), value


def _readings(log: Arrays) -> Iterator[Message]:
    """Yield what fixture, gripper and driver read, by what each is called in the log."""
    topics: dict[str, dict[str, str]] = {}
    for column, values in log.items():
        if values.ndim == 1 and column.endswith(("_opening", "_torque")):
            device, _, name = column.rpartition("_")
            topics.setdefault(f"/{device}", {})[name] = column
        elif column.startswith("jig_"):
            topics.setdefault("/jig", {})[column.removeprefix("jig_")] = column
    for topic, columns in topics.items():
        yield from _numbers(topic, log["time"], {n: log[c] for n, c in columns.items()})


def _threads(cell: Cell, log: Arrays) -> Iterator[Message]:
    """Yield turns since the catch and clamp force [N] of each bolt."""
    for number, bolt in enumerate(cell.threads):
        columns = {"turns": log["thread_turns"][:, number], "clamp": log["clamp_force"][:, number]}
        yield from _numbers(f"/thread/{bolt}", log["time"], columns)


def _numbers(topic: str, times: np.ndarray, columns: Mapping[str, np.ndarray]) -> Iterator[Message]:
    schema, name = (
        foxglove.readings(list(columns)),
        "soft_jig." + topic.strip("/").replace("/", "."),
    )
    for row, time in enumerate(times):
        value: dict[str, Any] = {name: float(column[row]) for name, column in columns.items()}
        yield topic, name, schema, float(time), {"timestamp": stamp(time), **value}
