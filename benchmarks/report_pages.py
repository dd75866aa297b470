"""The report: its pages' bytes, and how a browser shows them by software alone."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterator
from pathlib import Path

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.processes import ROOT

DEMO = ROOT / "results" / "demo"
# Play for three seconds by the page's own clock and count what was drawn.
PLAYED = """() => new Promise((done) => {
  const viewer = document.querySelector("[data-hand-viewer]").viewer;
  viewer.goTo(0);
  viewer.play();
  const drawn = viewer.drawn, start = performance.now();
  setTimeout(() => {
    viewer.pause();
    done((viewer.drawn - drawn) / (performance.now() - start) * 1000);
  }, 3000);
})"""
# Scroll through the page a window's height a frame; give the longest time between two frames, ms.
SCROLLED = """() => new Promise((done) => {
  let longest = 0, before = performance.now();
  const step = (now) => {
    longest = Math.max(longest, now - before);
    before = now;
    const at = scrollY;
    scrollBy(0, innerHeight / 4);
    if (scrollY === at) done(longest); else requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    parser.add_argument("--results", type=Path, default=DEMO, help="results of a study (default: the demo's)")


def run(results: Path = DEMO) -> Iterator[TextTable]:
    """Give the tables: how large the pages are, then how a browser shows them."""
    report = results / "report.html"
    if not report.is_file():
        yield TextTable("report_pages", ("needs",), [(f"{report}: run the study first",)], "")
        return
    pages = sorted((results / "report").rglob("*.html"), key=lambda page: page.stat().st_size)
    rows: list[tuple[Cell, ...]] = [
        (what, page.relative_to(results).as_posix(), page.stat().st_size / 1000)
        for what, page in (
            ("the study", report),
            ("the smallest other", pages[0]),
            ("the largest", pages[-1]),
        )
    ]
    yield TextTable(
        "report_pages: size",
        ("page", "file", "kB:.0f"),
        rows,
        "What it takes to write them is in studies (rules report and subject_pages).",
    )
    yield _looking(report, next(page for page in pages if page.stem.startswith("opposition")))


def _looking(report: Path, recording: Path) -> TextTable:
    """Open pages in Chromium, which draws with the processor alone."""
    program = shutil.which("chromium")
    if program is None:
        return TextTable("report_pages: looking at them", ("needs",), [("chromium on the path",)], "")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = driver.chromium.launch(executable_path=program, args=options)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(recording.as_uri())
        page.wait_for_function("!!document.querySelector('[data-hand-viewer]').viewer")
        played = max(float(page.evaluate(PLAYED)) for _ in range(3))
        page.goto(report.as_uri())
        opened_s = page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd") / 1000
        scrolled_ms = float(page.evaluate(SCROLLED))
        browser.close()
    rows: list[tuple[Cell, ...]] = [
        ("frames a second that the moving hand is drawn in, the best of three times 3 s", played),
        ("seconds until the study's page is there", opened_s),
        ("longest time between two frames while scrolling through it, ms", scrolled_ms),
    ]
    return TextTable(
        "report_pages: looking at them",
        ("what", "measured:.1f"),
        rows,
        "Chromium without a graphics card, 1280 x 800.",
    )
