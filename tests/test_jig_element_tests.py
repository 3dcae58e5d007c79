"""The script of the element tests: reference data, formulas, and one short run of each kind."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.jig.element_tests import (
    CYLINDER,
    frozen_punch,
    held,
    lateral_formula,
    punch,
    reference,
    residual,
)
from experiments.jig.element_tests import UP as Z
from experiments.jig_element_tests import Row


def test_reference_has_a_force_for_every_depth() -> None:
    data = reference()
    for kind in ("vented_lateral", "sealed_lateral"):
        assert len(data[kind]["depth_mm"]) == len(data[kind]["force_N"])


def test_formula_is_the_statics_of_the_standing_cylinder() -> None:
    """132 kPa on 35 x 10 mm and the weight resist; a seal adds p A b over the lever arm."""
    vented = lateral_formula(0.010, 90e3, sealed=False)
    assert vented == pytest.approx((132e3 * 0.035 * 0.010 * 0.005 + 1.96 * 0.0175) / 0.05, rel=0.01)
    sealed = lateral_formula(0.010, 90e3, sealed=True) - vented
    assert sealed == pytest.approx(90e3 * 11.3e-4 * 0.0175 / 0.05, rel=0.01)


def test_soft_bed_is_stiffer_than_beads_without_a_membrane() -> None:
    """The reference has no membrane: a lower bound, to within a factor of four."""
    curve, _ = punch(0.010, step=2e-3)
    dome = reference()["dome_punch"]
    for depth, pressure in zip(dome["depth_mm"][2:8], dome["pressure_kPa"][2:8], strict=True):
        ours = np.interp(depth / 1e3, *curve.T) / 1e3
        assert 0.9 * pressure < ours < 4 * pressure


def test_bed_without_membrane_bears_like_the_reference() -> None:
    """Within 30 % of the mean of its scattered points from 3 to 10 mm; the imprint stays."""
    curve, bed = punch(0.010, step=2e-3, membrane=False)
    dome = reference()["dome_punch"]
    ours = [np.interp(depth / 1e3, *curve.T) / 1e3 for depth in dome["depth_mm"][2:8]]
    assert np.mean(ours) == pytest.approx(np.mean(dome["pressure_kPa"][2:8]), rel=0.3)
    assert residual(bed, 0.010) > 0.9


def test_frozen_bed_bears_more_than_ten_presses() -> None:
    """Ten times 20 N within a millimetre; the 837 N of the formula are not reached."""
    drag = frozen_punch()
    assert np.interp(1e-3, drag.way[:300], drag.force[:300]) > 200.0
    assert drag.force.max() < 837.0


@pytest.fixture(scope="module")
def pulls() -> dict[bool, float]:
    """Return the resistance of a shallow cylinder to an upward pull, vented and sealed [N]."""
    forces = {}
    for sealed in (False, True):
        rig = held(0.005, 90e3, sealed)
        drag = rig.drag(np.array([0.0, 0.0, CYLINDER.length]), Z, way=0.007, speed=0.03)
        forces[sealed] = drag.holding_force
    return forces


def test_seal_adds_the_suction_to_the_pull_out_force(pulls: dict[bool, float]) -> None:
    """Vented it is little more than the weight of 2 N; sealed about 102 N more."""
    assert pulls[False] < 8.0
    assert pulls[True] - pulls[False] == pytest.approx(90e3 * 11.3e-4, rel=0.3)


def test_missing_reference_is_not_a_number() -> None:
    assert np.isnan(Row("x", 1.0).formula)
    assert np.isnan(Row("x", 1.0).reference).all()
