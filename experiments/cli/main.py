"""The command line: ``soft-jig COMMAND ...``; commands by name, parsing, exit codes.

What the exit codes mean is in ``ending.py``.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Sequence
from importlib.metadata import version

import tyro
from tyro.conf import FlagCreatePairsOff

import cell
from cell.errors import UnknownName
from experiments.cli.assemble import Assemble
from experiments.cli.check import Check
from experiments.cli.common import BadUsage
from experiments.cli.compare import Compare
from experiments.cli.ending import exit_code
from experiments.cli.init import Init
from experiments.cli.paper import Place, Push
from experiments.cli.plan import Plan
from experiments.cli.regress import Regress
from experiments.cli.sweep import Sweep

DESCRIPTION = """\
A digital twin of a dual-arm assembly cell with a soft jig.
Exit code 0: success. 1: it ran and failed. 2: bad input, named in one line on stderr.
3: an error of the machine or of ours. 130, 143: interrupted; what was done is kept.
--version prints the versions of the twin and of Drake.
"""
Command = Plan | Assemble | Init | Check | Place | Push | Regress | Sweep | Compare
COMMANDS: dict[str, type[Command]] = {
    "plan": Plan,
    "assemble": Assemble,
    "init": Init,
    "check": Check,
    "place": Place,
    "push": Push,
    "regress": Regress,
    "sweep": Sweep,
    "compare": Compare,
}


def parse(arguments: Sequence[str]) -> Command:
    """Return the command that the arguments describe.

    Raises:
        BadUsage: Or `UnknownName` for a command that does not exist.
        SystemExit: With code 0, after printing help or version.
    """
    command = arguments[0] if arguments else ""
    if command == "--version":
        print(f"soft-jig {cell.__version__}, Drake {version('drake')}")
        raise SystemExit(0)
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
    return exit_code(
        "soft-jig", lambda: parse(sys.argv[1:] if arguments is None else arguments).run()
    )
