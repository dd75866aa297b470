"""Rows and names that are added to the files people keep: every byte there stays."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from program_files import REPOSITORY
from small_study import write_study

from shukotsu.coach.study_setup import archive_of, enter_recording, setup_of
from shukotsu.coach.study_sheets import add_row, hands_of, name_sheet
from shukotsu.errors import InputError
from shukotsu.schemas.config_files import read_yaml
from shukotsu.schemas.sheets import MEASUREMENTS, PARTICIPANTS, RECORDINGS, TOUCHES, read_sheet

LENGTH = {"subject": "03", "hand": "right", "quantity": "index_middle", "value_mm": 23.5, "sd_mm": 0.4}
MET = {"subject": "03", "hand": "left", "task": "rom", "digit": "index", "meets": "thumb"}


def test_sheets_are_made_and_read_back(tmp_path: Path) -> None:
    add_row(tmp_path / "own" / "m.tsv", MEASUREMENTS, LENGTH)
    add_row(tmp_path / "own" / "m.tsv", MEASUREMENTS, LENGTH | {"session": "2"})
    rows = read_sheet(tmp_path / "own" / "m.tsv", MEASUREMENTS)
    assert [row.values for row in rows] == [LENGTH | {"session": ""}, LENGTH | {"session": "2"}]
    add_row(tmp_path / "t.tsv", TOUCHES, MET | {"from_s": 1.25, "to_s": 2, "sd_mm": None})
    (row,) = read_sheet(tmp_path / "t.tsv", TOUCHES)
    assert (row["meets"], row["from_s"], row["x_mm"], row["sd_mm"]) == ("thumb", 1.25, None, None)
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["t.tsv", "m.tsv"]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("last", ["", "{end}", "{end}{end}"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_every_byte_stays(tmp_path: Path, end: str, last: str, mark: bytes) -> None:
    """Line ends, the order of columns, columns of others, blanks, a line without its end."""
    path = tmp_path / "m.tsv"
    header = "note\tsd_mm\tsubject \tvalue_mm\thand\tquantity"
    text = f"{header}{end}é ä\t0.5\tP 1\t20\tleft\tindex_middle" + last.format(end=end)
    path.write_bytes(mark + text.encode())
    path.chmod(0o640)
    add_row(path, PARTICIPANTS, {"subject": "03", "site": "A"})
    line_end = "" if last else end
    more = text.replace(header, f"{header}\tsite", 1) + f"{line_end}\t\t03\t\t\t\tA{end}"
    assert path.read_bytes() == mark + more.encode()
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        (LENGTH, "row 3: subject '03', hand 'right', quantity 'index_middle' already stands in row 2"),
        (
            LENGTH | {"quantity": "a", "sd_mm": -1},
            "row 3, column sd_mm: is '-1'; expected a number above",
        ),
        (LENGTH | {"quantity": "a", "colour": "red"}, "row 1: unknown column colour"),
        (LENGTH | {"quantity": "a\tb"}, "column quantity: 'a\\tb' has tabs"),
    ],
)
def test_a_row_that_cannot_stand_there_is_refused(tmp_path: Path, row: dict[str, Any], sentence: str) -> None:
    path = tmp_path / "m.tsv"
    add_row(path, MEASUREMENTS, LENGTH)
    before = path.read_bytes()
    with pytest.raises(InputError) as refused:
        add_row(path, MEASUREMENTS, row)
    assert sentence in str(refused.value)
    assert path.read_bytes() == before


ADDING = """
import sys
from pathlib import Path
from shukotsu.coach.study_sheets import add_row
from shukotsu.schemas.sheets import PARTICIPANTS
for number in range(25):
    add_row(Path(sys.argv[1]), PARTICIPANTS, {"subject": f"{sys.argv[2]}-{number}"})
"""


def test_processes_that_add_at_once_lose_no_row(tmp_path: Path) -> None:
    path = tmp_path / "participants.tsv"
    argv = [sys.executable, "-c", ADDING, str(path)]
    adding = [subprocess.Popen([*argv, name], cwd=REPOSITORY) for name in "abc"]
    assert [process.wait() for process in adding] == [0, 0, 0]
    assert len(read_sheet(path, PARTICIPANTS)) == 75
    assert [own.name for own in tmp_path.iterdir()] == ["participants.tsv"]


@pytest.mark.parametrize(
    "text", ["study: a  # ours\nlist: [1,\n  2]", "# é\r\nstudy: 'a'\r\n# touches: no\r\n"]
)
def test_a_sheet_is_named_and_all_else_stays(tmp_path: Path, text: str) -> None:
    study = tmp_path / "study.yaml"
    study.write_bytes(text.encode())
    before = read_yaml(study, "study")
    for _ in range(2):  # the second time it stands there
        assert name_sheet(study, "touches", "my touches.tsv") == tmp_path / "my touches.tsv"
    end = "\r\n" if "\r\n" in text else "\n"
    line = f"touches: my touches.tsv{end}"
    assert study.read_bytes().decode() == text + ("" if text.endswith("\n") else end) + line
    assert read_yaml(study, "study") == before | {"touches": "my touches.tsv"}
    assert name_sheet(study, "touches", "others.tsv") == tmp_path / "my touches.tsv"


@pytest.mark.parametrize("text", ["{study: a}\n", "study: a\n...\n", "study: a\nnote: |\n  open", "- a\n"])
def test_where_a_line_changes_more_it_is_left_to_the_user(tmp_path: Path, text: str) -> None:
    study = tmp_path / "study.yaml"
    study.write_text(text)
    with pytest.raises(InputError, match=r"add the line `touches: touches\.tsv` to it by hand"):
        name_sheet(study, "touches", "touches.tsv")
    assert study.read_text() == text


def test_who_is_done(tmp_path: Path) -> None:
    """Who has no recording yet is among them; one to evaluate, left out or without a file does not count."""
    rows = ["1 right rom both 1.csv", "1 left rom evaluation 1.csv", "2 left rom calibration 2.csv"]
    study = write_study(tmp_path, *rows, "3 right rom both 1.csv - - torn", participants="subject\n4\n1")
    (tmp_path / "1.csv").touch()
    done = [(subject, hand) for subject in "4123" for hand in ("right", "left")]
    assert [own[:2] for own in hands_of(study)] == done
    assert [own[:2] for own in hands_of(study) if own.done] == [("1", "right")]
    assert [own[:2] for own in hands_of(study, "left")] == [(subject, "left") for subject in "4123"]
    assert not any(own.done for own in hands_of(study, session="b")), "receivers are put on anew"


def recorded(study: Path, exclude: str = "") -> list[str]:
    """Enter a recording, a touch and a length of it; give the sheets that were written."""
    own = setup_of(study, "03", "left", "", "rom")
    rows = {
        "touches": [own.whose | MET | {"trial": own.trial, "from_s": 1.0, "to_s": 1.5}],
        "measurements": [LENGTH | {"hand": "left", "quantity": f"index_{'middle' if exclude else 'distal'}"}],
    }
    return [path.name for path in enter_recording(study, own, archive_of(study, own), exclude, rows)]


def test_a_recording_that_is_left_out_keeps_what_was_measured(tmp_path: Path) -> None:
    study = write_study(tmp_path)
    assert recorded(study, "receivers were put right in it") == ["recordings.tsv", "measurements.tsv"]
    (row,) = setup_of(study, "03", "left", "", "rom").measurements
    assert row["quantity"] == "index_middle"
    assert recorded(study) == ["recordings.tsv", "touches.tsv", "measurements.tsv"]


def test_what_two_coaches_record_at_once_become_two_repetitions(tmp_path: Path) -> None:
    study = write_study(tmp_path)
    first, second = (setup_of(study, "03", "left", "", "rom") for _ in range(2))
    touch = second.whose | MET | {"trial": second.trial, "from_s": 1.0, "to_s": 1.5}
    for own, name in ((first, "a.arrows"), (second, "b.arrows")):
        enter_recording(study, own, tmp_path / name, "", {"touches": [touch]} if own is second else {})
    rows = read_sheet(study.parent / "sheets/recordings.tsv", RECORDINGS)
    assert [(row["trial"], row["file"]) for row in rows] == [("", "a.arrows"), ("2", "b.arrows")]
    assert [row["trial"] for row in read_sheet(study.parent / "touches.tsv", TOUCHES)] == ["2"]
