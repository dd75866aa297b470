"""The whole report in a real browser: from study to subject to recording, whatever people are called.

axe-core is in .tools/node_modules, as of tests/export_tools/package.json, or where SHUKOTSU_TOOLS says.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import WatchedPage, watched
from playwright.sync_api import Browser
from report_samples.hand_tables import write_subject_tables, write_tips
from report_samples.made_study import make_study
from stage_runs import subject_pages

from shukotsu.report.study_page import render_study
from shukotsu.report.study_results import read_results
from shukotsu.study.results import Results
from shukotsu.study.study import Study, read_study
from shukotsu.tables.whole_files import write_text

pytestmark = pytest.mark.slow
TOOLS = Path(os.environ.get("SHUKOTSU_TOOLS", Path(__file__).parents[2] / ".tools"))
AXE = TOOLS / "node_modules" / "axe-core" / "axe.min.js"

SCRIPT = "<script>alert(1)</script>"
NAMES = (SCRIPT, "手 骨/%2F ' \" & #?", "plain")


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Results]:
    """Every page of a study whose subjects have such names; the last one's left recording failed."""
    folder = tmp_path_factory.mktemp("report")
    file, results = make_study(folder, n_frames=30, models=("paper-fig3", "paper-fig4"), subjects=NAMES)
    study, paths = read_study(file), Results(results)
    write_subject_tables(study, paths)
    write_tips(study, paths)
    write_text(paths.report, render_study(read_results(study, results), study))
    for name in NAMES:
        out = str(paths.subject_pages(name))
        argv = ["--plan", str(paths.plan(name)), "--out", out]
        assert subject_pages(argv) == 0
    return study, paths


@pytest.fixture
def opened(browser: Browser, report: tuple[Study, Results]) -> Iterator[WatchedPage]:
    """The study's page; other pages of the report may be opened, and nothing else."""
    study, paths = report
    with watched(browser) as page:
        page.opened |= {paths.subject_page(name).as_uri() for name in NAMES}
        page.opened |= {paths.recording_page(recording).as_uri() for recording in study.shown}
        page.page.on("dialog", lambda dialog: pytest.fail(f"a name was run as a script: {dialog.message}"))
        page.open(paths.report)
        yield page


@pytest.mark.parametrize("name", NAMES)
def test_from_the_study_to_a_subject_to_a_recording_and_back(opened: WatchedPage, name: str) -> None:
    """Every step by a link that a person would click; the name is shown as it is."""
    page, shown = opened.page, " ".join(name.split())
    page.locator("#subjects a").get_by_text(shown, exact=True).first.click()
    assert page.locator("h1").inner_text() == f"Subject {shown}"
    page.get_by_role("link", name="opposition, right hand").click()
    assert page.locator("h1").inner_text() == f"Subject {shown}, right hand, opposition"
    opened.wait("!!document.querySelector('[data-hand-viewer]').viewer")
    page.get_by_role("link", name="Study made").click()
    assert page.locator("h1").inner_text() == "Study made"


def test_through_the_subjects_one_after_the_other(opened: WatchedPage) -> None:
    """A page that was reached from the study's has the list of subjects, in the sheet's order."""
    page = opened.page
    page.locator("#subjects a").get_by_text(SCRIPT, exact=True).first.click()
    for name in NAMES[1:]:
        page.locator("[rel=next]").click()
        assert page.locator("h1").inner_text() == f"Subject {' '.join(name.split())}"
    assert page.locator("[rel=next]").is_hidden()
    page.locator("[rel=prev]").click()
    assert page.locator("h1").inner_text() == f"Subject {' '.join(NAMES[1].split())}"


@pytest.mark.parametrize("width", [390, 1280, 1920])
def test_no_page_is_wider_than_its_window(
    browser: Browser, report: tuple[Study, Results], width: int
) -> None:
    _, paths = report
    for path in (paths.report, paths.subject_page(NAMES[1])):
        with watched(browser, viewport={"width": width, "height": 900}) as page:
            page.open(path)
            assert page.value("document.documentElement.scrollWidth") <= width


@pytest.mark.tools
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing_serious(browser: Browser, report: tuple[Study, Results], theme: str) -> None:
    """In the study's page, a subject's and a recording's, with everything unfolded."""
    if not AXE.is_file():
        pytest.skip(f"no {AXE}; SHUKOTSU_TOOLS can name another folder")
    study, paths = report
    for path in (paths.report, paths.subject_page(NAMES[-1]), paths.recording_page(study.shown[0])):
        with watched(browser, color_scheme=theme, bypass_csp=True) as page:
            page.open(path)
            page.value("document.querySelectorAll('details').forEach((part) => (part.open = true))")
            page.page.add_script_tag(path=AXE)
            violations = page.value("async () => (await axe.run()).violations")
            serious = [each for each in violations if each["impact"] in ("serious", "critical")]
            assert [f"{each['id']}: {each['nodes'][0]['html']}" for each in serious] == []
