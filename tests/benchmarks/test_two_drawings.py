"""The benchmark of two drawings: what its numbers are."""

from itertools import product

import numpy as np
import pytest

from benchmarks.two_drawings import (
    OTHER,
    OWN,
    WITHOUT,
    JointErrors,
    expected_calibration_error,
    one_hand,
    shared_table,
)


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
    rows = {row[:2]: row for row in shared_table(joints, []).rows}
    mean, share, far = rows[OWN, "index_pip"][2:5], rows[OWN, "index_pip"][6], rows[OWN, "index_pip"][7]
    assert mean == pytest.approx((0.0, 1.0, 0.0), abs=0.25)
    assert share == pytest.approx(100 * 1.0 / 1.75, abs=12)
    assert far == "x"
    assert rows[OTHER, "ring_dip"][7] == ""


@pytest.mark.parametrize("drawing", [OWN, OTHER])
def test_a_hand_without_skin_is_nearer_to_its_truth(drawing: str) -> None:
    errors_mm = {}
    for without in ("", "skin"):
        assert without in {"", *WITHOUT[drawing]}
        joints, lengths = one_hand(drawing, 3, without)
        assert len(joints) == 15
        assert {kind for _, kind, *_ in lengths} == {"metacarpal", "proximal", "middle"}
        errors_mm[without] = np.mean([own.child_mm for own in joints])
    assert errors_mm["skin"] < errors_mm[""] < 4.0
