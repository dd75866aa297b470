"""No page has a serious finding of axe-core, in either theme, with everything unfolded.

axe-core is in .tools/node_modules, as of tests/export_tools/package.json, or where SHUKOTSU_TOOLS says.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from browser import watched
from playwright.sync_api import Browser
from report_samples.hand_tables import write_subject_tables
from report_samples.made_movement import write_movement
from report_samples.made_study import FITTED_MODELS, make_study
from stage_runs import report as main
from stage_runs import subject_pages as subject_main

from shukotsu.study.results import Results
from shukotsu.study.study import read_study

pytestmark = pytest.mark.tools
TOOLS = Path(os.environ.get("SHUKOTSU_TOOLS", Path(__file__).parents[2] / ".tools"))
SERIOUS = ("serious", "critical")
SUBJECTS = ("S01", "S02")


@pytest.fixture(scope="module")
def axe() -> Path:
    """The script that examines a page."""
    script = TOOLS / "node_modules" / "axe-core" / "axe.min.js"
    if not script.is_file():
        pytest.skip(f"no {script}; SHUKOTSU_TOOLS can name another folder")
    return script


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a study's pages."""
    study, results = make_study(
        tmp_path_factory.mktemp("pages"), n_frames=40, models=FITTED_MODELS, subjects=SUBJECTS, simulated=True
    )
    write_movement(results, SUBJECTS, models=FITTED_MODELS)
    paths = Results(results)
    write_subject_tables(read_study(study), paths)
    plan, pages = str(paths.plan("S01")), str(paths.subject_pages("S01"))
    assert subject_main(["--plan", plan, "--out", pages]) == 0
    assert main(["--study", str(study), "--results", str(results), "--out", str(paths.report)]) == 0
    return results


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize(
    "page", ["report.html", "report/sub-S01/subject.html", "report/sub-S01/right/opposition.html"]
)
def test_axe_finds_nothing_serious(browser: Browser, axe: Path, report: Path, page: str, theme: str) -> None:
    with watched(browser, color_scheme=theme, bypass_csp=True) as opened:
        opened.open(report / page)
        opened.value("document.querySelectorAll('details').forEach((one) => (one.open = true))")
        opened.page.add_script_tag(path=axe)
        found = opened.value("async () => (await axe.run()).violations")
        serious = [f"{one['id']}: {one['nodes'][0]['html']}" for one in found if one["impact"] in SERIOUS]
        assert not serious
