"""``soft-jig init`` and its options."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, UseAppendAction, arg

from experiments.cli.common import Common, split_order


@dataclass(frozen=True)
class Init:
    """From CAD to a product that can be run: a folder with product.yaml, models and a tray."""

    product: Annotated[Positional[str], arg(metavar="FOLDER|FILE")]
    """A folder of meshes in assembled pose, or a STEP or GLB assembly."""

    units: Annotated[str | None, arg(metavar="mm|cm|m|in")] = None
    """Unit of meshes that state none. Without such: overrides what STEP and GLB state."""

    material: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="[PART=]NAME")] = ()
    """Material of a part, or of all that are not named, such as steel or pla. Repeatable."""

    strength: Annotated[str, arg(metavar="CLASS")] = "8.8"
    """Strength class of the screws: it limits their torque."""

    torque: Annotated[float | None, arg(metavar="N_M")] = None
    """Tightening torque of all screws. Default: what their class bears and the driver gives."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts, or groups such as screws. Default: the best one."""

    up: Annotated[str | None, arg(metavar="+x|-x|...|-z")] = None
    """Axis that points up on the jig; write --up=-z. Default: +z."""

    split: bool = False
    """Make parts of the bodies or objects that one mesh or solid model holds."""

    leave_out: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = ()
    """Leave a part, sub-assembly or file out. Repeatable."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``product.yaml``, ``models`` and print the guesses; return the exit code."""
        config = self.common.load_config()
        from experiments.product.init import Wanted, run_init

        wanted = Wanted(
            source=Path(self.product),
            units=self.units,
            materials=self.material,
            strength=self.strength,
            torque=self.torque,
            order=split_order(self.order),
            up=self.up,
            split=self.split,
            leave_out=self.leave_out,
        )
        return run_init(wanted, self.common.out, config, quiet=self.common.quiet)
