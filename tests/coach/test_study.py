"""What the coach reads of a study, and the row that it adds to the sheet of recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from shukotsu.coach.study import enter_recording, hand_of, new_archive
from shukotsu.commands.new_study import main as new_study
from shukotsu.errors import InputError
from shukotsu.schemas.sheets import RECORDINGS, read_sheet
from shukotsu.stages.fit_hand.measurements import Measurement

WHOSE = {"subject": "03", "hand": "left"}


@pytest.fixture
def study(tmp_path: Path) -> Path:
    assert new_study([str(tmp_path / "piano")]) == 0
    return tmp_path / "piano/study.yaml"


def test_sizes_lengths_and_what_is_asked_are_the_studys(study: Path) -> None:
    folder = study.parent
    (folder / "participants.tsv").write_text("subject\thand_length_mm\thand_breadth_mm\n03\t190\t85\n")
    rows = (
        "subject\thand\tquantity\tvalue_mm\tsd_mm",
        "03\tleft\tindex_middle\t23.5\t0.4",
        "03\tright\tindex_middle\t9\t1",
    )
    (folder / "measurements.tsv").write_text("".join(f"{row}\n" for row in rows))
    study.write_text(study.read_text() + "measurements: measurements.tsv\nwanted_mm: 1.5\n")
    hand = hand_of(study, "03", "left")
    assert (hand.hand_length_mm, hand.hand_breadth_mm, hand.wanted_mm) == (190.0, 85.0, 1.5)
    assert hand.measurements == (Measurement("index_middle", 23.5, 0.4),)
    assert (hand.layout.name, hand.model.name, dict(hand.whose)) == ("liberty16", "whole-hand", WHOSE)


def test_a_recording_becomes_the_next_repetition_and_every_byte_before_stays(study: Path) -> None:
    sheet = study.parent / "recordings.tsv"
    before = b"\xef\xbb\xbfsubject\thand\ttask\trole\tfile\r\n03\tleft\trom\tboth\ta.csv\r\n\r\n"
    sheet.write_bytes(before)
    archive = study.parent / "captures/b.arrows"
    assert enter_recording(study, WHOSE, archive, "put right") == sheet
    header, *rows = sheet.read_bytes().removeprefix(b"\xef\xbb\xbf").decode().split("\r\n")
    assert header == "subject\thand\ttask\trole\tfile\ttrial\texclude"
    assert rows == [
        "03\tleft\trom\tboth\ta.csv",
        "",
        "03\tleft\trom\tcalibration\tcaptures/b.arrows\t2\tput right",
        "",
    ]
    enter_recording(study, WHOSE, archive.with_name("c.arrows"))
    assert [row["trial"] for row in read_sheet(sheet, RECORDINGS)] == ["", "2", "3"]


def test_a_sheet_that_would_be_refused_stays_as_it_was(study: Path) -> None:
    sheet = study.parent / "recordings.tsv"
    sheet.write_text("subject\thand\ttask\trole\tfile\n03\tup\trom\tboth\ta.csv\n")
    before = sheet.read_bytes()
    with pytest.raises(InputError, match="hand"):
        enter_recording(study, WHOSE, study.parent / "captures/b.arrows")
    assert sheet.read_bytes() == before


def test_no_archive_takes_the_place_of_another(tmp_path: Path) -> None:
    first = new_archive(tmp_path, WHOSE, "left")
    assert first.relative_to(tmp_path).as_posix() == "captures/03_left_rom.arrows"
    first.parent.mkdir()
    first.touch()
    assert new_archive(tmp_path, WHOSE, "left").name == "03_left_rom_2.arrows"
    assert new_archive(tmp_path, {}, "right").name == "right_rom.arrows"
