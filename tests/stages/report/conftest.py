"""The made-up study, its results and its page, made once for all tests of the report."""

from __future__ import annotations

from pathlib import Path

import pytest
from report_samples.made_study import FITTED_MODELS, make_study

from schemas.study import read_study
from stages.report.page import render_page
from stages.report.study_results import StudyResults, read_results


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Study file and results folder; not to be changed."""
    return make_study(tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="session")
def results(made: tuple[Path, Path]) -> StudyResults:
    """The made-up study, read."""
    return read_results(read_study(made[0]), made[1])


@pytest.fixture(scope="session")
def page(results: StudyResults) -> str:
    """The made-up study's page."""
    return render_page(results)


@pytest.fixture(scope="session")
def fitted_made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A simulated study with a model that fits the whole hand; not to be changed."""
    return make_study(
        tmp_path_factory.mktemp("fitted"),
        n_frames=20,
        models=FITTED_MODELS,
        subjects=("S01",),
        simulated=True,
    )


@pytest.fixture(scope="session")
def fitted(fitted_made: tuple[Path, Path]) -> StudyResults:
    """That study, read."""
    return read_results(read_study(fitted_made[0]), fitted_made[1])


@pytest.fixture(scope="session")
def fitted_page(fitted: StudyResults) -> str:
    """Its page."""
    return render_page(fitted)
