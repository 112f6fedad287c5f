"""The signal path of a safety function: what it shows, and that its texts stay in their boxes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from report.made import BASE, TIMED, inputs_of
from studio.browser import chromium  # noqa: F401 - a fixture

from fsoe_net.document.model import Picture
from fsoe_net.document.style import standalone_picture
from fsoe_net.report.function_picture import function_picture

LONG = "guard door with two channels on the left side of the press, W-17"
HOSTILE = "</title></svg><script>alert(1)</script>"
NAMES = [LONG, "W" * 60, "a_b_c_" * 10, "急停按钮" * 15, HOSTILE]


def pictures(folder: Path, *changes: tuple[str, str]) -> list[Picture]:
    """Return the pictures of `TIMED` with these changes, one for each safety function."""
    text = TIMED.read_text("utf-8")
    for find, put in changes:
        assert find in text
        text = text.replace(find, put)
    (folder / "devices").symlink_to(BASE / "devices")
    path = folder / "network.yaml"
    path.write_text(text, "utf-8")
    budget = inputs_of(path).budget
    assert budget is not None
    return [function_picture(f) for f in budget.functions]


def blocks(svg: str) -> list[list[str]]:
    """Return the texts of each box, in the order of the drawing."""
    return [[t.text or "" for t in g.iter("text")] for g in ElementTree.fromstring(svg).iter("g")]


def test_each_part_and_connection_has_a_box_with_the_values_of_the_file(tmp_path: Path):
    (picture,) = pictures(tmp_path)
    shown = [
        ["sensor", "ES1", "5 ms", "PFH 1.00e-08/h", "PL d"],
        ["input", "io", "4 ms", "PFH 1.11e-09/h", "PL d"],
        ["FSoE", "logic-io", "watchdog", "100 ms"],
        ["logic", "logic", "2 ms", "PFH 1.03e-09/h", "PL d"],
        ["FSoE", "logic-io2", "watchdog", "100 ms"],
        ["output", "io2", "3 ms", "PFH 1.25e-09/h", "PL d"],
        ["actuator", "K1", "20 ms", "PFH 1.00e-08/h", "PL d"],
    ]
    assert blocks(picture.svg) == shown
    flat = [" ".join(block) for block in shown]
    assert [" ".join(block) for block in blocks(picture.narrow)] == flat
    assert picture.words == (
        "ES1 → io → logic-io (watchdog 100 ms) → logic → logic-io2 (watchdog 100 ms) → io2 → K1"
    )


def test_a_missing_value_is_open_and_never_left_out(tmp_path: Path):
    (picture,) = pictures(
        tmp_path,
        ("name: ES1, time_ms: 5, pfh_per_hour: 1.0e-8, claim: {pl: d}, source: sheet of the maker",
         "name: ES1"),
        ("connection_id: 10, watchdog_ms: 100", "connection_id: 10"),
        ("claim: {pl: d}, source: manual 1.2", "claim: {pl: d}"),
    )  # fmt: skip
    sensor, _, bus, logic, *_ = (" ".join(block) for block in blocks(picture.svg))
    assert sensor == "sensor ES1 ○ no time ○ no PFH ○ no claim"
    assert bus == "FSoE logic-io ○ no watchdog"
    assert logic.endswith("○ unverified")


def test_an_end_without_a_connection_to_the_logic_is_an_error(tmp_path: Path):
    (picture,) = pictures(
        tmp_path,
        ("      - {main: logic, sub: io2, address: 2, connection_id: 11, watchdog_ms: 100, "
         'app_parameters: "01 00"}\n', ""),
        ("""      - size: 6
        in: {ec_module: io2, index: 0x6000, subindex: 1}
        out: {ec_module: logic, index: 0x7010, subindex: 1}
      - size: 6
        in: {ec_module: logic, index: 0x6010, subindex: 1}
        out: {ec_module: io2, index: 0x7000, subindex: 1}
""", ""),
    )  # fmt: skip
    assert " ".join(blocks(picture.svg)[4]) == "FSoE ✖ no connection of io2"
    assert "no FSoE connection joins io2 and logic" in picture.words


def test_many_parts_are_counted_and_all_are_in_the_words(tmp_path: Path):
    row = "      - {kind: actuator, name: K1, time_ms: 20"
    more = "".join(f"      - {{kind: actuator, name: K{n}}}\n" for n in range(2, 13))
    (picture,) = pictures(tmp_path, (row, more + row))
    assert sum(block[0] == "actuator" for block in blocks(picture.svg)) == 5
    assert blocks(picture.svg)[-1] == ["and 7 more"]
    assert all(re.search(rf"\bK{n}\b", picture.words) for n in range(1, 13))


@pytest.mark.parametrize(
    ("elements", "heads"),
    [
        ("[]", []),
        ("[{kind: logic, sub: logic}]", ["logic"]),
        ("[{kind: input, sub: io}, {kind: output, sub: io2}]", ["input", "output"]),
        ("[{kind: input, sub: logic}, {kind: logic, sub: logic}]", ["input", "logic"]),
        ("[{kind: output, sub: io}, {kind: logic, sub: logic}]", ["logic", "FSoE", "output"]),
    ],
)
def test_a_path_has_the_parts_that_are_stated(tmp_path: Path, elements: str, heads: list[str]):
    text = TIMED.read_text("utf-8").partition("    elements:\n")[2]
    (picture,) = pictures(tmp_path, (f"elements:\n{text}", f"elements: {elements}\n"))
    assert [block[0] for block in blocks(picture.svg)] == heads


@pytest.mark.parametrize("name", NAMES)
def test_texts_of_any_name_stay_in_their_boxes(tmp_path: Path, name: str, chromium: Any):  # noqa: F811
    (picture,) = pictures(
        tmp_path, ("name: ES1,", f'name: "{name}",'), ("name: K1,", f'name: "{name}",')
    )
    page = chromium.new_page(viewport={"width": 1280, "height": 800})
    for svg in (picture.svg, picture.narrow):
        page.set_content(standalone_picture(svg))
        assert page.locator("script").count() == 0
        outside = page.evaluate("""() => [...document.querySelectorAll("g")].flatMap((group) => {
          const box = group.querySelector("rect").getBBox();
          return [...group.querySelectorAll("text")].filter((text) => {
            const own = text.getBBox();
            return own.x < box.x || own.x + own.width > box.x + box.width
              || own.y < box.y || own.y + own.height > box.y + box.height;
          }).map((text) => text.textContent);
        })""")
        assert outside == []
    page.close()
