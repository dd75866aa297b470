"""A recording in parts gives what it gives at once, wherever it is cut and whatever is kept in memory."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schemas.catalogue import POSES
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.tables import Provenance, write_table_in_parts
from stages.capture.formats.columns import Columns
from stages.capture.formats.csv_columns import csv_blocks, open_csv
from stages.capture.formats.parquet_columns import open_parquet, parquet_blocks
from stages.capture.formats.raw_capture import capture_parts, read_capture
from stages.capture.formats.tidy import read_samples, wanted_columns
from stages.capture.poses import poses_of_parts, poses_table
from stages.capture.samples import ReadingOptions, Samples, joined
from stages.capture.spool import Spool

SEGMENTS = ("hand", "thumb", "index")
PARENTS = {"thumb": "hand", "index": "hand"}
LIBERTY = read_layout("liberty16")
NAN = float("nan")


@st.composite
def recordings(draw: st.DrawFn) -> Samples:
    """Rows in order of frames, of segments or in none, with rows twice, gaps, marks and times that fall."""
    count = draw(st.integers(1, 60))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    segment = random.integers(0, len(SEGMENTS), count)
    frame = random.integers(-4, 14, count)
    order = draw(st.sampled_from([(segment, frame), (frame, segment), None]))
    rows = np.arange(count) if order is None else np.lexsort(order)
    numbers = np.tile([1.0, 2.0, 3.0, 0.6, 0.8, 0.0, 0.0], (count, 1))
    numbers[:, 0] += random.integers(0, 2, count)
    numbers[random.random((count, 7)) < 0.03] = NAN
    time_s = np.where(random.random(count) < 0.2, NAN, frame / 8 - random.integers(0, 2, count) / 4)
    marks = {"distorted": random.random(count) < 0.3, "misfit": random.random(count) < 0.1}
    return Samples(
        SEGMENTS,
        segment[rows],
        frame[rows],
        time_s[rows],
        numbers[rows],
        lambda row: f"line {row}",
        {flag: marked[rows] for flag, marked in marks.items()},
    )


def cut(samples: Samples, cuts: Iterable[int]) -> list[Samples]:
    """Cut samples at those rows; parts may be empty, and have places of their own."""
    edges = [0, *sorted(cuts), len(samples.segment)]
    return [part(samples, first, last) for first, last in itertools.pairwise(edges)]


def part(samples: Samples, first: int, last: int) -> Samples:
    rows = slice(first, last)
    return Samples(
        samples.segments,
        samples.segment[rows],
        samples.frame[rows],
        samples.time_s[rows],
        samples.numbers[rows],
        lambda row: samples.place(first + row),
        {flag: marked[rows] for flag, marked in samples.marks.items()},
    )


@settings(max_examples=150, deadline=None)
@given(
    recordings(),
    st.lists(st.integers(0, 60), max_size=8),
    st.sampled_from([0, 300, 1 << 20]),
    st.integers(1, 9),
)
def test_parts_give_the_table_of_the_whole(
    tmp_path_factory: pytest.TempPathFactory,
    samples: Samples,
    cuts: list[int],
    memory_bytes: int,
    group_frames: int,
) -> None:
    folder = tmp_path_factory.mktemp("parts")
    pieces = cut(samples, [at for at in cuts if at <= len(samples.segment)])
    with pytest.MonkeyPatch.context() as patch, Spool(folder, memory_bytes) as spool:
        patch.setattr("stages.capture.poses.SPAN_FRAMES", 3)  # so that few frames are many
        patch.setattr("stages.capture.poses.FROZEN_FRAMES", 2)
        whole = poses_table(samples, PARENTS, group_frames)
        write_table_in_parts(folder / "whole.parquet", POSES, whole.row_groups(), Provenance())
        table = poses_of_parts(lambda: pieces, PARENTS, spool, group_frames)
        write_table_in_parts(folder / "parts.parquet", POSES, table.row_groups(), Provenance())
    assert (folder / "parts.parquet").read_bytes() == (folder / "whole.parquet").read_bytes()
    assert (table.segments, table.usable, table.frozen) == (whole.segments, whole.usable, whole.frozen)
    np.testing.assert_equal(table.span_mm, whole.span_mm)
    assert {path.name for path in folder.iterdir()} == {"whole.parquet", "parts.parquet"}


@given(recordings(), st.lists(st.integers(0, 60), max_size=5))
def test_joined_parts_are_the_recording(samples: Samples, cuts: list[int]) -> None:
    again = joined(cut(samples, [at for at in cuts if at <= len(samples.segment)]))
    for name in ("segment", "frame", "time_s", "numbers"):
        np.testing.assert_array_equal(getattr(again, name), getattr(samples, name))
    for flag, marked in samples.marks.items():
        np.testing.assert_array_equal(again.marks[flag], marked)
    rows = range(len(samples.segment))
    assert [again.place(row) for row in rows] == [samples.place(row) for row in rows]


def test_the_place_of_a_bad_quaternion_is_that_in_the_whole_recording(tmp_path: Path) -> None:
    """The first in the recording's order, though it is the last segment's, and of all parts are counted."""
    good = [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]
    numbers = np.tile(good, (9, 1))
    numbers[[4, 5, 8], 3] = 2.0
    segment = np.array([0, 1, 2, 0, 2, 1, 0, 1, 0])
    samples = Samples(SEGMENTS, segment, np.arange(9), np.arange(9) / 9, numbers, lambda row: f"line {row}")
    with Spool(tmp_path) as spool, pytest.raises(InputError) as caught:
        poses_of_parts(lambda: cut(samples, [2, 3]), {}, spool)
    assert str(caught.value).startswith("line 4, segment index, frame 4: ")
    assert "and 2 more rows like it" in str(caught.value)


def tidy_table(random: np.random.Generator, rows: int) -> pa.Table:
    """A tidy recording with empty cells, whole numbers written as reals now and then, in any order."""
    numbers = random.normal(0, 100, (rows, 9)).round(3)
    numbers[random.random((rows, 9)) < 0.05] = NAN
    columns = {"frame": random.integers(0, 50, rows), "time_s": numbers[:, 0]}
    columns |= {name: numbers[:, 1 + i] for i, name in enumerate(("x_mm", "y_mm", "z_mm"))}
    columns |= {name: numbers[:, 4 + i] for i, name in enumerate(("qw", "qx", "qy", "qz"))}
    table = {name: pa.array(values, from_pandas=True) for name, values in columns.items()}
    return pa.table({**table, "segment": random.choice(LIBERTY.measured, rows)})


def csv_parts(path: Path, rows: int) -> Iterator[Columns]:
    return csv_blocks(path, wanted_columns, rows, read_bytes=200)


def parquet_parts(path: Path, rows: int) -> Iterator[Columns]:
    return parquet_blocks(path, wanted_columns, rows)


@pytest.mark.parametrize(("ending", "parts"), [(".csv", csv_parts), (".parquet", parquet_parts)])
@pytest.mark.parametrize("rows", [1, 7, 100])
def test_a_tidy_file_in_blocks_is_the_file(
    tmp_path: Path, ending: str, parts: Callable[[Path, int], Iterator[Columns]], rows: int
) -> None:
    """Every cell, and every row's place in the file, empty lines counted."""
    path, table = tmp_path / f"rom{ending}", tidy_table(np.random.default_rng(rows), 60)
    if ending == ".csv":
        pa_csv.write_csv(table, path)
        lines = path.read_text("utf-8").splitlines()
        path.write_text("\n".join([*lines[:20], "", *lines[20:]]), "utf-8")
        whole = read_samples(open_csv(path, wanted_columns), path, LIBERTY)
    else:
        pq.write_table(table, path, row_group_size=9)
        whole = read_samples(open_parquet(path, wanted_columns), path, LIBERTY)
    blocks = list(parts(path, rows))
    assert len(blocks) > 1 or rows == 100
    again = joined([read_samples(block, path, LIBERTY) for block in blocks])
    for name in ("segment", "frame", "time_s", "numbers"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert [again.place(row) for row in range(60)] == [whole.place(row) for row in range(60)]


def test_a_bad_cell_far_down_is_told_by_its_line(tmp_path: Path) -> None:
    """In a later block, too, and so is a line with a cell too many, which pyarrow tells in other words."""
    path = tmp_path / "rom.csv"
    pa_csv.write_csv(tidy_table(np.random.default_rng(0), 60), path)
    lines = path.read_text("utf-8").splitlines()
    path.write_text("\n".join([*lines[:50], lines[50].replace(",", ",left", 1), *lines[51:]]), "utf-8")
    with pytest.raises(InputError, match="line 51, column time_s: is 'left"):
        [read_samples(block, path, LIBERTY) for block in csv_parts(path, 5)]
    path.write_text("\n".join([*lines[:50], f"{lines[50]},7", *lines[51:]]), "utf-8")
    with pytest.raises(InputError, match="line 51: has 11 cells; expected 10 as in the header"):
        list(csv_parts(path, 5))


def test_a_short_capture_is_read_as_a_long_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether its records are kept between the two passes or decoded again."""
    from benchmarks.made_up_capture import write_capture

    path = tmp_path / "rom.arrows"
    write_capture(path, 2.0)
    kept = read_capture(path, LIBERTY, ReadingOptions())
    monkeypatch.setattr("stages.capture.formats.raw_capture._KEPT_BYTES", 0)
    again = list(capture_parts(path, LIBERTY, ReadingOptions()))
    assert [len(part.segment) > 0 for part in again[-2:]] == [True, False]
    assert again[-1].notes == kept.notes
    for name in ("segment", "frame", "time_s", "numbers"):
        np.testing.assert_array_equal(getattr(joined(again), name), getattr(kept, name))
