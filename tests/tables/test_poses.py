"""Reading poses tables: segments, blocks, names, hands and refusals."""

from pathlib import Path

import numpy as np
import pytest

from shukotsu.errors import InputError
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import NUMBERS, one_hand, pose_blocks, read_poses, recording_name
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Provenance, write_table, write_table_in_parts

NAME = {"subject": "01", "hand": "right", "task": "rom", "trial": ""}


def write(
    path: Path,
    frames_by_segment: dict[str, list[int]],
    times_s: object = None,
    numbers: object = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    group_frames: int | None = None,
    **name: str,
) -> Path:
    """Write a poses table.

    numbers : (7,) or (rows, 7), by default receivers at rest at the origin. group_frames : rows per row
    group, by default all of a segment.
    """
    n_rows = sum(map(len, frames_by_segment.values()))
    poses = np.broadcast_to(np.asarray(numbers), (n_rows, 7))
    times = np.full(n_rows, np.nan) if times_s is None else np.asarray(times_s, float)
    groups, done = [], 0
    for segment, frames in frames_by_segment.items():
        for start in range(0, len(frames), group_frames or len(frames)):
            group = frames[start : start + (group_frames or len(frames))]
            rows = slice(done, done + len(group))
            done = rows.stop
            columns = {"segment": [segment] * len(group), "frame": group, "flags": [""] * len(group)}
            columns |= {"time_s": times[rows], "valid": np.isfinite(poses[rows]).all(-1)}
            groups.append(columns | dict(zip(NUMBERS, poses[rows].T, strict=True)))
    write_table_in_parts(path, POSES, groups, Provenance(parameters=NAME | name))
    return path


def test_a_segment_missing_from_the_file_is_never_valid(tmp_path: Path) -> None:
    poses = read_poses(write(tmp_path / "p.parquet", {"hand": [4, 5]}), ("thumb", "hand"))
    np.testing.assert_array_equal(poses.valid, [[False, True]] * 2)
    assert np.isnan(poses.position_mm[:, poses.index("thumb")]).all()
    nobody = read_poses(tmp_path / "p.parquet", ("thumb",))
    assert nobody.frame.size == 0


@pytest.mark.parametrize("thumb", [[1, 2, 4], [1, 2], [1, 2, 3, 4]])
@pytest.mark.parametrize("block_frames", [2, None])
def test_segments_with_different_frames_are_refused(
    tmp_path: Path, thumb: list[int], block_frames: int | None
) -> None:
    path = write(tmp_path / "p.parquet", {"hand": [1, 2, 3], "thumb": thumb})
    with pytest.raises(InputError, match="has other frames than the other segments; make it again"):
        list(pose_blocks(path, ("hand", "thumb"), block_frames))


def moving(path: Path, frames: int, group_frames: int, lost: slice = slice(0)) -> Path:
    numbers = np.random.default_rng(frames).normal(size=(2, frames, 7))
    numbers[1, lost] = np.nan
    times_s = np.where(np.arange(2 * frames) % 7 == 0, np.nan, np.tile(np.arange(frames) / 240, 2))
    segments = {"hand": list(range(frames)), "thumb": list(range(frames))}
    return write(path, segments, times_s, numbers.reshape(-1, 7), group_frames)


@pytest.mark.parametrize("group_frames", [1, 7, 20])
@pytest.mark.parametrize("block_frames", [1, 6, None])
def test_blocks_do_not_depend_on_row_groups(
    tmp_path: Path, group_frames: int, block_frames: int | None
) -> None:
    """Blocks have the requested size and together are the whole recording, including times and gaps."""
    path = moving(tmp_path / "p.parquet", 20, group_frames, slice(5, 9))
    whole = read_poses(path, ("thumb", "hand"))
    assert not whole.valid[5:9, 0].any()
    assert whole.valid[:, 1].all()
    assert np.isnan(whole.position_mm[5:9, 0]).all()
    np.testing.assert_array_equal(whole.time_s, np.arange(20) / 240)  # some times are in one segment only
    assert np.flatnonzero(np.isnan(read_poses(path, ("hand",)).time_s)).tolist() == [0, 7, 14]
    blocks = list(pose_blocks(path, ("thumb", "hand"), block_frames))
    assert [len(block.frame) for block in blocks[:-1]] == [block_frames] * (len(blocks) - 1)
    for name in ("frame", "time_s", "position_mm", "quaternion", "valid"):
        joined = np.concatenate([getattr(block, name) for block in blocks])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)


def test_the_name_of_a_recording_is_read_from_its_metadata(tmp_path: Path) -> None:
    path = write(tmp_path / "p.parquet", {"hand": [1]}, trial="2")
    assert str(recording_name(path)) == "subject 01, right hand, rom, 2"
    write_table(path, POSES, {column.name: [] for column in POSES.columns}, Provenance())
    with pytest.raises(InputError, match="its metadata lacks 'subject'; make it with"):
        recording_name(path)


def test_all_files_must_be_of_one_hand(tmp_path: Path) -> None:
    right = write(tmp_path / "right.parquet", {"hand": [1]})
    left = write(tmp_path / "left.parquet", {"hand": [1]}, hand="left")
    assert one_hand([right], None, None, None) == Hand("01", "right")
    assert one_hand([], "02", None, "left") == Hand("02", "left")
    with pytest.raises(InputError, match="left hand, rom; expected subject 01, right hand"):
        one_hand([right, left], None, None, None)
    with pytest.raises(InputError, match="expected subject 02, right hand"):
        one_hand([right], "02", None, None)
    with pytest.raises(InputError, match="--subject and --hand must state whose hand it is"):
        one_hand([], "02", None, None)
    with pytest.raises(InputError, match=r"absent.parquet: no such file; expected a poses table"):
        one_hand([tmp_path / "absent.parquet"], "02", None, None)
