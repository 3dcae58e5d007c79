"""The element tests: how curves are read, the reference, formulas, and short runs of each kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cell.fixtures.soft_jig.soft.bed import Bed
from experiments.jig.curves import Curve, compare, reference_curves
from experiments.jig.element_tests import (
    Case,
    frozen_punch,
    lateral_formula,
    parameters,
    punch,
    reference,
    residual,
)
from experiments.jig_element_tests import COMPARED, IN_CUP, Row


def test_measures_of_a_spring_that_slips_are_exact() -> None:
    """20 N/mm up to 10 N: read as means over 0.1 mm, and the work as that below the curve."""
    x = np.linspace(0.0, 3e-3, 3001)
    known = [Curve(np.linspace(0.1e-3, 2e-3, 20), np.full(20, force)) for force in (8.0, 12.0)]
    peak, half, one, work = compare(Curve(x, np.minimum(2e4 * x, 10.0)), known)
    assert (peak.ours, half.ours, one.ours) == pytest.approx((10.0, 9.75, 10.0), rel=0.01)
    assert work.ours == pytest.approx(10 * 1.9 - 0.5 * 0.4 * 8.0, rel=0.02)
    assert peak.ratio == pytest.approx(1.0)
    assert peak.within


def test_every_comparison_has_a_reference() -> None:
    for case in [*COMPARED, *IN_CUP]:
        curves = reference_curves(case.test, case.bed)
        assert curves, case
        assert all(np.all(np.diff(curve.displacement) > 0) for curve in curves)


def test_cup_is_flat_and_as_deep_as_that_of_the_reference() -> None:
    """39.7 mm of beads at the wall, 50 mm in radius, and little more in the middle."""
    params = parameters(bed="cup")
    bed = Bed(params.bag, params.soil)
    assert params.bag.aperture_radius == pytest.approx(0.050, rel=1e-3)
    heights = bed.height_at(np.array([[0.0, 0.0], [0.047, 0.0]]))
    assert heights == pytest.approx([0.0397, 0.0397], abs=1.3e-3)


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


@pytest.mark.parametrize("time_step", [1e-3, 0.5e-3])
def test_sealed_push_is_that_of_the_discrete_elements(time_step: float) -> None:
    """Peak, force at 0.5 and 1 mm, and work within 25 %, at either step."""
    case = Case("push", True, 0.015)
    drag = case.run(time_step=time_step)
    for measure in compare(Curve(drag.way, drag.force), reference_curves(case.test, case.bed)):
        assert measure.ratio == pytest.approx(1.0, abs=0.25), measure.name


@pytest.mark.parametrize(
    "case", [Case("push", False, 0.010), Case("push", False, 0.015), Case("pull", False, 0.015)]
)
def test_vented_part_is_held_as_by_the_discrete_elements(case: Case) -> None:
    """In their range or within a factor of two of their mean: they scatter two- to fivefold."""
    drag = case.run()
    for measure in compare(Curve(drag.way, drag.force), reference_curves(case.test, case.bed)):
        assert measure.within or 0.5 < measure.ratio < 2.0, measure.name


def test_holding_grows_with_vacuum() -> None:
    """Sealed about in proportion; vented the weight alone without any."""
    sealed = [Case("push", True, 0.010, p).run().holding_force for p in (30e3, 90e3)]
    assert sealed[1] / sealed[0] == pytest.approx(3.0, rel=0.25)


def test_missing_reference_is_not_a_number() -> None:
    assert np.isnan(replace(Row("x", 1.0)).formula)
    assert np.isnan(Row("x", 1.0).ratio)
