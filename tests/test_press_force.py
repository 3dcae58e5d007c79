"""Force of press fits: analytic cases, and one that is drawn."""

from pathlib import Path

import numpy as np
import pytest
from drawn_products import pinned_block

from cell.products.loading import load_product
from cell.products.materials import DENSITIES, MODULI
from cell.products.press_force import FRICTION, Ring, press_force
from cell.products.read_options import ReadOptions
from experiments.product.random_drawing import write_cad
from planning.product_draft.draft import DraftOptions, draft_product


def test_a_solid_shaft_in_an_endless_hub_of_its_material() -> None:
    """The pressure is E delta / (2 r), whatever the radius: F = mu pi E delta L."""
    for radius in (3e-3, 10e-3):
        shaft, hub = Ring("steel", 0.0, radius), Ring("steel", radius, 1e3 * radius)
        expected = FRICTION * np.pi * MODULI["steel"] * 10e-6 * 20e-3
        assert press_force(shaft, hub, 10e-6, 20e-3) == pytest.approx(expected, rel=1e-5)


def test_thin_rings_give_way() -> None:
    """Thin rings are hoops: each gives way by p r^2 / (E t)."""
    radius, thin = 20e-3, 0.2e-3
    thick = 0.05 * radius
    shaft, hub = Ring("pom", radius - thin, radius), Ring("pom", radius, radius + thick)
    pressure = MODULI["pom"] * 10e-6 / radius**2 / (1 / thin + 1 / thick)
    expected = FRICTION * pressure * 2 * np.pi * radius * 5e-3
    assert press_force(shaft, hub, 10e-6, 5e-3) == pytest.approx(expected, rel=0.05)


def test_every_material_has_its_modulus() -> None:
    assert set(MODULI) == set(DENSITIES)


def test_the_force_of_a_drafted_press_fit(tmp_path: Path) -> None:
    """20 um radially at 16 mm, 16 mm deep, aluminium: several kilonewtons."""
    source = write_cad(pinned_block(-0.02), tmp_path / "cad")
    cad = load_product(source, ReadOptions(units="mm"))
    drafted = draft_product(cad, tmp_path, DraftOptions()).product
    (press,) = drafted.presses
    endless = FRICTION * np.pi * MODULI["aluminium"] * 20e-6 * press.depth
    assert 0.5 * endless < press.force < endless
