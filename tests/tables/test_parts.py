"""Subjects' tables in parts: reading parts, missing parts and failed parts."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_study import recording_numbers

from shukotsu.errors import InputError, TableError
from shukotsu.tables.catalogue import METACARPALS
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.typed_table import METADATA_KEY, Column, Provenance, Table, read_table, rows_of

KEYS = ("subject", "hand", "model", "made_without")
SHORT = Table(
    "short",
    1,
    "a bone",
    (
        *(Column(name, pa.string(), "", "whose") for name in (*KEYS, "bone")),
        Column("length_mm", pa.float64(), "mm", "how long", nullable=True),
    ),
    (*KEYS, "bone"),
)
WHOLE, WITHOUT = Part("right", "rigid", "", "01"), Part("right", "rigid", "rom", "01")
LEFT = Part("left", "rigid", "", "01")
TURNS = [f"q{name}" for name in "wxyz"]


def bone(name: str, length_mm: float | None = None) -> dict[str, Any]:
    return {"bone": name, "length_mm": length_mm}


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """A table with two parts with rows, one written in two calls, one part without rows and a failed part."""
    path = tmp_path / "short.parquet"
    with parts_writer(path, SHORT, Provenance()) as writer:
        writer.rows(WHOLE, [bone("a", 1.0)], calibrated_on=["rom"])
        writer.rows(LEFT, [bone("c", 3.0)])
        writer.rows(WHOLE, [bone("b")], own_cmc=["thumb_cmc"])
        writer.rows(Part("left", "rigid", "rom", "01"), [])
        writer.failure(WITHOUT, "no recording calibrates", calibrated_on=[])
    return path


def test_parts_are_read_back_with_their_parameters(short: Path) -> None:
    read_back = read_part(short, SHORT, WHOLE)
    assert [(row["bone"], row["length_mm"]) for row in rows_of(read_back)] == [("a", 1.0), ("b", None)]
    assert read_back.column("hand").to_pylist() == ["right"] * 2
    assert read_part(short, SHORT, LEFT, ["length_mm"]).to_pydict() == {"length_mm": [3.0]}
    assert read_part(short, SHORT, Part("left", "rigid", "rom", "01")).num_rows == 0
    assert part_metadata(short, SHORT) == {
        WHOLE: {"calibrated_on": ["rom"], "own_cmc": ["thumb_cmc"]},
        LEFT: {},
        Part("left", "rigid", "rom", "01"): {},
        WITHOUT: {"calibrated_on": [], "failure": "no recording calibrates"},
    }
    assert read_table(short, SHORT).num_rows == 3
    assert pq.ParquetFile(short).num_row_groups == 1


def test_a_missing_part_is_refused_and_a_failed_one_gives_its_reason(short: Path) -> None:
    for part in (
        Part("left", "paper-fig4", "", "01"),
        Part("right", "rigid", "", "02"),
        Part("right", "rigid", "x", "01"),
    ):
        with pytest.raises(TableError, match=f"short.parquet: has no rows of {part}; name one that this"):
            read_part(short, SHORT, part)
    with pytest.raises(InputError, match=r"^no recording calibrates$") as caught:
        read_part(short, SHORT, WITHOUT)
    assert not isinstance(caught.value, TableError)


names = st.text("ab%é ", max_size=3)
parts = st.builds(Part, st.sampled_from(["right", "left"]), names, names, names)


@given(st.dictionaries(parts, st.none() | st.lists(st.floats(allow_nan=False), max_size=3), max_size=5))
def test_any_parts_are_read_back_with_their_rows(
    tmp_path_factory: pytest.TempPathFactory, contents: dict[Part, list[float] | None]
) -> None:
    """Names may contain any characters; None stands for a failed part."""
    path = tmp_path_factory.mktemp("parts") / "short.parquet"
    with parts_writer(path, SHORT, Provenance()) as writer:
        for part, lengths in contents.items():
            if lengths is None:
                writer.failure(part, "failed")
            else:
                writer.rows(part, [bone(f"{i}", length) for i, length in enumerate(lengths)])
    assert list(part_metadata(path, SHORT)) == list(contents)
    for part, lengths in contents.items():
        if lengths is not None:
            assert read_part(path, SHORT, part).column("length_mm").to_pylist() == lengths


# --- frame by frame ---------------------------------------------------------------------------------------


def turns(n_frames: int, start: float) -> np.ndarray:
    values = start + np.arange(n_frames * 4.0).reshape(n_frames, 4)
    values[0] = np.nan
    return values


def columns(digit: str, task: str, values: np.ndarray, trial: str = "") -> dict[str, Any]:
    unknown = np.full(len(values), np.nan)
    return {
        "subject": "01",
        "task": task,
        "trial": trial,
        "digit": digit,
        "frame": np.arange(len(values)),
        **{name: values[:, index] for index, name in enumerate(TURNS)},
        **dict.fromkeys(("swing_deg", "twist_deg", "length_mm"), unknown),
        "flags": [""] * len(values),
    }


LONG = {
    (WHOLE, "rom", "", "thumb"): turns(5, 0.0),
    (WHOLE, "rom", "", "index"): turns(5, 100.0),
    (WHOLE, "rom", "2", "index"): turns(4, 200.0),
    (WHOLE, "opposition", "", "index"): turns(3, 300.0),
    (WITHOUT, "rom", "", "index"): turns(5, 400.0),
    (LEFT, "rom", "", "index"): turns(6, 500.0),
}


@pytest.fixture
def long(tmp_path: Path) -> Path:
    path = tmp_path / "metacarpals.parquet"
    with parts_writer(path, METACARPALS, Provenance()) as writer:
        for (part, task, trial, digit), values in LONG.items():
            writer.columns(part, columns(digit, task, values, trial))
        writer.failure(Part("left", "rigid", "rom", "01"), "no joint")
    return path


def test_a_recordings_numbers_are_read_by_part_and_name(long: Path) -> None:
    read_back = recording_numbers(long, METACARPALS, WHOLE, "rom", "", TURNS, 5)
    assert list(read_back) == ["thumb", "index"]
    for digit, values in read_back.items():
        np.testing.assert_array_equal(values, LONG[WHOLE, "rom", "", digit])
    for part, task, trial, digit in LONG:
        other = recording_numbers(long, METACARPALS, part, task, trial, ["qy"])[digit]
        np.testing.assert_array_equal(other[:, 0], LONG[part, task, trial, digit][:, 2])
    assert recording_numbers(long, METACARPALS, LEFT, "opposition", "", TURNS, 3) == {}
    metadata = pq.ParquetFile(long).metadata
    assert [metadata.row_group(i).num_rows for i in range(metadata.num_row_groups)] == [5, 5, 4, 3, 5, 6]


def test_each_digit_is_a_row_group_and_its_name_a_string_to_any_reader(tmp_path: Path) -> None:
    path, values = tmp_path / "metacarpals.parquet", turns(10, 0.0)
    both = {"digit": ["thumb"] * 5 + ["index"] * 5, "frame": np.tile(np.arange(5), 2)}
    with parts_writer(path, METACARPALS, Provenance()) as writer:
        writer.columns(WHOLE, columns("", "rom", values) | both)
    file = pq.ParquetFile(path)
    assert [file.metadata.row_group(group).num_rows for group in range(file.num_row_groups)] == [5, 5]
    assert file.schema_arrow.field("digit").type == pa.string()
    assert file.read().column("digit").to_pylist() == both["digit"]
    assert json.loads(file.metadata.metadata[METADATA_KEY])["schema"] == "metacarpals"
    read_back = recording_numbers(path, METACARPALS, WHOLE, "rom", "", TURNS, 5)
    np.testing.assert_array_equal(np.concatenate([*read_back.values()]), values)
