"""The coach's page in a real browser."""

from pathlib import Path

import pytest
from browser import WatchedPage
from simulated_poses import recorded

from shukotsu.coach.coach import Coach
from shukotsu.coach.page import write_page
from shukotsu.coach.study import hand_alone


@pytest.mark.slow
def test_the_page_shows_hand_joints_and_advice_and_refreshes(
    watched_page: WatchedPage, tmp_path: Path
) -> None:
    coach, path, page = Coach(hand_alone(None, "right")), tmp_path / "page.html", watched_page.page
    write_page(path, coach, "a recording", "Nothing has come.")
    watched_page.open(path)
    coach.take(recorded(seed=7001, n_frames=1680)[1], may_leave_out=True)
    assert coach.calibration.estimate is not None
    coach.findings = ["index_middle <b> is swapped"]
    write_page(path, coach, "a recording")
    page.locator(".advice", has_text=coach.advice).wait_for()  # after its automatic refresh
    page.locator("tbody tr").nth(14).wait_for()
    page.locator(".warning", has_text="index_middle <b> is swapped").wait_for()
    coach.findings = []
    coach.end()
    write_page(path, coach, "a recording")
    page.locator("h1", has_text="ended").wait_for()
    assert watched_page.value("document.querySelector('meta[http-equiv=refresh]')") is None
    assert watched_page.value("document.querySelectorAll('svg path').length") > 12
    cells = watched_page.value("[...document.querySelectorAll('tbody tr')].map(row => row.innerText)")
    assert any("thumb_cmc" in row and "with care" in row and "the error exceeds" in row for row in cells)
    assert coach.summary() in watched_page.value("document.body.innerText")
    assert watched_page.value("document.documentElement.scrollWidth <= innerWidth")
    assert list(tmp_path.iterdir()) == [path]
