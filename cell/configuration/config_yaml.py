"""The commented default configuration file, written from the settings in the code.

``python -m cell.configuration.config_yaml`` writes ``models/config/default.yaml``.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import yaml

from cell.configuration.config import CellConfig
from cell.configuration.config_file import CONFIG_FOLDER, setting_of
from cell.setting import Setting

HEADER = """\
# The default configuration, written by `make models` from the settings in the code.
# Copy it, keep only what you change, and pass the copy with --config; or change single values
# with --set, for example --set simulation.time_step=0.002.
"""


def commented_yaml(section: Any, indent: str = "") -> str:
    """Return a section as YAML, each value with its unit, range and meaning as a comment."""
    lines = []
    for info in fields(section):
        value = getattr(section, info.name)
        if is_dataclass(value):
            summary = (type(value).__doc__ or "").splitlines()[0]
            lines += ["", f"{indent}# {summary}", f"{indent}{info.name}:"]
            lines.append(commented_yaml(value, indent + "  "))
        else:
            about = setting_of(section, info)
            text = yaml.safe_dump(
                list(value) if isinstance(value, tuple) else value,
                default_flow_style=True, width=1000,
            )  # fmt: skip
            text = text.removesuffix("...\n").strip()
            if comment := _comment(about):
                lines.append(f"{indent}# {comment}")
            lines.append(f"{indent}{info.name}: {text}")
    return "\n".join(lines)


def _comment(about: Setting) -> str:
    limits = " | ".join(about.choices) or about.range_text()
    if limits == about.unit:
        limits = ""
    unit = f"[{about.unit}] " if about.unit else ""
    return f"{unit}{about.meaning}" + (f" Valid: {limits}." if limits else "")


def main() -> None:
    """Write ``models/config/default.yaml``."""
    CONFIG_FOLDER.mkdir(exist_ok=True)
    text = f"{HEADER}{commented_yaml(CellConfig())}\n"
    (CONFIG_FOLDER / "default.yaml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
