"""Screenshots for the guide: the demo study's report and the coach's page.

After `make demo`: PYTHONPATH=.:tests .venv/bin/python -m report_samples.screenshots
"""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

from browser import chromium, watched
from PIL import Image
from simulated_poses import recorded

from shukotsu.coach.coach import Coach
from shukotsu.coach.page import write_page
from shukotsu.coach.study import hand_alone
from shukotsu.study.results import Results

FOLDER, RESULTS = Path("docs/screenshots"), Results(Path("results/demo"))
RECORDING = RESULTS.folder / "report" / "sub-01" / "right" / "opposition.html"
WIDTH, SCALE, COLOURS = 1000, 1.5, 256
DRAWN = "document.querySelector('.viewer canvas').width > 0"
TOP = "(css) => css ? document.querySelector(css).getBoundingClientRect().top + scrollY - 3 : 0"
SCREENSHOTS = {
    "study": (RESULTS.report, "", 785, DRAWN),
    "subject": (RESULTS.subject_page("01"), "", 1180, "true"),
    "recording": (RECORDING, "#time", 720, DRAWN),
    "curves": (RECORDING, "#cycles", 600, "true"),
    "viewer": (RECORDING, ".viewer", 590, DRAWN),
}
"""By file name: the page, a selector of its top edge, its height in CSS pixels and the condition to wait
for.
"""


def write_coached_page(page: Path) -> None:
    """Write the coach's page 14 s into a simulated calibration, without its automatic refresh."""
    coach = Coach(hand_alone(None, "right"))
    coach.take(recorded(seed=7001, n_frames=3360)[1])
    write_page(page, coach, "03_right_rom.arrows, right hand")
    page.write_text(re.sub(".*http-equiv=.refresh.*", "", page.read_text("utf-8")), "utf-8")


def main() -> None:
    with chromium() as browser, TemporaryDirectory() as folder:
        coached = Path(folder, "coach.html")
        write_coached_page(coached)
        for name, (file, start, height, ready) in (
            SCREENSHOTS | {"coach": (coached, "", 720, "true")}
        ).items():
            picture = FOLDER / f"{name}.png"
            with watched(browser, device_scale_factor=SCALE, color_scheme="light") as page:
                page.page.set_viewport_size({"width": WIDTH, "height": height})
                page.open(file.absolute())
                page.wait(ready)
                page.value(f"(css) => scrollTo(0, ({TOP})(css))", start)
                page.page.wait_for_timeout(300)  # canvases are drawn when they come into view
                page.page.screenshot(path=picture)
            with Image.open(picture) as taken:
                taken.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(picture, optimize=True)


if __name__ == "__main__":
    main()
