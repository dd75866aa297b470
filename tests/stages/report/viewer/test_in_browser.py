"""The moving hand in a real browser: it draws, plays by the clock, obeys, and asks for nothing."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import WatchedPage, chromium, watched
from report_samples.small_page import page_of_viewer

pytestmark = pytest.mark.slow

MODELS = ("paper-fig4", "paper-fig3", "whole-hand")
FRAMES = 600
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
# The page's clock, which a browser sets once for all that it draws together, beside the recording's.
HEARING = """(v) => {
  window.heard = [];
  v.onframe(({index, time}) => heard.push([document.timeline.currentTime / 1000, time, index]));
}"""

# Pairs of words over the picture, of those shown, whose letters lie on each other.
ON_EACH_OTHER = """() => {
  const words = [...document.querySelectorAll(
    ".viewer-labels span:not([hidden]), .viewer-models span:not([hidden]), .viewer-scale")];
  const boxes = words.map((word) => {
    const range = document.createRange();
    range.selectNodeContents(word);
    return [word.textContent, range.getBoundingClientRect()];
  });
  return boxes.flatMap(([own, a], i) => boxes.slice(i + 1).filter(([, b]) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > .5
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > .5).map(([other]) => `${own}, ${other}`));
}"""


def write(path: Path, motion: Any, title: str = "Subject 01, right hand, opposition") -> Path:
    """Write the motion's page."""
    path.write_text(page_of_viewer(title, motion), "utf-8")
    return path


@pytest.fixture(scope="module")
def shown(make_known: Callable[[str, int], Any]) -> Any:
    """A motion of a right hand under three models, the last of them fitted."""
    return make_known("right", FRAMES).motion(*MODELS)


@pytest.fixture(scope="module")
def file(shown: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its page."""
    return write(tmp_path_factory.mktemp("page") / "hand.html", shown)


@pytest.fixture
def page(watched_page: WatchedPage, file: Path) -> WatchedPage:
    """The page in the browser, its hand able to move."""
    return opened(watched_page, file)


def opened(page: WatchedPage, file: Path) -> WatchedPage:
    page.open(file)
    page.wait(f"!!{VIEWER}")
    return page


def part(name: str) -> str:
    return f"{VIEWER}.part.{name}"


def choose(page: WatchedPage, name: str, value: str | bool) -> None:
    """Set a control as its user would."""
    control = page.page.locator(f"[data-part={name}]")
    if isinstance(value, bool):
        control.set_checked(value)
    else:
        control.select_option(value)


def seen(page: WatchedPage) -> dict[str, Any]:
    """What the picture now holds."""
    found: dict[str, Any] = page.value(f"({PIXELS})({VIEWER})")
    assert found["error"] == 0
    return found


def thirds(page: WatchedPage) -> tuple[int, int, int]:
    """Pixels drawn in the left, middle and right third of the picture."""
    left, middle, right = (int(part.sum()) for part in np.array_split(seen(page)["columns"], 3))
    return left, middle, right


def played(page: WatchedPage, from_index: int = 0) -> np.ndarray:
    """Play for a quarter of a second or more; of each frame the page's clock, the recording's, the index."""
    page.value(f"({HEARING})({VIEWER})")
    page.value(f"{VIEWER}.goTo({from_index})")
    page.value("void heard.splice(0)")
    page.value(f"{VIEWER}.play()")
    page.wait("heard.length > 3 && heard.at(-1)[0] - heard[0][0] > .25")
    page.value(f"{VIEWER}.pause()")
    return np.array(page.value("heard"))


def test_the_browser_draws_every_point_where_the_recording_has_it(page: WatchedPage, shown: Any) -> None:
    assert seen(page)["inked"] > 10_000
    assert not page.page.locator(".viewer-still").is_visible()
    assert page.page.locator("form").is_visible()
    assert [skeleton.seats is None for skeleton in shown.skeletons] == [False, False, True]
    for s, skeleton in enumerate(shown.skeletons):
        for frame in (0, 55, FRAMES - 1):
            found = page.value(
                "([v, s, f]) => v.skeletons[s].points.map((_, i) => v.place(s, i, f).map((x) => x || null))",
                [page.page.evaluate_handle(VIEWER), s, frame],
            )
            places = np.array(found, float)
            expected = skeleton.position_mm[frame]
            np.testing.assert_array_equal(np.isnan(places[:, 0]), np.isnan(expected[:, 0]))
            np.testing.assert_allclose(places, expected, atol=0.06)


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_nothing_moves_by_itself(browser: Any, file: Path, motion: str) -> None:
    with watched(browser, reduced_motion=motion) as page:
        opened(page, file)
        page.wait(f"{VIEWER}.calm && {VIEWER}.asleep")
        assert page.value(f"[{VIEWER}.index, {VIEWER}.playing]") == [0, False]


@pytest.mark.parametrize(("speed", "factor"), [("1", 1.0), ("0.25", 0.25), ("2", 2.0)])
def test_it_plays_by_the_clock_at_the_speed_chosen(page: WatchedPage, speed: str, factor: float) -> None:
    choose(page, "speed", speed)
    clock_s, time_s, _ = played(page).T
    passed = time_s - time_s[0]
    expected = (clock_s - clock_s[0]) * factor
    wrapped = np.flatnonzero(np.diff(time_s) < 0)
    end = wrapped[0] + 1 if len(wrapped) else None  # where a slow machine came round to the start
    np.testing.assert_allclose(passed[:end], expected[:end], atol=1.5 / 240)
    assert len(passed[:end]) > 1


def test_a_loop_begins_again_and_without_it_the_hand_stops(page: WatchedPage) -> None:
    index = played(page, FRAMES - 10)[:, 2]
    assert index.min() < FRAMES - 10
    choose(page, "loop", False)
    page.value(f"{VIEWER}.goTo({FRAMES - 10})")
    page.page.get_by_role("button", name="Play").click()
    page.wait(f"!{VIEWER}.playing")
    assert page.value(f"{VIEWER}.index") == FRAMES - 1
    assert page.page.locator("[data-part=play]").text_content() == "Play"


def test_seeking_moves_the_hand_the_slider_and_the_words(page: WatchedPage) -> None:
    before = seen(page)
    told = page.value(
        f"(() => {{ const heard = []; const end = {VIEWER}.onframe((now) => heard.push(now));"
        f" {VIEWER}.seek(401); end(); {VIEWER}.seek(500); {VIEWER}.seek(401); return heard; }})()"
    )
    assert [(now["index"], now["frame"]) for now in told] == [(400, 401)]
    assert told[0]["time"] == pytest.approx(400 / 240, abs=1e-4)
    assert seen(page)["sum"] != before["sum"]
    page.wait(f"{part('slider')}.value === '400'")
    assert page.page.locator("[data-part=where]").text_content() == "frame 401, 1.667 s"
    assert page.page.get_by_label("Frame", exact=True).get_attribute("aria-valuetext") == "frame 401, 1.667 s"
    page.page.locator("[data-part=slider]").fill("300")
    assert page.value(f"{VIEWER}.index") == 300
    for name, index in (("+1, one frame on", 301), ("+1, one frame on", 302), ("−1, one frame back", 301)):
        page.page.get_by_role("button", name=name).click()
        assert page.value(f"{VIEWER}.index") == index


def test_keys_step_play_turn_and_enlarge(page: WatchedPage) -> None:
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


def test_every_control_is_reached_by_the_keyboard(page: WatchedPage) -> None:
    count = page.value("document.querySelectorAll('canvas, button, select, input').length")
    page.page.locator("canvas").focus()
    reached = set()
    for _ in range(count):
        reached.add(page.value("document.activeElement.dataset.part ?? document.activeElement.dataset.look"))
        page.page.keyboard.press("Tab")
    disabled = page.value("[...document.querySelectorAll(':disabled')].map((e) => e.dataset.part)")
    assert len(reached - {None}) == count - len(disabled)
    assert {"canvas", "slider", "first", "second", "over", "receivers", "axes", "planes", "tips"} <= reached


@pytest.mark.parametrize(("hand", "thumb_is"), [("right", "left"), ("left", "right")])
def test_no_hand_is_mirrored_and_looks_are_from_where_they_say(
    watched_page: WatchedPage, make_known: Callable[[str, int], Any], tmp_path: Path, hand: str, thumb_is: str
) -> None:
    motion = make_known(hand, 60).motion("whole-hand")
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
    names_stand_at_their_fingertips(page, hand)


def names_stand_at_their_fingertips(page: WatchedPage, hand: str) -> None:
    page.page.locator("[data-look=back]").click()
    labels = page.page.locator(".viewer-labels span")
    page.wait(f"{VIEWER}.calm")
    places = [box["x"] for label in labels.all() if (box := label.bounding_box())]
    assert labels.all_text_contents() == ["thumb", "index", "middle", "ring", "little"]
    assert (places[1] < places[4]) == (hand == "right"), "bent neighbours may cross, index and little do not"
    choose(page, "names", False)
    page.wait(f"[...{part('labels')}.children].every((label) => label.hidden)")


def test_dragging_turns_the_hand_with_shift_it_moves_and_with_two_fingers_it_grows(page: WatchedPage) -> None:
    before, distance = seen(page), page.value(f"{VIEWER}.distance()")
    mouse = page.page.mouse

    def drag() -> None:
        mouse.move(300, 300)
        mouse.down()
        mouse.move(380, 320)
        mouse.up()

    drag()
    turned = page.value(f"{VIEWER}.turn")
    assert seen(page)["sum"] != before["sum"]
    assert turned != [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert page.value(f"{VIEWER}.pan") == [0, 0]
    page.page.keyboard.down("Shift")
    drag()
    page.page.keyboard.up("Shift")
    assert page.value(f"{VIEWER}.turn") == turned
    right, up = page.value(f"{VIEWER}.pan")
    assert right < 0 < up, "the picture follows the pointer"
    assert page.value(f"{VIEWER}.distance()") == distance
    session = page.page.context.new_cdp_session(page.page)
    for kind, places in (
        ("touchStart", [(300, 300), (340, 300)]),
        ("touchMove", [(280, 300), (360, 300)]),
        ("touchEnd", []),
    ):
        points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(places)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    assert page.value(f"{VIEWER}.distance()") < 0.7 * distance


def test_the_wheel_enlarges_only_once_the_picture_was_clicked(page: WatchedPage) -> None:
    distance = page.value(f"{VIEWER}.distance()")
    page.value("window.scrolls = 0, addEventListener('wheel', () => scrolls++)")
    page.page.set_viewport_size({"width": 1280, "height": 500})
    distance = page.value(f"{VIEWER}.distance()")
    page.page.mouse.move(300, 200)
    page.page.mouse.wheel(0, 120)
    page.wait("scrolls === 1")
    assert page.value(f"{VIEWER}.distance()") == distance
    page.page.locator("canvas").click()
    page.page.mouse.wheel(0, -120)
    page.wait(f"{VIEWER}.distance() < {distance}")


def test_colourings_differ_and_have_their_legends(page: WatchedPage) -> None:
    sums, legends = set(), {}
    for colour in ("digit", "sd", "tip"):
        choose(page, "colour", colour)
        sums.add(seen(page)["sum"])
        legends[colour] = [page.page.locator(f".viewer-of-{name}").is_visible() for name in ("mm", "belief")]
    assert len(sums) == 3
    assert legends == {"digit": [False, True], "sd": [True, False], "tip": [True, False]}
    assert (
        "radius of a fingertip’s ball: 3 mm and the error" in page.page.locator(".viewer-of-mm").inner_text()
    )


@pytest.mark.parametrize(
    ("colour", "change"),
    [
        ("sd", "for (const {{sd}} of v.skeletons) sd.fill({mm})"),
        ("tip", "for (const s of [0, 2]) v.blocks[`errors${{s}}`].values.fill({mm})"),
    ],
    ids=["sd", "tip"],
)
def test_balls_grow_and_change_colour_with_the_numbers_that_they_stand_for(
    page: WatchedPage, colour: str, change: str
) -> None:
    def drawn(mm: float) -> dict[str, Any]:
        page.value(f"((v) => {{ {change.format(mm=mm)} }})({VIEWER})")
        return seen(page)

    choose(page, "colour", colour)
    small, large, same = drawn(4.5), drawn(7.5), drawn(7.5)
    assert large["inked"] > small["inked"] + 200
    assert same["sum"] == large["sum"]
    assert drawn(3.5)["sum"] != small["sum"]
    choose(page, "colour", "digit")
    assert drawn(4.5)["sum"] == drawn(7.5)["sum"]


def test_receivers_axes_and_planes_are_drawn_each_on_its_own_request(page: WatchedPage) -> None:
    plain = seen(page)
    sums = {plain["sum"]}
    for name in ("receivers", "axes", "planes"):
        choose(page, name, True)
        alone = seen(page)
        assert alone["inked"] > plain["inked"] + 100, name
        sums.add(alone["sum"])
        choose(page, name, False)
        assert seen(page)["sum"] == plain["sum"], name
    assert len(sums) == 4
    choose(page, "second", "")
    assert page.page.get_by_label("Sagittal planes").is_disabled(), "a fitted hand cuts no axes"
    choose(page, "first", "0")
    assert page.page.get_by_label("Sagittal planes").is_enabled()


def test_skeletons_stand_side_by_side_or_one_over_the_other_or_alone(page: WatchedPage) -> None:
    left, _, right = thirds(page)
    assert min(left, right) > 3000
    choose(page, "over", True)
    left, middle, right = thirds(page)
    assert middle > 6000
    assert left + right < 0.2 * middle
    both = seen(page)
    assert page.page.locator(".viewer-of-models").inner_text().split() == ["whole-hand", "paper-fig4"]
    second = f"{VIEWER}.skeletons[{VIEWER}.shown[1]].place"
    page.value(f"void ({VIEWER}.colours.model[{second}] = [0, 0, 0])")
    assert seen(page)["sum"] != both["sum"], "each has its colour"
    choose(page, "second", "")
    alone = seen(page)
    assert 6000 < alone["inked"] < both["inked"]
    assert page.page.get_by_label("One over the other").is_disabled()


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("names", [(), ("母指", "示指", "中指", "環指", "小指")], ids=["english", "japanese"])
def test_no_words_lie_on_each_other(
    page: WatchedPage, file: Path, names: tuple[str, ...], width: int, tmp_path: Path
) -> None:
    """A letter of Japanese is as wide as it is high; here it is made so, whatever the machine's fonts."""
    style = "<style>.viewer-labels span { width: 2em; text-align-last: justify; }</style>" if names else ""
    text = file.read_text("utf-8")
    for english, own in zip(("thumb", "index", "middle", "ring", "little"), names, strict=False):
        text = text.replace(f"<span hidden>{english}</span>", f"<span hidden>{own}</span>")
    (tmp_path / "hand.html").write_text(text.replace("</head>", f"{style}</head>"), "utf-8")
    page.page.set_viewport_size({"width": width, "height": 800})
    opened(page, tmp_path / "hand.html")
    found: set[str] = set()
    for index in range(0, FRAMES, 20):
        page.value(f"{VIEWER}.goTo({index}), {VIEWER}.draw()")
        found |= set(page.value(ON_EACH_OTHER))
    assert found == set()


def test_any_two_models_can_be_chosen_and_who_asks_is_told(page: WatchedPage) -> None:
    page.value("window.told = 0, addEventListener('viewershown', () => told++)")

    def now() -> tuple[list[int], list[list[int]], list[str], int]:
        names = [name for name in page.page.locator(".viewer-models span").all() if name.is_visible()]
        heads = [name.text_content() for name in names]
        return page.value(f"{VIEWER}.shown"), page.value(f"{VIEWER}.pictures()"), heads, page.value("told")

    assert now() == ([2, 0], [[2], [0]], ["whole-hand", "paper-fig4"], 0)
    sums = {seen(page)["sum"]}
    choose(page, "second", "1")
    assert now() == ([2, 1], [[2], [1]], ["whole-hand", "paper-fig3"], 1)
    sums.add(seen(page)["sum"])
    choose(page, "over", True)
    assert now() == ([2, 1], [[2, 1]], ["whole-hand", "paper-fig3"], 1)
    choose(page, "first", "1")
    assert now() == ([1, 2], [[1, 2]], ["paper-fig3", "whole-hand"], 2), "the two change places"
    choose(page, "over", False)
    choose(page, "first", "0")
    assert now() == ([0, 2], [[0], [2]], ["paper-fig4", "whole-hand"], 3)
    sums.add(seen(page)["sum"])
    choose(page, "second", "")
    assert now() == ([0], [[0]], ["paper-fig4"], 4)
    sums.add(seen(page)["sum"])
    assert len(sums) == 4
    options = page.page.locator("[data-part=second] option")
    assert [option.is_disabled() for option in options.all()] == [False, True, False, False]


def test_numbers_and_words_are_of_the_models_that_are_shown(page: WatchedPage, shown: Any) -> None:
    def text(first: str, second: str) -> str:
        choose(page, "first", first)
        choose(page, "second", second)
        return str(page.page.locator("[data-part=error1]").text_content())

    fitted, replayed = shown.skeletons[2].tip_error_mm[0, 1], shown.skeletons[0].tip_error_mm[0, 1]
    assert text("2", "0") == f"{fitted:.1f} | {replayed:.1f}"
    assert text("0", "") == f"{replayed:.1f}"


def test_without_following_the_hand_moves_through_the_view(page: WatchedPage) -> None:
    page.value(f"{VIEWER}.seek(100)")
    choose(page, "follow", False)
    held = page.value(f"{VIEWER}.still.origin")
    page.value(f"{VIEWER}.seek(500)")
    base = f"{VIEWER}.vector('receivers', {VIEWER}.header.base)"
    away = page.value(f"{VIEWER}.seen({base}, {VIEWER}.still)")
    assert page.value(f"{VIEWER}.still.origin") == held
    assert max(abs(x) for x in away) > 1


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (800, "dark"), (1920, "light")])
def test_it_fits_every_window_in_the_light_and_in_the_dark(
    page: WatchedPage, width: int, scheme: str
) -> None:
    page.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    page.page.set_viewport_size({"width": width, "height": 800})
    assert page.value("document.documentElement.scrollWidth") <= width
    columns = np.array(seen(page)["columns"])
    assert columns.sum() > 1000
    assert columns[[0, -1]].sum() == 0
    ground = page.value("getComputedStyle(document.documentElement).backgroundColor")
    assert (sum(int(x) for x in re.findall(r"\d+", ground)) < 380) == (scheme == "dark")
    before = page.value(f"{VIEWER}.colours.digit[4][0]")
    page.page.emulate_media(color_scheme="light" if scheme == "dark" else "dark")
    page.wait(f"{VIEWER}.colours.digit[4][0] !== {before}")


def test_two_viewers_on_a_page_go_their_own_ways(
    watched_page: WatchedPage, shown: Any, tmp_path: Path
) -> None:
    one, other = (page_of_viewer(name, shown) for name in ("one", "other"))
    section = re.search(r"<section.*?</section>", other, re.DOTALL)
    assert section is not None
    path = tmp_path / "two.html"
    path.write_text(one.replace("</section>", "</section>" + section[0]), "utf-8")
    watched_page.open(path)
    roots = "[...document.querySelectorAll('[data-hand-viewer]')]"
    watched_page.wait(f"{roots}.length === 2 && {roots}.every((root) => root.viewer)")
    second = watched_page.page.locator("[data-hand-viewer]").nth(1)
    second.get_by_label("Skeleton").select_option("0")
    watched_page.value(f"{roots}[1].viewer.seek(300)")
    assert watched_page.value(f"{roots}.map((root) => root.viewer.index)") == [0, 299]
    assert watched_page.value(f"{roots}.map((root) => root.viewer.shown)") == [[2, 0], [0, 2]]


def test_hostile_names_are_text(watched_page: WatchedPage, shown: Any, tmp_path: Path) -> None:
    evil = '</script></title><img src=x onerror="document.body.remove()">\'{{7*7}}&amp;'
    skeletons = tuple(replace(skeleton, model=evil + skeleton.model) for skeleton in shown.skeletons)
    path = write(tmp_path / "hand.html", replace(shown, skeletons=skeletons), evil)
    page = opened(watched_page, path)
    assert page.page.title() == evil
    assert page.page.locator("h1").text_content() == evil
    assert page.page.locator("[data-part=name1]").text_content() == f"{evil}paper-fig4"
    assert page.page.locator("img").count() == 0


def test_a_lost_picture_comes_back(page: WatchedPage) -> None:
    before = seen(page)
    page.value(f"window.lost = {VIEWER}.painter.gl.getExtension('WEBGL_lose_context'); lost.loseContext()")
    page.wait(f"{VIEWER}.painter.gl.isContextLost()")
    page.value(f"{VIEWER}.seek(200)")
    page.wait(f"{VIEWER}.calm")
    page.value(f"window.drawn = {VIEWER}.drawn; lost.restoreContext()")
    page.wait(f"!{VIEWER}.painter.gl.isContextLost() && {VIEWER}.drawn > drawn")
    page.value(f"{VIEWER}.goTo(0)")
    assert seen(page)["sum"] == before["sum"]
    assert all("CONTEXT_LOST_WEBGL" in words for words in page.console)
    page.console.clear()


@pytest.mark.parametrize("lacking", ["scripts", "WebGL", "DecompressionStream"])
def test_where_nothing_can_move_the_still_picture_stands(browser: Any, file: Path, lacking: str) -> None:
    with ExitStack() as stack:
        if lacking == "WebGL":
            browser = stack.enter_context(chromium("--disable-gpu", "--disable-3d-apis"))
        page = stack.enter_context(watched(browser, java_script_enabled=lacking != "scripts"))
        if lacking == "DecompressionStream":
            page.page.add_init_script("delete window.DecompressionStream")
        page.open(file)
        if lacking != "scripts":
            page.wait("document.body.innerText.includes('The hand does not move here')")
        assert page.page.locator(".viewer-still > svg").is_visible()
        assert not page.page.locator("form").is_visible()
        assert "whole-hand, frame" in page.page.locator(".viewer-still p").inner_text()
        words = page.page.locator(".viewer-lacking").inner_text()
        assert ("where the browser runs scripts" in words) == (lacking == "scripts")
