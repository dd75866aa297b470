"""Damage anywhere in a Parquet file is noticed by every reading function."""

import random
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from chains import as_poses
from simulated_poses import write_poses

from shukotsu.errors import TableError
from shukotsu.tables.catalogue import JOINT_CENTRES
from shukotsu.tables.parquet_files import open_parquet
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.poses import read_poses, recording_name
from shukotsu.tables.typed_table import Provenance, read_metadata, rows_of

SEGMENTS = ("hand", "index_proximal")
PART = Part("right", "rigid", "", "01")


def poses_file(path: Path) -> Path:
    numbers = np.random.default_rng(1).normal(size=(20, len(SEGMENTS), 7))
    return write_poses(path, as_poses(SEGMENTS, numbers[..., :3], numbers[..., 3:]), "right", "rom")


def joints_file(path: Path) -> Path:
    row = {c.name: "a" if c.type == pa.string() else 2 for c in JOINT_CENTRES.columns if not c.nullable}
    with parts_writer(path, JOINT_CENTRES, Provenance()) as writer:
        writer.rows(PART, [row], gap_rms_mm=1.5)
    return path


def all_of_poses(path: Path) -> object:
    poses = read_poses(path, SEGMENTS)
    arrays = (poses.frame, poses.time_s, poses.position_mm, poses.quaternion, poses.valid)
    return [recording_name(path), read_metadata(path), *(array.tobytes() for array in arrays)]


def all_of_joints(path: Path) -> object:
    return [list(rows_of(read_part(path, JOINT_CENTRES, PART))), part_metadata(path, JOINT_CENTRES)]


KINDS = {"poses": (poses_file, all_of_poses), "joints": (joints_file, all_of_joints)}


@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", KINDS)
def test_a_flipped_bit_never_gives_a_wrong_number(tmp_path: Path, name: str, whole: bool) -> None:
    """Bits are flipped in pages, headers, footer, metadata and the checksum; whole : every 19th bit, else a
    sample.
    """
    make, read = KINDS[name]
    path = make(tmp_path / "t.parquet")
    clean, expected = path.read_bytes(), read(path)
    bits = 8 * len(clean)
    sample = [*random.Random(1).sample(range(bits), 250), *range(bits - 8 * 8, bits)]
    same = 0
    for bit in range(0, bits, 19) if whole else sample:
        data = bytearray(clean)
        data[bit // 8] ^= 1 << bit % 8
        path.unlink()  # a new file, as its modification time may be the same
        path.write_bytes(data)
        with suppress(TableError):
            assert read(path) == expected
            same += 1
    assert same <= 20, "only the letters before the checksum do not matter"


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" * 3, b"x" * 100])
def test_files_that_are_not_parquet_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.parquet"
    path.write_bytes(content)
    with pytest.raises(TableError, match="not a readable Parquet file"):
        open_parquet(path, "a table")


def test_a_damaged_column_name_is_refused_in_plain_words(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"column": [1.0]}), path)
    path.write_bytes(path.read_bytes().replace(b"column", b"co\xbdumn"))
    with pytest.raises(TableError, match=r"not a readable Parquet file \(invalid start byte\)"):
        open_parquet(path, "a table")


@pytest.mark.parametrize("made", [True, False])
def test_only_results_of_a_run_are_advised_to_be_removed(tmp_path: Path, made: bool) -> None:
    """Results are files beside the plan of a run; others may be recordings."""
    plan = tmp_path / "sub-01" / "plan.json"
    for path in (plan, plan.parent / "right" / "rom" / "poses.parquet", tmp_path / "gains.parquet"):
        path.parent.mkdir(parents=True, exist_ok=True)
        if made or path != plan:
            path.write_text("x,y\n1,2\n")
        if path != plan:
            cure = "remove it and run the study again" if made else "name one that this program made"
            with pytest.raises(TableError, match=rf"not a readable Parquet file \(.*\); {cure}$"):
                open_parquet(path, "a table")
