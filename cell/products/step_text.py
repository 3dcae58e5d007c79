"""What a STEP file says outside of its shapes: names, tree, units, files that it refers to.

OpenCASCADE gives an instance without a name that of its occurrence, and forgets the product's, so
products are looked up here. Only the entities that say so are read, wherever line breaks are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

ENTITY = re.compile(
    rb"#(\d+)\s*=\s*(PRODUCT|PRODUCT_DEFINITION_FORMATION\w*|NEXT_ASSEMBLY_USAGE_OCCURRENCE"
    rb"|PRODUCT_DEFINITION(?:_WITH_ASSOCIATED_DOCUMENTS)?|DOCUMENT_FILE"
    rb"|(?:APPLIED|CC_DESIGN|AUTO_DESIGN)_DOCUMENT_REFERENCE|DOCUMENT_PRODUCT_EQUIVALENCE)\s*\("
)
ARGUMENT = re.compile(rb"'(?:[^']|'')*'|[(),]|/\*.*?\*/|[^'(),/]+|/", re.DOTALL)
REFERENCE = re.compile(rb"#(\d+)")
PREFIX = {b"$": 1.0, b".MICRO.": 1e-6, b".MILLI.": 1e-3, b".CENTI.": 1e-2, b".DECI.": 0.1}
PREFIX |= {b".KILO.": 1e3}


@dataclass(frozen=True)
class Usage:
    """An instance of a product in an assembly.

    Attributes:
        given: Name of the instance.
        product: Name of the product.
        parent, child: Entities that define the assembly and the product.
        name_at: Where in the file the name of the instance lies, quotes included.
    """

    given: str
    product: str
    parent: int
    child: int
    name_at: tuple[int, int]


class StepText:
    """The text of a STEP file."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._entities: dict[bytes, dict[int, list[tuple[int, int]]]] = {}
        for match in ENTITY.finditer(data):
            kind = b"PRODUCT_DEFINITION_FORMATION" if b"FORMATION" in match[2] else match[2]
            kind = b"PRODUCT_DEFINITION" if kind.endswith(b"_DOCUMENTS") else kind
            kind = b"DOCUMENT_REFERENCE" if kind.endswith(b"_REFERENCE") else kind
            entities = self._entities.setdefault(kind, {})
            entities[int(match[1])] = _arguments(data, match.end())

    def _of_kind(self, kind: bytes, least: int) -> Mapping[int, list[tuple[int, int]]]:
        """Return where the arguments lie, by entity, of those that have enough of them."""
        entities = self._entities.get(kind, {})
        return {number: spans for number, spans in entities.items() if len(spans) >= least}

    def _text(self, span: tuple[int, int]) -> str:
        tokens = ARGUMENT.findall(self._data[slice(*span)])  # The argument, and comments.
        return decoded(next((token for token in tokens if token.startswith(b"'")), b"$"))

    def _references(self, span: tuple[int, int]) -> list[int]:
        return [int(number) for number in REFERENCE.findall(self._data[slice(*span)])]

    def _reference(self, span: tuple[int, int]) -> int:
        return next(iter(self._references(span)), 0)

    @cached_property
    def products(self) -> Mapping[int, str]:
        """Names of products by the entity that defines the product's shape."""
        names = {
            number: self._text(spans[1]) or self._text(spans[0])
            for number, spans in self._of_kind(b"PRODUCT", 2).items()
        }
        formations = {
            number: self._reference(spans[2])
            for number, spans in self._of_kind(b"PRODUCT_DEFINITION_FORMATION", 3).items()
        }
        return {
            number: names.get(formations.get(self._reference(spans[2]), 0), "")
            for number, spans in self._of_kind(b"PRODUCT_DEFINITION", 3).items()
        }

    @cached_property
    def usages(self) -> Mapping[int, Usage]:
        """The instances in assemblies, by entity."""
        usages = {}
        for number, spans in self._of_kind(b"NEXT_ASSEMBLY_USAGE_OCCURRENCE", 5).items():
            parent, child = self._reference(spans[3]), self._reference(spans[4])
            name = self.products.get(child, "")
            usages[number] = Usage(self._text(spans[1]), name, parent, child, spans[1])
        return usages

    @property
    def roots(self) -> list[int]:
        """The entities that define products which are in no assembly."""
        used = {usage.child for usage in self.usages.values()}
        return [number for number in self.products if number not in used]

    def with_keys(self) -> bytes:
        """Return the file with each instance named "#" and the number of its entity.

        What OpenCASCADE makes of an instance is known by this key, whatever names are shared.
        """
        pieces, at = [], 0
        for number, usage in sorted(self.usages.items(), key=lambda item: item[1].name_at):
            start, end = usage.name_at
            pieces += [self._data[at:start], b"'#%d'" % number]
            at = end
        return b"".join([*pieces, self._data[at:]])

    def documents(self) -> Mapping[int, list[str]]:
        """Return the names of the files that hold a product's shape, by the entity defining it."""
        files = {
            number: self._text(spans[0])
            for number, spans in self._of_kind(b"DOCUMENT_FILE", 1).items()
        }
        found: dict[int, list[str]] = {}
        for number, spans in self._of_kind(b"PRODUCT_DEFINITION", 5).items():
            names = [files[d] for d in self._references(spans[4]) if d in files]
            found.setdefault(number, []).extend(names)
        for spans in self._of_kind(b"DOCUMENT_REFERENCE", 2).values():
            document = self._reference(spans[0])
            for number in [n for span in spans[1:] for n in self._references(span)]:
                if document in files and number in self.products:
                    found.setdefault(number, []).append(files[document])
        return {number: list(dict.fromkeys(names)) for number, names in found.items() if names}

    def length_units(self) -> set[float]:
        """Return the units of length of the file's shapes, in metres."""
        text = self._data
        complex_ = {
            int(m[1]): m[2]
            for m in re.finditer(rb"#(\d+)\s*=\s*\(([^;]*\bLENGTH_UNIT\b[^;]*);", text)
        }
        measures = {
            int(m[1]): (float(m[2]), int(m[3]))
            for m in re.finditer(
                rb"#(\d+)\s*=\s*LENGTH_MEASURE_WITH_UNIT\s*\(\s*LENGTH_MEASURE\s*\(\s*"
                rb"([-+.\dEe]+)\s*\)\s*,\s*#(\d+)",
                text,
            )
        }

        def meters(number: int, depth: int = 0) -> float:
            unit = complex_.get(number, b"")
            if si := re.search(rb"SI_UNIT\s*\(\s*([$.\w]+)\s*,\s*\.METRE\.", unit):
                return PREFIX.get(si[1], 0.0)
            based = re.search(rb"CONVERSION_BASED_UNIT\s*\(\s*'[^']*'\s*,\s*#(\d+)", unit)
            if based and depth < 3 and int(based[1]) in measures:
                value, base = measures[int(based[1])]
                return value * meters(base, depth + 1)
            return 0.0

        used = re.finditer(rb"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)", text)
        numbers = {int(number) for match in used for number in REFERENCE.findall(match[1])}
        return {value for number in numbers & complex_.keys() if (value := meters(number))}


def _arguments(data: bytes, start: int) -> list[tuple[int, int]]:
    """Return where the arguments of an entity lie that follow its opening parenthesis."""
    spans, depth, first = [], 0, start
    for token in ARGUMENT.finditer(data, start):
        text = token[0]
        if (text == b"," and not depth) or (text == b")" and not depth):
            spans.append(_stripped(data, first, token.start()))
            first = token.end()
            if text == b")":
                break
        depth += (text == b"(") - (text == b")")
    return spans


def _stripped(data: bytes, start: int, end: int) -> tuple[int, int]:
    text = data[start:end]
    return start + len(text) - len(text.lstrip()), end - len(text) + len(text.rstrip())


def decoded(raw: bytes) -> str:
    """Return a string of a STEP file, with its control directives carried out [R] (ISO 10303-21).

    Bytes beyond ASCII, which the standard does not have, are UTF-8, else the usual code pages.
    """
    if not raw.startswith(b"'"):
        return ""
    text = _unicode(raw[1:-1].replace(b"''", b"'").replace(b"\n", b"").replace(b"\r", b""))

    def directive(match: re.Match[str]) -> str:
        wide, hexadecimal, latin, upper = match["wide"], match["hex"], match["latin"], match["up"]
        if wide:
            data = bytes.fromhex(hexadecimal)
            return data.decode("utf-16-be" if wide == "2" else "utf-32-be", "replace")
        if latin:
            return bytes.fromhex(latin).decode("latin-1")
        if upper:
            return chr(ord(upper) + 128)
        return "\\" if match[0] == "\\\\" else ""

    pattern = (
        r"\\X(?P<wide>[24])\\(?P<hex>(?:[\dA-Fa-f]{4})*)\\X0\\|\\X\\(?P<latin>[\dA-Fa-f]{2})"
        r"|\\S\\(?P<up>[ -~])|\\P[A-I]\\|\\\\"
    )
    return re.sub(pattern, directive, text)


def _unicode(raw: bytes) -> str:
    # SolidWorks writes names in the code page of its system. In GB 2312 both bytes are above
    # 0xA0, in Shift-JIS the first is often one of 0x81 to 0x9F, which Western names do not have.
    pages = ["utf-8", "gb2312"] + (["cp932"] if re.search(rb"[\x81-\x9f]", raw) else [])
    for page in pages:
        try:
            return raw.decode(page)
        except UnicodeDecodeError:
            pass
    return raw.decode("latin-1")
