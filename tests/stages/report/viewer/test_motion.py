"""What is drawn is where the hand is: against simulated hands, whose every joint is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from schemas.errors import InputError
from schemas.layout import FINGER_MM, read_layout
from schemas.model import read_model
from schemas.poses import read_poses
from schemas.verdict import UNJUDGED, judged_joint
from stages.report.belief import NOT
from stages.report.hand_motion import hand_motion, ridden_skeleton, seen, shown_first, thinned
from stages.simulate.random_hand import BONES, DIGITS

LAYOUT = read_layout("liberty16")


def points_of(motion: Any, name: str) -> np.ndarray:
    """Positions (T, 3) of a point of the motion's only skeleton."""
    skeleton = motion.skeletons[0]
    return np.asarray(skeleton.position_mm[:, skeleton.points.index(name)])


@pytest.mark.parametrize("segment", ["hand", "thumb_metacarpal", "index_proximal", "little_distal"])
def test_joints_of_a_replayed_skeleton_are_the_true_ones(known: Any, segment: str) -> None:
    joint = (
        "wrist" if segment == "hand" else next(j.name for j in LAYOUT.joints.values() if j.child == segment)
    )
    true = known.made.truth.bone_position_mm[:, BONES.index(segment)]
    np.testing.assert_allclose(points_of(known.motion("paper-fig4"), joint), true, atol=1e-6)


def test_frames_without_a_valid_receiver_stay_gaps(right: Any) -> None:
    motion = right.motion("paper-fig4")
    for point in ("index_tip", "index_dip"):
        gap = np.isnan(points_of(motion, point)).all(-1)
        assert np.flatnonzero(gap).tolist() == list(range(50, 60)), point
    assert np.isfinite(points_of(motion, "index_pip")).all()


def test_a_fitted_hand_moves_as_its_bones_were_posed(known: Any) -> None:
    motion, truth = known.motion("whole-hand"), known.made.truth
    for joint in ("thumb_mcp", "ring_cmc", "little_dip"):
        bone = BONES.index(LAYOUT.joints[joint].child)
        np.testing.assert_allclose(points_of(motion, joint), truth.bone_position_mm[:, bone], atol=1e-9)
    np.testing.assert_allclose(points_of(motion, "middle_tip"), truth.tip_mm[:, 2], atol=1e-9)
    assert np.flatnonzero(np.isnan(points_of(motion, "index_pip")[:, 0])).tolist() == list(range(50, 60))


def test_tip_errors_are_those_of_the_skeleton_that_is_drawn(right: Any) -> None:
    replayed, fitted = right.motion("paper-fig4", "whole-hand").skeletons
    distal = right.made.distal_mm
    np.testing.assert_allclose(
        replayed.tip_error_mm, np.linalg.norm(right.made.truth.tip_mm - distal, axis=-1), atol=1e-9
    )
    posed = np.arange(5) + np.arange(120)[:, None] / 100
    np.testing.assert_allclose(fitted.posed_error_mm, posed)
    assert replayed.posed_error_mm is None


def test_stated_errors_go_with_their_points(right: Any) -> None:
    replayed, fitted = right.motion("paper-fig4", "whole-hand").skeletons
    sd = dict(zip(fitted.points, fitted.sd_mm, strict=True))
    assert sd["index_pip"] == 1.5
    assert sd["index_tip"] == 2.5
    assert np.isnan(dict(zip(replayed.points, replayed.sd_mm, strict=True))["index_tip"])


def test_digits_start_where_the_model_says(right: Any) -> None:
    replayed, fitted = right.motion("paper-fig4", "whole-hand").skeletons
    starts = [replayed.points[bone.start] for bone in replayed.bones if bone.level == 0]
    assert starts == ["thumb_cmc", "wrist", "wrist", "wrist", "wrist"]
    assert [bone.shared for bone in replayed.bones if bone.level == 0] == [False, True, True, True, True]
    links = [(fitted.points[b.start], fitted.points[b.end]) for b in fitted.bones if b.level < 0]
    assert links == [("wrist", f"{digit}_cmc") for digit in DIGITS]


def test_only_a_model_that_cuts_axes_has_planes(right: Any) -> None:
    replayed, fitted = right.motion("paper-fig4", "whole-hand").skeletons
    planes = {replayed.points[axis.point]: axis.plane_segment for axis in replayed.axes}
    assert planes["index_pip"] == "index_middle"
    assert {axis.plane_segment for axis in fitted.axes} == {""}


def test_a_failed_joint_has_no_place(right: Any) -> None:
    poses = read_poses(right.results().poses(right.recording), LAYOUT.measured)
    model = read_model("paper-fig4")
    errors = np.zeros((len(poses.frame), 5))
    row = {"status": "failed", "child_segment": "", "parent_segment": "", "axis_child_x": None, "sd_mm": None}
    row = judged_joint(row | UNJUDGED, FINGER_MM)
    skeleton = ridden_skeleton(LAYOUT, model, 0, {"ring_pip": row}, errors, poses)
    assert np.isnan(skeleton.position_mm[:, skeleton.points.index("ring_pip")]).all()
    assert skeleton.believed[skeleton.points.index("ring_pip")] == NOT
    assert skeleton.seats[skeleton.points.index("ring_pip")].segment == ""
    assert np.isfinite(skeleton.position_mm[:, skeleton.points.index("ring_tip")]).all()


def test_a_fitted_hand_is_shown_first_and_the_papers_beside_it(right: Any) -> None:
    motion = right.motion("paper-fig3", "paper-fig4", "whole-hand")
    assert shown_first(motion) == (2, 1)
    assert shown_first(right.motion("whole-hand", "paper-fig3", "paper-fig4")) == (0, 2)
    assert shown_first(right.motion("paper-fig3", "paper-fig4")) == (0, 1)
    assert shown_first(replace(motion, paper="")) == (2, 0), "without the paper's the study's first"
    assert shown_first(right.motion("whole-hand")) == (0,)
    empty = replace(motion.skeletons[2], position_mm=np.full_like(motion.skeletons[2].position_mm, np.nan))
    unposed = replace(motion, skeletons=(*motion.skeletons[:2], empty))
    assert shown_first(unposed) == (0, 1), "a hand that was not posed in this recording is not shown first"


def test_the_view_is_upright_and_not_mirrored(known: Any) -> None:
    motion = known.motion("whole-hand")
    skeleton, frames = motion.skeletons[0], np.arange(len(motion.frame))
    places = np.nanmean(seen(motion, frames, skeleton.position_mm), axis=0)
    at = dict(zip(skeleton.points, places, strict=True))
    assert at["middle_pip"][1] > at["middle_mcp"][1] + 20 > at["wrist"][1] + 60
    to_the_right = at["thumb_mcp"][0] - at["little_mcp"][0]
    assert to_the_right < -30 if known.recording.hand.hand == "right" else to_the_right > 30
    receivers = seen(motion, frames, motion.receiver_mm)[:, motion.receivers.index("middle_proximal")]
    assert (receivers[:, 2] > at["middle_mcp"][2] - 30).all()


def test_without_its_base_a_hand_is_refused(right: Any) -> None:
    poses = read_poses(right.results().poses(right.recording), LAYOUT.measured)
    valid = poses.valid.copy()
    valid[:, poses.index("hand")] = False
    with pytest.raises(InputError, match="the receiver of hand has no valid pose"):
        hand_motion("right", LAYOUT, replace(poses, valid=valid), [])


def test_receivers_that_were_not_worn_are_left_out(right: Any) -> None:
    motion = right.motion("paper-fig4")
    assert "forearm" in LAYOUT.measured
    assert motion.receivers == tuple(name for name in LAYOUT.measured if name != "forearm")
    assert motion.receivers[motion.base] == "hand"


def test_a_long_recording_is_thinned_and_keeps_its_frame_numbers(right: Any) -> None:
    motion = right.motion("paper-fig4")
    thin = thinned(motion, 50)
    assert (thin.every, len(thin.frame)) == (3, 40)
    assert thin.frame[:3].tolist() == [1, 4, 7]
    np.testing.assert_array_equal(thin.skeletons[0].position_mm, motion.skeletons[0].position_mm[::3])
    np.testing.assert_array_equal(thin.receiver_mm, motion.receiver_mm[::3])
    assert thinned(motion, 120) is motion
