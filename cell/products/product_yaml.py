"""A product file: parts, groups, orders and fasteners, every key known and every name checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from cell.errors import BadOrder, CellError
from cell.products.fields import Fields, names_at, one_of
from cell.products.part_yaml import model_name, read_part
from cell.products.product import Fastener, Fit, Part, Product

PRODUCT_KEYS = (
    "name",
    "units",
    "up",
    "contact_tolerance_mm",
    "tray",
    "parts",
    "groups",
    "orders",
    "fasteners",
    "fits",
)
FASTENER_KEYS = (
    "into",
    "clamps",
    "thread",
    "diameter_mm",
    "pitch_mm",
    "thread_depth_mm",
    "torque_Nm",
    "nut_factor",
)
FIT_KEYS = ("shaft", "hole", "at_mm", "depth_mm")
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


def read_product(file: Path) -> Product:
    """Return the product that a YAML file describes."""
    fields = Fields(_read_yaml(file), file.name, PRODUCT_KEYS)
    units = fields.text("units") if "units" in fields else "mm"
    parts = {
        name: read_part(name, data, file, units) for name, data in fields.mapping("parts").items()
    }
    if not parts:
        raise CellError(f"{file.name}: a product has at least one part.")
    product = Product(fields.text("name") if "name" in fields else file.stem, parts)
    product = replace(product, groups=_groups(fields, parts))
    product = replace(product, fasteners=_fasteners(fields, product))
    product = replace(product, fits=_fits(fields, product))
    product = replace(product, orders=_orders(fields, product))
    return replace(product, **_settings(fields))


class _UniqueKeys(yaml.SafeLoader):
    """A safe loader to which a repeated key is an error, as two parts of one name are."""


def _construct_mapping(loader: _UniqueKeys, node: yaml.MappingNode) -> dict[Any, Any]:
    keys = [str(key.value) for key, _ in node.value if key.tag != "tag:yaml.org,2002:merge"]
    repeated = {key for key in keys if keys.count(key) > 1}
    place = f"{node.start_mark.name}, line {node.start_mark.line + 1}"
    if repeated:
        raise CellError(f"{place}: '{min(repeated)}' occurs twice.")
    if not all(isinstance(key, yaml.ScalarNode) for key, _ in node.value):
        raise CellError(f"{place}: a key is a name, not a list.")
    loader.flatten_mapping(node)
    return dict(loader.construct_pairs(node, deep=True))


_UniqueKeys.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _construct_mapping)


def _read_yaml(file: Path) -> Any:
    """Return the content of a YAML file."""
    try:
        with file.open() as stream:
            return yaml.load(stream, Loader=_UniqueKeys)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split())
        raise CellError(f"'{file}' is not valid YAML: {reason}.") from error


def _settings(fields: Fields) -> dict[str, Any]:
    """Return the optional settings of a product that are present."""
    settings: dict[str, Any] = {}
    if "up" in fields:
        settings["up"] = one_of("axis", fields.text("up"), AXES)
    if "contact_tolerance_mm" in fields:
        settings["contact_tolerance"] = fields.positive("contact_tolerance_mm") * 1e-3
    if "tray" in fields:
        settings["tray"] = model_name(fields.text("tray"))
    return settings


def _groups(fields: Fields, parts: Mapping[str, Part]) -> dict[str, tuple[str, ...]]:
    """Return the groups; a part is in one of them at most."""
    groups: dict[str, tuple[str, ...]] = {}
    taken: dict[str, str] = {}
    for group, members in fields.mapping("groups").items():
        if group in parts:
            raise CellError(f"{fields.where}: '{group}' is both a part and a group.")
        groups[group] = names_at(members, f"{fields.where}.groups.{group}")
        if not groups[group]:
            raise CellError(f"{fields.where}: group '{group}' has no parts.")
        for name in groups[group]:
            one_of("part", name, list(parts))
            if name in taken:
                raise CellError(f"{fields.where}: '{name}' is in '{taken[name]}' and '{group}'.")
            taken[name] = group
    return groups


def _orders(fields: Fields, product: Product) -> tuple[tuple[str, ...], ...]:
    """Return the assembly orders; each lists every part once, itself or by its group."""
    if "orders" not in fields:
        return ()
    entries = fields.raw("orders")
    if not isinstance(entries, list):
        raise CellError(f"{fields.where}.orders: expected a list of orders, got {entries!r}.")
    orders = tuple(names_at(e, f"{fields.where}.orders[{k}]") for k, e in enumerate(entries))
    for order in orders:
        listed = [part for item in order for part in product.members(item)]
        if sorted(listed) != sorted(product.parts):
            raise BadOrder(
                f"{fields.where}: order [{', '.join(order)}] must list each of "
                f"{', '.join(product.items())} once."
            )
    return orders


def _fasteners(fields: Fields, product: Product) -> dict[str, Fastener]:
    """Return a fastener for each member of each named part or group."""
    return {
        part: _fastener(
            part, Fields(data, f"{fields.where}: fasteners.{item}", FASTENER_KEYS), product
        )
        for item, data in fields.mapping("fasteners").items()
        for part in product.members(item)
    }


def _fastener(part: str, fields: Fields, product: Product) -> Fastener:
    return Fastener(
        part=part,
        into=one_of("part", fields.text("into"), list(product.parts)),
        clamps=one_of("part", fields.text("clamps"), list(product.parts)),
        thread=fields.text("thread"),
        diameter=fields.positive("diameter_mm") * 1e-3,
        pitch=fields.positive("pitch_mm") * 1e-3,
        thread_depth=fields.positive("thread_depth_mm") * 1e-3,
        torque=fields.positive("torque_Nm"),
        nut_factor=fields.positive("nut_factor"),
    )


def _fits(fields: Fields, product: Product) -> tuple[Fit, ...]:
    """Return the fits of shafts in holes."""
    if "fits" not in fields:
        return ()
    entries = fields.raw("fits")
    if not isinstance(entries, list):
        raise CellError(f"{fields.where}.fits: expected a list of fits, got {entries!r}.")
    where = f"{fields.where}: fits"
    return tuple(
        _fit(Fields(data, f"{where}[{k}]", FIT_KEYS), product) for k, data in enumerate(entries)
    )


def _fit(fields: Fields, product: Product) -> Fit:
    return Fit(
        shaft=one_of("part", fields.text("shaft"), list(product.parts)),
        hole=one_of("part", fields.text("hole"), list(product.parts)),
        p_AoF=fields.vector("at_mm") * 1e-3,
        depth=fields.positive("depth_mm") * 1e-3,
    )
