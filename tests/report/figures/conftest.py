"""Made-up studies with their results, and their figures, made once for all tests of the figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from report_samples.made_study import FITTED_MODELS, compared, make_study

from shukotsu.report.figures.study_figures import Drawing, of_study
from shukotsu.report.study_results import Row, StudyResults, read_results
from shukotsu.study.study import read_study

SUBJECTS = tuple(f"S{index}" for index in range(8))


@pytest.fixture(scope="session")
def simulated_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Study file and results of eight simulated subjects; not to be changed."""
    folder = tmp_path_factory.mktemp("simulated")
    return make_study(folder, n_frames=12, models=FITTED_MODELS, subjects=SUBJECTS, simulated=True)


@pytest.fixture(scope="session")
def simulated(simulated_files: tuple[Path, Path]) -> StudyResults:
    """That study, read, with subjects that differ."""
    results = read_results(read_study(simulated_files[0]), simulated_files[1])
    different = replace(
        results,
        scores=[_of_subject(row, "true_tip_mean_mm") for row in results.scores],
        joint_errors=[_of_subject(row, "error_mm") for row in results.joint_errors],
    )
    return compared(different)


def _of_subject(row: Row, name: str) -> Row:
    """The row with its number scaled, unevenly from subject to subject."""
    value = row[name]
    return {**row, name: None if value is None else value * (1 + 0.03 * SUBJECTS.index(row["subject"]) ** 2)}


@pytest.fixture(scope="session")
def drawings(simulated: StudyResults) -> dict[str, Drawing]:
    return {drawing.name: drawing for drawing in of_study(simulated)}
