"""Campaigns: no trial is lost, none is run twice, and the same trials give the same rows."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import campaign_experiments as experiments
import pyarrow.parquet as parquet
import pytest

from cell.errors import CellError, InputError, MachineError
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.executors import LocalExecutor, WorkerDied
from experiments.campaigns.points import grid, trials
from experiments.campaigns.store import DamagedTrial, read_trial, trial_file
from experiments.campaigns.trial import Row, Trial

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = Path(experiments.__file__)
SPEEDS = {"push.speed": [0.1, 0.2, 0.3]}


def tiny_trials(seeds: int = 2, **options: Any) -> list[Trial]:
    axes = SPEEDS | {name: [value] for name, value in options.items()}
    return trials(experiments.tiny, grid(axes), seeds=range(seeds))


def comparable(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return rows without what depends on the machine's speed."""
    return [asdict(row) | {"cpu_seconds": 0.0} for row in rows]


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


@dataclass(frozen=True)
class Campaign:
    """A campaign that has been run, for tests that read its folder or copy it."""

    wanted: list[Trial]
    out: Path
    rows: list[Row]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    wanted, out = tiny_trials(hardness=4.0), tmp_path_factory.mktemp("campaign")
    return Campaign(wanted, out, run_campaign(wanted, out, workers=2))


def test_every_trial_is_a_row_in_files_index_and_summary(campaign: Campaign) -> None:
    wanted, rows, out = campaign.wanted, campaign.rows, campaign.out
    assert [row.key for row in rows] == [trial.key for trial in wanted]
    assert comparable(rows) == comparable(
        [read_trial(trial_file(out, trial.key)) for trial in wanted]
    )
    verdicts = ["success"] * 4 + ["failure"] * 2  # 0.3 m/s x 4 is too much.
    assert [row.verdict for row in rows] == verdicts
    frame = parquet.read_table(out / "trials.parquet").to_pandas()
    assert list(frame["verdict"]) == verdicts
    assert list(frame["push.speed"]) == [0.1, 0.1, 0.2, 0.2, 0.3, 0.3]
    assert frame["load_N"][5] == pytest.approx(1.201)
    assert frame["odd"].isna().tolist() == [False, True] * 3
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["verdict"], summary["success"], summary["failure"]) == ("failure", 4, 2)
    # Wilson's interval of 4 of 6.
    assert summary["success_interval"] == pytest.approx([0.300, 0.903], abs=1e-3)
    (phase,) = summary["failures_by_phase"]
    assert (phase["phase"], phase["trials"], len(phase["states"])) == ("press", 2, 2)
    assert (out / phase["states"][0]).read_bytes() == b"state"
    assert "failed_state.npz" in (out / "report.html").read_text()


def test_index_is_read_by_duckdb(campaign: Campaign) -> None:
    duckdb = pytest.importorskip("duckdb")
    found = duckdb.sql(
        f"select \"push.speed\", count(*), max(load_N) from '{campaign.out}/trials.parquet' "
        'group by all order by "push.speed"'
    ).fetchall()
    assert [row[:2] for row in found] == [(0.1, 2), (0.2, 2), (0.3, 2)]
    assert [row[2] for row in found] == pytest.approx([0.401, 0.801, 1.201])


def test_errors_are_rows_and_are_told_from_failures(tmp_path: Path) -> None:
    rows = run_campaign(trials(experiments.faulty, seeds=range(3)), tmp_path)
    assert [row.verdict for row in rows] == ["failure", "error", "failure"]
    assert [row.phase for row in rows] == ["unknown", "", "grip"]
    assert rows[1].evidence == "ValueError: a bug [of ours]"
    assert "campaign_experiments.py" in rows[1].traceback
    assert json.loads((tmp_path / "summary.json").read_text())["verdict"] == "error"


def test_killed_worker_costs_only_its_trial(tmp_path: Path) -> None:
    """It is a row, too, and the same command runs it again."""
    once = str(tmp_path / "killed_once")
    wanted = trials(experiments.deadly, [{"once": once}], seeds=range(4))
    rows = run_campaign(wanted, tmp_path)
    assert [row.verdict for row in rows] == ["success", "killed"] + ["success"] * 2
    assert rows[1].evidence == "its process was ended by SIGKILL"
    assert read_trial(trial_file(tmp_path, wanted[1].key)).verdict == "killed"
    again = run_campaign(wanted, tmp_path)
    assert [row.verdict for row in again] == ["success"] * 4


def test_what_the_machine_refuses_ends_the_campaign_and_is_no_verdict(tmp_path: Path) -> None:
    full = tmp_path / "full"
    full.touch()
    wanted = trials(experiments.on_a_full_disk, [{"full": str(full)}], seeds=range(9))
    with pytest.raises(MachineError, match="No space left"):
        run_campaign(wanted, tmp_path)
    assert [file.stem for file in tmp_path.glob("trials/*.json")] == [wanted[0].key]
    full.unlink()
    assert [row.verdict for row in run_campaign(wanted, tmp_path)] == ["success"] * 9


def test_finished_trials_are_not_run_again(tmp_path: Path) -> None:
    calls = tmp_path / "calls"
    calls.mkdir()
    name, points = experiments.counting, [{"folder": str(calls)}]
    run_campaign(trials(name, points, seeds=range(3)), tmp_path)
    rows = run_campaign(trials(name, points, seeds=range(5)), tmp_path)
    assert len(rows) == 5
    assert {file.name: file.read_text() for file in calls.iterdir()} == {
        str(seed): "x" for seed in range(5)
    }


def test_damaged_trials_are_noticed_and_run_again(campaign: Campaign, tmp_path: Path) -> None:
    """A file that was cut off, changed, swapped with another or emptied."""
    wanted, rows, out = campaign.wanted, campaign.rows, tmp_path / "copy"
    shutil.copytree(campaign.out, out)
    files = [trial_file(out, trial.key) for trial in wanted]
    texts = [file.read_text() for file in files]
    files[0].write_text(texts[0][: len(texts[0]) // 2])
    files[1].write_text(texts[1].replace("success", "failure"))
    files[2].write_text(texts[5])
    files[3].write_text("")
    for file in files[:4]:
        with pytest.raises(DamagedTrial, match=file.stem):
            read_trial(file)
    times = [file.stat().st_mtime_ns for file in files[4:]]
    assert comparable(run_campaign(wanted, out)) == comparable(rows)
    assert [file.stat().st_mtime_ns for file in files[4:]] == times
    assert comparable([read_trial(file) for file in files]) == comparable(rows)


def test_two_writers_leave_whole_files_with_the_same_rows(tmp_path: Path) -> None:
    wanted, found = tiny_trials(seeds=3), {}  # Nine: no process is replaced.

    def write(number: int) -> None:
        found[number] = run_campaign(wanted, tmp_path)

    writers = [threading.Thread(target=write, args=(number,)) for number in range(2)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert comparable(found[0]) == comparable(found[1])
    kept = [read_trial(trial_file(tmp_path, trial.key)) for trial in wanted]
    assert comparable(kept) == comparable(found[0])
    assert len(list((tmp_path / "trials").glob("*.json"))) == len(wanted)


def test_measured_quantity_with_the_name_of_a_column_is_refused(tmp_path: Path) -> None:
    script = tmp_path / "own.py"
    script.write_text(
        "from experiments.campaigns.trial import Outcome\n"
        "def own(task):\n    return Outcome(True, {'seed': 1.0})\n"
    )
    with pytest.raises(CellError, match="'seed' is the name of two columns"):
        run_campaign(trials(f"{script}:own"), tmp_path / "out")


# ---- Stopped and gone on with


def test_stopped_campaign_goes_on_to_the_same_rows(campaign: Campaign, tmp_path: Path) -> None:
    """What ended before the stop is kept; the rest is run by the next call."""

    def stop(row: Row) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign(campaign.wanted, tmp_path, ended=stop)
    kept = {file: file.stat().st_mtime_ns for file in tmp_path.glob("trials/*.json")}
    assert 1 <= len(kept) < len(campaign.wanted)
    assert json.loads((tmp_path / "summary.json").read_text())["verdict"] == "interrupted"
    assert parquet.read_table(tmp_path / "trials.parquet").num_rows == len(kept)
    rows = run_campaign(campaign.wanted, tmp_path)
    assert comparable(rows) == comparable(campaign.rows)
    assert all(file.stat().st_mtime_ns == time for file, time in kept.items())


@pytest.mark.slow
def test_interrupted_campaign_keeps_what_was_done_and_goes_on(tmp_path: Path) -> None:
    """After SIGINT nothing runs on; the same command ends with the rows of an undisturbed run."""
    command = [
        sys.executable, "-m", "experiments", "sweep", f"{SCRIPT}:tiny", "--workers", "2",
        "--grid", "push.speed=0.1,0.2", "--grid", "pause=0.3", "--seeds", "6",
    ]  # fmt: skip
    path = {**os.environ, "PYTHONPATH": str(ROOT)}
    out = tmp_path / "out"
    run = subprocess.Popen(
        [*command, "--out", str(out)], env=path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    wait_for(lambda: len(list(out.glob("trials/*.json"))) >= 3)
    run.send_signal(signal.SIGINT)
    began = time.monotonic()
    run.wait(timeout=20)
    assert time.monotonic() - began < 10.0  # A second on a free core.
    assert run.returncode != 0
    kept = {file.name: file.stat().st_mtime_ns for file in out.glob("trials/*.json")}
    assert 3 <= len(kept) < 12
    assert json.loads((out / "summary.json").read_text())["verdict"] == "interrupted"
    assert parquet.read_table(out / "trials.parquet").num_rows == len(kept)
    time.sleep(0.5)
    assert len(list(out.glob("trials/*.json"))) == len(kept)
    subprocess.run([*command, "--out", str(out), "--resume", "--quiet"], env=path, check=True)
    assert all((out / "trials" / name).stat().st_mtime_ns == kept[name] for name in kept)
    subprocess.run([*command, "--out", str(tmp_path / "whole"), "--quiet"], env=path, check=True)
    assert index_of(out) == index_of(tmp_path / "whole")


@pytest.mark.slow
def test_workers_end_when_the_campaign_is_killed(tmp_path: Path) -> None:
    """By SIGKILL: nobody is left to tell them."""
    command = [sys.executable, "-m", "experiments", "sweep", f"{SCRIPT}:tiny"]
    command += ["--grid", "pause=0.2,1.0", "--seeds", "40", "--out", str(tmp_path)]
    run = subprocess.Popen(
        command, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL
    )
    wait_for(lambda: any(tmp_path.glob("trials/*.json")))
    run.kill()
    run.wait()
    time.sleep(0.5)
    there = len(list(tmp_path.glob("trials/*.json")))
    time.sleep(1.0)
    assert len(list(tmp_path.glob("trials/*.json"))) == there
    for file in tmp_path.glob("trials/*.json"):
        read_trial(file)


def index_of(out: Path) -> dict[str, list[Any]]:
    columns = parquet.read_table(out / "trials.parquet").to_pydict()
    del columns["cpu_seconds"]
    return columns


# ---- Executors


def test_processes_are_replaced_after_some_tasks() -> None:
    with LocalExecutor(1, tasks_per_process=2) as executor:
        ids = [future.result() for future in [executor.submit(os.getpid) for _ in range(5)]]
    assert ids[0] == ids[1] and ids[2] == ids[3]
    assert len(set(ids)) == 3 and os.getpid() not in ids


def test_exception_of_a_task_is_raised_and_its_process_goes_on() -> None:
    with LocalExecutor(1) as executor:
        first = executor.submit(os.getpid).result()
        with pytest.raises(ValueError, match="invalid literal"):
            executor.submit(int, "x").result()
        assert executor.submit(os.getpid).result() == first
        with pytest.raises(WorkerDied, match="exit code 3"):
            executor.submit(os._exit, 3).result()
        assert executor.submit(os.getpid).result() != first


def test_processes_end_with_the_one_that_started_them(tmp_path: Path) -> None:
    """Also after SIGKILL, in the middle of a task."""
    script = (
        "import os, time\n"
        "from experiments.campaigns.executors import LocalExecutor\n"
        "if __name__ == '__main__':\n"
        "    executor = LocalExecutor(1)\n"
        "    print(executor.submit(os.getpid).result(), flush=True)\n"
        "    executor.submit(time.sleep, 60.0).result()\n"
    )
    (tmp_path / "parent.py").write_text(script)
    parent = subprocess.Popen(
        [sys.executable, str(tmp_path / "parent.py")],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert parent.stdout is not None
    worker = int(parent.stdout.readline())
    assert is_running(worker)
    parent.kill()
    parent.communicate()
    wait_for(lambda: not is_running(worker))


def is_running(process: int) -> bool:
    """Return whether a process runs; one that only waits to be taken note of does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.slow
def test_dask_cluster_gives_the_same_rows(tmp_path: Path) -> None:
    """Two worker processes, with a trial that kills its worker."""
    distributed = pytest.importorskip("distributed")
    wanted = [*tiny_trials(), *trials(experiments.faulty, seeds=range(3))]
    here = run_campaign(wanted, tmp_path / "here", workers=2)
    once = str(tmp_path / "killed_once")
    deadly = trials(experiments.deadly, [{"once": once}], seeds=range(3))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address.replace("tcp://", "dask://")
        there = run_campaign(wanted, tmp_path / "there", executor=address)
        assert comparable(there) == comparable(here)
        # Dask runs the trial again by itself, on the worker that replaces the one that was killed.
        rows = run_campaign(deadly, tmp_path / "deadly", executor=address)
        assert [row.verdict for row in rows] == ["success"] * 3
    files = [sorted(f.name for f in (tmp_path / n / "trials").iterdir()) for n in ("here", "there")]
    assert files[0] == files[1]


def test_scheduler_that_does_not_answer_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("experiments.campaigns.executors.CONNECT_SECONDS", 0.5)
    with pytest.raises(InputError, match="No Dask scheduler answers at dask://127.0.0.1:9"):
        run_campaign(tiny_trials(), tmp_path, executor="dask://127.0.0.1:9")
