"""What exists: products, arms, tools, soft jig, threads and sensors as one Drake diagram."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cell.builder import Cell, add_cell, build_cell
    from cell.config import CellConfig
    from cell.loading import load_product
    from cell.product import Product
    from cell.simulation import Simulation

__all__ = [
    "Cell",
    "CellConfig",
    "Product",
    "Simulation",
    "add_cell",
    "build_cell",
    "load_product",
]

# Looked up on first use: Drake takes a second that `cell.errors` and `--help` can do without.
_HOME = {
    "Cell": "cell.builder",
    "CellConfig": "cell.config",
    "Product": "cell.product",
    "Simulation": "cell.simulation",
    "add_cell": "cell.builder",
    "build_cell": "cell.builder",
    "load_product": "cell.loading",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'cell' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)
