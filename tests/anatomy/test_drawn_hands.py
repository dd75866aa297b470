"""The drawn hands: read by the simulator alone, which reads nothing that an estimator reads."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("anatomy", "checks", "schemas", "skeleton", "stages", "trackers", "workflow")


def readers_of(module: str) -> set[str]:
    """Folders of two levels whose modules name the anatomy module."""
    paths = (path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    return {
        "/".join(path.relative_to(ROOT).parts[:2])
        for path in paths
        if path.stem != module and module in path.read_text("utf-8")
    }


def test_no_estimator_reads_whom_the_simulator_draws() -> None:
    assert readers_of("drawn_hands") - {"anatomy/average_hand.py"} == {"stages/simulate"}


@pytest.mark.parametrize("module", ["average_hand", "known_digits", "anatomy.skin"])
def test_the_simulator_reads_nothing_that_estimators_expect(module: str) -> None:
    assert "stages/simulate" not in readers_of(module)
