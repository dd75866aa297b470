"""The moving hand in a real browser: it draws, plays by the clock, obeys, and asks for nothing."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stages.report.viewer.page import page_of_viewer

pytestmark = pytest.mark.slow

VIEWER = "document.querySelector('[data-hand-viewer]').viewer"
# Draw now and count what is seen; the picture itself is gone once the browser has shown it.
PIXELS = """(v) => {
  const gl = v.painter.gl, bytes = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  v.calm = false;
  v.draw();
  gl.readPixels(0, 0, gl.canvas.width, gl.canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const columns = new Array(gl.canvas.width).fill(0);
  let inked = 0, sum = 0;
  for (let i = 0; i < bytes.length; i += 4) {
    if (!bytes[i + 3]) continue;
    inked++;
    columns[i / 4 % gl.canvas.width]++;
    sum = (sum * 31 + bytes[i] + 3 * bytes[i + 1] + 7 * bytes[i + 2] + i) % 4294967291;
  }
  return {inked, sum, columns, error: gl.getError()};
}"""
PLAYED = """(v) => new Promise((done) => {
  const start = performance.now(), drawn = v.drawn, time = v.times[v.index];
  let told = 0;
  const end = v.onframe(() => told++);
  v.play();
  setTimeout(() => {
    v.pause();
    end();
    const seconds = (performance.now() - start) / 1000;
    done({seconds, told, drawn: v.drawn - drawn, passed: v.times[v.index] - time});
  }, 2000);
})"""


@pytest.fixture(scope="module")
def page(long_hand: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with two skeletons of a recording as long as the paper's."""
    path = tmp_path_factory.mktemp("page") / "hand.html"
    motion = long_hand.motion("paper-fig4", "whole-hand")
    path.write_text(page_of_viewer("Subject 01, right hand, opposition", motion), "utf-8")
    return path


@pytest.fixture
def opened(browser: Any, page: Path) -> Iterator[Any]:
    """The page in the browser; whatever a test does, the browser must have nothing to complain about."""
    browser.console.clear()
    browser.requests.clear()
    browser.window(1280, 800)
    browser.open(page)
    yield browser
    assert browser.console == []
    assert set(browser.requests) == {page.as_uri()}


def part(name: str) -> str:
    return f"document.querySelector('[data-part=\"{name}\"]')"


def choose(browser: Any, name: str, value: str | bool) -> None:
    """Set a control as its user would, the page being told."""
    key = "checked" if isinstance(value, bool) else "value"
    browser.value(f"{part(name)}.{key} = {json.dumps(value)}")
    browser.value(f"{part(name)}.dispatchEvent(new Event('change', {{bubbles: true}}))")


def seen(browser: Any) -> dict[str, Any]:
    found: dict[str, Any] = browser.value(f"({PIXELS})({VIEWER})")
    assert found["error"] == 0
    return found


def play(browser: Any) -> dict[str, Any]:
    """Play for two seconds; what then was drawn, told and passed."""
    played: dict[str, Any] = browser.value(f"({PLAYED})({VIEWER})")
    return played


def test_a_hand_is_drawn_and_the_still_picture_gives_way(opened: Any) -> None:
    assert seen(opened)["inked"] > 10_000
    assert opened.value("getComputedStyle(document.querySelector('.viewer-still')).display") == "none"


def test_the_browser_reads_the_numbers_that_were_packed(opened: Any, long_hand: Any) -> None:
    skeletons = long_hand.motion("paper-fig4", "whole-hand").skeletons
    for index, skeleton in enumerate(skeletons):
        for frame, point in (
            (0, 0),
            (55, skeleton.points.index("index tip")),
            (3773, len(skeleton.points) - 1),
        ):
            found = opened.value(f"{VIEWER}.vector('points{index}', {point}, {frame}).map((x) => x || 0)")
            expected = np.nan_to_num(skeleton.position_mm[frame, point])
            np.testing.assert_allclose(found, expected, atol=0.026)
    assert opened.value(f"isNaN({VIEWER}.vector('points0', 0, 55)[0])") is False
    tip = skeletons[0].points.index("index tip")
    assert opened.value(f"isNaN({VIEWER}.vector('points0', {tip}, 55)[0])") is True


def test_it_does_not_play_by_itself(opened: Any) -> None:
    opened.value("new Promise((done) => setTimeout(done, 500))")
    assert opened.value(f"{VIEWER}.index") == 0


def test_two_seconds_of_playing_are_two_seconds_of_the_recording(opened: Any) -> None:
    played = play(opened)
    assert played["passed"] == pytest.approx(played["seconds"], abs=0.35)
    assert played["told"] > 5


def test_thirty_frames_a_second_without_a_graphics_processor(opened: Any) -> None:
    assert opened.value(f"{VIEWER}.painter.slow") is True
    rates = [played["drawn"] / played["seconds"] for played in (play(opened) for _ in range(4))]
    if max(rates) < 30 and os.getloadavg()[0] > (os.cpu_count() or 1):
        pytest.skip(f"{max(rates):.0f} frames a second, but others are using this machine")
    assert max(rates) >= 30


def test_half_speed_is_half_as_fast(opened: Any) -> None:
    choose(opened, "speed", "0.5")
    played = play(opened)
    assert played["passed"] == pytest.approx(played["seconds"] / 2, abs=0.35)


def test_a_loop_begins_again_and_without_it_the_hand_stops(opened: Any) -> None:
    opened.value(f"{VIEWER}.seek(3700)")
    play(opened)
    assert 0 < opened.value(f"{VIEWER}.index") < 3000
    choose(opened, "loop", False)
    opened.value(f"{VIEWER}.seek(3700)")
    play(opened)
    assert opened.value(f"{VIEWER}.index") == 3773
    assert opened.value(f"{part('play')}.textContent") == "Play"


def test_seeking_moves_the_hand_the_slider_and_the_words(opened: Any) -> None:
    before = seen(opened)
    told = opened.value(
        f"(() => {{ const heard = []; const end = {VIEWER}.onframe((now) => heard.push(now));"
        f" {VIEWER}.seek(1001); end(); {VIEWER}.seek(1500); {VIEWER}.seek(1001); return heard; }})()"
    )
    assert [(now["index"], now["frame"]) for now in told] == [(1000, 1001)]
    assert told[0]["time"] == pytest.approx(1000 / 240, abs=1e-4)
    assert seen(opened)["sum"] != before["sum"]
    opened.wait(f"{part('slider')}.value === '1000'", 5)
    assert opened.value(f"{part('where')}.textContent") == "frame 1001, 4.167 s"
    assert opened.value(f"{part('slider')}.getAttribute('aria-valuetext')") == "frame 1001, 4.167 s"


def test_keys_step_play_turn_and_enlarge(opened: Any) -> None:
    opened.value(f"{VIEWER}.canvas.focus({{preventScroll: true}})")
    opened.press(".", ".")
    opened.press(".", ".")
    opened.press(",", ",")
    assert opened.value(f"{VIEWER}.index") == 1
    opened.press(" ", " ")
    assert opened.value(f"{VIEWER}.playing") is True
    opened.press(" ", " ")
    assert opened.value(f"{VIEWER}.playing") is False
    turned, near = opened.value(f"{VIEWER}.turn"), opened.value(f"{VIEWER}.distance()")
    opened.press("ArrowLeft")
    opened.press("+", "+")
    assert opened.value(f"{VIEWER}.turn") != turned
    assert opened.value(f"{VIEWER}.distance()") < near
    opened.press("ArrowUp", modifiers=8)
    assert opened.value(f"{VIEWER}.pan[1]") < 0
    opened.press("0", "0")
    assert opened.value(f"{VIEWER}.turn") == turned
    outline = opened.value(f"getComputedStyle({VIEWER}.canvas).outlineStyle")
    assert outline == "solid"


@pytest.mark.parametrize(
    ("key", "is_taken"), [("ArrowDown", True), (" ", True), ("Tab", False), ("a", False)]
)
def test_the_page_does_not_scroll_for_keys_that_the_view_takes(opened: Any, key: str, is_taken: bool) -> None:
    event = f"new KeyboardEvent('keydown', {{key: '{key}', bubbles: true, cancelable: true}})"
    assert opened.value(f"!{VIEWER}.canvas.dispatchEvent({event})") is is_taken


@pytest.mark.parametrize("hand", ["right", "left"])
def test_looks_are_from_where_they_say(
    browser: Any, make_known: Callable[[str], Any], tmp_path: Path, hand: str
) -> None:
    known = make_known(hand)
    path = tmp_path / "hand.html"
    path.write_text(page_of_viewer(hand, known.motion("whole-hand")), "utf-8")
    browser.open(path)
    points = known.motion("whole-hand").skeletons[0].points
    nearest = {}
    for look in ("back", "palm", "thumb", "tips"):
        browser.value(f"document.querySelector('[data-look={look}]').click()")
        turn = np.reshape(browser.value(f"{VIEWER}.turn"), (3, 3))
        depth = {}
        for name in ("thumb_mcp", "little_mcp", "wrist", "middle_pip"):
            place = browser.value(f"{VIEWER}.seen('points0', {points.index(name)}, {VIEWER}.baseAt(0))")
            depth[name] = float((turn @ place)[2])
        receiver = browser.value(f"{VIEWER}.seen('receivers', 0, {VIEWER}.baseAt(0))")
        nearest[look] = max(depth, key=lambda name: depth[name])
        if look in ("back", "palm"):
            assert ((turn @ receiver)[2] > depth["wrist"]) == (look == "back")
        if look == "tips":
            assert (turn @ [0, 0, 1])[1] == pytest.approx(1), "the back of the hand is up"
    assert nearest["thumb"] == "thumb_mcp"
    assert nearest["tips"] == "middle_pip"


def test_dragging_turns_the_hand_and_with_two_fingers_it_grows(opened: Any) -> None:
    before, distance = seen(opened), opened.value(f"{VIEWER}.distance()")
    opened.drag((300, 300), (380, 320))
    assert seen(opened)["sum"] != before["sum"]
    assert opened.value(f"{VIEWER}.distance()") == distance
    for kind, places in (
        ("touchStart", [(300, 300), (340, 300)]),
        ("touchMove", [(280, 300), (360, 300)]),
        ("touchEnd", []),
    ):
        points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(places)]
        opened.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    assert opened.value(f"{VIEWER}.distance()") < 0.7 * distance


def test_colourings_differ_and_have_their_legends(opened: Any) -> None:
    sums, legends = set(), {}
    for colour in ("digit", "sd", "tip"):
        choose(opened, "colour", colour)
        sums.add(seen(opened)["sum"])
        legends[colour] = opened.value(
            "[...document.querySelectorAll('.viewer-of-mm, .viewer-of-weak')].map((e) => e.offsetWidth > 0)"
        )
    assert len(sums) == 3
    assert legends == {"digit": [True, False], "sd": [False, True], "tip": [False, True]}


def test_colours_follow_the_numbers_that_they_stand_for(opened: Any) -> None:
    numbers = {
        "sd": f"{VIEWER}.skeletons[0].sd.fill(20)",
        "tip": f"{VIEWER}.blocks.errors0.values.fill(0.1)",
    }
    for colour, change in numbers.items():
        choose(opened, "colour", colour)
        before = seen(opened)["sum"]
        opened.value(f"void {change}")
        assert seen(opened)["sum"] != before, colour
    choose(opened, "colour", "digit")
    before = seen(opened)["sum"]
    opened.value(f"void {VIEWER}.skeletons[0].sd.fill(0.1)")
    assert seen(opened)["sum"] == before


def test_receivers_and_axes_are_drawn_on_request(opened: Any) -> None:
    plain = seen(opened)["inked"]
    choose(opened, "receivers", True)
    with_receivers = seen(opened)["inked"]
    choose(opened, "axes", True)
    assert plain < with_receivers < seen(opened)["inked"]


def test_skeletons_stand_side_by_side_or_one_over_the_other(opened: Any) -> None:
    def sides() -> tuple[int, int, int]:
        columns = np.array(seen(opened)["columns"])
        left, middle, right = np.array_split(columns, 3)
        return int(left.sum()), int(middle.sum()), int(right.sum())

    left, _, right = sides()
    assert min(left, right) > 3000
    choose(opened, "shown", "over")
    left, middle, right = sides()
    assert middle > 6000
    assert left + right < 0.2 * middle


@pytest.mark.parametrize(("hand", "thumb_is"), [("right", "left"), ("left", "right")])
def test_the_thumb_is_on_its_side(
    browser: Any, make_known: Callable[[str], Any], tmp_path: Path, hand: str, thumb_is: str
) -> None:
    path = tmp_path / "hand.html"
    path.write_text(page_of_viewer(hand, make_known(hand).motion("whole-hand")), "utf-8")
    browser.window(1280, 800)
    browser.open(path)
    browser.wait(f"!{part('labels')}.children[0].hidden", 5)
    middle = [
        browser.value(f"(({part('labels')}.children[{i}]).getBoundingClientRect().x)") for i in range(5)
    ]
    ordered = sorted(middle[1:], reverse=hand == "left")
    assert middle[1:] == ordered, "index, middle, ring and little finger stand in a row"
    browser.value("document.querySelector('[data-look=palm]').click()")
    browser.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    turned = [browser.value(f"({part('labels')}.children[{i}]).getBoundingClientRect().x") for i in (1, 4)]
    assert (middle[1] < middle[4]) == (hand == "right") == (thumb_is == "left")
    assert (turned[0] < turned[1]) != (middle[1] < middle[4])


def test_without_following_the_hand_moves_through_the_view(opened: Any) -> None:
    opened.value(f"{VIEWER}.seek(400)")
    choose(opened, "follow", False)
    held = opened.value(f"{VIEWER}.still.origin")
    opened.value(f"{VIEWER}.seek(3000)")
    away = opened.value(f"{VIEWER}.seen('receivers', {VIEWER}.header.base, {VIEWER}.still)")
    assert opened.value(f"{VIEWER}.still.origin") == held
    assert max(abs(x) for x in away) > 1


@pytest.mark.parametrize("width", [360, 800, 1920])
@pytest.mark.parametrize("dark", [False, True])
def test_it_fits_every_window_in_the_light_and_in_the_dark(opened: Any, width: int, dark: bool) -> None:
    opened.window(width, 800, dark=dark)
    assert opened.value("document.documentElement.scrollWidth") <= width
    columns = np.array(seen(opened)["columns"])
    assert columns.sum() > 1000
    assert columns[[0, -1]].sum() == 0
    ground = opened.value("getComputedStyle(document.documentElement).backgroundColor")
    assert (sum(int(x) for x in ground[4:-1].split(",")) < 380) == dark


@pytest.mark.parametrize(
    "missing",
    ["HTMLCanvasElement.prototype.getContext = () => null", "delete window.DecompressionStream"],
)
def test_what_a_browser_lacks_leaves_the_still_picture(
    start_browser: Callable[[], Any], page: Path, missing: str
) -> None:
    browser = start_browser()
    browser.call("Page.addScriptToEvaluateOnNewDocument", source=missing)
    browser.call("Page.navigate", url=page.as_uri())
    browser.wait("document.body?.innerText.includes('The hand does not move here')")
    assert browser.value("document.querySelector('.viewer-still svg').getBoundingClientRect().height") > 100
    assert browser.value("document.querySelector('.viewer-live').hidden") is True
    assert browser.console == []
