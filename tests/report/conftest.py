"""Synthetic studies with results and pages, built once for all tests of the report; tests must not change
them.
"""

from pathlib import Path

import pytest
from browser import browser, watched_page  # noqa: F401
from report_samples import made_study
from report_samples.made_study import FITTED_MODELS, HOSTILE, PAPERS, SECOND_FIT, MadeStudy

from shukotsu.report.study_results import StudyResults


@pytest.fixture(scope="session")
def study(tmp_path_factory: pytest.TempPathFactory) -> MadeStudy:
    """Two subjects without a known truth, under the paper's models and two whole-hand models."""
    models = (*PAPERS, "whole-hand", SECOND_FIT)
    folder = tmp_path_factory.mktemp("study")
    return made_study.make_study(folder, models=models, n_frames=300, spoiled=(HOSTILE, "right"))


@pytest.fixture(scope="session")
def results(study: MadeStudy) -> StudyResults:
    return study.results


@pytest.fixture(scope="session")
def pages(study: MadeStudy) -> dict[Path, str]:
    return study.pages


@pytest.fixture(scope="session")
def page(pages: dict[Path, str]) -> str:
    """The study's page and its subjects' pages, concatenated."""
    return "".join(pages.values())


@pytest.fixture(scope="session")
def fitted_study(tmp_path_factory: pytest.TempPathFactory) -> MadeStudy:
    """A simulated subject with a spoiled left hand, and models compared."""
    folder = tmp_path_factory.mktemp("fitted")
    fitted = made_study.make_study(folder, models=FITTED_MODELS, subjects=("S01",), simulated=True)
    made_study.compare_study(fitted.study, fitted.paths)
    return fitted


@pytest.fixture(scope="session")
def fitted(fitted_study: MadeStudy) -> StudyResults:
    return fitted_study.results


@pytest.fixture(scope="session")
def fitted_page(fitted_study: MadeStudy) -> str:
    """The fitted study's page and its subject's page, concatenated."""
    return "".join(fitted_study.pages.values())


@pytest.fixture(scope="session")
def twelve(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """Twelve simulated subjects with different numbers, and models compared."""
    return made_study.many_subjects(tmp_path_factory.mktemp("twelve"), 12).results
