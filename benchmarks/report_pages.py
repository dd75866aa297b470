"""The report: seconds to make its pages, their bytes, and how a browser shows them by software alone."""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from benchmarks.text_table import Cell, TextTable
from schemas.study import Hand, read_study

ROOT = Path(__file__).resolve().parent.parent
STUDY, RESULTS = ROOT / "config" / "demo.yaml", ROOT / "results" / "demo"
SUBJECTS = 100
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


def run() -> Iterator[TextTable]:
    """Give the tables: making the pages, then looking at them."""
    if not (RESULTS / "report.html").is_file():
        yield TextTable("report_pages", (("needs", ""),), [("the demo's results: run make demo first",)], "")
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield _making(folder)
        yield from _looking(folder)


def _making(folder: Path) -> TextTable:
    """Make the demo's pages as jobs do, and the page of a study of many subjects."""
    study = ["--study", str(STUDY), "--results", str(RESULTS)]
    rows: list[tuple[Cell, ...]] = [
        _job(
            "the study's page",
            [*study, "--out", str(folder / "report.html")],
            "report",
            folder / "report.html",
        )
    ]
    for subject in read_study(STUDY).subjects:
        out = folder / "report" / f"sub-{subject}"
        words = [*study, "--subject", subject, "--out", str(out)]
        rows.append(_job(f"subject {subject}, its page and 2 of recordings", words, "report.subject", out))
    rows.append(_many(folder / "many.html"))
    return TextTable(
        "report_pages: making them",
        (("what", ""), ("processor s", ".1f"), ("largest page, kB", ".0f")),
        rows,
        "A job each, start-up included; the last row without. A recording's page is of 3774 frames and six "
        f"models. The study of {SUBJECTS} subjects is the demo's two, many times over.",
    )


def _job(what: str, words: list[str], stage: str, out: Path) -> tuple[Cell, ...]:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", f"stages.{stage}", *words], check=True, cwd=ROOT)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    pages = [out] if out.is_file() else list(out.rglob("*.html"))
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return what, seconds, max(page.stat().st_size for page in pages) / 1000


def _many(out: Path) -> tuple[Cell, ...]:
    """The page of a study of many subjects."""
    from stages.report.study_page import render_study
    from stages.report.study_results import few_collections

    results = many_subjects(SUBJECTS)
    started = time.process_time()
    with few_collections():  # as the stage does
        out.write_text(render_study(results), "utf-8")
    return (
        f"the page of a study of {SUBJECTS} subjects",
        time.process_time() - started,
        out.stat().st_size / 1000,
    )


def many_subjects(count: int) -> Any:
    """The demo's results with its subjects many times over, by other names."""
    from stages.report.study_results import read_results

    study = read_study(STUDY)
    results = read_results(study, RESULTS)
    own = study.subjects
    renamed = {name: [f"{name}-{i:03d}" for i in range(count // len(own))] for name in own}
    recordings = tuple(
        replace(recording, hand=Hand(name, recording.hand.hand))
        for recording in study.recordings
        for name in renamed[recording.hand.subject]
    )
    rows: dict[str, Any] = {
        field.name: [
            row | {"subject": name}
            for row in getattr(results, field.name)
            for name in renamed[row["subject"]]
        ]
        for field in fields(results)
        if field.type == "list[Row]" and field.name != "problems"
    }
    layouts = {
        r.hand: results.layouts[Hand(r.hand.subject.rpartition("-")[0], r.hand.hand)] for r in recordings
    }
    return replace(results, study=replace(study, recordings=recordings), layouts=layouts, **rows)


def _looking(folder: Path) -> Iterator[TextTable]:
    """Open pages in Chromium, which draws with the processor alone."""
    program = shutil.which("chromium")
    if program is None:
        yield TextTable("report_pages: looking at them", (("needs", ""),), [("chromium on the path",)], "")
        return
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        words = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = driver.chromium.launch(executable_path=program, args=words)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        recording = next((folder / "report").rglob("opposition.html"))
        page.goto(recording.as_uri())
        page.wait_for_function("!!document.querySelector('[data-hand-viewer]').viewer")
        played = max(float(page.evaluate(PLAYED)) for _ in range(3))
        page.goto((folder / "many.html").as_uri())
        opened = page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd") / 1000
        scrolled = float(page.evaluate(SCROLLED))
        browser.close()
    yield TextTable(
        "report_pages: looking at them (Chromium, software rendering, 1280 x 800)",
        (("what", ""), ("", ".2f"), ("unit", "")),
        [
            ("two skeletons of 3774 frames playing, plots following", played, "frames a second"),
            (f"the page of {SUBJECTS} subjects, until loaded", opened, "s"),
            (f"the page of {SUBJECTS} subjects, scrolled through: longest frame", scrolled / 1000, "s"),
        ],
        "The best of three plays. All three suffer from whatever else runs.",
    )
