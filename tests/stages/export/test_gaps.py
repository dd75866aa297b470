"""Gaps are refused, held, cut or interpolated, as asked; never filled unasked, and always told."""

from __future__ import annotations

import numpy as np
import pytest
from export_samples.moving_fingers import blanked, moving_fingers
from hypothesis import given
from hypothesis import strategies as st

from schemas.errors import InputError
from skeleton.rotations import angle, conjugate, multiply
from stages.export.gaps import POLICIES, closed, find_gaps, with_lost_frames
from stages.export.motion import local_motion

MCP, TIP = 2, 3


def turned_apart_deg(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.degrees(angle(multiply(conjugate(first), second)))


@pytest.mark.parametrize("policy", POLICIES)
def test_a_motion_without_gaps_stays_as_it_is(policy: str) -> None:
    motion = moving_fingers(20)
    assert closed(motion, policy, 0.1) is motion


def test_a_gap_is_refused_with_its_place_and_the_choices() -> None:
    motion = blanked(blanked(moving_fingers(50), np.s_[10:13, MCP]), np.s_[30:31, 0])
    with pytest.raises(InputError) as refused:
        closed(motion, "refuse", 0.1)
    said = str(refused.value)
    assert (
        "subject 01, right hand, wave, made: joint index_mcp has no pose in frames 17 to 19 (0.040 s)" in said
    )
    assert "first of 2 gaps" in said
    assert "--gaps hold, cut or interpolate" in said


def test_lost_frames_are_a_gap_too() -> None:
    motion = moving_fingers(30).take(np.r_[0:10, 13:30])
    (gap,) = find_gaps(motion)
    assert (gap.first, gap.last, gap.joint) == (17, 19, "")
    with pytest.raises(InputError, match=r"the recording lost frames 17 to 19 \(0.040 s\)"):
        closed(motion, "refuse", 0.1)
    found = closed(motion, "interpolate", 0.1)
    np.testing.assert_array_equal(found.frame, moving_fingers(30).frame)
    np.testing.assert_allclose(found.time_s, moving_fingers(30).time_s)
    assert found.whole.all()
    assert not found.receivers.valid[10:13].any()
    assert np.isnan(found.receivers.position_mm[10:13]).all(), "receivers are measured, and never filled"


@pytest.mark.parametrize("policy", ["hold", "interpolate"])
@pytest.mark.parametrize("jump", [10**9, 10**15])
def test_a_wrong_frame_number_fills_no_disk(policy: str, jump: int) -> None:
    motion = moving_fingers(30)
    motion.frame[20:] += jump
    with pytest.raises(InputError, match=r"lost frames \d+ to \d+ .*, more than the 1000000 frames that are"):
        closed(motion, policy, 1e9)
    assert len(closed(motion, "cut", 0.1).frame) == 20


def test_a_hold_keeps_the_posture_while_the_hand_goes_on() -> None:
    motion = moving_fingers(50)
    held = closed(blanked(motion, np.s_[10:20, [MCP, TIP]]), "hold", 0.1)
    local, before = local_motion(held), local_motion(motion)
    assert turned_apart_deg(local.quaternion[9:20, MCP], before.quaternion[9:10, MCP]).max() < 1e-6
    np.testing.assert_allclose(
        local.offset_mm[9:20, MCP], before.offset_mm[9:10, MCP].repeat(11, 0), atol=1e-9
    )
    assert np.linalg.norm(held.position_mm[19, MCP] - held.position_mm[9, MCP]) > 1, (
        "but in the world it moves"
    )
    known = np.r_[0:10, 20:50]
    np.testing.assert_array_equal(held.position_mm[known], motion.position_mm[known])
    assert held.notes == (
        "1 gaps (10 frames, the longest 0.110 s) filled by the pose before, held in the frame of the bone "
        "before",
    )


def test_a_hold_at_the_start_takes_the_pose_after() -> None:
    motion = moving_fingers(20)
    held = closed(blanked(motion, np.s_[0:5]), "hold", 0.1)
    np.testing.assert_allclose(held.position_mm[:5], motion.position_mm[5:6].repeat(5, 0), atol=1e-9)
    late = closed(blanked(motion, np.s_[15:20]), "hold", 0.1)
    np.testing.assert_allclose(late.position_mm[15:], motion.position_mm[14:15].repeat(5, 0), atol=1e-9)


def test_a_cut_leaves_the_longest_whole_stretch() -> None:
    motion = blanked(blanked(moving_fingers(50), np.s_[0:2, TIP]), np.s_[20:21, MCP])
    found = closed(motion, "cut", 0.1)
    np.testing.assert_array_equal(found.frame, np.arange(21, 50) + 7)
    assert found.whole.all()
    assert found.notes == (
        "gaps cut: frames 28 to 56 stay, the longest stretch without a gap (29 of 50); cut away: 7-27",
    )


def test_a_cut_does_not_join_over_lost_frames() -> None:
    found = closed(moving_fingers(30).take(np.r_[0:10, 13:30]), "cut", 0.1)
    np.testing.assert_array_equal(found.frame, np.arange(13, 30) + 7)


def test_an_interpolation_is_near_the_truth_and_keeps_what_is_known() -> None:
    motion = moving_fingers(80)
    found = closed(blanked(motion, np.s_[30:35, [MCP, TIP]]), "interpolate", 0.1)
    np.testing.assert_allclose(found.position_mm, motion.position_mm, atol=0.05)
    assert turned_apart_deg(found.quaternion, motion.quaternion).max() < 0.2
    known = np.r_[0:30, 35:80]
    np.testing.assert_array_equal(found.quaternion[known], motion.quaternion[known])
    assert "filled between the poses before and after" in found.notes[-1]


def test_a_gap_that_is_too_long_or_open_is_not_interpolated() -> None:
    motion = moving_fingers(50)
    with pytest.raises(InputError, match=r"longer than --max-gap-s 0.1; raise it"):
        closed(blanked(motion, np.s_[10:25, MCP]), "interpolate", 0.1)
    assert closed(blanked(motion, np.s_[10:25, MCP]), "interpolate", 0.2).whole.all()
    for end in (slice(0, 3), slice(47, 50)):
        with pytest.raises(InputError, match="open to one end"):
            closed(blanked(motion, (end, MCP)), "interpolate", 9.0)


def test_what_cannot_be_filled_is_refused() -> None:
    motion = moving_fingers(20)
    with pytest.raises(InputError, match="joint index_mcp has no pose in any of these frames"):
        closed(blanked(motion, np.s_[0:20, MCP]), "hold", 0.1)
    with pytest.raises(InputError, match="--gaps cut leaves nothing"):
        closed(blanked(motion, np.s_[0:20, MCP]), "cut", 0.1)
    with pytest.raises(InputError, match="no frame to export"):
        closed(motion.take(slice(0, 0)), "hold", 0.1)


@given(
    st.lists(st.tuples(st.integers(0, 39), st.integers(1, 6), st.integers(0, 5)), max_size=6),
    st.sets(st.integers(1, 38), max_size=8),
    st.sampled_from(["hold", "cut"]),
)
def test_no_gap_is_left_and_known_poses_stay(
    holes: list[tuple[int, int, int]], lost: set[int], policy: str
) -> None:
    motion = moving_fingers(40, slip_mm=0.5)
    spoiled = motion
    for start, length, joint in holes:
        spoiled = blanked(spoiled, np.s_[start : start + length, joint])
    spoiled = spoiled.take(np.array([i for i in range(40) if i not in lost]))
    if not spoiled.known.any(0).all() or (policy == "cut" and not spoiled.whole.any()):
        return
    found = closed(spoiled, policy, 0.1)
    assert found.whole.all()
    assert not find_gaps(found)
    for row, frame in enumerate(found.frame):
        was = np.flatnonzero(spoiled.frame == frame)
        known = spoiled.known[was[0]] if len(was) else np.zeros(6, bool)
        np.testing.assert_array_equal(found.position_mm[row, known], motion.position_mm[frame - 7, known])
    np.testing.assert_allclose(np.linalg.norm(found.quaternion, axis=-1), 1, atol=1e-9)


def test_lost_frames_of_a_thinned_recording_are_found_by_its_usual_step() -> None:
    thinned = moving_fingers(60).take(slice(0, 60, 3))
    assert not find_gaps(thinned)
    assert len(with_lost_frames(thinned.take(np.r_[0:5, 7:20])).frame) == 20
