"""What has to be made or set up for a part: STL of the fixture, its settings, a picture.

    python -m experiments.custom_fixture motor_unit --part plate --up=-z --fixture rigid_jig

Writes NAME.stl in mm, to be printed as it stands; fixture.json with pads, posts and gap; and
fixture.png, empty and with the part, if the machine can render.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import tyro
from pydrake.math import RigidTransform
from rich.console import Console
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from cell.builder import Cell, build_cell
from cell.errors import InputError
from cell.fixtures import fixture_class
from cell.fixtures.custom.fixture import CustomFixture
from cell.fixtures.support_jig import SupportJig
from cell.machines.cameras.rendering import rendering_problem
from cell.products.loading import load_product
from experiments.cli.common import Common
from experiments.cli.ending import exit_code
from experiments.reporting.output import output_folder, whole_file, write_json
from experiments.reporting.render import View, take_picture

LIFTED = 0.06  # Of the part in the first picture [m].


@dataclass(frozen=True)
class FixtureOptions:
    """Options of the script."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")] = "motor_unit"
    """A name in models/products, or a YAML file."""

    part: Annotated[str | None, arg(metavar="NAME")] = None
    """The part to hold. Default: the first one of the product's first order."""

    up: Annotated[str | None, arg(metavar="AXIS")] = None
    """Axis of the product that points up, "+x" ... "-z". Default: the product's."""

    fixture: str = "rigid_jig"
    """rigid_jig or support_jig."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write the files; return the exit code."""
        config = self.common.load_config(self.fixture)
        if not fixture_class(self.fixture).custom:
            raise InputError(f"A {self.fixture} takes any part: nothing is made for it.")
        held = {"custom.held.part": self.part, "custom.held.up": self.up}
        config = config.with_changes({k: value for k, value in held.items() if value is not None})
        with output_folder(self.common.out) as out:
            cell = build_cell(config, load_product(self.product))
            fixture = cell.fixture
            assert isinstance(fixture, CustomFixture)
            for name, mesh in fixture.models().items():
                with whole_file(out / f"{name}.stl") as file:
                    file.write_bytes(mesh.copy().apply_scale(1e3).export(file_type="stl"))
            for name, picture in _pictures(cell, fixture).items():
                (out / f"{name}.png").write_bytes(picture)
            found = settings(fixture)
            write_json(out / "fixture.json", found)
        console = Console(quiet=self.common.quiet, highlight=False)
        for name, value in found.items():
            console.print(f"{name}: {value}", markup=False, soft_wrap=True)
        return 0


def settings(fixture: CustomFixture) -> dict[str, Any]:
    """Return what a fixture was made for and how it is set, in mm in D; see `cell.fixtures.custom`.

    Args:
        fixture: A nest or a jig with supports.
    """
    found: dict[str, Any] = {
        "fixture": fixture.name,
        "part": fixture.part,
        "yaw_deg": fixture.params.held.yaw_deg,
        "height_mm": 1e3 * fixture.entry_height,
        "mass_centre_margin_mm": fixture.datum.margin,
        "pads_mm": fixture.datum.pads.tolist(),
    }
    if isinstance(fixture, SupportJig):
        found["supports_mm"] = fixture.posts.supports.tolist()
        found["posts"] = [
            {
                "side": post.side,
                "locates": post.locates,
                "face_mm": [*post.touch[:2].tolist()],
                "gap_mm": post.gap,
            }
            for post in fixture.posts.sides
        ]
    return found


def _pictures(cell: Cell, fixture: CustomFixture) -> dict[str, bytes]:
    """Return PNGs of the fixture, the part over it and in it; none without a renderer."""
    if rendering_problem() or cell.diagram is None:
        return {}
    root = cell.diagram.CreateDefaultContext()
    context = cell.plant.GetMyMutableContextFromRoot(root)
    X_WSeat = cell.X_WJ @ fixture.seat(fixture.part)
    x, y, z = cell.X_WJ.translation()
    view = View((x + 0.16, y + 0.26, z + 0.22), (x, y, z + 0.05), fov_deg=30.0)
    pictures = {}
    for name, height in (("empty", LIFTED), ("seated", 0.0)):
        X_WP = RigidTransform([0.0, 0.0, height]) @ X_WSeat
        cell.plant.SetFreeBodyPose(context, cell.parts[fixture.part].body, X_WP)
        pictures[name] = take_picture(cell.scene_graph, root, view, shadows=False)
    return pictures


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    options = tyro.cli(
        FixtureOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("custom_fixture", options.run)


if __name__ == "__main__":
    sys.exit(main())
