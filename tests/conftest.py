"""Settings that must be in the environment before numpy and matplotlib are imported."""

import os

# The suite runs one process per core: more threads inside each would only wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

import pytest


@pytest.fixture(scope="session")
def motor_unit_cell():
    """Return the cell for the motor unit, built once; every test makes its own Simulation."""
    from cell import CellConfig, build_cell, load_product

    return build_cell(CellConfig(), load_product("motor_unit"))
