"""Files appear whole or not at all."""

import json
from pathlib import Path

import numpy as np
import pytest

from cell.errors import CellError, InputError
from experiments.reporting.output import (
    output_folder,
    whole_file,
    write_arrays,
    write_json,
    write_text,
)


def test_interrupted_file_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    write_text(path, "old")
    with pytest.raises(KeyboardInterrupt), whole_file(path) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_two_writers_of_a_file_do_not_share_a_temporary_one(tmp_path: Path) -> None:
    """The last to end wins; neither finds its own gone."""
    path = tmp_path / "result.json"
    with whole_file(path) as one:
        one.write_text("one")
        with whole_file(path) as other:
            assert other != one
            other.write_text("other")
        assert path.read_text() == "other"
    assert path.read_text() == "one"


def test_folder_of_one_run_is_refused_to_another(tmp_path: Path) -> None:
    with output_folder(tmp_path):
        second = output_folder(tmp_path)
        with pytest.raises(InputError, match="Another run writes to folder"), second:
            pass
    with output_folder(tmp_path):
        pass


def test_json_round_trip_of_numpy_values(tmp_path: Path) -> None:
    value = {"f": np.float64(0.1), "n": np.int64(3), "b": np.bool_(True), "a": np.eye(2)}
    write_json(tmp_path / "x.json", value | {"p": Path("a/b")})
    read = json.loads((tmp_path / "x.json").read_text())
    assert read == {"f": 0.1, "n": 3, "b": True, "a": [[1, 0], [0, 1]], "p": "a/b"}


@pytest.mark.parametrize("value", [float("nan"), np.float64("inf"), object()])
def test_what_json_cannot_hold_is_refused(tmp_path: Path, value: object) -> None:
    with pytest.raises((TypeError, ValueError)):
        write_json(tmp_path / "x.json", {"value": value})
    assert not list(tmp_path.iterdir())


def test_arrays_round_trip(tmp_path: Path) -> None:
    arrays = {"time": np.linspace(0, 1, 5), "names": np.array(["a", "b"])}
    write_arrays(tmp_path / "log.npz", arrays)
    read = np.load(tmp_path / "log.npz")
    for name, array in arrays.items():
        np.testing.assert_array_equal(read[name], array)


def test_failed_work_leaves_no_empty_folders_but_keeps_files(tmp_path: Path) -> None:
    with pytest.raises(CellError), output_folder(tmp_path / "a" / "b"):
        raise CellError("stop")
    assert not list(tmp_path.iterdir())
    with pytest.raises(CellError), output_folder(tmp_path / "a" / "b") as folder:
        (folder / "log").write_text("kept")
        raise CellError("stop")
    assert (tmp_path / "a" / "b" / "log").exists()


def test_folder_that_was_there_stays(tmp_path: Path) -> None:
    with pytest.raises(CellError), output_folder(tmp_path):
        raise CellError("stop")
    assert tmp_path.is_dir()
