"""The reference of all settings for the documentation, written from the code."""

from __future__ import annotations

from typing import Any

from cell.configuration.config import CellConfig
from cell.configuration.config_yaml import summary, value_text
from cell.configuration.sections import children, is_section, setting_of
from cell.setting import Setting

HEADER = """\
# Parameters

Every setting of the cell, written by `make models` from the declarations in the code. A value is
changed with `--set key=value` or in a YAML file given with `--config`; a copy of
`models/config/default.yaml` is a good start. A value outside its valid range is refused.

Tags of the sources: [S] the paper, [R] read in the source named, [M] measured, [D] derived,
[A] assumption. "DEM" is the project's discrete-element reference run with glass beads in a dome of
the same size.
"""
COLUMNS = ("key", "default", "unit", "valid", "meaning", "source")


def parameter_table() -> str:
    """Return the content of ``docs/reference/parameters.md``."""
    parts = [HEADER]
    for key, section in children(CellConfig()).items():
        parts += _tables(key, section)
    return "\n".join(parts)


def _tables(path: str, section: Any) -> list[str]:
    """Return one table for a section, then those of the sections in it."""
    rows, inner = [], []
    for key, value in children(section).items():
        full = f"{path}.{key}"
        if is_section(value):
            inner += _tables(full, value)
        else:
            rows.append(_row(full, value, setting_of(section, key)))
    if not rows:
        return inner
    lines = [f"| {' | '.join(row)} |" for row in (COLUMNS, ("---",) * len(COLUMNS), *rows)]
    return [f"## `{path}`\n\n{summary(section)}\n", *lines, "", *inner]


def _row(path: str, value: Any, info: Setting) -> tuple[str, ...]:
    cells = (
        f"`{path}`", f"`{value_text(value)}`", info.unit, info.range_text() or "any",
        info.meaning, info.source,
    )  # fmt: skip
    return tuple(cell.replace("|", "\\|") for cell in cells)
