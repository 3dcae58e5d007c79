"""The commented default configuration file, written from the settings in the code."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

import yaml

from cell.configuration.config import CellConfig
from cell.configuration.sections import children, is_section, setting_of
from cell.setting import Setting

HEADER = """\
# The default configuration, written by `make models` from the settings in the code.
# Copy it, keep only what you change, and pass the copy with --config; or change single values
# with --set, for example --set simulation.time_step=0.002.
# Above each value: [unit | valid] what it is; below that, where it comes from: [S] the paper,
# [R] read in the source named, [M] measured, [D] derived, [A] assumption. "DEM" is the project's
# discrete-element reference run with glass beads in a dome of the same size.
"""
WIDTH = 100


def default_yaml() -> str:
    """Return the content of ``models/config/default.yaml``."""
    return "\n".join([*HEADER.splitlines(), *_lines(CellConfig(), "")]) + "\n"


def summary(section: Any) -> str:
    """Return what a section is about: the first line of its class's docstring."""
    return "" if isinstance(section, Mapping) else (type(section).__doc__ or "").splitlines()[0]


def value_text(value: Any) -> str:
    """Return a value as YAML on one line."""
    plain = list(value) if isinstance(value, tuple) else value
    text = yaml.safe_dump(plain, default_flow_style=True, width=1000)
    return text.removesuffix("...\n").strip()


def _lines(section: Any, indent: str) -> list[str]:
    lines = []
    for key, value in children(section).items():
        if is_section(value):
            about = summary(value)
            lines += ["", *([f"{indent}# {about}"] if about else []), f"{indent}{key}:"]
            lines += _lines(value, indent + "  ")
        else:
            lines += _comment(setting_of(section, key), indent)
            lines.append(f"{indent}{key}: {value_text(value)}")
    return lines


def _comment(info: Setting, indent: str) -> list[str]:
    """Return meaning, unit, range and source as comment lines."""
    facts = [info.unit, info.range_text()]
    known = f"[{' | '.join(fact for fact in facts if fact)}] " if any(facts) else ""
    start = f"{indent}# "
    return [
        *textwrap.wrap(f"{known}{info.meaning}", WIDTH, initial_indent=start,
                       subsequent_indent=f"{start}  "),
        *textwrap.wrap(info.source, WIDTH, initial_indent=f"{start}  ",
                       subsequent_indent=f"{start}  "),
    ]  # fmt: skip
