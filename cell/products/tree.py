"""The tree of a CAD file: sub-assemblies, what is in them, and names as a person gives them."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import trimesh

# Names that exporters make up: by OpenCASCADE and the kernels' classes, glTF writers, CadQuery, and
# the occurrences of SolidWorks, Creo and STEP libraries.
GENERATED = re.compile(
    r"""[\d_:.\[\]=>#-]*
    | Open_?CASCADE.* | (COMPOUND|COMPSOLID|SOLID|SHELL|SHAPE|ASSEMBLY)[\d_:.]*
    | NAUO\d* | Next_assembly.* | (none|unnamed|untitled|undefined|unknown|noname)[\d_:.]*
    | (node|mesh|geometry|gltf|primitive)[\d_:.]*
    | [\da-f]{8}-[\da-f]{4}-[\da-f]{4}-[\da-f]{4}-[\da-f]{12}(_part)?""",
    re.IGNORECASE | re.VERBOSE,
)

UNNAMED = "part"


@dataclass(frozen=True)
class Surface:
    """One surface of a part.

    Attributes:
        mesh: In a frame of its own [m]; instances of one product share it.
        X_AP: (4, 4) its pose in the product frame A.
        name: Of the object in a file with several.
    """

    mesh: trimesh.Trimesh
    X_AP: np.ndarray = field(default_factory=lambda: np.eye(4))
    name: str = ""


@dataclass(frozen=True)
class Node:
    """An instance of a part or of a sub-assembly.

    Attributes:
        given: Its own name, fit for an order; "" if the author gave none.
        product: Name of what it is an instance of, likewise.
        surfaces: Of a part.
        children: Of a sub-assembly.
        lacking: Why it has neither, "" if it has.
        X_AP: (4, 4) its pose in the product frame A.
    """

    given: str = ""
    product: str = ""
    surfaces: tuple[Surface, ...] = ()
    children: tuple[Node, ...] = ()
    lacking: str = ""
    X_AP: np.ndarray = field(default_factory=lambda: np.eye(4))

    @property
    def name(self) -> str:
        """The name of the instance, else that of its product; "" if the author named neither."""
        return self.given or self.product

    def moved(self, X: np.ndarray) -> Node:
        """Return the tree with its poses multiplied by X (4, 4) from the left."""
        return replace(
            self,
            surfaces=tuple(replace(surface, X_AP=X @ surface.X_AP) for surface in self.surfaces),
            children=tuple(child.moved(X) for child in self.children),
            X_AP=X @ self.X_AP,
        )


def fit_for_orders(name: str) -> str:
    """Return a name without what breaks an order (commas, blanks) or a path (slashes)."""
    printable = "".join(c for c in name if c.isprintable()).strip()
    return re.sub(r"[\s,/]+", "_", printable)


def authored(name: str) -> str:
    """Return a name fit for orders, or "" if an exporter made it up."""
    name = fit_for_orders(name)
    return "" if GENERATED.fullmatch(name) else name


def trimmed(root: Node) -> Node:
    """Return the tree without levels that tell nothing apart.

    A root with a single child is that child; a sub-assembly that holds nothing but one part is that
    part, named as the sub-assembly.
    """
    children = tuple(_single(child) for child in root.children)
    if len(children) == 1 and not root.surfaces:
        return trimmed(children[0])
    return replace(root, children=children)


def _single(node: Node) -> Node:
    children = tuple(_single(child) for child in node.children)
    if len(children) != 1 or node.surfaces or children[0].children:
        return replace(node, children=children)
    named = node if node.name else children[0]
    return replace(children[0], given=named.given, product=named.product)


def named_parts(root: Node, default: str) -> Iterator[tuple[str, Node]]:
    """Yield every part with its name: the path of instances below the root, "clamp_1/pin_2".

    Args:
        root: Trimmed.
        default: Name of the root, if it is a part that has none.
    """
    if root.children:
        yield from _below(root, "")
    else:
        yield root.name or default, root


def _below(node: Node, path: str) -> Iterator[tuple[str, Node]]:
    for name, child in zip(distinct(node.children), node.children, strict=True):
        if child.children:
            yield from _below(child, f"{path}{name}/")
        else:
            yield f"{path}{name}", child


def distinct(siblings: Sequence[Node]) -> list[str]:
    """Return the names of siblings, numbered from 1 where they share one.

    A single one that the author gave the name keeps it; those that are named after their product
    are then numbered from 2. What has no name is numbered even if there is only one.
    """
    labels = [node.name or UNNAMED for node in siblings]
    count, given = Counter(labels), Counter(node.given for node in siblings)
    keeps = [
        bool(node.name) and (count[label] == 1 or (given[label] == 1 and node.given == label))
        for node, label in zip(siblings, labels, strict=True)
    ]
    taken = {label for label, kept in zip(labels, keeps, strict=True) if kept}
    first = {label: 2 if label in taken else 1 for label in labels}
    names = []
    for label, kept in zip(labels, keeps, strict=True):
        numbered = (f"{label}_{k}" for k in itertools.count(first[label]))
        names.append(label if kept else next(name for name in numbered if name not in taken))
        taken.add(names[-1])
    return names


def natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts bolt_2 before bolt_10."""
    pieces = re.split(r"(\d+)", name)
    return [(int(piece), "") if piece.isdecimal() else (-1, piece) for piece in pieces]
