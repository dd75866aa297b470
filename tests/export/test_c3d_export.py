"""C3D export: points and rotations as read by ezc3d and by the package c3d."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_fingers import blanked, moving_fingers, timed
from program_files import printed_by
from simulated_hands import FITTED, SimulatedHand

from shukotsu.errors import InputError
from shukotsu.export.c3d_file import write
from shukotsu.export.exported_motion import with_seen_receivers
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import angle, conjugate, from_matrix, matrix, multiply

NEAR_MM, NEAR_DEG = 1e-3, 1e-3


def read(path: Path) -> Any:
    import ezc3d

    return ezc3d.c3d(str(path))


def points_of(motion: PosedRecording) -> np.ndarray:
    """Return the expected points (T, P, 3) in mm, computed independently of the writer."""
    there = motion.receivers
    parts = [motion.position_mm]
    for index in range(len(there.segments)):
        origin, turn = there.position_mm[:, index], matrix(there.quaternion[:, index])
        parts += [np.stack([origin, *(origin + 20 * turn[..., axis] for axis in range(3))], 1)]
    return np.concatenate(parts, 1)


def check_numbers(content: Any, motion: PosedRecording) -> None:
    """Check that points (T, P, 3) and rotations (T, R, 4, 4) are those of the motion, including gaps."""
    points, rotations = content
    np.testing.assert_allclose(points, points_of(motion), rtol=0, atol=NEAR_MM)
    bones = [index for index, joint in enumerate(motion.joints) if not joint.tip]
    there = motion.receivers
    position_mm = np.concatenate([motion.position_mm[:, bones], there.position_mm], 1)
    turn = np.concatenate([motion.quaternion[:, bones], there.quaternion], 1)
    posed = np.isfinite(position_mm).all(-1) & np.isfinite(turn).all(-1)
    np.testing.assert_array_equal(np.isfinite(rotations).all((-1, -2)), posed)
    np.testing.assert_allclose(rotations[posed][:, :3, 3], position_mm[posed], rtol=0, atol=NEAR_MM)
    np.testing.assert_array_equal(rotations[posed][:, 3], [[0, 0, 0, 1]] * posed.sum())
    off = angle(multiply(conjugate(from_matrix(rotations[posed][:, :3, :3])), turn[posed]))
    assert np.degrees(off).max(initial=0) < NEAR_DEG


def numbers(path: Path) -> tuple[np.ndarray, np.ndarray]:
    data = read(path)["data"]
    return data["points"].transpose(2, 1, 0)[:, :, :3], data["rotations"].transpose(3, 2, 0, 1)


@pytest.mark.slow
def test_another_reader_reads_the_same_points(
    right: SimulatedHand, tmp_path: Path, export_tool: Callable[..., Path]
) -> None:
    """The reader is the package c3d, which shares no code with ezc3d."""
    python = export_tool("python/bin/python", "c3d")
    code = (
        "import c3d, sys, numpy as np\n"
        "frames = [(n, p) for n, p, _ in c3d.Reader(open(sys.argv[1], 'rb')).read_frames()]\n"
        "np.savez(sys.argv[2], frame=[n for n, _ in frames], points=np.stack([p for _, p in frames]))\n"
    )
    gap, _ = with_seen_receivers(right.motion(FITTED))
    gap.position_mm[3, 4] = np.nan
    for motion in (gap, moving_fingers(20_000, rate_hz=240)):
        write(motion, tmp_path / "a.c3d")
        printed_by(python, "-W", "ignore", "-c", code, tmp_path / "a.c3d", tmp_path / "a.npz")
        content = np.load(tmp_path / "a.npz")
        expected = points_of(motion)
        seen = np.isfinite(expected).all(-1)
        np.testing.assert_array_equal(content["points"][..., 3], np.where(seen, 0, -1))
        np.testing.assert_allclose(content["points"][..., :3][seen], expected[seen], rtol=0, atol=NEAR_MM)
        assert np.diff(content["frame"]).tolist() == [1] * (len(motion.frame) - 1)


@settings(max_examples=12)
@given(
    st.integers(12, 40),
    st.integers(0, 9),
    st.floats(0, 0.6),
    st.integers(-3, 3000),
    st.sets(st.integers(1, 10), max_size=3),
)
def test_every_point_and_pose_is_read_back_from_a_c3d(
    tmp_path_factory: pytest.TempPathFactory, frames: int, seed: int, share: float, first: int, lost: set[int]
) -> None:
    """Gaps of joints and receivers are kept; lost frames are present without points."""
    rng, whole = np.random.default_rng(seed), moving_fingers(frames, seed=seed, slip_mm=3)
    whole = blanked(whole, rng.random(whole.known.shape) < share, rng.random((frames, 2)) < share)
    kept = ~np.isin(np.arange(frames), list(lost))
    motion = timed(whole, frame=np.arange(frames) + first).take(kept)
    path = tmp_path_factory.mktemp("any") / "a.c3d"
    dropped = write(motion, path)
    expected, _ = with_seen_receivers(blanked(whole, ~kept, ~kept))
    check_numbers(numbers(path), expected)
    assert read(path)["header"]["points"]["first_frame"] + 1 == max(first, 1)
    assert any("frame numbers" in sentence for sentence in dropped) == (first < 1)


def test_a_gap_has_a_residual_of_minus_one(tmp_path: Path) -> None:
    motion = moving_fingers(4)
    motion.position_mm[1, 2] = np.nan
    write(motion, tmp_path / "a.c3d")
    content = read(tmp_path / "a.c3d")["data"]
    assert np.argwhere(content["meta_points"]["residuals"][0] < 0).tolist() == [[2, 1]]


def test_motions_that_c3d_cannot_hold_are_refused(tmp_path: Path) -> None:
    motion = moving_fingers(40)
    late = np.arange(40) > 20
    uneven = timed(motion, time_s=motion.time_s + np.where(late, 0.004, 0) * np.arange(40))
    for bad, words in (
        (motion.take(slice(0)), "needs at least one frame"),
        (uneven, "resample with --fps"),
        (
            timed(motion, frame=motion.frame + 70_000 * late, time_s=motion.time_s + 700 * late),
            "C3D holds at most 65534",
        ),
    ):
        with pytest.raises(InputError, match=words):
            write(bad, tmp_path / "a.c3d")
    assert not list(tmp_path.iterdir())
