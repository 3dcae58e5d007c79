"""Densities of materials by name [kg/m3], and their elasticity.

[R] Metals: "Important properties of selected engineering materials" (6061, C36000, C22000, C11000,
4140; stainless between 302 and 316; grey iron of class 20), Tokyo Titanium for Ti-6Al-4V. Plastics:
engineersedge.com, "Properties of plastic materials"; PETG as a range from 24kjx.com.cn; PLA from
Scientific Reports 12 (2022) 22520. [A] PEEK and zinc; all moduli, as handbooks have them.
"""

from __future__ import annotations

from collections.abc import Mapping

from cell.errors import UnknownName

DENSITIES: Mapping[str, float] = {
    "abs": 1050.0,
    "aluminium": 2700.0,
    "brass": 8500.0,
    "bronze": 8800.0,
    "cast iron": 7150.0,
    "copper": 8890.0,
    "nylon": 1140.0,
    "peek": 1320.0,
    "petg": 1270.0,
    "pla": 1240.0,
    "pmma": 1190.0,
    "polycarbonate": 1200.0,
    "pom": 1410.0,
    "ptfe": 2190.0,
    "stainless steel": 7900.0,
    "steel": 7850.0,
    "titanium": 4430.0,
    "zinc": 7140.0,
}
MODULI: Mapping[str, float] = {
    "abs": 2.2e9,
    "aluminium": 70e9,
    "brass": 105e9,
    "bronze": 110e9,
    "cast iron": 110e9,
    "copper": 117e9,
    "nylon": 2.7e9,
    "peek": 3.6e9,
    "petg": 2.1e9,
    "pla": 3.5e9,
    "pmma": 3.1e9,
    "polycarbonate": 2.4e9,
    "pom": 2.8e9,
    "ptfe": 0.5e9,
    "stainless steel": 193e9,
    "steel": 206e9,
    "titanium": 114e9,
    "zinc": 97e9,
}
"""Young's moduli [Pa]."""
POISSON_RATIO = 0.33  # [A] Of all: 0.29 for steel and 0.38 for plastics change forces by 5 %.

ALIASES: Mapping[str, str] = {"aluminum": "aluminium", "stainless": "stainless steel"}

DEFAULT_MATERIAL = "aluminium"
FASTENER_MATERIAL = "steel"


def material_named(name: str) -> str:
    """Return a material's own name, in whatever case and spelling it was given.

    Raises:
        UnknownName: There is none of that name.
    """
    plain = " ".join(name.lower().replace("_", " ").split())
    plain = ALIASES.get(plain, plain)
    if plain not in DENSITIES:
        raise UnknownName("material", name, DENSITIES)
    return plain


def material_in(part: str) -> str | None:
    """Return the material that a part's name contains, such as "brass_bush"; None for none."""
    plain = part.lower().replace("_", " ").replace("-", " ")
    known = [*DENSITIES, *ALIASES]
    found = [name for name in known if f" {name} " in f" {plain} "]
    return material_named(max(found, key=len)) if found else None
