"""Whether what stands in the cell before a run stands clear of each other: tray, jig, parts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from pydrake.geometry import GeometryId, QueryObject
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from cell.builder import Cell
from planning.product_check.finding import Finding, doubtful, fails, good

SUNK = 2e-4  # [A] A part in its nest may overlap it this much before it comes to rest [m].
FLOATS = 5e-3  # [A] A part this far above its nest falls [m].
NEIGHBOURHOOD = 0.1  # [m] Farther apart need not be measured.


def clearance_findings(cell: Cell, root: Context) -> Iterator[Finding]:
    """Yield findings on the tray against the jig, and on the parts in the tray."""
    query = cell.scene_graph.get_query_output_port().Eval(
        cell.scene_graph.GetMyContextFromRoot(root)
    )
    if cell.product.tray is None:
        yield fails("tray", "the product names none: nothing presents its parts")
        return
    tray = _tray(cell)
    stands = {"jig": cell.jig_base.body, "force plate": cell.jig_base.plate}
    for name, body in stands.items():
        gap = _gap(cell, query, tray, _shapes(cell, body))
        if gap < 0.0:
            text = f"it reaches {-1e3 * gap:.3g} mm into the {name}; move workcell.p_WT"
            yield fails("tray", text)
    shapes = {part.part.name: _shapes(cell, part.body) for part in cell.parts}
    before = True
    for name, own in shapes.items():
        gap = _gap(cell, query, tray, own)
        if gap < -SUNK:
            before = False
            yield fails(name, f"its place in the tray is {-1e3 * gap:.3g} mm inside of the tray")
        elif gap > FLOATS:
            yield doubtful(name, f"it falls {1e3 * gap:.3g} mm into the tray")
    for one, other in combinations(shapes, 2):
        gap = _gap(cell, query, shapes[one], shapes[other])
        if gap < -SUNK:
            before = False
            yield fails(one, f"in the tray it overlaps '{other}' by {-1e3 * gap:.3g} mm")
    if before:
        yield good("tray", "clear of the jig; parts stand in it without overlap")


def _tray(cell: Cell) -> Sequence[GeometryId]:
    plant = cell.plant
    name = str(cell.product.tray).rpartition("/")[2].removesuffix(".sdf")
    instance = plant.GetModelInstanceByName(name)
    (index,) = plant.GetBodyIndices(instance)
    return _shapes(cell, plant.get_body(index))


def _shapes(cell: Cell, body: RigidBody) -> Sequence[GeometryId]:
    return cell.plant.GetCollisionGeometriesForBody(body)


def _gap(
    cell: Cell, query: QueryObject, ours: Sequence[GeometryId], theirs: Sequence[GeometryId]
) -> float:
    """Return the least distance between two sets of shapes, negative if they overlap [m].

    Surfaces count as their convex hulls.
    """
    least = np.inf
    for a in ours:
        for b in theirs:
            least = min(least, query.ComputeSignedDistancePairClosestPoints(a, b).distance)
    return float(least)
