"""Provenance of a result: versions and settings, as ``result.json`` states them."""

from __future__ import annotations

import math
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

PACKAGES = ("soft-jig-cell", "drake", "numpy", "scipy", "ompl", "trimesh")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that affect the outcome."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # Run from the source tree, not installed.
            found[package] = "unknown"
    return found


def finite(value: Any) -> Any:
    """Return nested settings with infinity and NaN as text: JSON has no number for them."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
