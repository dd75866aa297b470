"""A recording's page in a real browser: plots follow the hand and the pointer and show the tables'
numbers.
"""

import re
from pathlib import Path

import pytest
from browser import WatchedPage, chromium, watched
from playwright.sync_api import Browser, Locator
from report_samples.made_study import ANGLES as ANGLE_COLUMNS
from report_samples.made_study import FITTED_MODELS, PEAK_FRAME, SECOND_FIT, UNSEEN, MadeStudy

from shukotsu.report.recording_page import recording_page
from shukotsu.report.viewer import ERROR_STEP_MM
from shukotsu.tables.catalogue import JOINT_ANGLES, TIPS
from shukotsu.tables.whole_files import write_text

pytestmark = pytest.mark.slow

VIEWER = "document.querySelector('[data-hand-viewer]').viewer"
ERRORS, ANGLES = '[data-plot="errors"]', '[data-plot="angles"]'
LEFT, RIGHT = 44, 10
N_FRAMES, RATE_HZ = 300, 240
MODELS = (*FITTED_MODELS, SECOND_FIT)
DIGITS = ("thumb", "index", "middle", "ring", "little")
CURSOR = """(plot) => {
  const line = document.querySelector(plot + ' .plot-cursor');
  return line.hidden ? null : new DOMMatrix(getComputedStyle(line).transform).e;
}"""
# Positions [x, y] of pixels with a colour in a part (left, top, width, height) of a plot's canvas.
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
def path(study: MadeStudy) -> Path:
    path = study.paths.recording_page(study.recording())
    write_text(path, recording_page(study.recording_results("S01", "right", *MODELS)))
    return path


def show(page: WatchedPage, path: Path) -> None:
    page.open(path)
    page.wait("document.querySelector('[data-plots]').classList.contains('drawn')")
    page.value(SETTLED)


def index(page: WatchedPage) -> int:
    return int(page.value(f"{VIEWER}.index"))


def at(plot: Locator, frame: float) -> dict[str, float]:
    """Return the position (CSS pixels) of a frame on a plot that shows the whole recording."""
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    return {"x": LEFT + frame / (N_FRAMES - 1) * (box["width"] - LEFT - RIGHT), "y": box["height"] - 100}


def cursor(page: WatchedPage, plot: str) -> float:
    page.value(SETTLED)
    return float(page.value(CURSOR, plot))


def plays_to(page: WatchedPage, frame: int) -> None:
    start = cursor(page, ERRORS)
    page.value(COUNTED)
    page.page.get_by_role("button", name="Play", exact=True).click()
    page.wait(f"{VIEWER}.index > {frame}")
    page.page.get_by_role("button", name="Pause").click()
    assert abs(cursor(page, ERRORS) - at(page.page.locator(ERRORS), index(page))["x"]) < 1.5
    assert cursor(page, ERRORS) > start + 30


def test_plots_follow_the_hand_and_show_the_tables_numbers(
    watched_page: WatchedPage, path: Path, study: MadeStudy
) -> None:
    """A click moves the hand to that frame; during playback the cursor moves and no plot is redrawn."""
    page = watched_page
    show(page, path)
    hovering_shows_tip_errors(page, study)
    hovering_shows_joint_angles(page, study)
    for plot, frame in ((ERRORS, 200), (ANGLES, 20)):
        element = page.page.locator(plot)
        element.click(position=at(element, frame))
        assert abs(index(page) - frame) <= 1
        for each in (ERRORS, ANGLES):
            assert abs(cursor(page, each) - at(element, index(page))["x"]) < 1.5
    plays_to(page, 90)
    assert page.value("strokes") == 0


def hovering_shows_tip_errors(page: WatchedPage, study: MadeStudy) -> None:
    tip_error_mm = {
        (model, row["digit"], row["frame"]): row["error_mm"]
        for model in MODELS
        for row in study.rows(TIPS, model, task="opposition")
    }
    plot = page.page.locator(ERRORS)
    for frame in (4, 121, PEAK_FRAME + 1):
        plot.hover(position=at(plot, frame - 1))
        where = page.page.locator('[data-part="error-where"]').inner_text()
        assert where == f"Tip error [mm] at frame {frame}, {(frame - 1) / RATE_HZ:.3f} s"
        for m, model in enumerate(MODELS):
            cells = page.page.locator("[data-model]").nth(m).locator("td").all_inner_texts()
            for digit, words in zip(DIGITS, cells, strict=True):
                error_mm = tip_error_mm[model, digit, frame]
                packed_mm = round((error_mm or 0.0) / ERROR_STEP_MM) * ERROR_STEP_MM
                assert words == ("–" if error_mm is None else f"{packed_mm:.2f}"), (model, digit, frame)
    assert index(page) == 0
    page.page.mouse.move(1, 1)
    assert "at frame 1," in page.page.locator('[data-part="error-where"]').inner_text()


def hovering_shows_joint_angles(page: WatchedPage, study: MadeStudy) -> None:
    plot = page.page.locator(ANGLES)
    for choice, model in enumerate(MODELS[1:]):
        page.page.locator('[data-part="angle-model"]').select_option(value=str(choice))
        page.page.locator('[data-part="joint"]').select_option(label="index_mcp")
        for frame in (78, 131):
            (row,) = study.rows(JOINT_ANGLES, model, task="opposition", joint="index_mcp", frame=frame)
            plot.hover(position=at(plot, frame - 1))
            words = page.page.locator('[data-part="angle-where"]').inner_text()
            assert re.findall(r"(?:flexion|abduction|rotation) (\S+?)°?(?:,|$)", words) == [
                "–" if row[name] is None else f"{row[name]:.1f}".replace("-", "−") for name in ANGLE_COLUMNS
            ]


def test_gaps_stay_empty_and_a_peak_is_drawn(watched_page: WatchedPage, path: Path) -> None:
    """The fitted hands have no index finger errors in UNSEEN. On a plot of 50 pixels, six frames per column,
    the peak is neither its column's first frame nor its last.
    """
    page = watched_page
    show(page, path)
    boxes = page.page.locator("[data-model] input").all()
    for model, box in enumerate(boxes):
        box.set_checked(model == 1)
    page.value(SETTLED)
    second_strip = 20 + 82
    pixels = page.value(COLOURED, [ERRORS, "--model1", 0, second_strip, 1000, 62])

    def inked(first: int, last: int) -> int:
        left, right = (at(page.page.locator(ERRORS), frame)["x"] for frame in (first, last))
        return sum(left < x < right for x, _ in pixels)

    assert inked(UNSEEN.start + 2, UNSEEN.stop - 3) == 0
    assert inked(60, 97) > 30
    assert inked(163, 190) > 30
    boxes[2].set_checked(True)
    log = page.page.get_by_label("Logarithmic")
    assert log.is_checked(), "the peak dwarfs the other digits"
    log.uncheck()
    page.page.locator(ERRORS).evaluate("(plot) => (plot.style.width = '104px')")
    page.value(SETTLED)
    page.value(SETTLED)
    pixels = page.value(COLOURED, [ERRORS, "--model2", 0, 20, 104, 20])
    assert pixels
    assert all(abs(x - (LEFT + PEAK_FRAME / 299 * 50)) < 3 for x, _ in pixels)
    (warning,) = page.console
    assert "willReadFrequently" in warning, "caused by this test, which reads pixels twice"
    page.console.clear()


def test_without_webgl_the_plots_play_below_a_still_picture(browser: Browser, path: Path) -> None:
    del browser  # the fixture ends the driver
    with chromium("--disable-gpu", "--disable-3d-apis") as blind, watched(blind) as page:
        show(page, path)
        page.wait("document.body.innerText.includes('The hand cannot be shown in motion')")
        still_hand(page)
        assert page.page.locator(".viewer-stage").is_hidden()
        plays_to(page, 30)


def still_hand(page: WatchedPage) -> None:
    """Check that the still picture is shown instead of the moving hand."""
    assert page.page.locator(".viewer-still > svg").is_visible()
    assert "whole-hand-b, frame" in page.page.locator(".viewer-still p").inner_text()


def test_without_scripts_the_page_states_what_is_needed(browser: Browser, path: Path) -> None:
    with watched(browser, java_script_enabled=False) as page:
        page.open(path)
        still_hand(page)
        assert "needs a browser with JavaScript" in page.page.locator(".viewer-lacking").inner_text()
        assert not page.page.locator("form").first.is_visible()
        assert page.page.locator(".plots-still-note").is_visible()
        assert page.page.locator(ERRORS).is_hidden()
        assert page.page.locator("#angles").is_hidden()
