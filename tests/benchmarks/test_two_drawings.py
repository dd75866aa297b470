"""The benchmark of two drawings: what its numbers are."""

import numpy as np
import pytest

from benchmarks import two_drawings
from benchmarks.two_drawings import OTHER, OWN, errors_table, one_hand


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Recordings of a third of the time."""
    monkeypatch.setattr(two_drawings, "DURATION_S", 8.0)


@pytest.mark.parametrize("drawing", [OWN, OTHER])
def test_a_hand_is_held_against_its_truth(drawing: str) -> None:
    joints, lengths = one_hand(drawing, 3)
    assert len(joints) == 15
    assert {kind for _, kind, *_ in lengths} == {"metacarpal", "proximal", "middle"}
    assert 0.3 < np.median([own.child_mm for own in joints]) < 2.0
    (row,) = errors_table(joints, lengths).rows
    assert row[10] == pytest.approx(100 * sum(own.believed for own in joints) / 15)
    assert row[10] > 40
