"""What the commands share: options, the refusal of a wrong one, how an order is written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import UseAppendAction, arg

from cell.errors import InputError

if TYPE_CHECKING:
    from cell.configuration.config import CellConfig

# What a command needs is imported when it runs: Drake takes a second that --help can do without.


class BadUsage(InputError):
    """A command line that cannot be understood."""


MOST = 100_000  # [A] Of anything that is counted: its list still fits into memory.


def check_counts(options: object, *names: str, least: int = 1) -> None:
    """Refuse numbers of trials, processes or the like that cannot be meant.

    Args:
        options: Has them as attributes.
        names: Of the attributes, written with a hyphen on the command line.
        least: What each has to be at least.

    Raises:
        BadUsage: One is out of range.
    """
    for name in names:
        count = getattr(options, name)
        if not least <= count <= MOST:
            option = name.replace("_", "-")
            raise BadUsage(f"--{option} must be from {least} to {MOST}, not {count}.")


@dataclass(frozen=True)
class Common:
    """Options that every command takes."""

    seed: int = 0
    """Seed of everything random: the same seed gives the same result, bit for bit."""

    out: Annotated[Path, arg(metavar="DIR")] = Path("out")
    """Folder for the results; made if it does not exist."""

    config: Annotated[str, arg(metavar="FILE")] = "default"
    """Configuration: a YAML file (it may be partial), or a name in models/config."""

    overrides: Annotated[
        UseAppendAction[tuple[str, ...]], arg(name="set", metavar="KEY=VALUE")
    ] = ()
    """Change one value of the configuration, for example simulation.time_step=5e-4. Repeatable."""

    quiet: bool = False
    """Print nothing but errors."""

    def load_config(self, fixture: str | None = None, sensor: str | None = None) -> CellConfig:
        """Return the configuration that the options describe, checked.

        Args:
            fixture: Name of another fixture than the configuration's; None leaves it.
            sensor: Name of another perception source than the configuration's; None leaves it.
        """
        from cell.configuration.config import CellConfig
        from cell.fixtures import fixture_class
        from planning.perception.sources import check_source

        if self.seed < 0:
            raise BadUsage(f"--seed must be >= 0, not {self.seed}.")
        config = CellConfig.load(self.config, self.overrides)
        if fixture is not None:
            config = config.with_changes({"workcell.fixture": fixture})
        fixture_class(config.workcell.fixture)
        if sensor is not None:
            config = config.with_changes({"sensor.source": sensor})
        check_source(config.sensor.source)
        return config


def split_order(text: str | None) -> tuple[str, ...] | None:
    """Return the items of an order written "a,b,c"; None stays None."""
    return None if text is None else tuple(item.strip() for item in text.split(","))
