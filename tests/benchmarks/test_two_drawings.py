"""The benchmark of two drawings: what its numbers are."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from benchmarks.two_drawings import (
    DRAWINGS,
    OTHER,
    OWN,
    JointErrors,
    errors_table,
    expected_calibration_error,
    joint_errors,
    one_hand,
    shared_table,
)
from shukotsu.schemas.layout import read_layout
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.simulate.simulation import LAYOUT


def test_a_stated_error_that_is_true_is_calibrated() -> None:
    rng = np.random.default_rng(0)
    sd_mm = rng.uniform(0.5, 3.0, 4000)
    error_mm = np.linalg.norm(rng.standard_normal((4000, 3)), axis=1) * sd_mm / 3**0.5
    assert expected_calibration_error(error_mm, sd_mm) < 0.02
    assert expected_calibration_error(error_mm, 0.5 * sd_mm) > 0.25


def test_what_all_hands_share_is_told_from_what_they_do_not() -> None:
    """A millimetre to one side in one joint of all hands, beside errors of each hand's own."""
    rng = np.random.default_rng(2)
    joints = []
    for drawing, joint, _ in product((OWN, OTHER), ("index_pip", "ring_dip"), range(40)):
        off_mm = rng.normal(np.array([0.0, joint == "index_pip", 0.0]), 0.5, (2, 3))
        joints.append(JointErrors(drawing, joint, off_mm, 1.0, 1.0, 1.0))
    rows = {row[:2]: row for row in shared_table(joints).rows}
    mean, share, far = rows[OWN, "index_pip"][2:5], rows[OWN, "index_pip"][6], rows[OWN, "index_pip"][7]
    assert mean == pytest.approx((0.0, 1.0, 0.0), abs=0.25)
    assert share == pytest.approx(100 * 1.0 / 1.75, abs=12)
    assert far == "x"
    assert rows[OTHER, "ring_dip"][7] == ""


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
