"""Screenshots of the guide: what "reading a report" speaks of, from the demo study's report.

After `make demo`: PYTHONPATH=.:tests .venv/bin/python -m report_samples.screenshots
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from browser import WatchedPage, chromium, watched
from PIL import Image

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
    """Take one, and keep it in few colours."""
    page.page.set_viewport_size({"width": WIDTH, "height": wanted.height})
    page.open(wanted.page.absolute())
    page.wait(wanted.ready)
    if wanted.unfold:
        page.value("(css) => document.querySelector(css).open = true", wanted.unfold)
    top = "(css) => css ? document.querySelector(css).getBoundingClientRect().top + scrollY - 12 : 0"
    page.value(f"(css) => scrollTo(0, ({top})(css))", wanted.start)
    page.page.wait_for_timeout(300)  # canvases are drawn when they come into view
    page.page.screenshot(path=picture)
    with Image.open(picture) as taken:
        taken.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(picture, optimize=True)


def take_all(results: Results, subject: str, recording: Path, folder: Path) -> list[Path]:
    """Take all of them into a folder, in the light theme; give the files."""
    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    with chromium() as browser:
        for name, wanted in screenshots(results, subject, recording).items():
            with watched(browser, device_scale_factor=SCALE, color_scheme="light") as page:
                take(page, wanted, folder / f"{name}.png")
            pictures.append(folder / f"{name}.png")
    return pictures


def main() -> None:
    """Take those of a study's results (default: the demo's)."""
    results = Results(Path(sys.argv[1] if len(sys.argv) > 1 else "results/demo"))
    recording = results.folder / "report" / "sub-01" / "right" / "opposition.html"
    take_all(results, "01", recording, FOLDER)


if __name__ == "__main__":
    main()
