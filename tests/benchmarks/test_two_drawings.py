"""The benchmark of two drawings: what its numbers are."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import two_drawings
from benchmarks.two_drawings import DRAWINGS, OTHER, OWN, errors_table, joint_errors, one_hand
from shukotsu.schemas.layout import read_layout
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.simulate.simulation import LAYOUT


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


def test_an_error_is_that_of_what_the_fit_says() -> None:
    """With a truth that is 5 % larger than the hand, errors grow."""
    drawn = DRAWINGS[OWN](3, "right")
    fit = fit_hand([drawn.poses], read_layout(LAYOUT), drawn.hand)
    larger = replace(drawn, truth={name: 1.05 * truth for name, truth in drawn.truth.items()})
    one, other = (np.median([own.worse_mm for own in joint_errors(OWN, d, fit)]) for d in (drawn, larger))
    assert one + 0.3 < other
