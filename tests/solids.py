"""Comparing generated meshes."""

from pathlib import Path

import numpy as np
import trimesh


def assert_same_solid(one: Path, other: Path) -> None:
    """Which diagonal splits a flat face depends on the processor; the solid does not."""
    a, b = (trimesh.load_mesh(path, process=True, merge_norm=True) for path in (one, other))
    np.testing.assert_allclose(a.bounds, b.bounds, atol=1e-8)
    np.testing.assert_allclose([a.area, a.volume], [b.area, b.volume], rtol=1e-6)
