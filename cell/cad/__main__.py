"""Write every generated model: ``python -m cell.cad [FOLDER]`` (default ``models/sdf``)."""

from __future__ import annotations

import sys
from pathlib import Path

from cell.cad import idler, motor_unit, robots, tray, workcell
from cell.paths import MODELS

WRITERS = [
    motor_unit.write_models,
    tray.write_models,
    idler.write_models,
    robots.write_models,
    workcell.write_models,
]
"""Functions that write models into a folder, one per module of this package."""


def main(folder: Path) -> None:
    """Write all models into a folder."""
    for write in WRITERS:
        write(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else MODELS / "sdf")
