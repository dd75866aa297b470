"""Simulated anatomy is used by the simulator only, which uses no expectation of the estimators."""

import pytest
from program_files import REPOSITORY, program_files


def readers_of(module: str) -> set[str]:
    """Return the folders (two levels) with modules that mention the anatomy module."""
    return {
        "/".join(path.relative_to(REPOSITORY).parts[:-1][:2])
        for path in program_files(suffix=".py")
        if path.stem != module and module in path.read_text("utf-8")
    }


def test_no_estimator_uses_the_simulators_anatomy() -> None:
    assert readers_of("drawn_hands") == {"shukotsu/simulate"}


@pytest.mark.parametrize("module", ["average_hand", "known_digits"])
def test_the_simulator_uses_no_expectation_of_the_estimators(module: str) -> None:
    assert "shukotsu/simulate" not in readers_of(module)
