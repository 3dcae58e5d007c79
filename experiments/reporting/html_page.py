"""Elements of a self-contained HTML page."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

Picture = tuple[str, bytes]  # Caption, and PNG or GIF.
STYLE = Path(__file__).with_name("report.css")
VERDICTS = ("success", "failure")


def page(title: str, body: str) -> str:
    """Return a whole page, style sheet included."""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width">\n<title>{escape(title)}</title>\n'
        f"<style>\n{STYLE.read_text()}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def section(heading: str, content: str) -> str:
    """Return a heading with its content, or nothing if there is no content."""
    return f"<h2>{heading}</h2>\n{content}" if content else ""


def figures(pictures: Iterable[Picture], *, wide: bool = False) -> str:
    """Return pictures with their captions: side by side if the page is wide enough, or each wide.

    Args:
        pictures: PNG or GIF.
        wide: Whether each takes the whole width.
    """
    each = "\n".join(
        f'<figure><img alt="{escape(caption)}" src="data:{_media_type(data)};base64,'
        f'{base64.b64encode(data).decode()}"><figcaption>{escape(caption)}</figcaption></figure>'
        for caption, data in pictures
    )
    return f'<div class="figures{" wide" if wide else ""}">\n{each}\n</div>' if each else ""


def _media_type(data: bytes) -> str:
    return "image/gif" if data[:4] == b"GIF8" else "image/png"


def table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    """Return a table; columns that no row has are left out."""
    used = [column for column in columns if any(column in row for row in rows)]
    if not used:
        return ""
    head = "".join(f"<th>{escape(words(column))}</th>" for column in used)
    lines = ["".join(_td(row.get(column)) for column in used) for row in rows]
    body = "\n".join(f"<tr>{line}</tr>" for line in lines)
    return f'<div class="wide"><table>\n<tr>{head}</tr>\n{body}\n</table></div>'


def pairs(values: Mapping[str, Any]) -> str:
    """Return a table of names and values."""
    rows = [f"<tr><th>{escape(words(key))}</th>{_td(value)}</tr>" for key, value in values.items()]
    return f"<table>\n{''.join(rows)}\n</table>" if rows else ""


def _td(value: Any) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return f'<td class="number">{cell(value)}</td>' if number else f"<td>{cell(value)}</td>"


def cell(value: Any) -> str:
    """Return a value as HTML text: verdicts coloured, numbers short, lists and 0/1 maps joined."""
    if value is None:
        return ""
    if value in VERDICTS:
        return f'<span class="verdict {value}">{value}</span>'
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return escape(", ".join(str(key) for key, item in value.items() if item)) or "none"
    if isinstance(value, list | tuple):
        return escape(", ".join(f"{x:.4g}" if isinstance(x, float) else str(x) for x in value))
    return escape(str(value))


def words(name: str) -> str:
    """Return the name of a quantity as words; the path of a setting stays as it is."""
    return name if "." in name else name.replace("_", " ")
