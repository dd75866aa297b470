"""The coach's page in a real browser: what it shows, enters, survives, and keeps from other pages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from browser import PATIENCE_MS, PAUSE_MS, WatchedPage
from coach.fake_coach import SHOWN_HZ, batch, hand_mm, skeleton, state

from shukotsu.coach.board import Board
from shukotsu.coach.page_server import METHODS, PageServer, serve

pytestmark = pytest.mark.slow

HOSTILE = """<body><iframe src="BASE/"></iframe><script>
window.tried = [];
const note = (value) => tried.push(String(value));
const headers = {"X-Coach-Token": "TOKEN"}; // even if it had it
for (const own of [{mode: "cors"}, {mode: "no-cors"}, {mode: "cors", headers}]) {
  fetch("BASE/events", own).then((reply) => reply.text()).then(note, note);
  fetch("BASE/enter", {method: "POST", body: '{"kind": "done"}', ...own}).then(note, note);
}
document.querySelector("iframe").onload = ({target}) => {
  try { note(target.contentWindow.document.body.textContent); } catch { note("closed"); }
};
</script>"""


@pytest.fixture
def server() -> Iterator[PageServer]:
    board = Board()
    board.publish(state())
    with closing(serve(board)) as served:
        yield served


def visit(page: WatchedPage, server: PageServer) -> WatchedPage:
    """Open the page by the terminal's address, and wait until it has a state."""
    page.opened |= {f"http://127.0.0.1:{server.port}{path}" for path in METHODS}
    page.page.goto(server.url)
    page.wait("!!coach.page.state")
    return page


def text(page: WatchedPage, selector: str) -> str:
    return str(page.page.locator(selector).inner_text())


def entered(page: WatchedPage, server: PageServer) -> list[dict[str, object]]:
    """Give what comes in next."""
    for _ in range(PATIENCE_MS // PAUSE_MS):
        if found := server.board.entered():
            return found
        page.page.wait_for_timeout(PAUSE_MS)
    raise AssertionError("nothing was entered")


def test_it_shows_the_state_and_no_number_for_what_was_not_done(
    watched_page: WatchedPage, server: PageServer
) -> None:
    page, expected = visit(watched_page, server), state()
    assert text(page, "#request") == expected["request"]["sentence"]
    assert text(page, "#findings") == expected["findings"][0]
    assert text(page, "#settled") == "4 of 10 joints settled"
    for part in ("piano · 03 · right", "03_rom.arrows, since 14:02", "1:31"):
        assert part in text(page, "header")
    assert text(page, "#of-study") == "1 of 2 hands done"
    assert text(page, "#hands [aria-current]") == "– 03 right"
    assert page.page.locator("#done").get_attribute("data-success") == "true"
    for row, joint in zip(page.page.locator("#joints li").all(), expected["joints"], strict=True):
        known = joint["sd_mm"] is not None
        assert row.locator("b").inner_text() == (f"{joint['sd_mm']:.1f} mm" if known else "")
        assert row.locator(".bar").count() == known
        assert joint["name"] in row.inner_text()
        assert joint["verdict"] in str(row.get_attribute("class"))
    assert page.page.locator("#drawing").is_visible()
    server.board.publish(
        state(2, findings=[], request=None, summary="Calibrated in 48 s.", message="So it is.")
    )
    page.page.get_by_text("So it is.").wait_for()
    assert text(page, "#request") == "Calibrated in 48 s."
    for selector in ("#findings", "#drawing"):
        page.page.locator(selector).wait_for(state="hidden")
    assert page.page.get_by_role("button", name="Done").is_disabled()


def test_it_speaks_japanese_where_the_coach_does(watched_page: WatchedPage) -> None:
    board = Board()
    board.publish(state())
    with closing(serve(board, language="ja")) as server:
        page = visit(watched_page, server)
        assert page.page.locator("html").get_attribute("lang") == "ja"
        assert text(page, "[data-enter=done]") == "できた"
        assert text(page, "#settled") == "10 関節のうち 4 が決まった"
        page.page.goto("about:blank")  # before the connection ends, of which the browser would tell


def test_marks_are_entered_by_button_and_by_form(watched_page: WatchedPage, server: PageServer) -> None:
    page = visit(watched_page, server)
    page.page.get_by_role("button", name="Done").press("Enter")
    assert entered(page, server) == [{"kind": "done", "number": 4}]
    page.page.get_by_role("button", name="Finish").click()
    page.page.get_by_role("button", name="Finish: press again").click()
    assert entered(page, server) == [{"kind": "finish"}]
    page.page.get_by_text("A touch").click()
    page.page.locator("#touch [name=digit]").select_option("index")
    page.page.locator("#touch [name=other]").select_option("meets thumb")
    server.board.publish(state(2))
    page.wait("coach.page.state.time_s === 2")  # and what was chosen stays chosen
    page.page.locator("#touch button").click()
    assert entered(page, server) == [{"kind": "touch", "digit": "index", "meets": "thumb"}]
    page.page.locator("#touch [name=other]").select_option("point post")
    page.page.locator("#touch button").click()
    assert entered(page, server) == [{"kind": "touch", "digit": "index", "part": "tip", "point": "post"}]
    page.page.get_by_text("A length").click()
    page.page.locator("[name=value_mm]").fill("3.1")
    page.page.locator("[name=sd_mm]").fill("0.4")
    page.page.locator("#length button").click()
    expected = {"kind": "length", "quantity": "index_middle.lateral", "value_mm": 3.1, "sd_mm": 0.4}
    assert entered(page, server) == [expected]
    page.page.get_by_text("Entered.").wait_for()


@pytest.mark.parametrize("hand", ["right", "left"])
def test_every_frame_is_drawn_seen_from_the_back_and_never_mirrored(
    watched_page: WatchedPage, server: PageServer, hand: str
) -> None:
    server.board.publish(state(91.5, hand))
    watched_page.page.clock.install()
    watched_page.page.clock.pause_at("2100-01-01")
    page = visit(watched_page, server)
    for start in range(10, 80, 7):
        server.board.show_poses(*batch(hand, start))
        page.wait(f"coach.live.frames.at(-1)?.time > {(start + 6) / SHOWN_HZ} - .001")
        page.page.clock.run_for(1000 * 7 / SHOWN_HZ)
    page.page.clock.run_for(1000)
    drawn = [round(time * SHOWN_HZ) for time in page.value("coach.drawn")]
    assert drawn == list(range(drawn[0], 80))
    assert drawn[0] < 14
    names, shown = skeleton(hand)["points"], np.array(page.value("coach.points"), float)
    true = np.stack(list(hand_mm(hand).values()))
    apart, expected = (np.linalg.norm(at[:, None] - at, axis=-1) for at in (shown, true))
    assert apart == pytest.approx(expected, abs=0.1)
    place = dict(zip(names, shown, strict=True))
    assert place["index_mcp"][1] > place["wrist"][1] + 30
    assert (place["little_mcp"][0] - place["thumb_mcp"][0] > 20) == (hand == "right")
    middle, little = (place[name] - place["wrist"] for name in ("middle_tip", "little_mcp"))
    assert (np.cross(little, middle)[2] > 0) == (hand == "right")
    server.board.show_poses(*batch(hand, 0))  # another recording, or this one after a sleep, begins at once
    page.wait("coach.live.frames.length === 7 && coach.live.frames[0].time === 0")


def test_it_lives_through_reload_and_restart_and_says_what_it_lacks(
    watched_page: WatchedPage, server: PageServer
) -> None:
    page = visit(watched_page, server)
    port = server.port
    assert page.page.url == f"http://127.0.0.1:{port}/"  # the token is no longer to be read there
    assert page.page.context.cookies() == []
    page.page.reload()
    page.wait("!!coach.page.state")
    server.close()
    page.wait("document.body.classList.contains('lost')")
    assert "Connection lost: the last state is" in text(page, "#lost")
    board = Board()
    board.publish(state(9))
    with closing(serve(board, port=port)) as restarted:
        page.page.get_by_text("open the address that the terminal shows").wait_for()
        restarted.token = server.token
        page.wait("coach.page.state.time_s === 9 && !document.body.classList.contains('lost')")
    page.console.clear()  # the browser tells of every connection that fails


def test_another_site_reads_nothing_and_changes_nothing(
    watched_page: WatchedPage, server: PageServer
) -> None:
    page = visit(watched_page, server)
    content = HOSTILE.replace("BASE", f"http://127.0.0.1:{server.port}").replace("TOKEN", server.token)
    foe = page.page.context.new_page()
    foe.route("http://127.0.0.1:1/", lambda route: route.fulfill(body=content, content_type="text/html"))
    foe.goto("http://127.0.0.1:1/")
    for _ in range(PATIENCE_MS // PAUSE_MS):
        if len(tried := foe.evaluate("tried")) == 7:
            break
        foe.wait_for_timeout(PAUSE_MS)
    assert sorted(tried) == ["TypeError: Failed to fetch"] * 6 + ["closed"]
    assert server.board.entered() == []


def test_another_computer_gives_the_password(watched_page: WatchedPage) -> None:
    board = Board()
    board.publish(state())
    with closing(serve(board, listen="127.0.0.1:0", password="long enough")) as server:
        watched_page.opened |= {f"http://127.0.0.1:{server.port}{path}" for path in METHODS}
        watched_page.page.goto(server.url.partition("#")[0])
        watched_page.page.locator("[name=password]").fill("long enough")
        watched_page.page.get_by_role("button", name="Open").click()
        watched_page.page.get_by_text("4 of 10").wait_for()
        assert not watched_page.page.locator("[name=password]").is_visible()
        watched_page.console.clear()  # that it was refused first
