"""The made-up study, its results and its page, made once for all tests of the report."""

from __future__ import annotations

from pathlib import Path

import pytest
from browser import browser, watched_page  # noqa: F401
from report_samples.hand_tables import write_tips
from report_samples.made_study import FITTED_MODELS, make_study
from report_samples.pages import subject_page, whole_report

from shukotsu.report.study_page import render_study
from shukotsu.report.study_results import StudyResults, read_results
from shukotsu.study.results import Results
from shukotsu.study.study import Study, read_study


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Study file and results folder, its subjects' tips among them; not to be changed."""
    study, folder = make_study(tmp_path_factory.mktemp("made"))
    write_tips(read_study(study), Results(folder))
    return study, folder


@pytest.fixture(scope="session")
def study(made: tuple[Path, Path]) -> Study:
    """The made-up study's file, read."""
    return read_study(made[0])


@pytest.fixture(scope="session")
def results(made: tuple[Path, Path], study: Study) -> StudyResults:
    """The made-up study, read."""
    return read_results(study, made[1])


@pytest.fixture(scope="session")
def page(results: StudyResults, study: Study) -> str:
    """The made-up study's page and its subjects', one after the other."""
    return whole_report(results, study)


@pytest.fixture(scope="session")
def pages(results: StudyResults, study: Study) -> dict[Path, str]:
    """The made-up study's page and its subjects', by path."""
    paths = results.paths
    of_subjects = {paths.subject_page(name): subject_page(results, name) for name in results.subjects}
    return {paths.report: render_study(results, study), **of_subjects}


@pytest.fixture(scope="session")
def fitted_made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A simulated study with a model that fits the whole hand; not to be changed."""
    return make_study(
        tmp_path_factory.mktemp("fitted"),
        n_frames=20,
        models=FITTED_MODELS,
        subjects=("S01",),
        simulated=True,
        compared=True,
    )


@pytest.fixture(scope="session")
def fitted(fitted_made: tuple[Path, Path]) -> StudyResults:
    """That study, read."""
    return read_results(read_study(fitted_made[0]), fitted_made[1])


@pytest.fixture(scope="session")
def fitted_page(fitted: StudyResults, fitted_made: tuple[Path, Path]) -> str:
    """Its page and its subject's."""
    return whole_report(fitted, read_study(fitted_made[0]))
