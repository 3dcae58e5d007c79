"""The recording: it plays offline, and the jig's surface changes in it."""

import base64
import re
from enum import Enum
from pathlib import Path

import pytest
from pydrake.systems.framework import DiagramBuilder

from cell.builder import add_cell
from cell.configuration.config import CellConfig
from cell.fixtures.soft_jig import SoftJig
from cell.products.loading import load_product
from cell.simulation.phase import Phase, after
from cell.simulation.simulation import Simulation
from experiments.assembly.replay import MEMBRANE_PERIOD, Replay, membrane_path


class MadeUp(Enum):
    """The phase of the test."""

    WAIT = "wait"


def test_nothing_wanted_adds_nothing() -> None:
    replay = Replay(view=False, file=None)
    assert (replay.meshcat, replay.url) == (None, None)
    replay.save()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording in which the bag sinks by 5 mm from one moment to the next."""
    file = tmp_path_factory.mktemp("replay") / "run.html"
    replay, builder = Replay(view=False, file=file), DiagramBuilder()
    cell = add_cell(builder, CellConfig(), load_product("motor_unit"))
    replay.add_to(builder, cell)
    simulation = Simulation(cell.with_diagram(builder.Build()))
    replay.follow(simulation)
    wait = Phase(MadeUp.WAIT, after(1.5 * MEMBRANE_PERIOD), timeout=1.0)
    simulation.run([wait])
    assert isinstance(cell.fixture, SoftJig)
    cell.fixture.memory(simulation.root).bed.heights -= 5e-3
    simulation.run([wait])
    assert replay.meshcat is not None
    assert replay.meshcat.HasPath(membrane_path(cell, "visualizer"))
    replay.save()
    return file


def test_recording_is_one_file_that_needs_no_network(recording: Path) -> None:
    page = recording.read_text()
    assert "<html" in page
    assert 'src="http' not in page


def test_surface_of_the_jig_changes(recording: Path) -> None:
    commands = decoded(recording)
    shapes = {name for name in (b"/membrane/0", b"/membrane/1") if any(name in c for c in commands)}
    assert len(shapes) == 2
    (animation,) = [c for c in commands if b"set_animation" in c[:40]]
    # The two surfaces, and the one that they stand in for.
    assert animation.count(b".visible") == 3
    assert b"soft_jig_membrane" in animation


def decoded(file: Path) -> list[bytes]:
    """Return Meshcat's commands in a static page."""
    found = re.findall(r"base64,([A-Za-z0-9+/=]{100,})", file.read_text())
    return [base64.b64decode(text) for text in found]


def test_view_has_an_address() -> None:
    url = Replay(view=True, file=None).url
    assert url is not None
    assert url.startswith("http://")
