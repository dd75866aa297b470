"""A motion that lies in files and is gone through block by block gives the files that it gives whole."""

from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from hypothesis import given, settings
from hypothesis import strategies as st

from kinematics.rotations import unit
from stages.export import frames
from stages.export.__main__ import write_format
from stages.export.bvh import EulerAngles, euler_zyx_deg
from stages.export.frames import Growing, regrouped, release, slices
from stages.export.motion import Signs, SkeletonMotion, continuous, stiffened
from stages.export.settings import Settings

FORMATS = ("bvh", "csv", "c3d", "glb", "bids")


@pytest.mark.parametrize("model", [REPLAYED, FITTED])
@pytest.mark.parametrize("block_frames", [7, 100])
def test_blocks_give_the_files_of_the_whole(
    right: KnownHand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str, block_frames: int
) -> None:
    """Byte for byte: what is averaged, turned, unwrapped and counted over all frames, too."""
    whole = right.motion(model)
    monkeypatch.setattr(frames, "BLOCK_FRAMES", block_frames)
    monkeypatch.setattr("stages.export.reading.BLOCK_FRAMES", block_frames)
    monkeypatch.setattr(frames, "IN_MEMORY_BYTES", 0)
    motion = right.motion(model)
    for name in ("position_mm", "quaternion", "rest_offset_mm", "rest_rotation", "axis"):
        np.testing.assert_array_equal(getattr(motion, name), getattr(whole, name))
    written(motion, tmp_path / "blocks")
    monkeypatch.undo()
    written(whole, tmp_path / "whole")
    files = {path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*.*")}
    assert len(files) > len(FORMATS)
    for path in files:
        assert (tmp_path / "blocks" / path).read_bytes() == (tmp_path / "whole" / path).read_bytes(), path


def written(motion: SkeletonMotion, folder: Path) -> None:
    """Write a motion in every format that streams."""
    for name in FORMATS:
        place = "bids/dataset_description.json" if name == "bids" else f"a.{name}"
        write_format(motion, Settings(), name, folder / place)


def test_a_joint_that_moves_in_one_block_alone(
    right: KnownHand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has positions in the file like any other that moves, though the last block has it at its place."""
    motion = stiffened(right.motion(REPLAYED))
    motion.position_mm[3, motion.index("index_pip")] += 5.0
    written(motion, tmp_path / "whole")
    monkeypatch.setattr(frames, "BLOCK_FRAMES", 50)
    written(motion, tmp_path / "blocks")
    for name in ("a.glb", "a.bvh"):
        assert (tmp_path / "blocks" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


turns = st.integers(0, 2**32 - 1).map(
    lambda seed: unit(np.cumsum(np.random.default_rng(seed).normal(size=(40, 3, 4)), axis=0))
)


@given(turns, st.integers(1, 41), st.floats(0, 0.9))
@settings(max_examples=40)
def test_signs_and_angles_go_on_from_block_to_block(quaternion: np.ndarray, size: int, gone: float) -> None:
    """Also where poses are missing, of the signs; angles are asked for only where there are none."""
    blocks = [quaternion[rows] for rows in slices(len(quaternion), size)]
    angles = EulerAngles()
    found = np.concatenate([angles.zyx_deg(block) for block in blocks])
    np.testing.assert_array_equal(found, euler_zyx_deg(quaternion))
    missing = quaternion.copy()
    missing[np.random.default_rng(size).random(missing.shape[:2]) < gone] = np.nan
    signs = Signs()
    kept = np.concatenate([signs.continuous(missing[rows]) for rows in slices(len(missing), size)])
    np.testing.assert_array_equal(kept, continuous(missing))


@given(
    st.lists(st.integers(0, 9), min_size=1, max_size=9), st.sampled_from([0, 100, 1 << 20]), st.integers(1, 9)
)
def test_what_grows_in_a_file_is_what_was_put_in(lengths: list[int], memory: int, length: int) -> None:
    parts = [np.random.default_rng(i).normal(size=(n, 2, 3)) for i, n in enumerate(lengths)]
    whole = np.concatenate(parts)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frames, "IN_MEMORY_BYTES", memory)
        grown = Growing()
        for part in parts:
            grown.append(part)
    found = grown.finished()
    np.testing.assert_array_equal(found, whole)
    release(found[1:])
    np.testing.assert_array_equal(found, whole)
    cut = list(regrouped(iter(parts), length))
    assert all(len(part) == length for part in cut[:-1])
    assert not len(whole) or np.array_equal(np.concatenate(cut), whole)
