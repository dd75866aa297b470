"""The recording's page in a real browser: plots follow the hand, obey the pointer, and do not lie."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import WatchedPage, chromium, watched
from playwright.sync_api import Browser, Locator

from shukotsu.report.recording_page import recording_page
from shukotsu.report.viewer import ERROR_STEP_MM
from shukotsu.tables.catalogue import JOINT_ANGLES, TIPS
from shukotsu.tables.whole_files import write_text

pytestmark = pytest.mark.slow

VIEWER = "document.querySelector('[data-hand-viewer]').viewer"
ERRORS, ANGLES = '[data-plot="errors"]', '[data-plot="angles"]'
LEFT, RIGHT = 44, 10
N_FRAMES, RATE_HZ = 300, 240
DIGITS = ("thumb", "index", "middle", "ring", "little")
CURSOR = """(plot) => {
  const line = document.querySelector(plot + ' .plot-cursor');
  return line.hidden ? null : new DOMMatrix(getComputedStyle(line).transform).e;
}"""
# Where in a part of a plot's canvas (left, top, width, height) pixels have a colour, as [x, y] in the part.
COLOURED = """([plot, name, left, top, width, height]) => {
  const hex = getComputedStyle(document.querySelector('[data-plots]')).getPropertyValue(name);
  const wanted = hex.match(/[0-9a-f]{2}/gi).map((part) => parseInt(part, 16)), pixels = [];
  const to = document.querySelector(plot + ' canvas').getContext('2d');
  const {data} = to.getImageData(left, top, width, height);
  for (let i = 0; i < data.length; i += 4) {
    const same = wanted.every((part, k) => Math.abs(data[i + k] - part) < 60);
    if (same && data[i + 3] > 99) pixels.push([i / 4 % width, Math.floor(i / 4 / width)]);
  }
  return pixels;
}"""
COUNTED = """() => {
  window.strokes = 0;
  const stroke = CanvasRenderingContext2D.prototype.stroke;
  CanvasRenderingContext2D.prototype.stroke = function (...all) {
    strokes++;
    return stroke.apply(this, all);
  };
}"""
SETTLED = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture(scope="module")
def path(hands: Any) -> Path:
    path: Path = hands.paths.recording_page(hands.recording())
    write_text(path, recording_page(hands.results()))
    return path


@pytest.fixture
def opened(watched_page: WatchedPage, path: Path) -> Iterator[WatchedPage]:
    """That page with its plots drawn, nothing to complain about at the end."""
    show(watched_page, path)
    yield watched_page
    watched_page.check()


def show(page: WatchedPage, path: Path) -> None:
    page.open(path)
    page.wait("document.querySelector('[data-plots]').classList.contains('drawn')")
    page.value(SETTLED)


def index(page: WatchedPage) -> int:
    return int(page.value(f"{VIEWER}.index"))


def at(plot: Locator, frame: float) -> dict[str, float]:
    """Return where a frame is on a plot that shows the whole recording."""
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    return {"x": LEFT + frame / (N_FRAMES - 1) * (box["width"] - LEFT - RIGHT), "y": box["height"] - 100}


def cursor(page: WatchedPage, plot: str) -> float:
    page.value(SETTLED)
    return float(page.value(CURSOR, plot))


def test_a_click_takes_the_hand_to_that_frame(opened: WatchedPage) -> None:
    for plot, frame in ((ERRORS, 200), (ANGLES, 90)):
        element = opened.page.locator(plot)
        element.click(position=at(element, frame))
        assert abs(index(opened) - frame) <= 1
        for each in (ERRORS, ANGLES):
            assert abs(cursor(opened, each) - at(element, index(opened))["x"]) < 1.5


def test_the_cursor_moves_with_the_playing_hand_and_no_plot_is_drawn_anew(opened: WatchedPage) -> None:
    plays_to(opened, 60)
    assert opened.value("strokes") == 0


def plays_to(page: WatchedPage, frame: int) -> None:
    start = cursor(page, ERRORS)
    page.value(COUNTED)
    page.page.get_by_role("button", name="Play", exact=True).click()
    page.wait(f"{VIEWER}.index > {frame}")
    page.page.get_by_role("button", name="Pause").click()
    assert abs(cursor(page, ERRORS) - at(page.page.locator(ERRORS), index(page))["x"]) < 1.5
    assert cursor(page, ERRORS) > start + 30


def test_hovering_tells_the_tables_tip_errors(opened: WatchedPage, hands: Any) -> None:
    tip_error_mm = {
        (model, row["digit"], row["frame"]): row["error_mm"]
        for model in hands.study.models
        for row in hands.rows(model, TIPS, task="opposition")
    }
    plot = opened.page.locator(ERRORS)
    for frame in (3, 120, 217):
        plot.hover(position=at(plot, frame))
        where = opened.page.locator('[data-part="error-where"]').inner_text()
        assert where == f"Tip error [mm] at frame {frame}, {frame / RATE_HZ:.3f} s"
        for m, model in enumerate(hands.study.models):
            cells = opened.page.locator("[data-model]").nth(m).locator("td").all_inner_texts()
            for digit, words in zip(DIGITS, cells, strict=True):
                expected = tip_error_mm.get((model, digit, frame))
                known = expected is not None and np.isfinite(expected)
                packed = round(expected / ERROR_STEP_MM) * ERROR_STEP_MM if known else 0.0
                assert words == (f"{packed:.2f}" if known else "–"), (model, digit, frame)
    assert index(opened) == 0
    opened.page.mouse.move(1, 1)
    assert "at frame 0," in opened.page.locator('[data-part="error-where"]').inner_text()


def test_hovering_tells_the_tables_joint_angles(opened: WatchedPage, hands: Any) -> None:
    plot = opened.page.locator(ANGLES)
    for choice, model in enumerate(("whole-hand", "whole-hand-b")):
        opened.page.locator('[data-part="angle-model"]').select_option(value=str(choice))
        opened.page.locator('[data-part="joint"]').select_option(label="index_mcp")
        for frame in (77, 130):
            (row,) = hands.rows(model, JOINT_ANGLES, task="opposition", joint="index_mcp", frame=frame)
            plot.hover(position=at(plot, frame))
            expected = [row[name] for name in ("flexion_deg", "abduction_deg", "rotation_deg")]
            words = opened.page.locator('[data-part="angle-where"]').inner_text()
            assert re.findall(r"(?:flexion|abduction|rotation) (\S+?)°?(?:,|$)", words) == [
                "–" if angle is None else f"{angle:.1f}".replace("-", "−") for angle in expected
            ]


def test_a_peak_of_one_frame_is_drawn_though_frames_share_a_column(opened: WatchedPage) -> None:
    """On 50 pixels, six frames a column, the peak of frame 217 is neither its column's first nor its last."""
    box = opened.page.get_by_label("Logarithmic")
    assert box.is_checked(), "the peak dwarfs the other digits"
    box.uncheck()
    opened.page.locator(ERRORS).evaluate("(plot) => (plot.style.width = '104px')")
    opened.value(SETTLED)
    opened.value(SETTLED)
    pixels = opened.value(COLOURED, [ERRORS, "--model2", 0, 20, 104, 20])
    assert pixels
    assert all(abs(x - (LEFT + 217 / 299 * 50)) < 3 for x, _ in pixels)


def test_gaps_stay_gaps(opened: WatchedPage) -> None:
    """The index finger's errors of the fitted hands are not known in frames 100 to 159."""
    for model, box in enumerate(opened.page.locator("[data-model] input").all()):
        box.set_checked(model == 1)
    opened.value(SETTLED)
    second_strip = 20 + 82
    pixels = opened.value(COLOURED, [ERRORS, "--model1", 0, second_strip, 1000, 62])

    def inked(first: int, last: int) -> int:
        left, right = (at(opened.page.locator(ERRORS), frame)["x"] for frame in (first, last))
        return sum(left < x < right for x, _ in pixels)

    assert inked(102, 157) == 0
    assert inked(60, 97) > 30
    assert inked(163, 190) > 30


def test_without_webgl_the_plots_still_play_below_a_still_hand(browser: Browser, path: Path) -> None:
    del browser  # it ends the driver
    with chromium("--disable-gpu", "--disable-3d-apis") as blind, watched(blind) as page:
        show(page, path)
        assert page.page.locator(".viewer-still > svg").is_visible()
        assert page.page.locator(".viewer-stage").is_hidden()
        plays_to(page, 30)


def test_without_scripts_the_page_says_what_to_do(browser: Browser, path: Path) -> None:
    with watched(browser, java_script_enabled=False) as page:
        page.open(path)
        assert page.page.locator(".plots-still-note").is_visible()
        assert page.page.locator(ERRORS).is_hidden()
        assert page.page.locator("#angles").is_hidden()
