"""The accuracy benchmark's own mathematics: errors against known values, what is injected."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.accuracy import accuracy_tables, estimators, person_result
from benchmarks.accuracy.score import (
    JOINT_TYPES,
    PHALANGES,
    BoneError,
    Centre,
    Estimate,
    HandScore,
    JointError,
    coverage,
    joint_error,
    phalanges_mm,
    score,
)
from benchmarks.accuracy.tip_scores import TOUCHED, TRUE
from benchmarks.accuracy.trials import FULL, Trial, record
from shukotsu.stages.simulate.simulated_truth import TrueJoint

N = 480
X, Y, Z = np.eye(3)


def true_joint() -> TrueJoint:
    nothing = np.zeros(N)
    return TrueJoint("index_dip", "index_middle", "index_distal", 1, 5 * X, -8 * X, Y, Y, 60.0, nothing)


@pytest.fixture(scope="module")
def trial() -> Trial:
    return record(3, "left", FULL, N)


def truth_as_estimate(trial: Trial) -> Estimate:
    centres = {
        name: Centre(joint.parent_mm, joint.child_mm, np.eye(6), -joint.axis_child)
        for name, joint in trial.truth.joints.items()
        if joint.parent_segment
    }
    return Estimate(centres, 0.5, phalanges_mm(centres), {"ring_metacarpal": 2.0})


def test_an_error_is_split_along_and_across_the_axis() -> None:
    off = joint_error(true_joint(), Centre(5 * X, -8 * X + [3.0, -4.0, 12.0]), hinge=True)
    assert (off.child_mm, off.along_mm, off.across_mm) == pytest.approx((13.0, 4.0, math.hypot(3, 12)))
    assert math.isnan(off.axis_deg)
    assert off.in_radius is None


def test_coverage_is_that_of_the_stated_covariance() -> None:
    """Errors drawn from a covariance are in its 95 % ellipsoid 95 % of the time; round ones in the radius."""
    rng = np.random.default_rng(0)
    root = rng.standard_normal((6, 6))
    covariance = root @ root.T
    drawn = rng.standard_normal((4000, 6)) @ root.T
    inside = [coverage(e[:3], e[3:], covariance)[1] for e in drawn]
    assert np.mean([share for share in inside if share is not None]) == pytest.approx(0.95, abs=0.01)
    radius = [coverage(e[:3], 0 * e[3:], np.eye(6))[0] for e in rng.standard_normal((4000, 6))]
    assert np.mean(radius) == pytest.approx(0.95, abs=0.015)
    assert coverage(X, X, np.diag([1.0, 1, 1, 1, 0, 1]))[1] is None


def test_the_truth_has_no_error(trial: Trial) -> None:
    """But that a bone between two centres, each a mean over a tilting receiver's frames, is a bit short."""
    found = score("truth", trial, truth_as_estimate(trial))
    assert len(found.joints) == 15
    assert max(joint.child_mm for joint in found.joints) == 0.0
    assert max(abs(bone.percent) for bone in found.bones) < 0.5
    assert len(found.bones) == len(PHALANGES) == 9
    hinges = [joint.axis_deg for joint in found.joints if np.isfinite(joint.axis_deg)]
    assert len(hinges) == 9
    assert max(hinges) < 1e-6


def made_up(estimator: str, off_mm: float) -> HandScore:
    joints = [name for members in JOINT_TYPES.values() for name in members]
    errors = tuple(JointError(name, off_mm, 0.0, off_mm, 3.0, 1.0, 0.5) for name in joints)
    return HandScore(estimator, errors, (BoneError("index_proximal", -2.0, 1.0),), (1.5,), 0.5)


def test_a_person_is_scored_hand_by_hand() -> None:
    wanted = (estimators.PAPER, estimators.WHOLE, estimators.BOTH)
    found = person_result(3, FULL, wanted, N)
    assert sorted(one.estimator for one in found.scores) == sorted(2 * wanted)
    for one in found.scores:
        assert len(one.joints) == 15
        assert all(np.isfinite(joint.child_mm) for joint in one.joints)
        assert {*PHALANGES} <= {bone.bone for bone in one.bones}
    right, left = (one for one in found.scores if one.estimator == estimators.WHOLE)
    assert right.palm_deg != left.palm_deg
    assert all(0 < degrees < 20 for degrees in (*right.palm_deg, *left.palm_deg))
    assert {tip.digit for tip in found.tips} == {"thumb", "index", "middle", "ring", "little"}
    true, touched, fitted = (
        np.mean([tip.mean_mm for tip in found.tips if tip.skeleton == skeleton])
        for skeleton in (TRUE, TOUCHED, estimators.WHOLE)
    )
    assert true < touched < fitted
    assert len(accuracy_tables.tip_table(found.tips, "one person").rows) == 9


def test_every_estimator_has_a_row() -> None:
    scores = {name: [made_up(name, 2.0)] for name in estimators.OURS}
    table = accuracy_tables.estimator_table(FULL.name, scores, "one person")
    assert [row[0] for row in table.rows] == [*estimators.OURS]
    by_scenario = {FULL.name: scores, "another": scores}
    assert len(accuracy_tables.length_table(by_scenario, estimators.OURS, "one person").rows) == 2 * len(
        scores
    )
