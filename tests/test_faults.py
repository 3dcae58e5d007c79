"""Nothing is lost: real processes that are interrupted, killed, refused, or run out of disk."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import SHORT_RUN, Process, result_in

OWN_FILES = {"log.npz", "report.html", "result.json", "state.npz"}


def start(out: Path, *options: str, **environment: Any) -> Process:
    return Process([SHORT_RUN, "--quiet", "--out", str(out), *options], **environment)


def measured(folder: Path) -> dict[str, dict[str, float]]:
    return {step["name"]: step["measured"] for step in result_in(folder)["steps"]}


def assert_same_end(one: Path, other: Path) -> None:
    """Results and logs are equal to the last bit."""
    assert measured(one) == measured(other)
    assert len(measured(one)) == 3
    with np.load(one / "log.npz") as log, np.load(other / "log.npz") as again:
        assert set(log.files) == set(again.files)
        for name in log.files:
            np.testing.assert_array_equal(log[name], again[name])


def one_line(stderr: str, *words: str) -> None:
    assert stderr.count("\n") == 1 and len(stderr) <= 201
    assert "Traceback" not in stderr
    assert all(word in stderr for word in words)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that nothing has disturbed."""
    out = tmp_path_factory.mktemp("whole")
    code, stderr = start(out).end()
    assert (code, stderr) == (0, "")
    assert {path.name for path in out.iterdir()} == OWN_FILES
    return out


SLOW = pytest.mark.slow  # The same again, in another way: each process takes some seconds.


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), pytest.param(signal.SIGTERM, 143, marks=SLOW)],
)
def test_signal_ends_a_run_that_goes_on_as_if_nothing_had_been(
    number: int, code: int, whole: Path, tmp_path: Path
) -> None:
    run = start(tmp_path)
    run.wait_for(lambda: len(result_in(tmp_path).get("steps", [])) == 2)
    assert result_in(tmp_path)["verdict"] == "running"
    found, stderr = run.end(number)
    assert found == code
    assert run.seconds_to_end < 2.0
    one_line(stderr, "Interrupted", signal.Signals(number).name)
    result = result_in(tmp_path)
    assert (result["verdict"], result["phase"][:6]) == ("interrupted", "motor:")
    assert {path.name for path in tmp_path.iterdir()} == OWN_FILES - {"report.html"}
    assert start(tmp_path, "--start", str(tmp_path / "state.npz")).end() == (0, "")
    assert_same_end(tmp_path, whole)


@pytest.mark.parametrize(
    "moment",
    ["REPLACE:5", *(pytest.param(at, marks=SLOW) for at in ("REPLACE:1", "SYNC:3", "REPLACE:9"))],
)
def test_killed_run_leaves_a_folder_that_can_be_read_and_gone_on_from(
    moment: str, whole: Path, tmp_path: Path
) -> None:
    """Killed in the middle of writing: before anything is there, of a state, a result, the end."""
    code, _ = start(tmp_path, KILL_AT=moment).end()
    assert code == -signal.SIGKILL
    result = result_in(tmp_path)
    assert result.get("verdict") in (None, "running")
    options = ["--start", str(tmp_path / "state.npz")] if "state" in result else []
    assert start(tmp_path, *options).end() == (0, "")
    assert_same_end(tmp_path, whole)
    assert {path.name for path in tmp_path.iterdir()} == OWN_FILES


@pytest.mark.slow
def test_failed_state_runs_the_step_that_failed_again(whole: Path, tmp_path: Path) -> None:
    former = tmp_path / "report.html"
    former.write_text("of an earlier run")
    code, _ = start(tmp_path, FAIL="two").end()
    assert code == 1
    assert {path.name for path in tmp_path.iterdir()} == OWN_FILES - {"state.npz"} | {
        "failed_state.npz"
    }
    assert former.read_text() != "of an earlier run"
    failure = result_in(tmp_path)["failure"]
    assert failure["phase"] == "motor: hold"
    state = str(tmp_path / failure["state"])
    again, mended = tmp_path / "again", tmp_path / "mended"
    assert start(again, "--start", state, FAIL="two").end()[0] == 1
    assert result_in(again)["failure"] == failure
    assert start(mended, "--start", state).end() == (0, "")
    assert_same_end(mended, whole)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--seed", "7"], ["of --seed 0"]),
        pytest.param(["--set", "placement.press_force=15"], ["another configuration"], marks=SLOW),
        pytest.param(["idler"], ["of another"], marks=SLOW),
    ],
)
def test_state_of_another_run_is_refused(
    options: list[str], words: list[str], whole: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    code, stderr = start(out, "--start", str(whole / "state.npz"), *options).end()
    assert code == 2
    one_line(stderr, *words)
    assert not out.exists()


def test_second_run_in_a_folder_is_refused_until_the_first_has_ended(tmp_path: Path) -> None:
    first = start(tmp_path)
    first.wait_for(lambda: result_in(tmp_path) != {})
    before = result_in(tmp_path)
    code, stderr = start(tmp_path).end()
    assert code == 2
    one_line(stderr, str(tmp_path), f"process {first.process.pid}")
    assert result_in(tmp_path)["seed"] == before["seed"]
    first.kill()
    assert (tmp_path / ".lock").exists()  # It says nothing: nobody holds it any more.
    assert start(tmp_path).end() == (0, "")
    assert not (tmp_path / ".lock").exists()


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_full_disk_leaves_the_former_results(whole: Path, tmp_path: Path) -> None:
    """No file may be larger than 2 kB, which a result is."""
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    code, stderr = start(out, largest_file=2000).end()
    assert code == 3
    one_line(stderr, str(out))
    assert contents(out) == contents(whole)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """Return the mount point of a disk of 800 kB, if this user may mount one."""
    point = tmp_path / "disk"
    point.mkdir()
    options = ["-t", "tmpfs", "-o", "size=800k", "tmpfs"]
    mount = shutil.which("mount")
    if mount is None or os.geteuid() != 0 or subprocess.call([mount, *options, str(point)]) != 0:
        pytest.skip("no disk can be mounted here")
    yield point
    subprocess.check_call(["umount", str(point)])


def test_disk_that_fills_up_ends_a_run_that_goes_on_elsewhere(
    disk: Path, whole: Path, tmp_path: Path
) -> None:
    """The first state fits, but no second one beside it."""
    code, stderr = start(disk).end()
    assert code == 3
    one_line(stderr, "state.npz", "No space left")
    assert result_in(disk)["verdict"] == "error"
    out = tmp_path / "elsewhere"
    assert start(out, "--start", str(disk / "state.npz")).end() == (0, "")
    assert_same_end(out, whole)


def test_read_only_disk_is_the_machines_fault(disk: Path) -> None:
    (disk / "result.json").write_text("{}")
    subprocess.check_call(["mount", "-o", "remount,ro", str(disk)])
    code, stderr = start(disk).end()
    assert code == 3
    one_line(stderr, str(disk), "Read-only")
    assert (disk / "result.json").read_text() == "{}"


def test_folder_that_nobody_may_write_to_is_the_machines_fault() -> None:
    code, stderr = start(Path("/sys/nowhere")).end()
    assert code == 3
    one_line(stderr, "/sys/nowhere")


@pytest.mark.slow
@pytest.mark.parametrize("stream", ["closed", "nobody listens", "full"])
def test_output_that_nobody_reads_does_not_end_a_run(stream: str, tmp_path: Path) -> None:
    redirection = {"closed": ">&-", "nobody listens": "| true", "full": "> /dev/full"}[stream]
    command = f'set -o pipefail; "$0" "$1" --out "$2" {redirection}'
    environment = {**os.environ, "PYTHONPATH": os.path.dirname(os.path.dirname(SHORT_RUN))}
    done = subprocess.run(
        ["bash", "-c", command, sys.executable, SHORT_RUN, str(tmp_path)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert result_in(tmp_path)["verdict"] == "success"
