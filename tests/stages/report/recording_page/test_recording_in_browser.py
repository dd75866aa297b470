"""The recording's plots in a real browser: they follow the hand, obey pointer and keys, and do not lie."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import WatchedPage, watched
from playwright.sync_api import Browser, Locator

from shukotsu.files.whole_files import write_text
from shukotsu.schemas.catalogue import JOINT_ANGLES, TIPS
from shukotsu.stages.report.recording_page.recording_content import recording_page
from shukotsu.stages.report.viewer import ERROR_STEP_MM

pytestmark = pytest.mark.slow

VIEWER = "document.querySelector('[data-hand-viewer]').viewer"
ERRORS, ANGLES = '[data-plot="errors"]', '[data-plot="angles"]'
LEFT, RIGHT, AXIS = 44, 10, 36
N_FRAMES, RATE_HZ = 300, 240
DIGITS = ("thumb", "index", "middle", "ring", "little")
# What is drawn: differs wherever a pixel of a plot does.
INK = "(plot) => document.querySelector(plot + ' canvas').toDataURL()"
CURSOR = """(plot) => {
  const line = document.querySelector(plot + ' .plot-cursor');
  return line.hidden ? null : new DOMMatrix(getComputedStyle(line).transform).e;
}"""
# Where in a part of a plot's canvas (left, top, width, height) pixels have a colour, as [x, y] in the part.
FOUND = """([plot, name, left, top, width, height]) => {
  const hex = getComputedStyle(document.querySelector('[data-plots]')).getPropertyValue(name);
  const wanted = hex.match(/[0-9a-f]{2}/gi).map((part) => parseInt(part, 16)), found = [];
  const to = document.querySelector(plot + ' canvas').getContext('2d');
  const {data} = to.getImageData(left, top, width, height);
  for (let i = 0; i < data.length; i += 4) {
    const same = wanted.every((part, k) => Math.abs(data[i + k] - part) < 60);
    if (same && data[i + 3] > 99) found.push([i / 4 % width, Math.floor(i / 4 / width)]);
  }
  return found;
}"""
COUNTED = """() => {
  window.strokes = 0;
  const own = CanvasRenderingContext2D.prototype.stroke;
  CanvasRenderingContext2D.prototype.stroke = function (...all) {
    strokes++;
    return own.apply(this, all);
  };
}"""
SETTLED = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture(scope="module")
def pages(hands: Any) -> Path:
    """The pages of all recordings that there are, in their places; give that of S01's right hand."""
    for recording in hands.study.shown:
        results = hands.results(recording.hand.subject, recording.hand.hand)
        write_text(hands.paths.recording_page(recording), recording_page(results))
    return hands.paths.recording_page(hands.recording())


@pytest.fixture
def opened(watched_page: WatchedPage, pages: Path) -> Iterator[WatchedPage]:
    """That page with its plots drawn, nothing to complain about at the end."""
    show(watched_page, pages)
    yield watched_page
    watched_page.check()


def show(page: WatchedPage, path: Path) -> None:
    page.open(path)
    page.wait("document.querySelector('[data-plots]').classList.contains('drawn')")
    settle(page)


def settle(page: WatchedPage) -> None:
    page.value(SETTLED)


def ink(page: WatchedPage, plot: str = ERRORS) -> Any:
    settle(page)
    return page.value(INK, plot)


def choose(page: WatchedPage, part: str, **option: Any) -> None:
    page.page.locator(f'[data-part="{part}"]').select_option(**option)


def index(page: WatchedPage) -> int:
    return int(page.value(f"{VIEWER}.index"))


def at(plot: Locator, frame: float, above: float = 100.0) -> dict[str, float]:
    """Where a frame is on a plot that shows the whole recording, so many pixels above its foot."""
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    x = LEFT + frame / (N_FRAMES - 1) * (box["width"] - LEFT - RIGHT)
    return {"x": x, "y": box["height"] - above}


def point(page: WatchedPage, frame: float, plot: str = ERRORS, above: float = 100.0) -> tuple[float, float]:
    """The same on the page."""
    element = page.page.locator(plot)
    place, box = at(element, frame, above), element.bounding_box()
    assert box is not None
    return box["x"] + place["x"], box["y"] + place["y"]


def translated(page: WatchedPage, model: int) -> dict[str, str]:
    """The numbers beside a model's name."""
    page.page.wait_for_timeout(200)
    cells = page.page.locator("[data-model]").nth(model).locator("td").all_inner_texts()
    return dict(zip(DIGITS, cells, strict=True))


def angles_told(page: WatchedPage) -> list[str]:
    page.page.wait_for_timeout(200)
    words = page.page.locator('[data-part="angle-where"]').inner_text()
    return re.findall(r"(?:flexion|abduction|rotation) (\S+?)°?(?:,|$)", words)


def cursor(page: WatchedPage, plot: str = ERRORS) -> float:
    settle(page)
    place = page.value(CURSOR, plot)
    assert place is not None, "the frame is not in view"
    return float(place)


@pytest.mark.parametrize("plot", [ERRORS, ANGLES])
def test_a_click_takes_the_hand_to_that_frame(opened: WatchedPage, plot: str) -> None:
    element = opened.page.locator(plot)
    element.click(position=at(element, 200))
    assert abs(index(opened) - 200) <= 1
    place = at(element, index(opened))["x"]
    assert abs(cursor(opened, ERRORS) - place) < 1.5
    assert abs(cursor(opened, ANGLES) - place) < 1.5


def test_the_cursor_moves_with_the_playing_hand_and_no_plot_is_drawn_anew(opened: WatchedPage) -> None:
    start = cursor(opened)
    opened.value(COUNTED)
    opened.page.get_by_role("button", name="Play", exact=True).click()
    opened.wait(f"{VIEWER}.index > 60")
    opened.page.get_by_role("button", name="Pause").click()
    element = opened.page.locator(ERRORS)
    assert abs(cursor(opened) - at(element, index(opened))["x"]) < 1.5
    assert cursor(opened) > start + 30
    assert opened.value("strokes") == 0


def test_hovering_tells_the_tables_tip_errors(opened: WatchedPage, hands: Any) -> None:
    tip_error_mm = {
        (model, row["digit"], row["frame"]): row["error_mm"]
        for model in hands.study.models
        for row in hands.rows(model, TIPS, task="opposition")
    }
    for frame in (3, 120, 217):
        opened.page.mouse.move(*point(opened, frame))
        where = opened.page.locator('[data-part="error-where"]').inner_text()
        assert where == f"Tip error [mm] at frame {frame}, {frame / RATE_HZ:.3f} s"
        for m, model in enumerate(hands.study.models):
            for digit, words in translated(opened, m).items():
                expected = tip_error_mm.get((model, digit, frame))
                known = expected is not None and np.isfinite(expected)
                packed = round(expected / ERROR_STEP_MM) * ERROR_STEP_MM if known else 0.0
                assert words == (f"{packed:.2f}" if known else "–"), (model, digit, frame)
    assert index(opened) == 0
    opened.page.mouse.move(1, 1)
    opened.page.wait_for_timeout(200)
    assert "at frame 0," in opened.page.locator('[data-part="error-where"]').inner_text()


def test_hovering_tells_the_tables_joint_angles(opened: WatchedPage, hands: Any) -> None:
    for own, model in enumerate(("whole-hand", "whole-hand-b")):
        choose(opened, "angle-model", value=str(own))
        for joint in ("ring_pip", "index_mcp"):
            choose(opened, "joint", label=joint)
            for frame in (77, 130):
                (row,) = hands.rows(model, JOINT_ANGLES, task="opposition", joint=joint, frame=frame)
                opened.page.mouse.move(*point(opened, frame, ANGLES))
                expected = [row[name] for name in ("flexion_deg", "abduction_deg", "rotation_deg")]
                words = ["–" if v is None else f"{v:.1f}".replace("-", "−") for v in expected]
                assert angles_told(opened) == words


def test_a_peak_of_one_frame_is_drawn_though_frames_share_a_column(opened: WatchedPage) -> None:
    """On 50 pixels, six frames a column, the peak of frame 217 is neither its column's first nor its last."""
    box, before = opened.page.get_by_label("Logarithmic"), ink(opened)
    assert box.is_checked(), "the peak dwarfs the other digits"
    box.uncheck()
    assert ink(opened) != before
    opened.page.locator(ERRORS).evaluate("(plot) => (plot.style.width = '104px')")
    settle(opened)
    settle(opened)
    found = opened.value(FOUND, [ERRORS, "--model2", 0, 20, 104, 20])
    assert found
    assert all(abs(x - (LEFT + 217 / 299 * 50)) < 3 for x, _ in found)


def test_without_scripts_the_page_says_what_to_do(browser: Browser, pages: Path) -> None:
    with watched(browser, java_script_enabled=False) as page:
        page.open(pages)
        assert page.page.locator(".plots-still-note").first.is_visible()
        assert page.page.locator(ERRORS).is_hidden()
        assert page.page.locator("[data-switch]").is_hidden()


def test_gaps_stay_gaps(opened: WatchedPage) -> None:
    """The index finger's errors of the fitted hands are not known in frames 100 to 159."""
    boxes = opened.page.locator("[data-model] input")
    for box in boxes.all():
        box.uncheck()
    boxes.nth(1).check()
    settle(opened)
    element, second_strip = opened.page.locator(ERRORS), 20 + 82
    found = opened.value(FOUND, [ERRORS, "--model1", 0, second_strip, 1000, 62])

    def inked(first: int, last: int) -> int:
        left, right = (at(element, frame)["x"] for frame in (first, last))
        return sum(left < x < right for x, _ in found)

    assert inked(102, 157) == 0
    assert inked(60, 97) > 30
    assert inked(163, 190) > 30
