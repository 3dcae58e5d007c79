"""Joints of a product file: every kind reads, and what cannot be read says why."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from cell.errors import InputError, UnknownName
from cell.paths import model_folder
from cell.products.fields import Fields
from cell.products.joints import JOINT_TYPES, Fit, Press, Rest, Screw, head_friction
from cell.products.loading import load_product
from cell.products.product import Product

PARTS = """
parts:
  base: {mesh: cube.stl, mass_kg: 0.1}
  lid: {mesh: cube.stl, mass_kg: 0.1}
  pin_1: {mesh: cube.stl, mass_kg: 0.1}
  pin_2: {mesh: cube.stl, mass_kg: 0.1}
groups: {pins: [pin_1, pin_2]}
"""
FIT = "{type: fit, shaft: base, hole: lid, at_mm: [1, 2, 3], depth_mm: 6}"
PRESS = "{type: press, shaft: pin_1, hole: lid, at_mm: [1, 2, 3], depth_mm: 6, force_N: 50}"
SCREW = (
    "{type: screw, part: pins, into: base, clamps: lid, thread: M3, diameter_mm: 3, "
    "pitch_mm: 0.5, thread_depth_mm: 5, torque_Nm: 0.5, nut_factor: 0.2}"
)
REST = "{type: rest, part: lid, on: base}"


@pytest.fixture
def read(tmp_path: Path):
    """Return a function that reads a product with the given text after its parts."""
    trimesh.creation.box((20, 20, 20)).export(tmp_path / "cube.stl")

    def read(*entries: str, key: str = "joints") -> Product:
        file = tmp_path / "joined.yaml"
        file.write_text(PARTS + f"{key}: [{', '.join(entries)}]\n")
        return load_product(file)

    return read


def test_every_kind_of_joint_reads_in_the_order_of_the_file(read) -> None:
    product = read(REST, FIT, SCREW, PRESS)
    rest, fit, bolt_1, bolt_2, press = product.joints
    assert rest == Rest("lid", "base")
    assert isinstance(fit, Fit) and (fit.shaft, fit.hole, fit.depth) == ("base", "lid", 6e-3)
    np.testing.assert_allclose(fit.p_AoF, [1e-3, 2e-3, 3e-3])
    assert isinstance(press, Press) and press.parts == ("pin_1", "lid")
    assert (press.depth, press.force) == (6e-3, 50.0)
    assert bolt_1 == Screw("pin_1", "base", "lid", "M3", 3e-3, 5e-4, 5e-3, 0.5, 0.2)
    assert bolt_2 == replace(bolt_1, part="pin_2")


def test_a_bit_fits_in_as_many_ways_as_its_drive_has_sides(read) -> None:
    entry = SCREW[:-1] + ", drive: {}, bit_seat_mm: 0.8}}"
    for drive, ways in (("hex 3", 6), ("cross 2", 4)):
        bolt = read(entry.replace("{}", drive).replace("}}", "}")).joints[0]
        assert (bolt.drive.name, bolt.drive.positions) == (drive, ways)
        assert bolt.bit_seat == pytest.approx(8e-4)
    with pytest.raises(UnknownName, match="torx 10"):
        read(entry.replace("{}", "torx 10").replace("}}", "}"))


def test_screws_are_tightened_in_one_pass_or_two(read) -> None:
    entry = SCREW[:-1] + ", passes: {}}"
    assert read(SCREW).joints[0].passes == 1
    assert read(entry.replace("{}", "2")).joints[0].passes == 2
    for wrong in ("3", "1.5", "-1"):
        with pytest.raises(InputError, match="passes"):
            read(entry.replace("{}", wrong))


def test_fits_and_screws_are_views_of_the_joints(read) -> None:
    product = read(REST, FIT, SCREW, PRESS)
    assert product.fits == product.joints[1:2]
    assert product.screws == {"pin_1": product.joints[2], "pin_2": product.joints[3]}
    assert read().joints == ()


def test_group_that_rests_is_one_joint_per_member(read) -> None:
    product = read("{type: rest, part: pins, on: base}")
    assert product.joints == (Rest("pin_1", "base"), Rest("pin_2", "base"))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (FIT.replace("fit", "glue"), "type in joined.yaml: joints.0. called 'glue'.*fit, press, r"),
        (FIT.replace("fit", "fits"), "Did you mean 'fit'"),
        (FIT.replace("type: fit, ", ""), "joints.0.: 'type' is missing, one of fit, press, rest"),
        ("fit", "joints.0.: expected keys with values"),
        (FIT.replace("at_mm", "at_m"), "called 'at_m'. Did you mean 'at_mm'"),
        (FIT.replace("hole: lid, ", ""), "joints.0.: 'hole' is missing"),
        (FIT.replace("lid", "lit"), "No part 'lit'. Did you mean 'lid'"),
        (FIT.replace("shaft: base", "shaft: lid"), "joins a part to itself: lid, lid"),
        (FIT.replace("depth_mm: 6", "depth_mm: -6"), "joints.0..depth_mm: .* above zero"),
        (PRESS.replace(", force_N: 50", ""), "'force_N' is missing"),
        (REST.replace("part: lid", "part: pens"), "No part or group 'pens'. Did you mean 'pins'"),
        (REST.replace("on: base", "on: pins"), "No part 'pins'"),
        (f"{SCREW}, {SCREW.replace('pins', 'pin_2')}", "joints.1.: 'pin_2' has a screw joint"),
        (SCREW.replace("factor: 0.2", "factor: 0.026"), "factor of 0.026 .* without friction"),
    ],
)
def test_joint_that_cannot_be_read_says_why(read, entry: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(entry)


@pytest.mark.parametrize(("key", "kind"), [("fasteners", "screw"), ("fits", "fit")])
def test_former_keys_name_their_successor(read, key: str, kind: str) -> None:
    with pytest.raises(InputError, match=f"'{key}' .* use 'joints', with 'type: {kind}'") as caught:
        read(key=key)
    assert "\n" not in str(caught.value)


def test_new_kind_of_joint_is_one_class(read, monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class Glue:
        keys: ClassVar[tuple[str, ...]] = ("on", "to")
        on: str
        to: str

        @property
        def parts(self) -> tuple[str, ...]:
            return self.on, self.to

        @classmethod
        def read(cls, entry: Fields, product: Product) -> list["Glue"]:
            return [cls(entry.text("on"), entry.text("to"))]

    monkeypatch.setitem(JOINT_TYPES, "glue", Glue)
    assert read("{type: glue, on: base, to: lid}").joints == (Glue("base", "lid"),)


def bolt(**fields) -> Screw:
    standard = Screw("bolt", "base", "lid", "M3", 3e-3, 5e-4, 5e-3, 0.5, 0.2, 2.2e-3)
    return replace(standard, **fields)


@pytest.mark.parametrize("K", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("counter", [None, 0.25, 0.8])
def test_head_friction_gives_the_nut_factor(K: float, counter: float | None) -> None:
    """T = F (P / (2 pi) + mu r) with what Drake combines from head and counter-surface."""
    screw = bolt(nut_factor=K)
    head = head_friction(screw, counter)
    other = head if counter is None else counter
    mu = 2 * head * other / (head + other)
    assert (5e-4 / (2 * np.pi) + mu * 2.2e-3) / 3e-3 == pytest.approx(K, rel=1e-5)


def test_standard_head_and_hole_are_within_a_twentieth_of_an_m3_socket_head() -> None:
    """Bearing face of 5.07 mm (ISO 4762) over a hole of 3.4 mm (ISO 273)."""
    drawn = bolt(friction_radius=(5.07e-3 + 3.4e-3) / 4)
    standard = bolt(friction_radius=None)
    assert head_friction(standard) == pytest.approx(head_friction(drawn), rel=0.05)


def test_impossible_nut_factors_are_refused() -> None:
    with pytest.raises(InputError, match="'bolt': a nut factor of 0.02 is no more than"):
        head_friction(bolt(nut_factor=0.02))
    with pytest.raises(InputError, match="needs a friction coefficient above 0.118 of 'lid'"):
        head_friction(bolt(), 0.1)


@pytest.mark.parametrize("name", ["motor_unit", "idler"])
def test_models_are_written_with_the_head_friction_of_their_product(name: str) -> None:
    """Head and washers alike, to the last digit: their combination is the same as well."""
    product = load_product(name)
    for screw in product.screws.values():
        head = model_friction(product, screw.part, "head")
        washers = model_friction(product, screw.clamps, "washer")
        assert head | washers == {head_friction(screw)} == {head_friction(screw, washers.pop())}


def model_friction(product: Product, part: str, prefix: str) -> set[float]:
    """Return the coefficients of the contact pieces of a model whose names begin so."""
    model = product.parts[part].model
    assert model is not None
    root = ElementTree.parse(model_folder(model) / f"{model}.sdf").getroot()
    return {
        float(mu.text or "nan")
        for piece in root.iter("collision")
        if piece.get("name", "").startswith(prefix)
        for tag in ("mu_static", "mu_dynamic")
        for mu in piece.iter(f"{{drake.mit.edu}}{tag}")
    }


def test_unknown_models_are_refused_by_name() -> None:
    with pytest.raises(UnknownName, match="No model 'moter'. Did you mean 'motor'"):
        model_folder("moter")
