"""Where a part goes on the jig: upright, centred, at the height asked for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cell import load_product
from planning.operations.placement import pose_on_jig, upright
from planning.operations.station import Station

X_WJ = RigidTransform([0.0, 0.15, 0.20])
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
YAWS = np.deg2rad([0.0, 37.0, 90.0, 200.0])


@pytest.fixture(scope="module")
def station() -> Station:
    """Return what these functions see of a station: the parts and where the jig is."""
    parts = load_product("motor_unit").parts
    stub = SimpleNamespace(part=parts.__getitem__, cell=SimpleNamespace(X_WJ=X_WJ))
    return cast(Station, stub)


def axis_of(up: str) -> np.ndarray:
    return (1.0 if up[0] == "+" else -1.0) * np.eye(3)["xyz".index(up[1])]


@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("yaw", YAWS)
def test_upright_is_a_rotation_that_turns_up_upwards(up: str, yaw: float) -> None:
    R_WA = upright(up, yaw).matrix()
    np.testing.assert_allclose(R_WA @ axis_of(up), [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(R_WA @ R_WA.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R_WA) == pytest.approx(1.0)


@pytest.mark.parametrize("up", AXES)
def test_yaw_turns_about_the_vertical(up: str) -> None:
    turn = upright(up, 0.5) @ upright(up, 0.0).inverse()
    np.testing.assert_allclose(turn.ToAngleAxis().axis(), [0.0, 0.0, 1.0], atol=1e-9)
    assert turn.ToAngleAxis().angle() == pytest.approx(0.5)


@pytest.mark.parametrize("part", ["motor", "plate"])
@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("yaw", YAWS[:2])
def test_part_stands_centred_at_its_height(
    station: Station, part: str, up: str, yaw: float
) -> None:
    """Centre of mass over the jig's centre, lowest point at the height, in every posture."""
    height = 0.04
    mesh = station.part(part).mesh
    X_WP = pose_on_jig(station, part, up, yaw, height)
    X_JP = X_WJ.inverse() @ X_WP
    np.testing.assert_allclose((X_JP @ mesh.center_mass)[:2], [0.0, 0.0], atol=1e-12)
    assert X_JP.multiply(mesh.vertices.T)[2].min() == pytest.approx(height, abs=1e-12)
