"""Reading poses tables: names, hands, and files that are not what they should be."""

import os
from pathlib import Path

import numpy as np
import pytest

from schemas import poses as poses_module
from schemas.catalogue import POSES, PROBLEMS
from schemas.errors import InputError, TableError
from schemas.poses import (
    frame_count,
    one_hand,
    pose_blocks,
    poses_reader,
    read_poses,
    recording_name,
    usable_poses,
)
from schemas.study import Hand
from schemas.tables import Provenance, columns_from_rows, write_failure, write_table, write_table_in_parts

NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
NAME = {"subject": "01", "hand": "right", "task": "rom", "trial": ""}


def write(
    path: Path,
    frames_by_segment: dict[str, list[int]],
    times_s: object = None,
    numbers: object = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    group_frames: int | None = None,
    **name: str,
) -> Path:
    """Write a poses table; numbers : (7,) or (rows, 7), by default receivers that stand still at the origin.

    group_frames : rows of a row group, by default a segment's.
    """
    n_rows = sum(map(len, frames_by_segment.values()))
    poses = np.broadcast_to(np.asarray(numbers), (n_rows, 7))
    times = np.full(n_rows, np.nan) if times_s is None else np.asarray(times_s, float)
    groups, done = [], 0
    for segment, frames in frames_by_segment.items():
        for start in range(0, len(frames), group_frames or len(frames)):
            own = frames[start : start + (group_frames or len(frames))]
            rows = slice(done, done + len(own))
            done = rows.stop
            columns = {"segment": [segment] * len(own), "frame": own, "flags": [""] * len(own)}
            columns |= {"time_s": times[rows], "valid": np.isfinite(poses[rows]).all(-1)}
            groups.append(columns | dict(zip(NUMBERS, poses[rows].T, strict=True)))
    write_table_in_parts(path, POSES, groups, Provenance(parameters=NAME | name))
    return path


def test_a_recording_without_rows_gives_one_empty_block(tmp_path: Path) -> None:
    poses = read_poses(write(tmp_path / "p.parquet", {}), ("hand", "thumb"))
    assert poses.position_mm.shape == (0, 2, 3)
    assert poses.quaternion.shape == (0, 2, 4)
    assert poses.segments == ("hand", "thumb")


def test_a_segment_that_the_file_lacks_is_never_valid(tmp_path: Path) -> None:
    poses = read_poses(write(tmp_path / "p.parquet", {"hand": [4, 5]}), ("thumb", "hand"))
    np.testing.assert_array_equal(poses.valid, [[False, True]] * 2)
    assert np.isnan(poses.position_mm[:, poses.index("thumb")]).all()
    nobody = read_poses(tmp_path / "p.parquet", ("thumb",))
    assert nobody.frame.size == 0


def test_a_frames_time_is_that_of_the_first_segment_that_has_one(tmp_path: Path) -> None:
    times = [None, 0.2, None, 0.1, 9.0, None]
    path = write(tmp_path / "p.parquet", {"hand": [1, 2, 3], "thumb": [1, 2, 3]}, times)
    np.testing.assert_array_equal(read_poses(path, ("hand", "thumb")).time_s, [0.1, 0.2, np.nan])


@pytest.mark.parametrize("thumb", [[1, 2, 4], [1, 2], [1, 2, 3, 4]])
@pytest.mark.parametrize("block_frames", [2, None])
def test_segments_that_do_not_share_their_frames(
    tmp_path: Path, thumb: list[int], block_frames: int | None
) -> None:
    """A table that no capture wrote is refused and never read out of step."""
    path = write(tmp_path / "p.parquet", {"hand": [1, 2, 3], "thumb": thumb})
    with pytest.raises(InputError, match="does not have the frames of the others; make it again"):
        list(pose_blocks(path, ("hand", "thumb"), block_frames))


def moving(path: Path, frames: int, group_frames: int, lost: slice = slice(0)) -> Path:
    """Write two receivers that move; frames `lost` lack the thumb, each seventh row its time."""
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
    """Blocks of the size asked for, which together are the whole recording, times and gaps too."""
    path = moving(tmp_path / "p.parquet", 20, group_frames, slice(5, 9))
    whole = read_poses(path, ("thumb", "hand"))
    assert not whole.valid[5:9, 0].any()
    assert whole.valid[:, 1].all()
    assert np.isnan(whole.position_mm[5:9, 0]).all()
    np.testing.assert_array_equal(whole.time_s, np.arange(20) / 240)  # where one lacks it, the other's
    assert np.flatnonzero(np.isnan(read_poses(path, ("hand",)).time_s)).tolist() == [0, 7, 14]
    blocks = list(pose_blocks(path, ("thumb", "hand"), block_frames))
    assert [len(block.frame) for block in blocks[:-1]] == [block_frames] * (len(blocks) - 1)
    for name in ("frame", "time_s", "position_mm", "quaternion", "valid"):
        joined = np.concatenate([getattr(block, name) for block in blocks])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)


def test_frames_are_counted(tmp_path: Path) -> None:
    assert frame_count(moving(tmp_path / "p.parquet", 20, 8, slice(5, 9))) == 20
    assert frame_count(write(tmp_path / "empty.parquet", {})) == 0


def test_a_damaged_column_is_said(tmp_path: Path) -> None:
    path = moving(tmp_path / "p.parquet", 2000, 2000)
    content = bytearray(path.read_bytes())
    content[4:100_000] = bytes(100_000 - 4)
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"p\.parquet: damaged Parquet file"):
        read_poses(path, ("hand", "thumb"))


def test_recordings_are_kept_until_they_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same arrays, which nobody can write to; another file under the same name is read again."""
    path = moving(tmp_path / "p.parquet", 20, 20)
    first = read_poses(path, ("hand", "thumb"))
    assert read_poses(path, ("hand", "thumb")) is first
    assert read_poses(path, ("thumb",)).segments == ("thumb",)
    with pytest.raises(ValueError, match="read-only"):
        first.position_mm[0] = 0.0
    moving(path, 30, 30)
    assert len(read_poses(path, ("hand", "thumb")).frame) == 30
    others = [moving(tmp_path / f"{n}.parquet", 20, 20) for n in range(6)]
    size = sum(array.nbytes for array in (first.frame, first.time_s, first.position_mm)) * 3
    monkeypatch.setattr(poses_module, "KEPT_BYTES", 4 * size)
    kept = [read_poses(other, ("hand", "thumb")) for other in others]
    assert read_poses(others[-1], ("hand", "thumb")) is kept[-1]
    assert read_poses(others[0], ("hand", "thumb")) is not kept[0]
    monkeypatch.setattr(poses_module, "KEPT_BYTES", 100)
    assert read_poses(others[1], ("thumb",)) is not read_poses(others[1], ("thumb",))


def test_a_recordings_name(tmp_path: Path) -> None:
    path = write(tmp_path / "p.parquet", {"hand": [1]}, trial="2")
    assert str(recording_name(path)) == "subject 01, right hand, rom, 2"
    write_table(path, POSES, {column.name: [] for column in POSES.columns}, Provenance())
    with pytest.raises(InputError, match=r"its metadata lacks 'subject'; make it with stages\.capture"):
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
    with pytest.raises(InputError, match="--subject and --hand must say whose hand it is"):
        one_hand([], "02", None, None)
    with pytest.raises(InputError, match=r"absent.parquet: no such file; expected a poses table"):
        one_hand([tmp_path / "absent.parquet"], "02", None, None)


def test_usable_files_and_the_reasons_why_others_are_not(tmp_path: Path) -> None:
    """A recorded failure is a reason; what is no poses table is refused."""
    good, failed = write(tmp_path / "good.parquet", {"hand": [1]}), tmp_path / "failed.parquet"
    write_failure(failed, POSES, "the reason", Provenance())
    assert usable_poses([failed, good]) == ([good], ["the reason"])
    with pytest.raises(TableError, match="no such file; expected a poses table"):
        usable_poses([good, tmp_path / "absent.parquet"])


def test_a_reader_gives_the_recordings_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Short ones with all segments, and the same arrays again; of long ones what is asked for."""
    paths = [moving(tmp_path / f"{n}.parquet", n, n) for n in (20, 30)]
    reader = poses_reader(paths, ("hand", "thumb"))
    short = list(reader("thumb"))
    assert [len(poses.frame) for poses in short] == [20, 30]
    assert [poses.segments for poses in short] == [("hand", "thumb")] * 2
    assert list(reader("hand"))[1] is short[1]
    monkeypatch.setattr(poses_module, "KEPT_BYTES", 4 * 25 * 2 * poses_module.BYTES_A_POSE)
    assert [poses.segments for poses in reader("thumb")] == [("hand", "thumb"), ("thumb",)]
    np.testing.assert_array_equal(list(reader("thumb"))[1].position_mm[:, 0], short[1].position_mm[:, 1])


@pytest.mark.parametrize("spoil", ["text", "other", "absent", "folder", "pipe"])
def test_a_name_is_of_a_poses_table(tmp_path: Path, spoil: str) -> None:
    path = tmp_path / "p.parquet"
    if spoil == "text":
        path.write_text("frame,time_s")
    elif spoil == "other":
        write_table(path, PROBLEMS, columns_from_rows(PROBLEMS, []), Provenance())
    elif spoil == "folder":
        path.mkdir()
    elif spoil == "pipe":
        os.mkfifo(path)
    said = {
        "text": "not a readable Parquet file",
        "other": "is a problems table; expected poses",
        "absent": "no such file; expected a poses table",
        "folder": "is a folder; expected a poses table, a regular file",
        "pipe": "is a pipe; expected a poses table, a regular file",
    }
    with pytest.raises(TableError, match=rf"p\.parquet: {said[spoil]}"):
        recording_name(path)


def test_a_failed_import_still_has_its_name(tmp_path: Path) -> None:
    write_failure(tmp_path / "p.parquet", POSES, "the reason", Provenance(parameters=NAME))
    assert str(recording_name(tmp_path / "p.parquet")) == "subject 01, right hand, rom"
