"""STEP assemblies (AP214) written in code: polyhedral solids, each a product with instances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from manifold3d import Manifold

UNITS = {
    "mm": "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))",
    "m": "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))",
}
SOLIDS = "ADVANCED_BREP_SHAPE_REPRESENTATION"

Place = tuple[float, float, float]


class StepFile:
    """Numbered entities of a STEP file, in the unit it is made with."""

    def __init__(self, unit: str = "mm") -> None:
        self._lines: list[str] = []
        application = self.add("APPLICATION_CONTEXT('automotive design')")
        self.product_context = self.add(f"PRODUCT_CONTEXT('',{application},'mechanical')")
        self.definition_context = self.add(
            f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')"
        )
        length = self.add(UNITS["mm" if unit == "in" else unit])
        if unit == "in":
            size = self.add(f"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),{length})")
            none = self.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)")
            length = self.add(
                f"(CONVERSION_BASED_UNIT('INCH',{size})LENGTH_UNIT()NAMED_UNIT({none}))"
            )
        angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
        solid = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
        rounding = self.add(
            f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-7),{length},'accuracy','')"
        )
        self.context = self.add(
            f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)"
            f"GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({rounding}))"
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid}))"
            f"REPRESENTATION_CONTEXT('',''))"
        )

    def add(self, entity: str) -> str:
        """Append an entity and return the reference to it."""
        self._lines.append(f"#{len(self._lines) + 1}={entity};")
        return f"#{len(self._lines)}"

    def text(self) -> str:
        """Return the whole file."""
        header = (
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
            "FILE_NAME('','2026-01-01T00:00:00',(''),(''),'','','');\n"
            "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n"
        )
        return header + "\n".join(self._lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"

    def point(self, p: Sequence[float] | np.ndarray) -> str:
        return self.add(f"CARTESIAN_POINT('',({_numbers(p)}))")

    def direction(self, d: Sequence[float] | np.ndarray) -> str:
        return self.add(f"DIRECTION('',({_numbers(d)}))")

    def frame(self, p: Sequence[float] | np.ndarray, z: np.ndarray, x: np.ndarray) -> str:
        return self.add(
            f"AXIS2_PLACEMENT_3D('',{self.point(p)},{self.direction(z)},{self.direction(x)})"
        )

    def world(self, p: Sequence[float] = (0.0, 0.0, 0.0)) -> str:
        return self.frame(p, np.array([0.0, 0, 1]), np.array([1.0, 0, 0]))

    def solid(self, shape: Manifold) -> str:
        """Add a solid with one plane face per triangle."""
        mesh = shape.to_mesh64()
        corners = np.array(mesh.vert_properties)[:, :3]
        vertices = [self.add(f"VERTEX_POINT('',{self.point(p)})") for p in corners]
        edges: dict[tuple[int, int], str] = {}
        faces = [self._face(corners, vertices, edges, t) for t in np.array(mesh.tri_verts, int)]
        shell = self.add(f"CLOSED_SHELL('',({','.join(faces)}))")
        return self.add(f"MANIFOLD_SOLID_BREP('',{shell})")

    def sheet(self, shape: Manifold) -> str:
        """Add the surface of a solid without its last face."""
        closed = self._lines[int(self.solid(shape)[1:]) - 2]
        faces = closed.partition("((")[2] if "((" in closed else closed.partition(",(")[2]
        faces = faces.rstrip(");").rpartition(",")[0]
        shell = self.add(f"OPEN_SHELL('',({faces}))")
        return self.add(f"SHELL_BASED_SURFACE_MODEL('',({shell}))")

    def rod(self, radius: float, height: float) -> str:
        """Add a cylinder on the plane z = 0, bounded by true circles."""
        seam = [np.array([radius, 0.0, z]) for z in (0.0, height)]
        vertices = [self.add(f"VERTEX_POINT('',{self.point(p)})") for p in seam]
        rims = []
        for z, vertex in zip((0.0, height), vertices, strict=True):
            circle = self.add(f"CIRCLE('',{self.world((0.0, 0.0, z))},{radius:.6E})")
            rims.append(self.add(f"EDGE_CURVE('',{vertex},{vertex},{circle},.T.)"))
        line = self._edge(np.array(seam), vertices, 0, 1)
        down = self.frame((0.0, 0, 0), np.array([0.0, 0, -1]), np.array([1.0, 0, 0]))
        side = self.add(f"CYLINDRICAL_SURFACE('',{self.world()},{radius:.6E})")
        bottom, top = (
            self.add(f"PLANE('',{frame})") for frame in (down, self.world((0, 0, height)))
        )
        faces = [
            self._bounded(side, [(rims[0], "T"), (line, "T"), (rims[1], "F"), (line, "F")]),
            self._bounded(bottom, [(rims[0], "F")]),
            self._bounded(top, [(rims[1], "T")]),
        ]
        shell = self.add(f"CLOSED_SHELL('',({','.join(faces)}))")
        return self.add(f"MANIFOLD_SOLID_BREP('',{shell})")

    def _bounded(self, surface: str, edges: Sequence[tuple[str, str]]) -> str:
        """Add a face with one loop of edges, each along its curve (T) or against it (F)."""
        sides = [self.add(f"ORIENTED_EDGE('',*,*,{edge},.{turn}.)") for edge, turn in edges]
        loop = self.add(f"EDGE_LOOP('',({','.join(sides)}))")
        bound = self.add(f"FACE_OUTER_BOUND('',{loop},.T.)")
        return self.add(f"ADVANCED_FACE('',({bound}),{surface},.T.)")

    def _face(
        self,
        corners: np.ndarray,
        vertices: list[str],
        edges: dict[tuple[int, int], str],
        triangle: np.ndarray,
    ) -> str:
        sides: list[tuple[str, str]] = []
        for a, b in zip(triangle, np.roll(triangle, -1), strict=True):
            key = (min(a, b), max(a, b))
            if key not in edges:
                edges[key] = self._edge(corners, vertices, *key)
            sides.append((edges[key], "T" if a < b else "F"))
        p, q, r = corners[triangle]
        normal = np.cross(q - p, r - p)
        plane = self.frame(p, normal / np.linalg.norm(normal), (q - p) / np.linalg.norm(q - p))
        return self._bounded(self.add(f"PLANE('',{plane})"), sides)

    def _edge(self, corners: np.ndarray, vertices: list[str], a: int, b: int) -> str:
        along = corners[b] - corners[a]
        length = float(np.linalg.norm(along))
        vector = self.add(f"VECTOR('',{self.direction(along / length)},1.)")
        line = self.add(f"LINE('',{self.point(corners[a])},{vector})")
        return self.add(f"EDGE_CURVE('',{vertices[a]},{vertices[b]},{line},.T.)")

    def product(self, name: str, kind: str, items: Sequence[str]) -> tuple[str, str]:
        """Add a product with a shape; return its definition and its representation."""
        product = self.add(f"PRODUCT('{name}','{name}','',({self.product_context}))")
        self.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))")
        formation = self.add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        definition = self.add(
            f"PRODUCT_DEFINITION('design','',{formation},{self.definition_context})"
        )
        shape = self.add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
        representation = self.add(f"{kind}('{name}',({','.join(items)}),{self.context})")
        self.add(f"SHAPE_DEFINITION_REPRESENTATION({shape},{representation})")
        return definition, representation

    def instance(
        self, name: str, parent: tuple[str, str], child: tuple[str, str], frames: tuple[str, str]
    ) -> None:
        """Put a product into an assembly; frames are its own, and where that is in the parent."""
        usage = self.add(
            f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{name}','{name}','',{parent[0]},{child[0]},$)"
        )
        shape = self.add(f"PRODUCT_DEFINITION_SHAPE('','',{usage})")
        transform = self.add(f"ITEM_DEFINED_TRANSFORMATION('','',{frames[0]},{frames[1]})")
        relation = self.add(
            f"(REPRESENTATION_RELATIONSHIP('','',{child[1]},{parent[1]})"
            f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION({transform})"
            f"SHAPE_REPRESENTATION_RELATIONSHIP())"
        )
        self.add(f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION({relation},{shape})")


class StepTree(StepFile):
    """A STEP file of products, in assemblies of any depth; everything is drawn at the origin."""

    def part(self, name: str, *shapes: Manifold) -> tuple[str, str]:
        """Add a product of some solids; without any it has no shape."""
        kind = SOLIDS if shapes else "SHAPE_REPRESENTATION"
        return self.product(name, kind, [self.world(), *(self.solid(s) for s in shapes)])

    def assembly(
        self, name: str, *instances: tuple[str, tuple[str, str], Place]
    ) -> tuple[str, str]:
        """Add an assembly of instances (name, product, place)."""
        places = [self.world(place) for _, _, place in instances]
        whole = self.product(name, "SHAPE_REPRESENTATION", [self.world(), *places])
        for (given, product, _), place in zip(instances, places, strict=True):
            self.instance(given, whole, product, (self.world(), place))
        return whole

    def refer(self, product: tuple[str, str], file: str) -> None:
        """Say that a product's shape is in another file, as AP214 exporters do."""
        kind = self.add("DOCUMENT_TYPE('geometry')")
        document = self.add(f"DOCUMENT_FILE('{file}','','',{kind},'',$)")
        role = self.add("IDENTIFICATION_ROLE('external document id and location',$)")
        source = self.add("EXTERNAL_SOURCE(IDENTIFIER(''))")
        self.add(
            f"APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT('{file}',{role},{source},({document}))"
        )
        self.add(f"APPLIED_DOCUMENT_REFERENCE({document},'',({product[0]}))")


def step_assembly(
    shapes: Mapping[str, Manifold],
    instances: Sequence[tuple[str, str, tuple[float, float, float]]],
    unit: str = "mm",
) -> str:
    """Return a STEP file with an assembly of instances (name, shape, place)."""
    file = StepFile(unit)
    own = {name: file.world() for name in shapes}
    children = {
        name: file.product(
            name, "ADVANCED_BREP_SHAPE_REPRESENTATION", [own[name], file.solid(shape)]
        )
        for name, shape in shapes.items()
    }
    places = [file.world(place) for _, _, place in instances]
    parent = file.product("assembly", "SHAPE_REPRESENTATION", [file.world(), *places])
    for (name, shape, _), place in zip(instances, places, strict=True):
        file.instance(name, parent, children[shape], (own[shape], place))
    return file.text()


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return ",".join(f"{float(v) + 0.0:.12E}" for v in values)
