"""What a saved state holds for: a digest of everything that a restored run depends on."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import version

import numpy as np

from cell.builder import Cell
from cell.products.product import Product


def identity_of(cell: Cell) -> dict[str, str]:
    """Return product, configuration, bodies and Drake's version of a cell, as digests."""
    return {
        "product": f"{cell.product.name} {_digest_of(cell.product)}",
        "configuration": _digest(json.dumps(cell.config.to_dict(), sort_keys=True, default=str)),
        # A caller may have added some.
        "set of bodies": _digest("\n".join(cell.plant.GetStateNames())),
        "Drake": version("drake"),
    }


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _digest_of(product: Product) -> str:
    """Return a digest of what a product's file and meshes say about its parts and joints."""
    digest = hashlib.sha256(repr(product.joints).encode())
    for part in product.parts.values():
        digest.update(f"{part.name} {part.mass} {part.model} {part.X_AP} {part.X_TrayP}".encode())
        digest.update(np.ascontiguousarray(part.mesh.vertices).tobytes())
        digest.update(np.ascontiguousarray(part.mesh.faces).tobytes())
    return digest.hexdigest()[:16]
