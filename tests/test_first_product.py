"""The guide to a first product: its own commands, run in a folder outside of the repository."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "guide" / "first_product.md"
COMMANDS = re.findall(r"```sh\n(.+?)\n```", PAGE.read_text(), re.DOTALL)
SCRIPT = "from experiments.cli.main import main; import sys; sys.exit(main())"


def follow(commands: list[str], folder: Path) -> None:
    """Carry out commands of the page, with this Python and these sources."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    for command in commands:
        program, *words = shlex.split(command)
        if program == "python":
            words[0] = str(ROOT / "docs" / "tutorials" / words[0])
        start = [sys.executable] if program == "python" else [sys.executable, "-c", SCRIPT]
        done = subprocess.run(
            [*start, *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


def test_the_page_goes_from_cad_to_an_assembly() -> None:
    verbs = [" ".join(command.split()[:2]) for command in COMMANDS]
    assert verbs == ["python draw_hub.py", "soft-jig init", "soft-jig check", "soft-jig assemble"]


def test_drafted_as_the_page_says_and_nothing_would_fail(tmp_path: Path) -> None:
    follow(COMMANDS[:3], tmp_path)
    product = yaml.safe_load((tmp_path / "hub_product" / "product.yaml").read_text())
    assert {"base", "flange", "screw_1", "screw_2"} == set(product["parts"])
    assert product["orders"] == [["base", "flange", "screws"]]


@pytest.mark.slow
def test_assembled_as_the_page_says(tmp_path: Path) -> None:
    follow(COMMANDS, tmp_path)
    result = json.loads((tmp_path / "out" / "hub" / "result.json").read_text())
    assert result["verdict"] == "success"
