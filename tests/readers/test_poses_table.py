"""Building the poses table from samples: order, frame grid, gaps, flags and spikes."""

import itertools
from collections.abc import Iterable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from recording_files import columns_of

from shukotsu.errors import InputError
from shukotsu.readers.jumps import spikes
from shukotsu.readers.poses_table import FROZEN_FRAMES, PosesTable, poses_table
from shukotsu.readers.samples import Samples
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import NUMBERS
from shukotsu.tables.typed_table import Provenance, write_table_in_parts

SEGMENTS = ("hand", "thumb", "index")
NAN = float("nan")
GOOD = (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0)
PARENTS = {"thumb": "hand", "index": "hand"}


def table_of(samples: Samples) -> PosesTable:
    return poses_table([samples], PARENTS)


def samples_of(*rows: tuple[str, int, float, tuple[float, ...]]) -> Samples:
    segment, frame, time_s, numbers = zip(*rows, strict=True)
    return Samples(
        SEGMENTS,
        np.array([SEGMENTS.index(name) for name in segment]),
        np.array(frame),
        np.array(time_s, float),
        np.array(numbers, float),
        lambda row: f"rom.csv: line {row + 2}",
    )


def table_rows(table: PosesTable) -> list[dict[str, Any]]:
    """Return the table's rows as dictionaries, NaN as None."""
    rows = pa.table(columns_of(table)).to_pylist()
    return [{k: None if v != v else v for k, v in row.items()} for row in rows]


def numbers_of(row: dict[str, Any]) -> list[float | None]:
    return [row[name] for name in NUMBERS]


def test_rows_are_ordered_by_segment_on_a_full_frame_grid() -> None:
    """Rows are ordered by the layout's segments, then by frame; rows missing from the recording are null and
    flagged.
    """
    table = table_of(samples_of(("index", 12, 0.3, GOOD), ("hand", 10, 0.1, GOOD), ("index", -5, 0.05, GOOD)))
    rows = table_rows(table)
    assert [(row["segment"], row["frame"], row["flags"]) for row in rows] == [
        ("hand", -5, "no-row"),
        ("hand", 10, ""),
        ("hand", 12, "no-row"),
        ("index", -5, ""),
        ("index", 10, "no-row"),
        ("index", 12, ""),
    ]
    assert [row["time_s"] for row in rows] == [None, 0.1, None, 0.05, None, 0.3]
    assert [row["valid"] for row in rows] == [row["flags"] == "" for row in rows]
    assert numbers_of(rows[0]) == [None] * 7
    assert table.segments == ("hand", "index")
    assert table.usable == (1, 2)


@pytest.mark.parametrize(
    ("numbers", "flags"),
    [
        ((NAN,) * 7, "missing"),
        ((NAN, *GOOD[1:]), "partly-missing"),
        ((*GOOD[:6], NAN), "partly-missing"),
        ((*GOOD[:3], NAN, 0.0, 0.0, 0.0), "partly-missing"),
        ((NAN, NAN, NAN, 0, 0, 0, 0), "partly-missing"),
        ((float("inf"), *GOOD[1:]), "not-finite"),
        ((1e154, *GOOD[1:]), "out-of-reach"),
        ((*GOOD[:2], -1e9, *GOOD[3:]), "out-of-reach"),
        ((float("-inf"), NAN, *GOOD[2:]), "partly-missing;not-finite"),
    ],
)
def test_an_incomplete_row_is_a_gap_with_a_reason(numbers: tuple[float, ...], flags: str) -> None:
    (row, *_) = table_rows(table_of(samples_of(("hand", 0, 0.0, numbers))))
    assert numbers_of(row) == [None] * 7
    assert (row["valid"], row["flags"], row["time_s"]) == (False, flags, 0.0)


@pytest.mark.parametrize(
    ("quaternion", "message"),
    [
        ((1, 1, 0, 0), "norm 1.41421 .*expected 1 within 0.01; check the column order .*leave the row's"),
        ((0.98, 0, 0, 0), "norm 0.98"),
        ((1e200, 0, 0, 0), "norm inf"),
        ((0, 0, 0, 0), "all zeros .*zeros for missing values must be left empty"),
    ],
)
def test_a_quaternion_off_unit_norm_is_refused(quaternion: tuple[float, ...], message: str) -> None:
    """The row named is the first in the file, not in the table; the number of further ones is given."""
    bad = (0.0, 0.0, 0.0, *quaternion)
    samples = samples_of(("thumb", 4, 0, GOOD), ("thumb", 3, 0, bad), ("hand", 3, 0, bad))
    with pytest.raises(InputError, match=message) as caught:
        table_of(samples)
    assert str(caught.value).startswith("rom.csv: line 3, segment thumb, frame 3: the quaternion ")
    assert "and 1 more rows like it" in str(caught.value)


def test_two_recordings_in_one_file_are_refused() -> None:
    moved = (9.0, *GOOD[1:])
    rows = [(name, frame, 0, GOOD) for frame in range(40) for name in ("hand", "thumb")]
    again = [(name, frame, 0, moved) for frame in range(10) for name in ("hand", "thumb")]
    with pytest.raises(InputError, match=r"line 82: frame 0 of receiver hand occurs twice with different"):
        table_of(samples_of(*rows, *again))
    table = table_of(samples_of(*rows, *again[:18], *again[:2]))
    assert table.usable == (31, 31)


@pytest.mark.parametrize("unit_mm", [1.0, 25.4])
def test_a_station_number_read_as_a_coordinate_is_refused(unit_mm: float) -> None:

    def rows(x: float, fraction: float) -> list[tuple[str, int, float, tuple[float, ...]]]:
        return [
            ("hand", n, 0.0, (x * unit_mm, n + fraction, 90 - n + fraction, *GOOD[3:])) for n in range(30)
        ]

    with pytest.raises(InputError, match="x of receiver hand is a whole number in all its poses"):
        table_of(samples_of(*rows(4.0, 0.3)))
    assert table_of(samples_of(*rows(4.3, 0.3))).usable == (30,)


def test_faulty_times_are_kept_and_flagged() -> None:
    times = [0.1, 0.2, NAN, 0.2, 0.15, 0.3, float("inf")]
    rows = [("thumb", frame, time, GOOD) for frame, time in enumerate(times)]
    rows_read = table_rows(table_of(samples_of(("hand", 9, 9.0, GOOD), *rows)))[8:15]
    assert [row["time_s"] for row in rows_read] == [0.1, 0.2, None, 0.2, 0.15, 0.3, None]
    late, missing = "time-not-increasing", "time-missing"
    assert [row["flags"] for row in rows_read] == ["", "", missing, late, late, "", missing]
    assert all(row["valid"] for row in rows_read)


@pytest.mark.parametrize(
    ("frames", "still", "frozen"),
    [
        (FROZEN_FRAMES, "thumb", True),
        (FROZEN_FRAMES - 1, "thumb", False),
        (FROZEN_FRAMES, "hand", False),
        (FROZEN_FRAMES, "both", False),
    ],
)
def test_a_receiver_frozen_while_its_parent_moves_is_invalid(frames: int, still: str, frozen: bool) -> None:
    rows = [
        (segment, frame, frame / 240, (float(frame * (still not in (segment, "both"))), *GOOD[1:]))
        for frame in range(frames)
        for segment in ("hand", "thumb")
    ]
    table = table_of(samples_of(*rows, ("hand", frames, 9.0, (NAN,) * 7)))
    rows_read = [row for row in table_rows(table) if row["segment"] == "thumb"]
    assert {row["valid"] for row in rows_read[:-1]} == {not frozen}
    assert {row["flags"] for row in rows_read[:-1]} == ({"frozen"} if frozen else {""})
    assert table.frozen == (("thumb",) if frozen else ())


def write(path: Path, table: PosesTable, group_frames: int) -> None:
    write_table_in_parts(path, POSES, table.row_groups(group_frames), Provenance())


def any_samples(random: np.random.Generator, order: str) -> Samples:
    """Return random rows in the given order, with duplicates, gaps, flags and decreasing times."""
    count = random.integers(1, 60)
    segment, frame = random.integers(0, len(SEGMENTS), count), random.integers(-4, 14, count)
    rows = np.lexsort(
        {"frames": (segment, frame), "segments": (frame, segment)}.get(order, (np.arange(count),))
    )
    numbers = np.tile([1.0, 2.0, 3.0, 0.6, 0.8, 0.0, 0.0], (count, 1))
    numbers[:, 0] += random.integers(0, 2, count)
    numbers[random.random((count, 7)) < 0.03] = NAN
    time_s = np.where(random.random(count) < 0.2, NAN, frame / 8 - random.integers(0, 2, count) / 4)
    flags = {"distorted": random.random(count) < 0.3, "misfit": random.random(count) < 0.1}
    return Samples(SEGMENTS, segment[rows], frame[rows], time_s[rows], numbers, "line {}".format, flags)


def cut(samples: Samples, cuts: Iterable[int]) -> list[Samples]:
    return [
        replace(samples.take(slice(first, end)), locate=lambda row, first=first: samples.locate(first + row))
        for first, end in itertools.pairwise([0, *sorted(cuts), len(samples.segment)])
    ]


@pytest.mark.parametrize("order", ["frames", "segments", "none"])
@pytest.mark.parametrize("seed", range(4))
def test_a_recording_in_parts_gives_the_same_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, order: str, seed: int
) -> None:
    """The bytes are the same wherever the recording is cut, and whether rows are buffered in memory or in
    files.
    """
    random = np.random.default_rng(seed)
    samples = any_samples(random, order)
    pieces = cut(samples, random.integers(0, len(samples.segment) + 1, seed + 1).tolist())
    monkeypatch.setattr("shukotsu.readers.poses_table.FROZEN_FRAMES", 2)
    whole = table_of(samples)
    monkeypatch.setattr("shukotsu.readers.segment_rows.MEMORY_BYTES", 3)
    with closing(poses_table(pieces, PARENTS, tmp_path)) as table:
        assert list(tmp_path.iterdir()) == []
        write(tmp_path / "parts.parquet", table, seed + 1)
    write(tmp_path / "whole.parquet", whole, seed + 1)
    assert (tmp_path / "parts.parquet").read_bytes() == (tmp_path / "whole.parquet").read_bytes()
    assert (table.segments, table.usable, table.frozen) == (whole.segments, whole.usable, whole.frozen)


def swinging(n_frames: int = 240, rate_hz: float = 240.0) -> np.ndarray:
    time_s = np.arange(n_frames) / rate_hz
    half, none = time_s / 2, np.zeros(n_frames)
    return np.stack([1000 * time_s, none + 300, none, np.cos(half), np.sin(half), none, none], -1)


@pytest.mark.parametrize(("rate_hz", "length"), [(240.0, 1), (240.0, 3), (240.0, 5), (30.0, 1), (30.0, 3)])
@pytest.mark.parametrize("kind", ["place", "turn"])
def test_only_the_frames_of_a_spike_are_flagged(length: int, kind: str, rate_hz: float) -> None:
    poses = swinging(rate_hz=rate_hz)
    if kind == "place":
        poses[10 : 10 + length, 0] += 10_000.0
    else:
        poses[10 : 10 + length, 3:] = [0.0, 0.0, 1.0, 0.0]
    assert np.flatnonzero(spikes(poses)).tolist() == [*range(10, 10 + length)]


@pytest.mark.parametrize(("end", "moved_mm"), [(240, 1e4), (16, 1e4), (11, 50.0), (10, 0.0)])
def test_lasting_and_small_jumps_are_not_spikes(end: int, moved_mm: float) -> None:
    poses = swinging()
    poses[10:end, 0] += moved_mm
    assert not spikes(poses).any()
