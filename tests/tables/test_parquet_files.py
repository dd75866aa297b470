"""Damage in a Parquet file: noticed wherever it is, by whichever function reads."""

import random
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shukotsu.errors import TableError
from shukotsu.tables.catalogue import JOINT_CENTRES, POSES
from shukotsu.tables.parquet_files import is_intact, open_parquet, store_digest
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.poses import Poses, read_poses, recording_name
from shukotsu.tables.typed_table import Provenance, read_metadata, rows_of, write_table_in_parts

SEGMENTS = ("hand", "index_proximal")
PART = Part("right", "rigid", "", "01")


def poses_file(path: Path) -> Path:
    """A poses table of two segments that move."""
    numbers = np.random.default_rng(1).normal(size=(len(SEGMENTS), 7, 20))
    names = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    same = {"frame": range(20), "time_s": np.arange(20) / 240, "valid": [True] * 20, "flags": [""] * 20}
    groups = [
        {"segment": [segment] * 20, **same, **dict(zip(names, own, strict=True))}
        for segment, own in zip(SEGMENTS, numbers, strict=True)
    ]
    recording = {"subject": "01", "hand": "right", "task": "rom", "trial": ""}
    write_table_in_parts(path, POSES, groups, Provenance(parameters=recording))
    return path


def joints_file(path: Path) -> Path:
    """A subject table of one part with one joint."""
    row = {c.name: "a" if c.type == pa.string() else 2 for c in JOINT_CENTRES.columns if not c.nullable}
    with parts_writer(path, JOINT_CENTRES, Provenance()) as writer:
        writer.rows(PART, [row], gap_rms_mm=1.5)
    return path


def all_of_poses(path: Path) -> object:
    """Everything that a stage reads of a poses table."""
    poses: Poses = read_poses(path, SEGMENTS)
    arrays = (poses.frame, poses.time_s, poses.position_mm, poses.quaternion, poses.valid)
    return [recording_name(path), read_metadata(path), *(array.tobytes() for array in arrays)]


def all_of_joints(path: Path) -> object:
    """Everything that a stage reads of a subject table."""
    return [list(rows_of(read_part(path, JOINT_CENTRES, PART))), part_metadata(path, JOINT_CENTRES)]


KINDS = {"poses": (poses_file, all_of_poses), "joints": (joints_file, all_of_joints)}


def outcomes(name: str, path: Path, places: list[int]) -> dict[str, int]:
    """Flip one bit after another; count refusals, results that are the same and ones that are not."""
    make, read = KINDS[name]
    clean = make(path).read_bytes()
    expected = read(path)
    counts = {"refused": 0, "the same": 0, "other": 0}
    for place in places:
        data = bytearray(clean)
        data[place // 8] ^= 1 << place % 8
        path.unlink()  # another file on the disk: its time may be the same
        path.write_bytes(data)
        with suppress(TableError):
            counts["the same" if read(path) == expected else "other"] += 1
            continue
        counts["refused"] += 1
    return counts


@pytest.mark.parametrize("name", KINDS)
def test_no_flipped_bit_gives_another_number(tmp_path: Path, name: str) -> None:
    """In pages, their headers, the footer, the metadata and the checksum itself."""
    path = KINDS[name][0](tmp_path / "t.parquet")
    bits = 8 * path.stat().st_size
    places = [*random.Random(1).sample(range(bits), 250), *range(bits - 8 * 8, bits)]
    counts = outcomes(name, path, places)
    assert counts["other"] == 0
    assert counts["refused"] > 250


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_no_bit_anywhere_gives_another_number(tmp_path: Path, name: str) -> None:
    """Every seventh one: in each byte some, in all bytes each."""
    path = KINDS[name][0](tmp_path / "t.parquet")
    counts = outcomes(name, path, list(range(0, 8 * path.stat().st_size, 7)))
    assert counts["other"] == 0
    assert counts["the same"] <= 20, "only the letters that stand before the checksum do not matter"


def test_other_programs_read_a_file_with_a_digest(tmp_path: Path) -> None:
    table = pa.table({"a": [1, 2, 3]})
    pq.write_table(table, tmp_path / "a.parquet")
    store_digest(tmp_path / "a.parquet")
    assert is_intact(tmp_path / "a.parquet")
    assert pq.read_table(tmp_path / "a.parquet") == table


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" * 3, b"x" * 100])
def test_files_that_are_none(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.parquet"
    path.write_bytes(content)
    with pytest.raises(TableError, match="not a readable Parquet file"):
        open_parquet(path, "a table")
