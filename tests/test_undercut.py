"""Declared snap fits and flexible parts: what they bend over, and how they leave."""

from __future__ import annotations

from dataclasses import replace

import pytest
from manifold3d import CrossSection, Manifold
from pydrake.math import RigidTransform
from tiny_products import box, product_of, rod

from cell.products.declared import declared_from
from cell.products.product import Product
from planning import plan
from planning.feasibility.directions import DIRECTIONS


def clipped(undercut: float, **declared: list[str]) -> Product:
    """A clip whose two hooks hold a frame from below, by an undercut [mm]."""
    frame = box((30, 30, 10), (-15, -15, 0)) - box((12, 12, 30), (-6, -6, -5))
    clip = box((20, 20, 4), (-10, -10, 10))
    for side in (1, -1):
        leg = box((2, 8, 14), (3.9, -4, -3))
        hook = box((0.1 + undercut, 8, 3), (5.9, -4, -3))
        clip += (leg + hook).scale([side, 1, 1])
    product = product_of({"frame": frame, "clip": clip})
    return replace(product, declared=declared_from(product, **declared))


def belt_drive(low: float, high: float, **declared: list[str]) -> Product:
    """A belt round two pulleys on a base; flanges are wider than the belt's inside [mm]."""
    shapes = {"base": box((110, 40, 4), (-55, -20, 0))}
    outline = CrossSection.batch_hull(
        [CrossSection.circle(10, 96).translate([x, 0]) for x in (-30, 30)]
    )
    for name, x in (("pulley_a", -30), ("pulley_b", 30)):
        pulley = rod(20, 4, 20, 96) + rod(20 + 2 * low, 4, 6) + rod(20 + 2 * high, 16, 20)
        shapes[name] = pulley.translate([x, 0, 0])
    wide = outline.offset(2.0, circular_segments=96)
    shapes["belt"] = Manifold.extrude(wide - outline, 8).translate([0, 0, 7])
    product = product_of(shapes)
    return replace(product, declared=declared_from(product, **declared))


@pytest.mark.parametrize("undercut", [0.3, 0.8, 1.5])
def test_a_snap_fit_leaves_over_its_undercut_when_it_is_declared(undercut):
    assert not plan(clipped(undercut)).feasible
    fixing = plan(clipped(undercut, snap=["clip,frame"]))
    assert fixing.feasible and fixing.evidence
    (one,) = fixing.evidence.undercuts
    assert (one.part, one.direction, one.kind) == ("frame", "-z", "snap")
    assert 1e3 * one.width == pytest.approx(undercut, abs=0.01)
    frame, clip = 0, 1
    assert [j for j in DIRECTIONS if fixing.free[j][clip, frame]] == ["+z"]
    assert [j for j in DIRECTIONS if fixing.free[j][frame, clip]] == ["-z"]
    left = {b.direction for b in fixing.blockers if b.moving == "clip"}
    assert left == set(DIRECTIONS) - {"+z"}


def test_a_snap_fit_does_not_excuse_other_parts():
    """A closed cage round both still holds them."""
    product = clipped(0.8)
    cage = box((60, 60, 60), (-30, -30, -30)) - box((50, 50, 50), (-25, -25, -25))
    both = {**product.parts, **product_of({"cage": cage}).parts}
    caged = replace(product, parts=both)
    fixing = plan(replace(caged, declared=declared_from(caged, snap=["clip,frame"])))
    assert not fixing.feasible


@pytest.mark.parametrize(
    ("low", "high", "ways"),
    [(1.0, 1.0, {"+z"}), (3.0, 3.0, {"+z"}), (3.0, 1.0, {"+z"}), (1.0, 3.0, {"+z"})],
)
def test_a_belt_stretches_over_its_flanges_when_it_is_declared(low, high, ways):
    """By the height of the flange, however thin it is; never through the base below."""
    assert not plan(belt_drive(low, high)).feasible
    fixing = plan(belt_drive(low, high, flexible=["belt"]))
    assert fixing.feasible and fixing.evidence
    assert {one.direction for one in fixing.evidence.undercuts} == ways
    assert [1e3 * one.width for one in fixing.evidence.undercuts] == pytest.approx([high], abs=0.05)
    belt, base = fixing.parts.index("belt"), fixing.parts.index("base")
    assert fixing.free["-z"][belt, base] == 0


@pytest.mark.parametrize(
    "shape", [box((20, 20, 1), (-10, -10, -0.5)), Manifold.sphere(8, 32)], ids=["sheet", "ball"]
)
@pytest.mark.parametrize("kind", ["snap", "flexible"])
def test_nothing_bends_out_of_a_closed_cavity(shape, kind):
    shell = box((30, 30, 30), (-15, -15, -15)) - shape
    product = product_of({"shell": shell, "part": shape})
    declared = {"snap": ["part,shell"]} if kind == "snap" else {"flexible": ["part"]}
    assert not plan(replace(product, declared=declared_from(product, **declared))).feasible


def test_a_snap_that_sits_too_deep_is_measured_on_what_is_accepted():
    """The clip is drawn 0.3 mm into the frame that it lies on."""
    product = clipped(0.8)
    clip = product.parts["clip"]
    lower = replace(clip, X_AP=RigidTransform([0, 0, -3e-4]))
    product = replace(product, parts={**product.parts, "clip": lower})
    declared = declared_from(product, snap=["clip,frame"], accept=["clip,frame"])
    fixing = plan(replace(product, declared=declared))
    assert fixing.feasible and fixing.evidence
    (one,) = fixing.evidence.undercuts
    assert (one.part, one.direction) == ("frame", "-z")
    assert 1e3 * one.width == pytest.approx(0.8, abs=0.01)
