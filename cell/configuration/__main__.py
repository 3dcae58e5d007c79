"""Write the files that follow from the settings: ``python -m cell.configuration``.

``models/config/default.yaml``, and ``docs/reference/parameters.md`` of a source tree.
"""

from __future__ import annotations

from pathlib import Path

from cell.configuration.config_file import CONFIG_FOLDER
from cell.configuration.config_yaml import default_yaml
from cell.configuration.parameter_table import parameter_table
from cell.paths import MODELS

GENERATED = {
    CONFIG_FOLDER / "default.yaml": default_yaml,
    MODELS.parent / "docs" / "reference" / "parameters.md": parameter_table,
}
"""Each generated file with what returns its content."""


def write_generated() -> list[Path]:
    """Write all of them; return their paths."""
    for file, content in GENERATED.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content(), encoding="utf-8")
    return list(GENERATED)


if __name__ == "__main__":
    write_generated()
