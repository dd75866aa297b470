"""Reading text files: refusal of other kinds, unreadable paths and excessive contents."""

import os
from pathlib import Path

import pytest

from shukotsu.errors import MOST_LETTERS, InputError
from shukotsu.study.config_files import read_config
from shukotsu.study.study import read_study
from shukotsu.tables.text_files import open_text, read_text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"%PDF-1.7 ...", "is a PDF document; expected a sheet: save it as text"),
        (b"PK\x03\x04...", r"is a spreadsheet .*\.xlsx.*; expected a sheet: save it as CSV"),
        (b"\xd0\xcf\x11\xe0...", "is an old spreadsheet"),
        (b"\x1f\x8b...", "is packed by gzip"),
        (b"PAR1", "is a Parquet file"),
        ("a".encode("utf-16")[:3], "begins as UTF-16 text but is not valid"),
        (b"a\nb\nc\xe9\n", "line 3: is not UTF-8 text; save it as UTF-8"),
    ],
)
def test_files_that_are_not_text_are_refused_by_kind(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "a.tsv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_text(path, "a sheet")
    if b"\n" not in content:
        with pytest.raises(InputError, match=message):
            open_text(path, "a sheet")


def test_a_text_is_read_with_any_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.tsv"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\rc\n")
    assert read_text(path, "a sheet") == "a\nb\nc\n"
    with pytest.raises(InputError, match="has 10 bytes; expected a sheet, at most 9 bytes"):
        read_text(path, "a sheet", 9)


def test_unreadable_paths_are_refused_with_the_reason(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.tsv: no such file; expected a sheet$"):
        read_text(tmp_path / "a.tsv", "a sheet")
    with pytest.raises(InputError, match=r"no such file; expected a sheet; folders are separated by / and"):
        read_text(tmp_path / "data\\a.tsv", "a sheet")
    with pytest.raises(InputError, match=r"cannot be read \(File name too long\)"):
        read_text(tmp_path / ("a" * 300), "a sheet")
    with pytest.raises(InputError, match="no file can have this name"):
        read_text(tmp_path / "a\0b", "a sheet")
    os.mkfifo(tmp_path / "pipe")
    for path, kind in (
        (tmp_path / "pipe", "a pipe"),
        (Path("/dev/zero"), "a device"),
        (tmp_path, "a folder"),
    ):
        for read in (read_text, open_text):
            with pytest.raises(InputError, match=f"is {kind}; expected a sheet, a regular file"):
                read(path, "a sheet")


def bomb(depth: int) -> str:
    """Return YAML of nested aliases that expands to 9**depth values."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, depth)]
    return "\n".join(lines)


REST = "recordings: r.tsv\nlayout: arm\nmodels: [rigid]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (bomb(10), r"not valid YAML: expands to more than 100000 values \(line 6, column 5\)"),
        ("a: &a [*a]", "expands to more than 100000 values"),
        ("study: " + "[" * 200_000, r"nested deeper than 40 \(line 1, column 47\)"),
        ("study: " + "[" * 300 + "]" * 300, "nested deeper than 40"),
        ("- " * 400, "nested deeper than 40"),
        ("study: " + "1" * 100_000, "not valid YAML: "),
        ("study: 0x" + "1" * 100_000, "study: is a number of more than 18 digits"),
        (REST + "study: " + "1:" * 5_000 + "1", "study: has 10001 letters"),
        ("study: a\n\trecordings: b", r"a tab .*\(line 2, column 1\); indent with spaces"),
        ('study: "a\\0b"', "study: contains a control character"),
        (REST + "study: " + "a" * 5_000, "study: has 5000 letters; expected at most 100"),
        ("x" * 1_900_000, "contains a text instead of keys; expected a study file"),
        ("x" * 2_100_000, "has 2100000 bytes; expected a study file, at most 2000000 bytes"),
    ],
)
def test_a_configuration_with_excessive_contents_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_config(path, "study")
    assert len(str(caught.value)) <= MOST_LETTERS


@pytest.mark.parametrize(
    ("keys", "subject", "file", "message"),
    [
        ("", "s" * 140_000, "a.csv", "row 2, columns subject, session, task, trial: have 140006 bytes"),
        ("", "s", "f" * 5_000, "row 2, column file: has a part of more than 255 bytes, which is too long"),
        (f"participants: {'p' * 5_000}\n", "s", "a.csv", r"cannot be read \(File name too long\)"),
    ],
)
def test_long_names_and_cells_are_shortened_in_messages(
    tmp_path: Path, keys: str, subject: str, file: str, message: str
) -> None:
    (tmp_path / "study.yaml").write_text(f"study: a\n{REST}{keys}")
    header = "subject\thand\ttask\trole\tfile"
    (tmp_path / "r.tsv").write_text(f"{header}\n{subject}\tright\trom\tboth\t{file}\n")
    with pytest.raises(InputError, match=message) as caught:
        read_study(tmp_path / "study.yaml")
    assert len(str(caught.value)) <= MOST_LETTERS
