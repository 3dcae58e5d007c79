"""The report is one file that any browser shows offline, with what the run measured."""

import base64
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from experiments.reporting.report import write_report
from planning.operations.limits import Limit

VOID = {"meta", "img", "br"}
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
PLAN = {
    "steps": [
        {
            "target": ["motor"],
            "incoming": ["bolt_1", "bolt_2"],
            "directions": {"+x": 0, "+z": 1},
            "posture": "+z",
            "fixed_part": "motor",
            "up": "+z",
            "cog_height_m": 0.0409123,
            "reason": "only +z is free & it is up",
        }
    ]
}
RESULT = {
    "command": "assemble",
    "product": "motor_unit",
    "order": ["motor", "plate", "bolts"],
    "seed": 0,
    "verdict": "success",
    "steps": [
        {
            "name": "fasten bolts",
            "operation": "tighten_bolts",
            "verdict": "failure",
            "sim_seconds": 1.5,
            "cpu_seconds": 12.345678,
            "measured": {"clamp_force_N": 830.123456, "tool": "<driver>", "seated": True},
        }
    ],
    "real_time_factor": 0.123456,
    "config": {"simulation": {"time_step": 0.001}},
    "versions": {"drake": "1.51.1"},
}


class Outline(HTMLParser):
    """Collects tags, text and references, and checks that every tag is closed in turn."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.text = ""
        self.urls: list[str] = []
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        self.urls += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def outline(folder: Path, **changes: Any) -> Outline:
    content: dict[str, Any] = dict(title="Run", plan=PLAN, result=RESULT) | changes
    write_report(folder / "report.html", **content)
    return Outline((folder / "report.html").read_text(encoding="utf-8"))


def test_report_shows_verdicts_measurements_and_plan(tmp_path: Path) -> None:
    text = re.sub(r"\s+", " ", outline(tmp_path).text)
    for expected in ("fasten bolts", "clamp force", "830 N", "12.35", "0.1235", "success"):
        assert expected in text
    for expected in ("bolt_1, bolt_2", "0.04091", "only +z is free & it is up", "1.51.1"):
        assert expected in text
    assert "+x" not in text, "a direction that is not free"


def test_report_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    """Works offline: the only references are images that it holds itself."""
    page = outline(tmp_path, pictures=[("before", PNG)], plots=[("force", PNG)])
    assert len(page.urls) == 2
    assert all(url.startswith("data:image/png;base64,") for url in page.urls)
    html = (tmp_path / "report.html").read_text()
    assert "http" not in html
    assert "@import" not in html
    assert "script" not in page.seen


def test_pictures_are_held_unchanged_and_captioned(tmp_path: Path) -> None:
    page = outline(tmp_path, pictures=[("a < b", PNG)])
    assert base64.b64decode(page.urls[0].split(",")[1]) == PNG
    assert "a < b" in page.text


def test_video_is_held_like_a_picture(tmp_path: Path) -> None:
    gif = b"GIF89a" + PNG
    page = outline(tmp_path, videos=[("the run", gif)])
    assert page.urls[0].startswith("data:image/gif;base64,")
    assert base64.b64decode(page.urls[0].split(",")[1]) == gif


def test_limits_and_phases_are_shown(tmp_path: Path) -> None:
    limits = {"fasten bolts": {"clamp_force_N": Limit("clamp_force_N", 1000.0, "it holds")}}
    phases = [{"phase": "bolt_1: tighten", "begins_s": 1.0, "lasts_s": 0.5}]
    text = outline(tmp_path, limits=limits, phases=phases).text.replace("\xa0", " ")
    for expected in ("1000 N", "17 %", "it holds", "bolt_1: tighten"):
        assert expected in text


def test_text_is_never_markup(tmp_path: Path) -> None:
    page = outline(tmp_path, title="<b>bold</b>", notes=["<i>no pictures</i>"])
    assert "<b>bold</b>" in page.text
    assert "<i>no pictures</i>" in page.text
    assert "<driver>" in page.text


def test_sections_without_content_are_left_out(tmp_path: Path) -> None:
    page = outline(tmp_path, plan={}, result={"verdict": "failure"})
    assert "Plan" not in page.text
    assert "Steps" not in page.text
    assert "failure" in page.text


def test_cases_stand_in_place_of_steps(tmp_path: Path) -> None:
    case = {"part": "motor", "posture": "P2", "direction": "a", "trials": 5, "successes": 0}
    result = {"cases": [case | {"expected": "failure", "measured": {"displacement_m": 0.0542}}]}
    page = outline(tmp_path, plan={}, result=result)
    assert "Cases" in page.text
    assert "motor/P2/a" in page.text
    assert "54.2" in page.text


def test_same_content_gives_the_same_file(tmp_path: Path) -> None:
    outline(tmp_path)
    first = (tmp_path / "report.html").read_bytes()
    outline(tmp_path)
    assert (tmp_path / "report.html").read_bytes() == first


def test_report_that_cannot_be_made_leaves_the_old_one(tmp_path: Path) -> None:
    outline(tmp_path)
    old = (tmp_path / "report.html").read_bytes()
    with pytest.raises(TypeError):
        outline(tmp_path, pictures=[("no bytes", None)])
    assert (tmp_path / "report.html").read_bytes() == old
