"""What a saved state holds for: a digest of everything that a restored run depends on."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from importlib.metadata import version

import numpy as np
from pydrake.multibody.tree import BodyIndex

from cell.builder import Cell
from cell.products.product import Product


def identity_of(cell: Cell) -> dict[str, str]:
    """Return product, configuration, bodies and Drake's version of a cell, as digests."""
    return {
        "product": f"{cell.product.name} {product_digest(cell.product)}",
        "configuration": _digest(json.dumps(cell.config.to_dict(), sort_keys=True, default=str)),
        "set of bodies": _digest("\n".join(_bodies(cell))),
        "Drake": version("drake"),
    }


def _bodies(cell: Cell) -> Iterator[str]:
    """Yield what the plant has: states, masses, shapes, and which contact properties there are."""
    plant, inspector = cell.plant, cell.scene_graph.model_inspector()
    context = plant.CreateDefaultContext()
    yield from plant.GetStateNames()
    for index in map(BodyIndex, range(plant.num_bodies())):
        body = plant.get_body(index)
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        yield f"{body.scoped_name()} {inertia.CopyToFullMatrix6()}"
        for geometry in plant.GetCollisionGeometriesForBody(body):
            yield f"{inspector.GetName(geometry)} {inspector.GetPoseInFrame(geometry)}"
            # The same wherever the models lie, and in whatever order Drake lists the properties.
            yield re.sub(r"'/.*/", "'", repr(inspector.GetShape(geometry)))
            yield from sorted(str(inspector.GetProximityProperties(geometry)).splitlines())


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def product_digest(product: Product) -> str:
    """Return a digest of what a product's file and meshes say about its parts and joints."""
    digest = hashlib.sha256(repr(product.joints).encode())
    for part in product.parts.values():
        model = (part.model or "").rpartition("/")[2]  # The same wherever it lies.
        digest.update(f"{part.name} {part.mass} {model} {part.X_AP} {part.X_TrayP}".encode())
        digest.update(np.ascontiguousarray(part.mesh.vertices).tobytes())
        digest.update(np.ascontiguousarray(part.mesh.faces).tobytes())
    return digest.hexdigest()[:16]
