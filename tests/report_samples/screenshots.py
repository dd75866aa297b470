"""Screenshots of the guide: of the demo study's report, and of the coach's page.

After `make demo`: PYTHONPATH=.:tests .venv/bin/python -m report_samples.screenshots
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from browser import WatchedPage, chromium, watched
from coached_hands import calibration
from PIL import Image

from shukotsu.coach.coach import Coach
from shukotsu.coach.page import write_page
from shukotsu.coach.study import hand_alone
from shukotsu.study.results import Results

FOLDER = Path("docs/screenshots")
WIDTH, SCALE = 1000, 1.5
COLOURS = 256
"""Of a kept picture: enough for these pages, and half of the bytes."""


@dataclass(frozen=True)
class Screenshot:
    """A window of a page: from `start` (a selector; empty is the top) on, `height` CSS pixels of it.

    ready : a JavaScript expression to wait for.
    """

    page: Path
    start: str
    height: int
    ready: str = "true"


def screenshots(results: Results, subject: str, recording: Path) -> dict[str, Screenshot]:
    """Every screenshot by the name of its file; recording : the page of one of the subject's recordings."""
    study, page = results.report, results.subject_page(subject)
    drawn = "document.querySelector('.viewer canvas').width > 0"
    return {
        "study": Screenshot(study, "", 760, ready=drawn),
        "subject": Screenshot(page, "", 1000),
        "recording": Screenshot(recording, "#time", 720, ready=drawn),
        "viewer": Screenshot(recording, ".viewer", 590, ready=drawn),
    }


def take(page: WatchedPage, wanted: Screenshot, picture: Path) -> None:
    """Take one."""
    page.page.set_viewport_size({"width": WIDTH, "height": wanted.height})
    page.open(wanted.page.absolute())
    page.wait(wanted.ready)
    top = "(css) => css ? document.querySelector(css).getBoundingClientRect().top + scrollY - 3 : 0"
    page.value(f"(css) => scrollTo(0, ({top})(css))", wanted.start)
    page.page.wait_for_timeout(300)  # canvases are drawn when they come into view
    page.page.screenshot(path=picture)


def coached_page(folder: Path) -> Screenshot:
    """The coach's page 14 s into a simulated calibration; here it does not load itself again."""
    coach, page = Coach(hand_alone(None, "right")), folder / "coach.html"
    coach.take(calibration(14.0))
    write_page(page, coach, "03_right_rom.arrows, right hand")
    page.write_text(re.sub(".*http-equiv=.refresh.*", "", page.read_text("utf-8")), "utf-8")
    return Screenshot(page, "", 720)


def take_all(results: Results, subject: str, recording: Path, folder: Path) -> list[Path]:
    """Take all of them into a folder, in the light theme; give the files."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    wanted = screenshots(results, subject, recording)
    with chromium() as browser, TemporaryDirectory() as folder_of_page:
        wanted["coach"] = coached_page(Path(folder_of_page))
        for name, screenshot in wanted.items():
            picture = folder / f"{name}.png"
            with watched(browser, device_scale_factor=SCALE, color_scheme="light") as page:
                take(page, screenshot, picture)
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
