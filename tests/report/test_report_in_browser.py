"""The whole report in a real browser: links from study to subject to recording, with any subject names.

axe-core is read from .tools/node_modules (installed by tests/export_tools/package.json) or the folder
SHUKOTSU_TOOLS.
"""

from collections.abc import Callable
from pathlib import Path

import pytest
from browser import watched
from playwright.sync_api import Browser
from report_samples.made_study import PAPERS, MadeStudy, make_study
from stage_runs import subject_pages

from shukotsu.tables.whole_files import write_text

pytestmark = pytest.mark.slow

SCRIPT = "<script>alert(1)</script>"
NAMES = (SCRIPT, "手 骨/%2F ' \" & #?", "plain")


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> MadeStudy:
    """All pages of a study of subjects NAMES; the last one's left recording failed."""
    study = make_study(tmp_path_factory.mktemp("report"), models=PAPERS[1:3], subjects=NAMES)
    write_text(study.paths.report, study.pages[study.paths.report])
    for name in NAMES:
        argv = ["--plan", str(study.paths.plan(name)), "--out", str(study.paths.subject_pages(name))]
        assert subject_pages(argv) == 0
    return study


def test_links_lead_from_the_study_to_every_recording_and_back(browser: Browser, report: MadeStudy) -> None:
    """Pages are reached by visible links only; names are shown literally, in the sheet's order."""
    names = [" ".join(name.split()) for name in NAMES]
    with watched(browser) as watch:
        watch.opened |= {report.paths.subject_page(name).as_uri() for name in NAMES}
        watch.opened |= {report.paths.recording_page(recording).as_uri() for recording in report.study.shown}
        page = watch.page
        page.on("dialog", lambda dialog: pytest.fail(f"a name was run as a script: {dialog.message}"))
        watch.open(report.paths.report)
        for name in names:
            page.locator("#subjects a").get_by_text(name, exact=True).first.click()
            assert page.locator("h1").inner_text() == f"Subject {name}"
            page.get_by_role("link", name="opposition, right hand").click()
            assert page.locator("h1").inner_text() == f"Subject {name}, right hand, opposition"
            watch.wait("!!document.querySelector('[data-hand-viewer]').viewer")
            page.get_by_role("link", name="Study made").click()
            assert page.locator("h1").inner_text() == "Study made"
        page.locator("#subjects a").get_by_text(names[0], exact=True).first.click()
        for name in names[1:]:
            page.locator("[rel=next]").click()
            assert page.locator("h1").inner_text() == f"Subject {name}"
        assert page.locator("[rel=next]").is_hidden()
        page.locator("[rel=prev]").click()
        assert page.locator("h1").inner_text() == f"Subject {names[1]}"


def test_no_page_is_wider_than_its_window(browser: Browser, report: MadeStudy) -> None:
    for path in (report.paths.report, report.paths.subject_page(NAMES[1])):
        with watched(browser) as page:
            page.open(path)
            for width in (390, 1280, 1920):
                page.page.set_viewport_size({"width": width, "height": 900})
                assert page.value("document.documentElement.scrollWidth") <= width


@pytest.mark.tools
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_no_serious_violation(
    browser: Browser, report: MadeStudy, export_tool: Callable[..., Path], theme: str
) -> None:
    """The pages of the study, a subject and a recording are checked with all details open."""
    axe = export_tool("node_modules/axe-core/axe.min.js")
    study, paths = report.study, report.paths
    for path in (paths.report, paths.subject_page(NAMES[-1]), paths.recording_page(study.shown[0])):
        with watched(browser, color_scheme=theme, bypass_csp=True) as page:
            page.open(path)
            page.value("document.querySelectorAll('details').forEach((part) => (part.open = true))")
            page.page.add_script_tag(path=axe)
            violations = page.value("async () => (await axe.run()).violations")
            serious = [each for each in violations if each["impact"] in ("serious", "critical")]
            assert [f"{each['id']}: {each['nodes'][0]['html']}" for each in serious] == []
