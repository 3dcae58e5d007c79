"""What is installed works on its own: the wheel carries the models."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ("cell", "planning", "experiments", "models", "pyproject.toml", "README.md", "LICENSE")


@pytest.mark.slow
def test_wheel_carries_every_data_file_and_no_tests(tmp_path: Path) -> None:
    """Built from a copy: setuptools leaves its build folder beside the sources."""
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name)
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", "dist", "."]
    subprocess.run(command, cwd=tmp_path, check=True)
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    packed = set(zipfile.ZipFile(wheel).namelist())
    models = {p.relative_to(ROOT).as_posix() for p in (ROOT / "models").rglob("*") if p.is_file()}
    assert models <= packed
    for package in ("cell", "planning", "experiments"):
        files = (p for p in (ROOT / package).rglob("*") if p.is_file() and p.suffix != ".pyc")
        assert {p.relative_to(ROOT).as_posix() for p in files} <= packed
        assert f"{package}/py.typed" in packed
    assert not any(name.startswith("tests/") for name in packed)
