"""The moving hand in a real browser: drawing, playback speed, controls, views and fallback."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import WatchedPage, watched
from playwright.sync_api import Browser
from report_samples.made_study import UNSEEN, MadeStudy
from report_samples.pages import page_of_viewer

from shukotsu.report.hand_motion import HandMotion

pytestmark = pytest.mark.slow

VIEWER = "document.querySelector('[data-hand-viewer]').viewer"
# Draw and count pixels at once: the drawing buffer is cleared after the browser has shown it.
PIXELS = """(v) => {
  const gl = v.painter.gl, bytes = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  v.calm = false;
  v.draw();
  gl.readPixels(0, 0, gl.canvas.width, gl.canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  let inked = 0, sum = 0;
  for (let i = 0; i < bytes.length; i += 4) {
    if (!bytes[i + 3]) continue;
    inked++;
    sum = (sum * 31 + bytes[i] + 3 * bytes[i + 1] + 7 * bytes[i + 2] + i) % 4294967291;
  }
  return {inked, sum, error: gl.getError()};
}"""
# Record the time that the browser passes to each drawing; the page's own clock may lag behind it.
CLOCK = """
  const request = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => request((now) => { window.drawnAt = now; draw(now); });
"""
HEARING = """(v) => {
  window.heard = [];
  document.addEventListener("viewermoved", () => heard.push([drawnAt / 1000, v.times[v.index]]));
}"""


def write(path: Path, motion: HandMotion) -> Path:
    path.write_text(page_of_viewer("Subject 01, right hand, opposition", motion), "utf-8")
    return path


@pytest.fixture(scope="module")
def shown(study: MadeStudy) -> HandMotion:
    """The motion of a right hand under three models, the last one fitted."""
    return study.motion("right", "paper-fig4", "paper-fig3", "whole-hand")


@pytest.fixture(scope="module")
def file(shown: HandMotion, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("page") / "hand.html", shown)


def opened(page: WatchedPage, file: Path) -> WatchedPage:
    page.open(file)
    page.wait(f"!!{VIEWER}")
    return page


def seen(page: WatchedPage) -> dict[str, Any]:
    picture: dict[str, Any] = page.value(f"({PIXELS})({VIEWER})")
    assert picture["error"] == 0
    return picture


def test_it_draws_seeks_and_obeys_keys(watched_page: WatchedPage, file: Path, shown: HandMotion) -> None:
    watched_page.page.add_init_script(CLOCK)
    page = opened(watched_page, file)
    draws_every_point_at_its_recorded_position(page, shown)
    seeking_moves_the_hand_the_slider_and_the_text(page)
    keys_step_play_turn_and_zoom(page)
    for speed in ("1", "0.25"):
        plays_by_the_clock_at_the_speed_chosen(page, speed)


def draws_every_point_at_its_recorded_position(page: WatchedPage, shown: HandMotion) -> None:
    assert seen(page)["inked"] > 10_000
    assert not page.page.locator(".viewer-still").is_visible()
    assert page.page.locator("form").is_visible()
    assert [skeleton.on_receivers is None for skeleton in shown.skeletons] == [False, False, True]
    for s, skeleton in enumerate(shown.skeletons):
        for frame in (0, UNSEEN.start + 5, 299):
            places_mm = page.value(
                "([v, s, f]) => v.skeletons[s].points.map((_, i) => v.place(s, i, f).map((x) => x || null))",
                [page.page.evaluate_handle(VIEWER), s, frame],
            )
            places = np.array(places_mm, float)
            expected = skeleton.position_mm[frame]
            np.testing.assert_array_equal(np.isnan(places[:, 0]), np.isnan(expected[:, 0]))
            np.testing.assert_allclose(places, expected, atol=0.06)


def plays_by_the_clock_at_the_speed_chosen(page: WatchedPage, speed: str) -> None:
    page.page.locator("[data-part=speed]").select_option(speed)
    page.value(f"{VIEWER}.goTo(0)")  # else `play` would jump there from the last frame, untimed
    page.value(f"({HEARING})({VIEWER})")
    page.value(f"{VIEWER}.play()")
    page.wait("heard.length > 3 && heard.at(-1)[0] - heard[0][0] > .25")
    page.value(f"{VIEWER}.pause()")
    clock_s, time_s = np.array(page.value("heard")).T
    wrapped = np.flatnonzero(np.diff(time_s) < 0)
    end = wrapped[0] + 1 if len(wrapped) else None  # a slow machine may have played past the end
    passed, expected = time_s - time_s[0], (clock_s - clock_s[0]) * float(speed)
    np.testing.assert_allclose(passed[:end], expected[:end], atol=1.5 / 240)
    assert len(passed[:end]) > 1


def seeking_moves_the_hand_the_slider_and_the_text(page: WatchedPage) -> None:
    before = seen(page)
    moments = page.value(
        f"(() => {{ const heard = [], v = {VIEWER};"
        " const hear = () => heard.push([v.frames[v.index], v.times[v.index]]);"
        " document.addEventListener('viewermoved', hear); v.goTo(200); v.goTo(200); return heard; })()"
    )
    assert moments == [[201, pytest.approx(200 / 240, abs=1e-4)]]
    assert seen(page)["sum"] != before["sum"]
    slider = page.page.get_by_label("Frame", exact=True)
    page.wait(f"{VIEWER}.part.slider.value === '200'")
    assert page.page.locator("[data-part=where]").text_content() == "frame 201, 0.833 s"
    assert slider.get_attribute("aria-valuetext") == "frame 201, 0.833 s"
    slider.fill("100")
    for name, index in (("+1, one frame forward", 101), ("−1, one frame back", 100)):
        page.page.get_by_role("button", name=name).click()
        assert page.value(f"{VIEWER}.index") == index


def keys_step_play_turn_and_zoom(page: WatchedPage) -> None:
    page.value(f"{VIEWER}.goTo(0)")
    page.page.locator("canvas").focus()
    press = page.page.keyboard.press
    for key in (".", ".", ","):
        press(key)
    assert page.value(f"{VIEWER}.index") == 1
    press("Space")
    assert page.value(f"{VIEWER}.playing") is True
    press("Space")
    assert page.value(f"{VIEWER}.playing") is False
    turned, near = page.value(f"{VIEWER}.turn"), page.value(f"{VIEWER}.distance()")
    press("ArrowLeft")
    press("+")
    assert page.value(f"{VIEWER}.turn") != turned
    assert page.value(f"{VIEWER}.distance()") < near
    press("Shift+ArrowUp")
    assert page.value(f"{VIEWER}.pan[1]") < 0
    press("0")
    assert page.value(f"{VIEWER}.turn") == turned
    assert page.value(f"{VIEWER}.distance()") == near
    assert page.value(f"getComputedStyle({VIEWER}.canvas).outlineStyle") == "solid"
    for key, is_taken in (("ArrowDown", True), (" ", True), ("Tab", False), ("a", False)):
        event = f"new KeyboardEvent('keydown', {{key: '{key}', bubbles: true, cancelable: true}})"
        assert page.value(f"!{VIEWER}.canvas.dispatchEvent({event})") is is_taken, "else the page scrolls"


@pytest.mark.parametrize(("hand", "thumb_is"), [("right", "left"), ("left", "right")])
def test_no_hand_is_mirrored_and_views_show_the_named_side(
    watched_page: WatchedPage, study: MadeStudy, tmp_path: Path, hand: str, thumb_is: str
) -> None:
    motion = study.motion(hand, "whole-hand")
    page = opened(watched_page, write(tmp_path / "hand.html", motion))
    names = ("thumb_mcp", "index_mcp", "little_mcp", "wrist", "middle_pip")
    places = {}
    for look in ("back", "palm", "thumb", "tips"):
        page.page.locator(f"[data-look={look}]").click()
        turn = np.reshape(page.value(f"{VIEWER}.turn"), (3, 3))
        for name in names:
            point = f"{VIEWER}.place(0, {motion.skeletons[0].points.index(name)})"
            places[look, name] = turn @ page.value(f"{VIEWER}.seen({point}, {VIEWER}.baseAt(0))")
        receiver = turn @ page.value(f"{VIEWER}.seen({VIEWER}.vector('receivers', 0), {VIEWER}.baseAt(0))")
        if look in ("back", "palm"):
            assert (receiver[2] > places[look, "wrist"][2]) == (look == "back")
            assert (places[look, "index_mcp"][0] < places[look, "little_mcp"][0]) == (
                (thumb_is == "left") == (look == "back")
            )
        if look == "tips":
            assert (turn @ [0, 0, 1])[1] == pytest.approx(1), "the back of the hand is up"
    for look, name in (("thumb", "thumb_mcp"), ("tips", "middle_pip")):
        assert max(names, key=lambda n: places[look, n][2]) == name
    names_are_at_their_fingertips(page, hand)


def names_are_at_their_fingertips(page: WatchedPage, hand: str) -> None:
    page.page.locator("[data-look=back]").click()
    labels = page.page.locator(".viewer-labels span")
    page.wait(f"{VIEWER}.calm")
    places = [box["x"] for label in labels.all() if (box := label.bounding_box())]
    assert labels.all_text_contents() == ["thumb", "index", "middle", "ring", "little"]
    assert (places[1] < places[4]) == (hand == "right"), "bent neighbours may cross, index and little do not"
    page.page.locator("[data-part=names]").uncheck()
    page.wait(f"[...{VIEWER}.part.labels.children].every((label) => label.hidden)")


def test_a_browser_that_cannot_unpack_the_motion_shows_a_still_picture(browser: Browser, file: Path) -> None:
    with watched(browser) as page:
        page.page.add_init_script("delete window.DecompressionStream")
        page.open(file)
        page.wait("document.body.innerText.includes('The hand cannot be shown in motion')")
        assert page.page.locator(".viewer-still > svg").is_visible()
        assert not page.page.locator("form").is_visible()
        assert "whole-hand, frame" in page.page.locator(".viewer-still p").inner_text()
        assert "needs a browser with JavaScript" not in page.page.locator(".viewer-lacking").inner_text()
