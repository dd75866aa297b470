"""Reading poses tables: names, hands, and files that are not what they should be."""

from pathlib import Path

import numpy as np
import pytest

from schemas.catalogue import POSES
from schemas.errors import InputError
from schemas.poses import one_hand, pose_blocks, read_poses, recording_name, usable_poses
from schemas.tables import Provenance, write_failure, write_table

NAME = {"subject": "01", "hand": "right", "task": "rom", "trial": ""}


def write(
    path: Path,
    frames_by_segment: dict[str, list[int]],
    times_s: list[float | None] | None = None,
    **name: str,
) -> Path:
    """Write a poses table of receivers that stand still at the origin."""
    cells = [(segment, frame) for segment, frames in frames_by_segment.items() for frame in frames]
    columns = {
        "segment": [segment for segment, _ in cells],
        "frame": [frame for _, frame in cells],
        "time_s": times_s or [None] * len(cells),
        **dict.fromkeys(("x_mm", "y_mm", "z_mm", "qx", "qy", "qz"), [0.0] * len(cells)),
        "qw": [1.0] * len(cells),
        "valid": [True] * len(cells),
        "flags": [""] * len(cells),
    }
    lengths = [len(frames) for frames in frames_by_segment.values()]
    write_table(path, POSES, columns, Provenance(parameters=NAME | name), row_group_rows=lengths)
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
@pytest.mark.parametrize("block_frames", [1, 2, None])
def test_segments_that_do_not_share_their_frames(
    tmp_path: Path, thumb: list[int], block_frames: int | None
) -> None:
    """A table that no capture wrote is refused and never read out of step."""
    path = write(tmp_path / "p.parquet", {"hand": [1, 2, 3], "thumb": thumb})
    with pytest.raises(InputError, match="does not have the frames of the others; make it again"):
        list(pose_blocks(path, ("hand", "thumb"), block_frames))


def test_a_recordings_name(tmp_path: Path) -> None:
    path = write(tmp_path / "p.parquet", {"hand": [1]}, trial="2")
    assert str(recording_name(path)) == "subject 01, right hand, rom, 2"
    write_table(path, POSES, {column.name: [] for column in POSES.columns}, Provenance())
    with pytest.raises(InputError, match=r"its metadata lacks 'subject'; make it with stages\.capture"):
        recording_name(path)


def test_all_files_must_be_of_one_hand(tmp_path: Path) -> None:
    right = write(tmp_path / "right.parquet", {"hand": [1]})
    left = write(tmp_path / "left.parquet", {"hand": [1]}, hand="left")
    assert one_hand([right], None, None) == ("01", "right")
    assert one_hand([], "02", "left") == ("02", "left")
    with pytest.raises(InputError, match="left hand, rom; expected subject 01, right hand"):
        one_hand([right, left], None, None)
    with pytest.raises(InputError, match="expected subject 02, right hand"):
        one_hand([right], "02", None)
    with pytest.raises(InputError, match="--subject and --hand must say whose hand it is"):
        one_hand([], "02", None)
    with pytest.raises(InputError, match=r"absent.parquet: no such file; expected a poses table"):
        one_hand([tmp_path / "absent.parquet"], "02", None)


def test_usable_files_and_the_reasons_why_others_are_not(tmp_path: Path) -> None:
    good, failed = write(tmp_path / "good.parquet", {"hand": [1]}), tmp_path / "failed.parquet"
    write_failure(failed, POSES, "the reason", Provenance())
    usable, reasons = usable_poses([failed, good, tmp_path / "absent.parquet"])
    assert usable == [good]
    assert reasons[0] == "the reason"
    assert "no such file" in reasons[1]
