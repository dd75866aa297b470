"""Reading tidy recordings from CSV and Parquet, and their refusals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import pytest
from recording_files import LIBERTY, read, refuse

from shukotsu.readers.formats.text_table import open_tidy_csv
from shukotsu.readers.formats.tidy import parquet_blocks, read_samples, wanted_columns
from shukotsu.readers.samples import Samples, join_samples

HEADER = "frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
ROW = "{frame},0.5,{segment},1,2,3,1,0,0,0\n"
TWO_ROWS = HEADER + ROW.format(frame=7, segment="hand") + ROW.format(frame=8, segment="index_distal")


def write(tmp_path: Path, content: str | bytes) -> Path:
    path = tmp_path / "rom.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    "content",
    [
        TWO_ROWS,
        "\ufeff" + TWO_ROWS,
        TWO_ROWS.replace("\n", "\r\n"),
        TWO_ROWS.replace("\n", "\r"),
        TWO_ROWS.replace("\n", "\n\n"),
        TWO_ROWS.replace(",", " , "),
        TWO_ROWS.replace("7,", "7.0,"),
        TWO_ROWS.replace("\n", ',"a ""note"""\n').replace(',"a ""note"""', ",note", 1),
        TWO_ROWS.replace(",", "\t").encode("utf-16"),
        TWO_ROWS.replace("\n8", "\n,,,,,,,,,\n8") + ",,,,,,,,,\n" * 9,
        TWO_ROWS.replace(",0.5,", ",1970-01-01 01:00:00.5+01:00,"),
    ],
)
def test_a_tidy_csv_is_read_in_every_text_format(tmp_path: Path, content: str) -> None:
    samples = read(write(tmp_path, content))
    assert samples.segments == LIBERTY.measured
    assert [samples.segments[index] for index in samples.segment] == ["hand", "index_distal"]
    np.testing.assert_array_equal(samples.frame, [7, 8])
    np.testing.assert_array_equal(samples.time_s, [0.5, 0.5])
    np.testing.assert_array_equal(samples.numbers, [[1, 2, 3, 1, 0, 0, 0]] * 2)
    assert samples.notes == (("10 empty rows are left out",) if ",,,,,," in str(content) else ())
    assert samples.locate(1).endswith("line 4" if samples.notes else "line 3") or content.count("\n") != 3


USUAL = "n/a N/A NA #N/A None - -- 1.#QNAN -1.#IND00 NULL nan -nan(ind) . <NA>"


@pytest.mark.parametrize("nothing", USUAL.split())
def test_usual_markers_of_missing_values_are_gaps(tmp_path: Path, nothing: str) -> None:
    samples = read(write(tmp_path, row_with("x_mm", nothing).replace("9,1.5", '"1,009",')))
    np.testing.assert_array_equal(samples.numbers[:, 0], [1, 1, np.nan])
    np.testing.assert_array_equal(samples.frame, [7, 8, 1009])


def test_station_numbers_are_mapped_by_the_layout(tmp_path: Path) -> None:
    content = HEADER.replace("segment", "receiver") + ROW.format(frame=0, segment=16)
    samples = read(write(tmp_path, content + ROW.format(frame=0, segment=1)))
    assert [samples.segments[index] for index in samples.segment] == ["little_distal", "hand"]
    segments = {
        name: replace(segment, left_receiver=segment.receiver + 20)
        for name, segment in LIBERTY.segments.items()
        if segment.receiver
    }
    both = replace(LIBERTY, segments=LIBERTY.segments | segments)
    for hand, receiver in (("right", 36), ("left", 16)):
        path = write(tmp_path, HEADER.replace("segment", "receiver") + ROW.format(frame=0, segment=receiver))
        refuse(path, f"receiver {receiver} sits on the other hand in layout liberty16", both.of_hand(hand))


def row_with(column: str, text: str) -> str:
    cells = dict(zip(HEADER.strip().split(","), ["9", "1.5", "hand", *"1231000"], strict=True))
    good = HEADER + ROW.format(frame=7, segment="hand") + "\n" + ROW.format(frame=8, segment="hand")
    return good + ",".join((cells | {column: text}).values()) + "\n"


@pytest.mark.parametrize(
    ("column", "text", "message"),
    [
        ("frame", "3.5", "line 5, column frame: is '3.5'; expected a whole number"),
        ("frame", "", "line 5, column frame: is empty; expected a whole number"),
        ("frame", str(2**63 - 1), "line 5, column frame: is '9223372036854775807'; expected a whole number"),
        ("frame", str(-(2**63)), "line 5, column frame: is '-9223372036854775808'; expected a whole number"),
        ("frame", "1e300", "line 5, column frame: is '1e300'; expected a whole number"),
        ("frame", "inf", "line 5, column frame: is 'inf'; expected a whole number"),
        ("frame", "one", "line 5, column frame: is 'one'; expected a number"),
        ("x_mm", "left", "line 5, column x_mm: is 'left'; expected a number"),
        ("x_mm", "1_0", "line 5, column x_mm: is '1_0'; expected a number"),
        ("qz", '"0,5"', "line 5, column qz: is '0,5'; expected a number with a decimal point, not a comma"),
        ("time_s", "00:01", "line 5, column time_s: is '00:01'; expected a number"),
        ("qz", "0,5", "line 5: has 11 cells; expected 10 as in the header .*decimal point"),
        ("segment", "", "line 5, column segment: is empty; expected a name"),
        ("segment", "indx_distal", "line 5: segment 'indx_distal' is not in layout .*mean 'index_distal'"),
        ("segment", "index_metacarpal", "line 5: segment 'index_metacarpal' carries no receiver in layout"),
    ],
)
def test_a_bad_cell_is_refused_with_its_line_and_column(
    tmp_path: Path, column: str, text: str, message: str
) -> None:
    refuse(write(tmp_path, row_with(column, text)), message)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty; expected a tidy recording"),
        ("\n \n", "is empty; expected a tidy recording"),
        (HEADER, "has a header but no rows"),
        (TWO_ROWS.replace("x_mm", "x"), "column x_mm is missing; found frame, time_s, segment, x, "),
        (TWO_ROWS.replace("segment", "name"), r"column segment \(or receiver\) is missing"),
        (TWO_ROWS.replace(",", ";"), "separated by semicolons: save with commas"),
        (TWO_ROWS + "a" * 10**6 + TWO_ROWS[-20:], "line 4: has more than 1000000 letters"),
        (TWO_ROWS.replace("qw", "QW"), "lower case"),
        (TWO_ROWS.replace("qx", "qw"), "column qx is missing"),
        (TWO_ROWS.replace("\n", ",9\n").replace(",9", ",qw", 1), "column qw is given twice"),
        (TWO_ROWS.replace("segment", "segment,receiver"), "both columns segment and receiver; keep one"),
        (TWO_ROWS[:-7] + "\n", "line 3: has 7 cells; expected 10"),
        (TWO_ROWS.encode() + ROW.format(frame=9, segment="\xe9").encode("latin-1"), "line 4: is not UTF-8"),
    ],
)
def test_a_foreign_csv_file_is_refused(tmp_path: Path, content: str | bytes, message: str) -> None:
    refuse(write(tmp_path, content), message)


def parquet(tmp_path: Path, **changes: object) -> Path:
    columns: dict[str, object] = {
        "frame": [7, 8],
        "time_s": [0.5, None],
        "segment": ["hand", "index_distal"],
        **{name: [0.0, 0.0] for name in ("x_mm", "y_mm", "z_mm", "qx", "qy", "qz")},
        "qw": [1.0, 1.0],
    } | changes
    path = tmp_path / "rom.parquet"
    pq.write_table(pa.table({k: pa.array(v) for k, v in columns.items() if v is not None}), path)
    return path


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x_mm": ["1", "2"]}, "column x_mm is string; expected numbers"),
        ({"frame": [True, False]}, "column frame is bool; expected numbers"),
        ({"frame": [1, None]}, "row 2, column frame: is empty; expected a whole number"),
        ({"frame": [1.5, 2.0]}, "row 1, column frame: is 1.5; expected a whole number"),
        ({"frame": pa.array([1, 2**64 - 1], pa.uint64())}, "row 2, column frame: is 18446744073709551615"),
        ({"segment": ["hand", None]}, "row 2, column segment: is empty; expected a name"),
        ({"segment": [1, 2]}, "column segment is int64; expected text"),
        ({"segment": ["hand", "foot"]}, "row 2: segment 'foot' is not in layout liberty16"),
        ({"qw": None}, "column qw is missing"),
    ],
)
def test_a_foreign_parquet_file_is_refused(tmp_path: Path, changes: dict[str, object], message: str) -> None:
    refuse(parquet(tmp_path, **changes), message)


@pytest.mark.parametrize(
    "changes",
    [
        {"segment": pa.array(["hand", "index_distal"], pa.string_view())},
        {"time_s": pa.array([500_000, None], pa.duration("us"))},
        {"time_s": pa.array([500, None], pa.timestamp("ms"))},
        {"segment": None, " segment ": ["hand", "index_distal"]},
    ],
    ids=["string-view", "duration", "timestamp", "blanks"],
)
def test_parquet_files_of_other_programs_are_read(tmp_path: Path, changes: dict[str, object]) -> None:
    samples = read(parquet(tmp_path, **changes))
    assert [samples.segments[index] for index in samples.segment] == ["hand", "index_distal"]
    np.testing.assert_array_equal(samples.time_s, [0.5, np.nan])
    assert bool(samples.notes) == (" segment " in changes)


def tidy_table(random: np.random.Generator, rows: int) -> pa.Table:
    """Return a tidy recording with empty cells and rows in random order."""
    numbers = random.normal(0, 100, (rows, 9)).round(3)
    numbers[random.random((rows, 9)) < 0.05] = np.nan
    columns = {"frame": random.integers(0, 50, rows), "time_s": numbers[:, 0]}
    columns |= {name: numbers[:, 1 + i] for i, name in enumerate(("x_mm", "y_mm", "z_mm"))}
    columns |= {name: numbers[:, 4 + i] for i, name in enumerate(("qw", "qx", "qy", "qz"))}
    table = {name: pa.array(values, from_pandas=True) for name, values in columns.items()}
    return pa.table({**table, "segment": random.choice(LIBERTY.measured, rows)})


def blocks_of(path: Path) -> list[Samples]:
    if path.suffix == ".parquet":
        blocks = parquet_blocks(path, 7)
    else:
        table = open_tidy_csv(path)
        blocks = table.blocks(wanted_columns(path, table.header), read_bytes=300)
    return [read_samples(block, path, LIBERTY) for block in blocks]


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_reading_in_blocks_equals_reading_at_once(tmp_path: Path, ending: str) -> None:
    """All cells are equal, and so is each row's line number, although the CSV file has an empty line."""
    path, table = tmp_path / f"rom{ending}", tidy_table(np.random.default_rng(7), 60)
    if ending == ".csv":
        pa_csv.write_csv(table, path)
        lines = path.read_text("utf-8").splitlines()
        path.write_text("\n".join([*lines[:20], "", *lines[20:]]), "utf-8")
    else:
        pq.write_table(table, path, row_group_size=9)
    whole = read(path)
    blocks = blocks_of(path)
    assert len(blocks) > 5
    again = join_samples(blocks)
    for name in ("segment", "frame", "time_s", "numbers"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert [again.locate(row) for row in range(60)] == [whole.locate(row) for row in range(60)]


@pytest.mark.parametrize("end", [",0,0,205.871", ",0,0,205.", ",0,0,2", ",0,0,", ",0,", ", 0", ""])
def test_a_last_line_without_a_line_end_is_not_read(end: str, tmp_path: Path) -> None:
    """Whether it was cut off inside its last number or before."""
    samples = read(write(tmp_path, f"{HEADER}0,0,hand,1,2,3,1,0,0,0\n1,1,hand,1,2,3,1{end}"))
    np.testing.assert_array_equal(samples.frame, [0])
    assert samples.losses == samples.notes
    assert "the last line has no line end" in samples.losses[0]
