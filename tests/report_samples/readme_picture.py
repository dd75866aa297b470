"""The first picture of the README: both hands of the demo study's first subject, from its page of the report.

After `make demo`: PYTHONPATH=.:tests .venv/bin/python -m report_samples.readme_picture
"""

from __future__ import annotations

from pathlib import Path

from browser import chromium, watched

from shukotsu.schemas.results import Results

PAGE = Results(Path("results/demo")).subject_page("01")
PICTURE = Path("docs/hands.png")
WIDTH, HEIGHT, SCALE = 1120, 900, 1.5


def main() -> None:
    """Take the picture."""
    window = {"width": WIDTH, "height": HEIGHT}
    with chromium() as browser, watched(browser, viewport=window, device_scale_factor=SCALE) as page:
        page.open(PAGE.absolute())
        page.value("document.querySelectorAll('.indexed > :not(figure)').forEach((each) => each.remove())")
        page.page.locator("#trust .hands").screenshot(path=PICTURE)


if __name__ == "__main__":
    main()
