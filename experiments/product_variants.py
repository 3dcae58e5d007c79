"""What a change of a product changes: differences of plan, holding and verdict, as a regression.

    python -m experiments.product_variants gearbox.step gearbox_b.step --out out/variants
    python -m experiments.product_variants parts/ --units mm --table dimensions.csv
    python -m experiments.product_variants motor_unit --table torques.csv --run --workers 2

A variant is another file or folder (a revised STEP, meshes, a product file), or a line of a table
of dimensions, whose columns are parts and axes in mm (``plate.z``: extent, ``plate.dz``: shift) or,
for a product file, paths in it (``joints.0.torque_Nm``). Base and variants are planned, the general
rule says what the jig holds in each step, and with --run the twin assembles them. Exit code 0:
nothing differs beyond its tolerance; 1: something does; 3: one came to no verdict. Run again, it
goes on where it was stopped.

A plan takes seconds, with --run a variant takes what `soft-jig assemble` does.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from cell.errors import InputError
from cell.products.loading import is_product_file, load_product, require_product_file
from cell.products.read_options import ReadOptions
from experiments.campaigns.campaign import run_campaign
from experiments.campaigns.points import trials
from experiments.campaigns.trial import Row
from experiments.cli.common import BadUsage, Common, check_counts, split_order
from experiments.cli.ending import exit_code
from experiments.compare.comparison import (
    Comparison,
    compared,
    rows_to_json,
    shown,
    tolerance_table,
    value_table,
)
from experiments.compare.files import check_files, write_csv, write_junit
from experiments.reporting.html_page import cell, page, pairs, section, table
from experiments.reporting.output import output_folder, write_json, write_text
from experiments.reporting.provenance import finite, versions
from experiments.studies.variant import values_of, variant
from experiments.studies.variant_input import read_table, write_variant

NAMES = ("base", "variant")
INPUTS = "inputs"  # Folder for what is written of a table.
MOST_ROWS = 40  # Of a variant on the terminal; the files have all.


@dataclass(frozen=True)
class VariantOptions:
    """Options of the script."""

    base: Annotated[Positional[str], arg(metavar="BASE")]
    """The product as it was: a name in models/products, a product file, STEP, a folder of CAD."""

    variants: Annotated[Positional[tuple[str, ...]], arg(metavar="VARIANT")] = ()
    """Its variants, of the same kinds."""

    table: Annotated[Path | None, arg(metavar="FILE.csv")] = None
    """Further variants of BASE, one a line: variant,plate.z,plate.dz ..."""

    units: Annotated[str | None, arg(metavar="mm|cm|m|in")] = None
    """Unit of meshes that state none."""

    order: Annotated[str, arg(metavar="A,B,C")] = ""
    """Assembly order. Default: the product's first one, or the best one."""

    run: bool = False
    """Also assemble each in the twin; CAD is drafted first."""

    junit: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write JUnit's XML as well."""

    csv: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write all values, as a table."""

    workers: Annotated[int, arg(metavar="N")] = 1
    """Variants at a time. What is done already is not run again."""

    executor: Annotated[str, arg(metavar="local|dask://HOST:PORT")] = "local"
    """Where trials run."""

    common: OmitArgPrefixes[Common] = field(default_factory=Common)


def run(options: VariantOptions) -> int:
    """Run what is missing, compare the variants with the base, and write the files.

    Raises:
        InputError: An option, a product or the table is invalid.
    """
    check_counts(options, "workers")
    if options.table is None and not options.variants:
        raise BadUsage("Name a VARIANT, or a --table of them.")
    check_files(junit=options.junit, csv=options.csv)
    config, seed = options.common.load_config(), options.common.seed
    console = Console(quiet=options.common.quiet, highlight=False)
    with output_folder(options.common.out) as out:
        inputs = inputs_of(options, out)
        base = load_product(inputs[NAMES[0]])
        for item in split_order(options.order or None) or ():
            base.members(item)
        given = {"order": options.order, "run": options.run}
        wanted = {
            name: trials(variant, [{"product": source, **given}], config=config, seeds=[seed])[0]
            for name, source in inputs.items()
        }
        planned = list({trial.key: trial for trial in wanted.values()}.values())
        about = {"command": "product_variants", "inputs": inputs, "seed": seed}
        rows = run_campaign(
            planned,
            out,
            workers=options.workers,
            executor=options.executor,
            about=about,
            console=console,
        )
        by_key = {row.key: row for row in rows}
        found = {name: by_key[trial.key] for name, trial in wanted.items()}
        facts = about | {"config": finite(config.to_dict()), "versions": versions()}
        return conclude(options, out, facts, found, console)


def inputs_of(options: VariantOptions, out: Path) -> dict[str, str]:
    """Return what is planned, by name; the base comes first.

    CAD without units, and lines of the table, are written into the folder ``inputs``.
    """
    sources = {NAMES[0]: options.base}
    for source in options.variants:
        sources[_new_name(Path(source).stem or source, sources)] = source
    lines = read_table(options.table) if options.table is not None else {}
    read = ReadOptions(units=options.units)
    found = {}
    for name, source in sources.items():
        if options.units is None or is_product_file(source):
            load_product(source)  # What cannot be read is refused before anything runs.
            found[name] = source
        else:
            found[name] = str(write_variant(source, {}, out / INPUTS / name, read))
    if lines and not is_product_file(options.base):  # Written like its variants, to be like them.
        found[NAMES[0]] = str(write_variant(options.base, {}, out / INPUTS / NAMES[0], read))
    for name, changes in lines.items():
        name = _new_name(name, found)
        found[name] = str(write_variant(options.base, changes, out / INPUTS / name, read))
    if options.run:
        for source in found.values():
            if is_product_file(source):
                require_product_file(source)
    return found


def _new_name(name: str, taken: Mapping[str, Any]) -> str:
    if name in taken:
        raise InputError(f"Two variants are called '{name}'.")
    return name


def conclude(
    options: VariantOptions,
    out: Path,
    facts: Mapping[str, Any],
    found: Mapping[str, Row],
    console: Console,
) -> int:
    """Compare, write ``variants.json``, ``variants.html`` and what else is wanted, and print.

    Args:
        options: Of the script.
        out: Folder of the campaign.
        facts: What else the result says.
        found: Row by name of a variant, that of the base among them.
        console: Where to print.

    Returns:
        The exit code.
    """
    errors = {n: f"{r.verdict}: {r.evidence}" for n, r in found.items() if not r.done}
    differences: dict[str, list[Comparison]] = {}
    if NAMES[0] not in errors:
        base = values_of(found[NAMES[0]], out)
        for name, row in found.items():
            if name != NAMES[0] and name not in errors:
                differences[name] = compared(base, values_of(row, out))
    everything = [
        replace(row, place=f"{name}: {row.place}")
        for name, rows in differences.items()
        for row in rows
    ]
    if options.junit is not None:
        write_junit(options.junit, "product_variants", everything, errors)
    if options.csv is not None:
        write_csv(options.csv, everything, NAMES)
    outside = [row for row in everything if not row.ok]
    verdict = "error" if errors else "failure" if outside else "success"
    result = {
        **facts,
        "verdict": verdict,
        "variants": {
            name: {"verdict": row.verdict, "phase": row.phase, "evidence": row.evidence}
            for name, row in found.items()
        },
        "compared": len(everything),
        "differ": len(outside),
        "differences": rows_to_json(outside, NAMES),
    }
    write_json(out / "variants.json", result)
    write_page(out, facts, found, differences, verdict)
    for name, rows in differences.items():
        _print(console, name, found[name], [row for row in rows if not row.ok])
    for name, error in errors.items():
        console.print(f"{name}: {error}", markup=False, soft_wrap=True)
    return {"success": 0, "failure": 1, "error": 3}[verdict]


def _print(console: Console, name: str, row: Row, outside: Sequence[Comparison]) -> None:
    why = f": {row.evidence}" if row.evidence else ""
    text = f"{name}: {row.verdict}{why}; {len(outside)} values differ."
    console.print(text, markup=False, soft_wrap=True)
    if outside:
        console.print(value_table(outside[:MOST_ROWS], "Differences", NAMES, "differs"))
        console.print(tolerance_table(outside[:MOST_ROWS]))


def write_page(
    out: Path,
    facts: Mapping[str, Any],
    found: Mapping[str, Row],
    differences: Mapping[str, Sequence[Comparison]],
    verdict: str,
) -> None:
    """Write ``variants.html``."""
    overview = [
        {
            "variant": name,
            "verdict": row.verdict,
            "values that differ": sum(not each.ok for each in differences.get(name, ())),
            "failed phase": row.phase,
            "evidence": row.evidence,
        }
        for name, row in found.items()
    ]
    parts = [
        "<h1>Product variants</h1>",
        f"<p>{cell(verdict)}: a value differs where it is outside its tolerance.</p>",
        section("Variants", table(overview, list(overview[0]))),
    ]
    for name, rows in differences.items():
        outside = [row for row in rows if not row.ok]
        lines = [
            {
                "where": row.place,
                "quantity": row.quantity,
                NAMES[0]: shown(row.before),
                NAMES[1]: shown(row.after),
                "allowed": row.allowed,
                "reason": row.reason,
            }
            for row in outside
        ]
        content = table(lines, list(lines[0])) if lines else "<p>No differences.</p>"
        parts.append(section(escape(f"{name}: {len(outside)} of {len(rows)} values"), content))
    parts.append(section("Inputs", pairs(facts["inputs"])))
    parts.append(section("Set-up", pairs(facts["versions"])))
    write_text(out / "variants.html", page("Product variants", "\n".join(parts)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script; return the exit code."""
    options = tyro.cli(
        VariantOptions, args=arguments, description=__doc__, config=(FlagCreatePairsOff,)
    )
    return exit_code("product_variants", lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
