"""Sheets: bad cells are refused with file, row and column; files are read as saved by any editor."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.errors import InputError
from shukotsu.study.sheets import (
    CORRECTIONS,
    MEASUREMENTS,
    PARTICIPANTS,
    RECORDINGS,
    TOUCHES,
    Sheet,
    read_sheet,
)

RECORDING = ["subject\thand\ttask\trole\tfile", "01\tright\trom\tboth\trom.csv"]
CORRECTION = ["subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm", "01\tleft\tthumb_ip\t1\t-2.5\t0"]


def written(tmp_path: Path, lines: list[str], end: str = "\n", encoding: str = "utf-8") -> Path:
    path = tmp_path / "sheet.tsv"
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


@pytest.mark.parametrize(
    ("end", "encoding"),
    [("\n", "utf-8"), ("\r\n", "utf-8"), ("\r", "utf-8"), ("\n", "utf-8-sig"), ("\n\n \t\n", "utf-8")],
    ids=["plain", "crlf", "cr", "bom", "empty-lines"],
)
def test_a_sheet_is_read_with_any_line_ends_and_encoding(tmp_path: Path, end: str, encoding: str) -> None:
    (row,) = read_sheet(written(tmp_path, RECORDING, end, encoding), RECORDINGS)
    stated = dict(zip(RECORDING[0].split("\t"), RECORDING[1].split("\t"), strict=True))
    empty = ("session", "trial", "layout", "mapping", "exclude", "accept", "events", "pulses")
    assert row.values == stated | dict.fromkeys(empty, "") | {"format": "auto", "hemisphere": "keep"}


def test_a_sheet_saved_by_a_spreadsheet_is_read(tmp_path: Path) -> None:
    """It has empty columns and rows, quotation marks inside a quoted cell, UTF-16, and markers of missing
    values.
    """
    lines = [f"{RECORDING[0]}\tformat\t\t", '01\tright\trom\tboth\t"a ""b"", 1.csv"\tn/a\t\t\t', "\t" * 7]
    (row,) = read_sheet(written(tmp_path, lines, "\r\n", "utf-16"), RECORDINGS)
    assert (row["file"], row["format"]) == ('a "b", 1.csv', "auto")
    (person,) = read_sheet(written(tmp_path, ["subject\thand_length_mm", "NA\tN/A"]), PARTICIPANTS)
    assert (person["subject"], person["hand_length_mm"]) == ("NA", None)


TOUCH, POINT = "subject\thand\ttask\tdigit\tfrom_s\tto_s", "x_mm\ty_mm\tz_mm\tsd_mm"


def test_a_touch_needs_a_point_or_a_second_digit(tmp_path: Path) -> None:
    cells = "01\tleft\trom\tthumb\t1\t2"
    (row,) = read_sheet(written(tmp_path, [f"{TOUCH}\tmeets", f"{cells}\tindex"]), TOUCHES)
    assert (row["meets"], row["part"], row["x_mm"], row["sd_mm"]) == ("index", "", None, None)
    for header, more, sentence in (
        ("", "", "row 1: column x_mm, y_mm, z_mm, sd_mm is missing"),
        (f"\tmeets\t{POINT}", "\t\t1\t2\t\t0.4", "row 2, column z_mm: is ''; .*, or a cell in column meets"),
    ):
        with pytest.raises(InputError, match=sentence):
            read_sheet(written(tmp_path, [TOUCH + header, cells + more]), TOUCHES)


@pytest.mark.parametrize(
    ("sheet", "lines", "message"),
    [
        (RECORDINGS, [RECORDING[0], "\tright\trom\tboth\tr.csv"], "row 2, column subject: is empty"),
        (RECORDINGS, [RECORDING[0], "", "01\tRight\trom\tboth\tr.csv"],
         "row 3, column hand: is 'Right'; expected right or left"),
        (RECORDINGS, [RECORDING[0], "01\tright\trom\ttest\tr.csv"],
         "row 2, column role: is 'test'; expected calibration, evaluation or both"),
        (RECORDINGS, [RECORDING[0] + "\tformat", RECORDING[1] + "\tc3d"],
         "row 2, column format: is 'c3d'; expected auto, csv, parquet, capture, xdf or sequence"),
        (RECORDINGS, [RECORDING[0], "01\tright\tr\x07m\tboth\tr.csv"],
         "column task: contains a control character"),
        (RECORDINGS, [RECORDING[0], "\x9b31m\tright\trom\tboth\tr.csv"],
         "column subject: contains a control character"),
        (RECORDINGS, [RECORDING[0], RECORDING[1] + "\tx"], "row 2: has 6 cells; expected 5"),
        (RECORDINGS, [*RECORDING, RECORDING[1]],
         "row 3: subject '01', hand 'right', task 'rom' is already in row 2"),
        (CORRECTIONS, [CORRECTION[0] + "\twhy"], "row 1: unknown column why; known are subject, hand"),
        (RECORDINGS, ["subject\thand\ttsak\trole\tfile"], "unknown column tsak; did you mean 'task'?"),
        (RECORDINGS, [RECORDING[0] + "\tsesion"], "unknown column sesion; did you mean 'session'?"),
        (RECORDINGS, [RECORDING[0] + "\thand"], "row 1: column hand is given twice"),
        (RECORDINGS, ["subject\thand\ttask\tfile"], "row 1: column role is missing; found subject, hand"),
        (RECORDINGS, [RECORDING[0].replace("\t", ",")], "are the columns separated by tabs"),
        (RECORDINGS, [""], "is empty; expected a header line with subject, hand, task, role, file"),
        (CORRECTIONS, [CORRECTION[0], "01\tleft\tj\t1\t\t0"], "column dy_mm: is ''; expected a number"),
        (CORRECTIONS, [CORRECTION[0], "01\tleft\tj\t1,5\t0\t0"], "column dx_mm: is '1,5'; expected a num"),
        (CORRECTIONS, [CORRECTION[0], "01\tleft\tj\tnan\t0\t0"], "column dx_mm: is 'nan'; expected a num"),
        (CORRECTIONS, [*CORRECTION, CORRECTION[1]], "row 3: .*joint 'thumb_ip' is already in row 2"),
        (PARTICIPANTS, ["subject\thand_length_mm", "01\t0"], "column hand_length_mm: is '0'; .* above zero"),
        (PARTICIPANTS, ["subject\thand_length_mm", "01\t18"], "is '18'; expected millimetres, 50 to 400"),
        (PARTICIPANTS, ["subject\thand_breadth_mm", "01\t8.5"], "is '8.5'; expected millimetres, 30 to 200"),
        (PARTICIPANTS, ["subject\thand_length_mm", "01\t1_80"], "is '1_80'; expected a number"),
        (PARTICIPANTS, ["subject", "01", "02", "01"], "row 4: subject '01' is already in row 2"),
        (MEASUREMENTS, ["subject\thand\tquantity\tvalue_mm\tsd_mm", "01\tleft\tindex_proximal\t40\t-1"],
         "row 2, column sd_mm: is '-1'; expected a number above zero"),
    ],
)  # fmt: skip
def test_a_faulty_sheet_is_refused(tmp_path: Path, sheet: Sheet, lines: list[str], message: str) -> None:
    path = written(tmp_path, lines)
    with pytest.raises(InputError, match=message) as caught:
        read_sheet(path, sheet)
    assert str(caught.value).startswith(f"{path}: ")


def test_the_first_five_bad_cells_are_reported_together(tmp_path: Path) -> None:
    lines = [CORRECTION[0], *(f"{n}\tleft\tj\tx\ty\t0" for n in range(8))]
    with pytest.raises(InputError) as caught:
        read_sheet(written(tmp_path, lines), CORRECTIONS)
    assert str(caught.value).count("expected a number") == 5
    assert str(caught.value).endswith("; and 11 more")


def test_further_columns_of_a_sheet_are_kept(tmp_path: Path) -> None:
    """A name is taken for a typo only of a missing column, so `mask` is allowed beside `task`. A missing
    length is None, not zero.
    """
    lines = [f"{RECORDING[0]}\tnote\tmask\tsession_date", f"{RECORDING[1]}\twarm\tyes\t3 May"]
    (row,) = read_sheet(written(tmp_path, lines), RECORDINGS)
    assert (row["note"], row["mask"], row["session_date"]) == ("warm", "yes", "3 May")
    lines = ["subject\tage\thand_length_mm", "01\t31\t", "02\t\t190.5"]
    first, second = read_sheet(written(tmp_path, lines), PARTICIPANTS)
    assert (first["age"], first["hand_length_mm"], first["hand_breadth_mm"]) == ("31", None, None)
    assert (second["age"], second["hand_length_mm"]) == ("", 190.5)


@given(name=st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1))
def test_names_without_spaces_and_control_characters_are_kept(
    tmp_path_factory: pytest.TempPathFactory, name: str
) -> None:
    path = written(tmp_path_factory.mktemp("sheets"), ["subject", name])
    (row,) = read_sheet(path, PARTICIPANTS)
    assert row["subject"] == name


@pytest.mark.parametrize("column", ["exclude", "accept"])
def test_words_for_no_are_not_reasons(tmp_path: Path, column: str) -> None:

    def reason(word: str) -> str:
        lines = [f"{RECORDING[0]}\t{column}", f"{RECORDING[1]}\t{word}"]
        (row,) = read_sheet(written(tmp_path, lines), RECORDINGS)
        return str(row[column])

    assert [reason(word) for word in ("no", "FALSE", "0")] == [""] * 3
    assert [reason(word) for word in ("yes", "bad cable")] == ["yes", "bad cable"]
    for word in ("n/a", "-", "NA"):
        with pytest.raises(InputError, match=f"column {column}: is '{word}'; expected a reason, yes or no"):
            reason(word)
