"""What exists: products, arms, tools, soft jig, threads and sensors as one Drake diagram.

What is named in `__all__` is for users. The folders are its rooms, from the lowest up:

- `soft_jig`: the bag of beads, soft and frozen.
- `settings`: the configuration.
- `products`: what is assembled, and reading it from files.
- `cad`: geometry of the models, ``python -m cell.cad``.
- `workpieces`: a product's parts and threads in the plant.
- `machines`: arms, tools, the jig's base, sensors.
- `running`: the cell as one diagram, phases, simulation, log, saved states.
- `trial`: one part on the jig, and the rig that pushes it.

A test keeps their imports pointing down; `errors` and `paths` are for all of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cell.builder import Cell, add_cell, build_cell
    from cell.configuration.config import CellConfig
    from cell.products.loading import load_product
    from cell.products.product import Product
    from cell.simulation.simulation import Simulation

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
    "CellConfig": "cell.configuration.config",
    "Product": "cell.products.product",
    "Simulation": "cell.simulation.simulation",
    "add_cell": "cell.builder",
    "build_cell": "cell.builder",
    "load_product": "cell.products.loading",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'cell' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)
