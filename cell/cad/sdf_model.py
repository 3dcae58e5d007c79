"""SDF models of machines: links with primitive or revolved shapes, joints and frames.

Shapes are placed by their pose in the link frame L. Numbers have twelve significant digits and the
files contain no dates, so the same code writes the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh

from cell.products.mesh_io import obj_text

PACKAGE = "package://soft_jig_models/sdf"
Color = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """A pose in the parent frame: position [m] and roll, pitch, yaw [rad], as SDF has it."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    def text(self) -> str:
        """Return the six numbers as SDF text."""
        return _numbers([self.x, self.y, self.z, self.roll, self.pitch, self.yaw])


@dataclass(frozen=True)
class LinkContact:
    """Contact properties of a collision shape.

    Attributes:
        kind: "point" (no hydroelastic representation), "rigid" or "compliant".
        friction: Coulomb coefficient, static and dynamic.
        modulus: Hydroelastic modulus of a compliant shape [Pa].
        dissipation: Hunt-Crossley dissipation [s/m].
        hint: Mesh resolution hint [m].
    """

    kind: str
    friction: float
    modulus: float = 1e7
    dissipation: float = 5.0
    hint: float = 0.02

    def element(self) -> ElementTree.Element:
        """Return the ``drake:proximity_properties`` element."""
        root = ElementTree.Element("drake:proximity_properties")
        if self.kind != "point":
            ElementTree.SubElement(root, f"drake:{self.kind}_hydroelastic")
            _add(root, "drake:mesh_resolution_hint", self.hint)
        if self.kind == "compliant":
            _add(root, "drake:hydroelastic_modulus", self.modulus)
        _add(root, "drake:hunt_crossley_dissipation", self.dissipation)
        _add(root, "drake:mu_static", self.friction)
        _add(root, "drake:mu_dynamic", self.friction)
        return root


@dataclass(frozen=True)
class LinkInertia:
    """Mass [kg], centre of mass in L [m], and principal moments about it, axes along L [kg m2]."""

    mass: float
    com: tuple[float, float, float]
    moments: tuple[float, float, float]

    @staticmethod
    def of_box(mass: float, size: Sequence[float], com: tuple[float, float, float]) -> LinkInertia:
        """Return the inertia of a homogeneous box with edges ``size`` (3,)."""
        x2, y2, z2 = (mass / 12 * length**2 for length in size)
        return LinkInertia(mass, com, (y2 + z2, x2 + z2, x2 + y2))

    @staticmethod
    def of_cylinder(
        mass: float, radius: float, length: float, com: tuple[float, float, float]
    ) -> LinkInertia:
        """Return the inertia of a homogeneous cylinder about z."""
        across = mass * (3 * radius**2 + length**2) / 12
        return LinkInertia(mass, com, (across, across, mass * radius**2 / 2))


def box(x: float, y: float, z: float) -> ElementTree.Element:
    """Return a box centred on its frame."""
    return _geometry("box", size=[x, y, z])


def cylinder(radius: float, length: float) -> ElementTree.Element:
    """Return a cylinder about z, centred on its frame."""
    return _geometry("cylinder", radius=[radius], length=[length])


def capsule(radius: float, length: float) -> ElementTree.Element:
    """Return a capsule about z, centred on its frame; ``length`` is without the round ends."""
    return _geometry("capsule", radius=[radius], length=[length])


class SdfModel:
    """Builder of an SDF model; ``write`` writes it and its meshes into a folder."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._sdf = ElementTree.Element("sdf", {"version": "1.9", "xmlns:drake": "drake.mit.edu"})
        self._model = ElementTree.SubElement(self._sdf, "model", name=name)
        self._links: dict[str, ElementTree.Element] = {}
        self._meshes: dict[str, trimesh.Trimesh] = {}

    def link(
        self,
        name: str,
        inertia: LinkInertia,
        *,
        parent: str | None = None,
        pose: Pose | None = None,
    ) -> None:
        """Add a link, placed by its pose relative to the link ``parent``."""
        link = ElementTree.SubElement(self._model, "link", name=name)
        self._links[name] = link
        if parent is not None and pose is not None:
            ElementTree.SubElement(link, "pose", relative_to=parent).text = pose.text()
        inertial = ElementTree.SubElement(link, "inertial")
        _add(inertial, "pose", *inertia.com, 0, 0, 0)
        _add(inertial, "mass", inertia.mass)
        tensor = ElementTree.SubElement(inertial, "inertia")
        for axis, moment in zip("xyz", inertia.moments, strict=True):
            _add(tensor, f"i{axis}{axis}", moment)
        for axes in ("xy", "xz", "yz"):
            _add(tensor, f"i{axes}", 0.0)

    def visual(
        self, link: str, name: str, geometry: ElementTree.Element, color: Color, pose: Pose = Pose()
    ) -> None:
        """Add a coloured visual shape."""
        visual = self._shape("visual", link, name, geometry, pose)
        material = ElementTree.SubElement(visual, "material")
        _add(material, "diffuse", *color, 1.0)

    def collision(
        self,
        link: str,
        name: str,
        geometry: ElementTree.Element,
        contact: LinkContact,
        pose: Pose = Pose(),
    ) -> None:
        """Add a collision shape."""
        self._shape("collision", link, name, geometry, pose).append(contact.element())

    def mesh(self, name: str, mesh: trimesh.Trimesh) -> ElementTree.Element:
        """Register a mesh as ``<name>.obj`` of this model and return it as a shape."""
        self._meshes[name] = mesh
        geometry = ElementTree.Element("geometry")
        uri = ElementTree.SubElement(ElementTree.SubElement(geometry, "mesh"), "uri")
        uri.text = f"{PACKAGE}/{self.name}/{name}.obj"
        return geometry

    def joint(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        *,
        axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
        position: tuple[float, float] | None = None,
        velocity: float,
        effort: float,
        damping: float,
        extra: Sequence[ElementTree.Element] = (),
    ) -> None:
        """Add a joint at the child's frame; effort 0 gives it no actuator.

        Args:
            name: Name of the joint.
            kind: SDF joint type.
            parent: Link.
            child: Link.
            axis: In the child's frame.
            position: Limits [rad or m]; None for a continuous joint.
            velocity: Limit [rad/s or m/s].
            effort: Limit [N m or N].
            damping: [N m s/rad or N s/m].
            extra: Elements from ``tag``, such as rotor inertia or mimic.
        """
        joint = ElementTree.SubElement(self._model, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "parent").text = parent
        ElementTree.SubElement(joint, "child").text = child
        element = ElementTree.SubElement(joint, "axis")
        _add(element, "xyz", *axis)
        limit = ElementTree.SubElement(element, "limit")
        if position is not None:
            _add(limit, "lower", position[0])
            _add(limit, "upper", position[1])
        _add(limit, "effort", effort)
        _add(limit, "velocity", velocity)
        _add(ElementTree.SubElement(element, "dynamics"), "damping", damping)
        joint.extend(extra)

    def frame(self, name: str, link: str, pose: Pose = Pose()) -> None:
        """Add a named frame fixed to a link."""
        frame = ElementTree.SubElement(self._model, "frame", name=name, attached_to=link)
        _add(frame, "pose", *(float(word) for word in pose.text().split()))

    def ignore_contact_between(self, name: str, links: Sequence[str]) -> None:
        """Exclude collisions between these links."""
        group = ElementTree.SubElement(self._model, "drake:collision_filter_group", name=name)
        for link in links:
            ElementTree.SubElement(group, "drake:member").text = link
        ElementTree.SubElement(group, "drake:ignored_collision_filter_group").text = name

    def write(self, folder: Path) -> None:
        """Write ``<folder>/<name>/<name>.sdf`` and the model's meshes."""
        home = folder / self.name
        home.mkdir(parents=True, exist_ok=True)
        ElementTree.indent(self._sdf)
        text = ElementTree.tostring(self._sdf, encoding="unicode")
        (home / f"{self.name}.sdf").write_text(f'<?xml version="1.0"?>\n{text}\n')
        for name, mesh in self._meshes.items():
            (home / f"{name}.obj").write_text(obj_text(mesh, normals=True))

    def _shape(
        self, kind: str, link: str, name: str, geometry: ElementTree.Element, pose: Pose
    ) -> ElementTree.Element:
        shape = ElementTree.SubElement(self._links[link], kind, name=name)
        _add(shape, "pose", *(float(word) for word in pose.text().split()))
        shape.append(geometry)
        return shape


_TURN = {
    "+x": (0.0, math.pi / 2),
    "-x": (0.0, -math.pi / 2),
    "+y": (-math.pi / 2, 0.0),
    "-y": (math.pi / 2, 0.0),
    "+z": (0.0, 0.0),
    "-z": (math.pi, 0.0),
}


def pointing(axis: str, start: tuple[float, float, float], distance: float = 0.0) -> Pose:
    """Return the pose ``distance`` away from ``start`` along ``axis``, with its z along ``axis``.

    Args:
        axis: "+x", "-x" ... "-z" of the link.
        start: Point in the link frame [m].
        distance: [m].
    """
    step = [0.0, 0.0, 0.0]
    step["xyz".index(axis[1])] = distance if axis[0] == "+" else -distance
    roll, pitch = _TURN[axis]
    x, y, z = (a + b for a, b in zip(start, step, strict=True))
    return Pose(x, y, z, roll, pitch)


def tag(
    name: str, value: float | None = None, attributes: Mapping[str, str] | None = None
) -> ElementTree.Element:
    """Return one element such as ``<drake:gear_ratio>100</drake:gear_ratio>``."""
    element = ElementTree.Element(name, dict(attributes or {}))
    if value is not None:
        element.text = _numbers([value])
    return element


def turned(profile: Sequence[tuple[float, float]], sections: int = 48) -> trimesh.Trimesh:
    """Return the surface of revolution about z of (radius, height) points, bottom up [m]."""
    return trimesh.creation.revolve(np.array(profile), sections=sections)


def rounded_cylinder(radius: float, length: float, fillet: float) -> trimesh.Trimesh:
    """Return a cylinder on z in [0, length] whose top edge is rounded."""
    arc = np.linspace(0.0, math.pi / 2, 6)
    edge = [(radius + fillet * (math.cos(a) - 1), length + fillet * (math.sin(a) - 1)) for a in arc]
    return turned([(0.0, 0.0), (radius, 0.0), *edge, (0.0, length)])


def _geometry(shape: str, **numbers: Sequence[float]) -> ElementTree.Element:
    geometry = ElementTree.Element("geometry")
    element = ElementTree.SubElement(geometry, shape)
    for name, values in numbers.items():
        _add(element, name, *values)
    return geometry


def _add(parent: ElementTree.Element, name: str, *values: float) -> None:
    ElementTree.SubElement(parent, name).text = _numbers(values)


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value + 0.0:.12g}" for value in values)
