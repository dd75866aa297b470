"""The drawn hands: read by the simulator alone, which reads nothing that an estimator reads."""

import pytest
from program_files import REPOSITORY, program_files


def readers_of(module: str) -> set[str]:
    """Folders of two levels whose modules name the anatomy module."""
    return {
        "/".join(path.relative_to(REPOSITORY).parts[:-1][:2])
        for path in program_files(suffix=".py")
        if path.stem != module and module in path.read_text("utf-8")
    }


def test_no_estimator_reads_whom_the_simulator_draws() -> None:
    assert readers_of("drawn_hands") == {"shukotsu/simulate"}


@pytest.mark.parametrize("module", ["average_hand", "known_digits"])
def test_the_simulator_reads_nothing_that_estimators_expect(module: str) -> None:
    assert "shukotsu/simulate" not in readers_of(module)
