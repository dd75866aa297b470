"""Screenshots of the guide: of the demo study's report, and of the coach's page.

After `make demo`: PYTHONPATH=.:tests .venv/bin/python -m report_samples.screenshots
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from browser import WatchedPage, chromium, watched
from coached_hands import CALIBRATION, arriving, one_after_another, setup
from PIL import Image

from benchmarks.faultless_hands import exchanged
from shukotsu.coach.board import Board
from shukotsu.coach.coach import Coach
from shukotsu.coach.page_server import METHODS, serve
from shukotsu.coach.setup import names_of
from shukotsu.schemas.results import Results

FOLDER = Path("docs/screenshots")
WIDTH, SCALE = 1000, 1.5
COLOURS = 128
"""Of a kept picture: enough for these pages, and a third of the bytes."""


@dataclass(frozen=True)
class Screenshot:
    """A window of a page: from `start` (a selector; empty is the top) on, `height` CSS pixels of it.

    unfold : a selector of folded parts to open first. ready : a JavaScript expression to wait for.
    """

    page: Path
    start: str
    height: int
    unfold: str = ""
    ready: str = "true"


def screenshots(results: Results, subject: str, recording: Path) -> dict[str, Screenshot]:
    """Every screenshot by the name of its file; recording : the page of one of the subject's recordings."""
    study, one = results.report, results.subject_page(subject)
    drawn = "document.querySelector('.viewer canvas').width > 0"
    return {
        "study": Screenshot(study, "", 760),
        "joints": Screenshot(one, "#trust details", 850, "#trust details"),
        "models": Screenshot(study, "#compared", 820),
        "movement": Screenshot(results.movement_page, "", 760),
        "recording": Screenshot(recording, "#time", 720, ready=drawn),
        "viewer": Screenshot(recording, "#hand", 620, ready=drawn),
    }


def take(page: WatchedPage, wanted: Screenshot, picture: Path) -> None:
    """Take one of the report."""
    page.page.set_viewport_size({"width": WIDTH, "height": wanted.height})
    page.open(wanted.page.absolute())
    page.wait(wanted.ready)
    if wanted.unfold:
        page.value("(css) => document.querySelector(css).open = true", wanted.unfold)
    top = "(css) => css ? document.querySelector(css).getBoundingClientRect().top + scrollY - 12 : 0"
    page.value(f"(css) => scrollTo(0, ({top})(css))", wanted.start)
    page.page.wait_for_timeout(300)  # canvases are drawn when they come into view
    page.page.screenshot(path=picture)


COACHED: Mapping[str, Callable[[Mapping[str, Any]], object]] = {
    "coach-request": lambda state: state["time_s"] >= 2.0,
    "coach-finding": lambda state: state["findings"],
    "coach-during": lambda state: state["skeleton"] and state["request"]["drawing"] and state["done"],
    "coach-enough": lambda state: state["summary"],
}
"""Pictures of the coach's page, each with what is true of the first state that it shows."""


def take_coach(page: WatchedPage, name: str, picture: Path) -> None:
    """Take one of the coach's page, of a simulated hand; for a finding two receivers are swapped."""
    coach, board = Coach(setup()), Board()
    poses = one_after_another(CALIBRATION)
    if name == "coach-finding":
        poses = exchanged(poses, ("index_middle", "middle_middle"))
    state, shown = next(
        (state, arrived.poses)
        for arrived in arriving(poses)
        for state in coach.take(arrived)
        if COACHED[name](state)
    )
    title = {
        "study": "piano",
        "subject": "03",
        "hand": "left",
        "file": "03_left_rom.arrows",
        "since": "14:02",
    }
    hands = [{"subject": subject, "hand": "left", "done": False} for subject in ("03", "04")]
    marks = names_of(coach.layout, ())
    board.publish({**state, "title": title, "message": "", "hands": hands, "marks": marks})
    with closing(serve(board)) as server:
        page.page.set_viewport_size({"width": WIDTH, "height": 700})
        page.opened |= {f"http://127.0.0.1:{server.port}{path}" for path in METHODS}
        page.page.goto(server.url)
        page.wait("!!coach.page.state")
        numbers = np.concatenate([shown.position_mm, shown.quaternion], -1)
        board.show_poses(shown.time_s, numbers)
        page.wait("coach.drawn.length > 0")
        page.page.screenshot(path=picture)
        page.page.goto("about:blank")  # before the connection ends, of which the browser would tell


def take_all(results: Results, subject: str, recording: Path, folder: Path) -> list[Path]:
    """Take all of them into a folder, in the light theme; give the files."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    of_report = screenshots(results, subject, recording)
    with chromium() as browser:
        for name in (*of_report, *COACHED):
            picture = folder / f"{name}.png"
            with watched(browser, device_scale_factor=SCALE, color_scheme="light") as page:
                if name in COACHED:
                    take_coach(page, name, picture)
                else:
                    take(page, of_report[name], picture)
            with Image.open(picture) as taken:
                taken.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(picture, optimize=True)
            pictures.append(picture)
    return pictures


def main() -> None:
    """Take those of a study's results (default: the demo's)."""
    results = Results(Path(sys.argv[1] if len(sys.argv) > 1 else "results/demo"))
    recording = results.folder / "report" / "sub-01" / "right" / "opposition.html"
    take_all(results, "01", recording, FOLDER)


if __name__ == "__main__":
    main()
