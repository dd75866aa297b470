"""The motion drawn by the viewer equals that of simulated hands with known joints."""

import numpy as np
import pytest
from report_samples.made_study import UNSEEN, MadeStudy, exact_hand

from shukotsu.report import recording_results
from shukotsu.report.hand_motion import HandMotion, view_points
from shukotsu.simulate.random_hand import BONES
from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import TIPS

LAYOUT = read_layout("liberty16")
GAP = list(range(UNSEEN.start, UNSEEN.stop))
SIDES = pytest.mark.parametrize("side", ["right", "left"])


def points_of(motion: HandMotion, name: str) -> np.ndarray:
    """Return the positions (T, 3) in mm of a point of the motion's only skeleton."""
    skeleton = motion.skeletons[0]
    return np.asarray(skeleton.position_mm[:, skeleton.points.index(name)])


@SIDES
@pytest.mark.parametrize("segment", ["hand", "thumb_metacarpal", "index_proximal", "little_distal"])
def test_joints_of_a_replayed_skeleton_are_the_true_ones(study: MadeStudy, side: str, segment: str) -> None:
    joint = (
        "wrist" if segment == "hand" else next(j.name for j in LAYOUT.joints.values() if j.child == segment)
    )
    true = exact_hand(side, 300)[0].truth.bone_position_mm[:, BONES.index(segment)]
    np.testing.assert_allclose(points_of(study.motion(side, "paper-fig4"), joint), true, atol=1e-6)


def test_frames_without_a_needed_receiver_are_gaps(study: MadeStudy) -> None:
    motion = study.motion("right", "paper-fig4")
    for point in ("index_tip", "index_dip"):
        gap = np.isnan(points_of(motion, point)).all(-1)
        assert np.flatnonzero(gap).tolist() == GAP, point
    assert np.isfinite(points_of(motion, "index_pip")).all()


@SIDES
def test_a_fitted_hand_moves_as_posed(study: MadeStudy, side: str) -> None:
    motion, truth = study.motion(side, "whole-hand"), exact_hand(side, 300)[0].truth
    for joint in ("thumb_mcp", "ring_cmc", "little_dip"):
        bone = BONES.index(LAYOUT.joints[joint].child)
        np.testing.assert_allclose(points_of(motion, joint), truth.bone_position_mm[:, bone], atol=1e-9)
    np.testing.assert_allclose(points_of(motion, "middle_tip"), truth.tip_mm[:, 2], atol=1e-9)
    assert np.flatnonzero(np.isnan(points_of(motion, "index_pip")[:, 0])).tolist() == GAP


@pytest.mark.parametrize("model", ["paper-fig4", "whole-hand"])
def test_tip_errors_equal_those_of_the_replay(study: MadeStudy, model: str) -> None:
    (skeleton,) = study.motion("right", model).skeletons
    rows = study.rows(TIPS, model, digit="middle")
    np.testing.assert_allclose(skeleton.tip_error_mm[:, 2], [row["error_mm"] for row in rows], atol=1e-9)


@SIDES
def test_the_view_is_upright_and_not_mirrored(study: MadeStudy, side: str) -> None:
    motion = study.motion(side, "whole-hand")
    skeleton, frames = motion.skeletons[0], np.arange(len(motion.frame))
    places = np.nanmean(view_points(motion, frames, skeleton.position_mm), axis=0)
    at = dict(zip(skeleton.points, places, strict=True))
    assert at["middle_pip"][1] > at["middle_mcp"][1] + 20 > at["wrist"][1] + 60
    to_the_right = at["thumb_mcp"][0] - at["little_mcp"][0]
    assert to_the_right < -30 if side == "right" else to_the_right > 30
    receivers = view_points(motion, frames, motion.receiver_mm)[:, motion.receivers.index("middle_proximal")]
    assert (receivers[:, 2] > at["middle_mcp"][2] - 30).all()


def test_a_long_recording_is_thinned_and_keeps_its_frame_numbers(
    study: MadeStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = study.motion("right", "paper-fig4")
    monkeypatch.setattr(recording_results, "MOST_FRAMES", 50)
    thin = study.motion("right", "paper-fig4")
    assert (thin.every, len(thin.frame)) == (6, 50)
    assert thin.frame[:3].tolist() == [1, 7, 13]
    np.testing.assert_array_equal(thin.skeletons[0].position_mm, motion.skeletons[0].position_mm[::6])
    np.testing.assert_array_equal(thin.receiver_mm, motion.receiver_mm[::6])
