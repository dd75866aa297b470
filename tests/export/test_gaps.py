"""Closing gaps by each policy, and resampling that preserves velocities and gaps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_fingers import blanked, moving_fingers, timed

from shukotsu.errors import InputError
from shukotsu.export.exported_motion import local_motion
from shukotsu.export.gaps import FILLED_FRAMES, close_gaps, find_gaps, resample_evenly
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import about_axis, angle, conjugate, multiply, unit

MCP, TIP = 2, 3


def test_a_gap_is_refused_with_its_frames_and_the_options() -> None:
    motion = blanked(blanked(moving_fingers(50), np.s_[10:13, MCP]), np.s_[30:31, 0])
    with pytest.raises(InputError) as refused:
        close_gaps(motion, "refuse", 0.1)
    for words in (
        "subject 01, right hand, wave, made: joint index_mcp has no pose in frames 17 to 19 (0.040 s)",
        "first of 2 gaps",
        "--gaps hold, cut or interpolate",
    ):
        assert words in str(refused.value)


def test_a_held_gap_keeps_the_posture_while_the_hand_moves() -> None:
    motion = moving_fingers(50)
    held = close_gaps(blanked(motion, np.s_[10:20, [MCP, TIP]]), "hold", 0.1)
    (local_mm, local), (before_mm, before) = local_motion(held), local_motion(motion)
    assert np.degrees(angle(multiply(conjugate(local[9:20, MCP]), before[9:10, MCP]))).max() < 1e-6
    np.testing.assert_allclose(local_mm[9:20, MCP], before_mm[9:10, MCP].repeat(11, 0), atol=1e-9)
    assert np.linalg.norm(held.position_mm[19, MCP] - held.position_mm[9, MCP]) > 1, (
        "but it moves in the transmitter frame"
    )
    recorded = np.r_[0:10, 20:50]
    np.testing.assert_array_equal(held.position_mm[recorded], motion.position_mm[recorded])
    assert held.notes == (
        "1 gap (10 frames, the longest 0.110 s) filled by holding the pose before it in the parent bone's "
        "frame",
    )


def test_a_cut_leaves_the_longest_complete_part() -> None:
    motion = blanked(blanked(moving_fingers(50), np.s_[0:2, TIP]), np.s_[20:21, MCP])
    rest = close_gaps(motion, "cut", 0.1)
    np.testing.assert_array_equal(rest.frame, np.arange(21, 50) + 7)
    assert rest.whole.all()
    assert rest.notes == (
        "gaps cut: frames 28 to 56 are kept, the longest stretch without a gap (29 of 50); removed: 7-27",
    )


def test_a_long_gap_or_one_at_an_end_is_not_interpolated() -> None:
    motion = moving_fingers(50)
    with pytest.raises(InputError, match=r"longer than --max-gap-s 0.1; raise it"):
        close_gaps(blanked(motion, np.s_[10:25, MCP]), "interpolate", 0.1)
    assert close_gaps(blanked(motion, np.s_[10:25, MCP]), "interpolate", 0.2).whole.all()
    for end in (slice(0, 3), slice(47, 50)):
        with pytest.raises(InputError, match="open to one end"):
            close_gaps(blanked(motion, (end, MCP)), "interpolate", 9.0)


@given(
    st.lists(st.tuples(st.integers(0, 39), st.integers(1, 6), st.integers(0, 5)), max_size=6),
    st.sets(st.integers(1, 38), max_size=8),
    st.sampled_from(["hold", "cut"]),
)
def test_closing_gaps_leaves_none_and_keeps_known_poses(
    holes: list[tuple[int, int, int]], lost: set[int], policy: str
) -> None:
    motion = moving_fingers(40, slip_mm=0.5)
    spoiled = motion
    for start, length, joint in holes:
        spoiled = blanked(spoiled, np.s_[start : start + length, joint])
    spoiled = spoiled.take(np.array([i for i in range(40) if i not in lost]))
    if not spoiled.known.any(0).all() or (policy == "cut" and not spoiled.whole.any()):
        return
    filled = close_gaps(spoiled, policy, 0.1)
    assert filled.whole.all()
    assert not find_gaps(filled)
    for row, frame in enumerate(filled.frame):
        was = np.flatnonzero(spoiled.frame == frame)
        posed = spoiled.known[was[0]] if len(was) else np.zeros(6, bool)
        np.testing.assert_array_equal(filled.position_mm[row, posed], motion.position_mm[frame - 7, posed])
    np.testing.assert_allclose(np.linalg.norm(filled.quaternion, axis=-1), 1, atol=1e-9)


def spinning(time_s: np.ndarray, axis: np.ndarray, speed: float, rate_hz: float) -> PosedRecording:
    """Return a motion with constant velocity along an axis and constant angular velocity about it, in
    rad/s.
    """
    motion = moving_fingers(len(time_s))
    turn = about_axis(axis, speed * time_s)[:, None].repeat(6, 1)
    along_mm = (time_s[:, None, None] * axis * 30).repeat(6, 1)
    return replace(timed(motion, time_s=time_s), rate_hz=rate_hz, position_mm=along_mm, quaternion=turn)


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.floats(-40, 40),
    st.floats(5, 300),
    st.integers(0, 2**31),
)
def test_resampling_preserves_constant_velocities(
    axis: list[float], speed: float, fps: float, seed: int
) -> None:
    """Recorded times are uneven; the bones turn by at most 0.2 rad per frame, and by more than half a
    turn.
    """
    rng = np.random.default_rng(seed)
    time_s = 3 + np.cumsum(rng.uniform(0.002, 0.005, 60))
    along = unit(np.array(axis))
    motion = spinning(time_s, along, speed, 1 / 0.0035)
    other = resample_evenly(motion, fps)
    even_s = time_s[0] + np.arange(len(other.frame)) / fps
    np.testing.assert_allclose(other.time_s, even_s, atol=1e-9)
    assert time_s[-1] - 1 / fps < other.time_s[-1] <= time_s[-1]
    truth = about_axis(along, speed * other.time_s)
    assert angle(multiply(conjugate(truth), other.quaternion[:, 0])).max() < 1e-7
    np.testing.assert_allclose(other.position_mm[:, 3], other.time_s[:, None] * along * 30, atol=1e-9)
    assert (np.sum(other.quaternion[1:] * other.quaternion[:-1], -1) >= -1e-9).all()
    assert other.rate_hz == fps


def test_resampling_to_too_many_frames_is_refused() -> None:
    motion = moving_fingers(100)
    assert len(resample_evenly(motion, 1e4).frame) < FILLED_FRAMES
    with pytest.raises(
        InputError, match=r"--fps: 1e\+06 would make \d{6} frames of .*more than 100000; give a"
    ):
        resample_evenly(motion, 1e6)


def test_no_poses_are_interpolated_across_a_long_time_gap() -> None:
    motion = moving_fingers(100).take(np.r_[0:40, 50:100])
    other = resample_evenly(motion, 30)
    inside = (other.time_s > motion.time_s[39]) & (other.time_s < motion.time_s[40])
    np.testing.assert_array_equal(~other.whole, inside)
    assert not other.receivers.valid[inside].any()
    assert other.receivers.valid[~inside].all()
    assert resample_evenly(motion, 30, widest_s=0.2).whole.all()
