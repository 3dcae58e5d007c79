"""The command line: ``soft-jig COMMAND ...``; the typed classes below are its options.

Exit code 0: done and the verdict is success. 1: it ran and the verdict is failure. 2: bad input,
with one line on stderr that names the culprit and the alternatives.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, UseAppendAction, arg

from cell.errors import CellError, UnknownName
from experiments.output import output_folder

if TYPE_CHECKING:
    from cell.config import CellConfig
    from experiments.plan_options import PlanOptions

# What a command needs is imported when it runs: Drake takes a second that --help can do without.


class BadUsage(CellError):
    """A command line that cannot be understood."""


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
    """Change one value of the configuration, for example simulation.time_step=0.002. Repeatable."""

    quiet: bool = False
    """Print nothing but errors."""

    def load_config(self) -> CellConfig:
        """Return the configuration that the options describe, checked."""
        from cell.config import CellConfig

        if self.seed < 0:
            raise BadUsage(f"--seed must be >= 0, not {self.seed}.")
        return CellConfig.load(self.config, self.overrides)


@dataclass(frozen=True)
class Plan:
    """Decide, for each assembly step, which part the jig holds and in which posture."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")]
    """A name in models/products, a YAML, STEP or GLB file, or a folder of meshes, assembled."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts or groups, separated by commas. Default: the product's, or the best."""

    units: Annotated[str | None, arg(metavar="mm|cm|m|in")] = None
    """Unit of a folder's meshes; needed unless all of them are .glb."""

    density: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="[PART=]KG_M3")] = ()
    """Density of a part, or of all that are not named; a YAML file states masses. Repeatable."""

    group: bool = False
    """Make one item of the order of parts that are identical."""

    up: Annotated[str | None, arg(metavar="+x|-x|...|-z")] = None
    """Axis that points up on the jig; write --up=-z. Default: the product's, or +z."""

    tolerance_mm: Annotated[float | None, arg(metavar="MM")] = None
    """Gap that still touches, overlap that does not block. Default: the product's, or derived."""

    slanted: bool = False
    """Also report ways out at an angle, from contact faces, and how far parts can move at all."""

    no_cache: bool = False
    """Compute the matrices anew, and do not keep them in the user's cache."""

    explain: bool = False
    """Also print the matrices, every candidate, and which pair blocks which direction, where."""

    html: bool = True
    """Write no plan.html, whose pictures take some seconds."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``plan.json``, ``matrices.npz`` and ``plan.html``; return the exit code."""
        config = self.common.load_config()
        stdout = io.StringIO() if self.common.quiet else sys.stdout
        with output_folder(self.common.out) as out, contextlib.redirect_stdout(stdout):
            from experiments.plan_command import run_plan

            return run_plan(
                self.product,
                split_order(self.order),
                self.options(),
                self.explain,
                out,
                config=config,
                html=self.html,
            )

    def options(self) -> PlanOptions:
        """Return how the product is read and planned."""
        from experiments.plan_options import PlanOptions
        from planning.fixing.cache import user_cache

        if self.tolerance_mm is not None and not 0.0 < self.tolerance_mm < 10.0:
            raise BadUsage(f"--tolerance-mm must be between 0 and 10, not {self.tolerance_mm:g}.")
        return PlanOptions(
            units=self.units,
            densities=dict(map(split_density, self.density)),
            group=self.group,
            tolerance=None if self.tolerance_mm is None else 1e-3 * self.tolerance_mm,
            cache=None if self.no_cache else user_cache(),
            slanted=self.slanted,
            up=self.up,
        )


@dataclass(frozen=True)
class Assemble:
    """Plan, then run the whole assembly in the twin, with contact forces."""

    product: Annotated[Positional[str], arg(metavar="PRODUCT")] = "motor_unit"
    """A name in models/products, or a YAML file."""

    order: Annotated[str | None, arg(metavar="A,B,C")] = None
    """Assembly order: parts or groups, separated by commas. Default: the product's first one."""

    view: bool = False
    """Show the run in a browser while it goes on."""

    replay: Annotated[Path | None, arg(metavar="FILE.html")] = None
    """Write a recording that plays in any browser, offline."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json``, ``log.npz`` and ``report.html``; return the exit code."""
        config = self.common.load_config()
        with contextlib.ExitStack() as folders:
            out = folders.enter_context(output_folder(self.common.out))
            if self.replay is not None:
                folders.enter_context(output_folder(self.replay.absolute().parent))
            from cell.loading import load_product
            from experiments.assemble import run_assemble

            return run_assemble(
                product=load_product(self.product),
                order=split_order(self.order),
                config=config,
                seed=self.common.seed,
                out=out,
                view=self.view,
                replay=self.replay,
                quiet=self.common.quiet,
            )


@dataclass(frozen=True)
class Place:
    """The paper's placement experiment: six postures, disturbed; upright and at rest counts."""

    case: Annotated[str | None, arg(metavar="motor/P2")] = None
    """A posture, or a part for all of its postures. Default: all six."""

    trials: int = 10
    """Trials of each case."""

    hand: Literal["rig", "robot"] = "rig"
    """What carries the gripper: a position-controlled rig, or the arm, with planned motions."""

    pressure: Annotated[float | None, arg(metavar="KPA")] = None
    """Vacuum in the bag [kPa]; 0 leaves it soft. Default: jig.vacuum.pressure."""

    bed: Literal["soft", "rigid"] = "soft"
    """What the part is pressed on: the soft jig, or a flat rigid block in its place."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json`` and ``report.html``; return the exit code."""
        return _run_experiment("place", self)


@dataclass(frozen=True)
class Push:
    """The paper's push experiment: nine cases, 70 mm; the jig has to go along by 63 mm."""

    case: Annotated[str | None, arg(metavar="motor/P2/a")] = None
    """A case, or a part or posture for all of its cases. Default: all nine."""

    trials: int = 5
    """Trials of each case."""

    hand: Literal["rig", "robot"] = "rig"
    """What carries the gripper: a position-controlled rig, or the arm, with planned motions."""

    pressure: Annotated[float | None, arg(metavar="KPA")] = None
    """Vacuum in the bag [kPa]; 0 leaves it soft. Default: jig.vacuum.pressure."""

    bed: Literal["soft", "rigid"] = "soft"
    """What the part is pressed on: the soft jig, or a flat rigid block in its place."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json`` and ``report.html``; return the exit code."""
        return _run_experiment("push", self)


@dataclass(frozen=True)
class Regress:
    """Run experiments with seed 0 and compare outcomes and metrics with the stored ones."""

    suite: Literal["quick", "full"] = "quick"
    """quick: three cases, minutes; full: every case three times."""

    update: bool = False
    """Store what comes out, and print what changes."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)

    def run(self) -> int:
        """Write ``result.json``; return the exit code."""
        config = self.common.load_config()
        if self.common.seed != 0:
            raise BadUsage("The stored metrics are those of --seed 0: leave it out.")
        with output_folder(self.common.out) as out:
            from experiments.regress import run_regress

            return run_regress(self.suite, self.update, config, out, self.common.quiet)


def _run_experiment(command: str, options: Place | Push) -> int:
    """Check everything that was asked for, then run it."""
    from experiments.case_results import Experiment
    from experiments.cases import check_hand
    from experiments.place_push import cases_of, check_trials, run_experiment, with_pressure

    common = options.common
    config = with_pressure(common.load_config(), options.pressure)
    check_trials(options.trials)
    check_hand(options.hand, options.bed)
    cases_of(command, options.case)
    with output_folder(common.out) as out:
        experiment = Experiment(
            command,
            config,
            options.hand,
            options.bed,
            options.trials,
            common.seed,
            out,
            common.quiet,
        )
        return run_experiment(experiment, options.case)


DESCRIPTION = """\
A digital twin of a dual-arm assembly cell with a soft jig.
Exit code 0: success. 1: it ran and failed. 2: bad input, named in one line on stderr.
"""
Command = Plan | Assemble | Place | Push | Regress
COMMANDS: dict[str, type[Command]] = {
    "plan": Plan,
    "assemble": Assemble,
    "place": Place,
    "push": Push,
    "regress": Regress,
}


def split_order(text: str | None) -> tuple[str, ...] | None:
    """Return the items of an order written "a,b,c"; None stays None."""
    return None if text is None else tuple(item.strip() for item in text.split(","))


def split_density(text: str) -> tuple[str, float]:
    """Return the name, "" for all parts, and the value of a density written "[PART=]VALUE"."""
    name, _, value = text.rpartition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise BadUsage(f"--density {text}: write it like 7850 or bolt=7850.") from None


def parse(arguments: Sequence[str]) -> Command:
    """Return the command that the arguments describe.

    Raises:
        BadUsage: Or `UnknownName` for a command that does not exist.
        SystemExit: With code 0, after printing the help that was asked for.
    """
    command = arguments[0] if arguments else ""
    if not command:
        raise BadUsage(f"A command is missing. Known: {', '.join(COMMANDS)}. See soft-jig --help.")
    if command not in COMMANDS and command not in ("-h", "--help"):
        raise UnknownName("command", command, COMMANDS)
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="soft-jig",
                description=DESCRIPTION,
                args=arguments,
                config=(FlagCreatePairsOff,),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        raise BadUsage(one_line(complaint.getvalue())) from None


def one_line(complaint: str) -> str:
    """Return tyro's complaint as one line: the fault, and the nearest right option.

    Tyro prints sections with rules between: in a box with the title in its border, or, where the
    terminal has no Unicode, without a box and with the title as the first section.
    """
    plain = re.sub(r"\x1b\[[0-9;]*m|[╭╰].*", "", complaint).replace("│", " ")
    sections = [" ".join(text.split()) for text in re.split(r"^\s*[─-]{3,}\s*$", plain, flags=re.M)]
    if "╭" not in complaint and len(sections) > 1:
        sections.pop(0)
    line = sections[0].removesuffix(" (required)").rstrip(".") + "."
    for section in sections:
        if nearest := re.match(r"Perhaps you meant: (\S+)", section):
            line += f" Did you mean '{nearest[1]}'?"
    return f"{line} See soft-jig --help."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    try:
        return parse(sys.argv[1:] if arguments is None else arguments).run()
    except CellError as error:
        print(f"soft-jig: {error}", file=sys.stderr)
        return 2
