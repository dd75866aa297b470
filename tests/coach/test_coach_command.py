"""The command `shukotsu coach`, the study settings that it uses, and the row that it adds to the sheet."""

import re
import shutil
import signal
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from simulated_poses import recorded, write_poses
from tracker_processes import PATIENCE_S, SHUKOTSU, emulator

from shukotsu.coach.study import enter_recording, hand_of, new_archive
from shukotsu.commands.coach_hand import main as coach
from shukotsu.commands.new_study import main as new_study
from shukotsu.errors import InputError
from shukotsu.fit.measurements import Measurement
from shukotsu.study.sheets import RECORDINGS, read_sheet
from shukotsu.tracker.archive import FollowedArchive

pytestmark = pytest.mark.slow


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    return tmp_path / "empty"


def test_a_replay_needs_no_study_and_leaves_no_file(
    archive: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The output is the same at any speed."""
    assert coach([f"--replay={archive}", "--speed=4"]) == 0
    first = capsys.readouterr().out
    assert ">> Move every finger" in first
    assert re.search(r"\d+ of 15 joints good enough after 3 s; left are ", first)
    assert list(folder.iterdir()) == []
    assert coach([f"--replay={archive}", "--speed=0", "--page=x.html"]) == 0
    assert capsys.readouterr().out == first
    assert [path.name for path in folder.iterdir()] == ["x.html"]
    short = folder / "short.arrows"
    short.write_bytes(archive.read_bytes()[: archive.stat().st_size // 2])
    assert coach([f"--replay={short}", "--speed=0"]) == 0
    assert re.search(r"Not calibrated: \d+ frames show no hand yet", capsys.readouterr().out)


def test_a_growing_file_is_followed_to_its_end(
    archive: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    growing, data = folder / "growing.arrows", archive.read_bytes()
    growing.write_bytes(data[: len(data) // 2])

    def grow() -> None:
        end = time.monotonic() + PATIENCE_S
        while not growing.with_suffix(".html").is_file() and time.monotonic() < end:
            time.sleep(0.01)  # until the coach shows the first half
        growing.write_bytes(data)

    with ThreadPoolExecutor() as others:
        others.submit(grow)
        assert coach([f"--follow={growing}"]) == 0
    assert "of 15 joints good enough after 3 s" in capsys.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == ["growing.arrows", "growing.html"]


def test_the_row_is_added_although_the_page_cannot_be_written(
    archive: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:

    class Recorded(FollowedArchive):
        notes = ("ended",)

        def __init__(self, out: Path, _options: list[str]) -> None:
            out.write_bytes(archive.read_bytes()[: archive.stat().st_size // 2])
            super().__init__(out)
            self.ended = True

        def stop(self) -> int:
            if Path("pages").is_dir():
                shutil.rmtree("pages")
                Path("pages").touch()
            return 0

    monkeypatch.setattr("shukotsu.coach.live_poses.Recorder", Recorded)
    assert new_study([str(folder)]) == 0
    (folder / "participants.tsv").write_text("subject\n03\n")
    (folder / "pages").mkdir()
    assert coach(["--port=made up", "--subject=03", "--page=pages/x.html"]) == 0
    printed = capsys.readouterr()
    assert "captures/03_right_rom.arrows: entered in recordings.tsv as excluded: it shows no" in printed.out
    assert printed.err.count("note: the page is no longer updated: pages/x.html: ") == 1
    (row,) = read_sheet(folder / "recordings.tsv", RECORDINGS)
    assert (row["file"], row["exclude"]) == ("captures/03_right_rom.arrows", "it shows no hand")


def test_a_calibration_from_a_tracker_becomes_a_row_of_the_study(folder: Path, tmp_path: Path) -> None:
    assert new_study([str(folder)]) == 0
    (folder / "participants.tsv").write_text("subject\n03\n")
    played = write_poses(tmp_path / "a.parquet", recorded(seed=7001, n_frames=2880)[1], "right", "rom")
    with emulator(f"--recording={played}") as port:
        command = [*SHUKOTSU, "coach", f"--port={port}", "--subject=03", "--", "--note=by hand"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            while "joints good enough" not in process.stdout.readline():
                assert process.poll() is None
            process.send_signal(signal.SIGINT)
            out, error = process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
    assert process.returncode == 0, error
    assert "captures/03_right_rom.arrows: entered in recordings.tsv" in out
    assert "0 frames lost" in error
    (row,) = read_sheet(folder / "recordings.tsv", RECORDINGS)
    assert (row["role"], row["file"], row["exclude"]) == ("calibration", "captures/03_right_rom.arrows", "")
    assert sorted(path.name for path in (folder / "captures").iterdir()) == [
        "03_right_rom.arrows",
        "03_right_rom.html",
    ]
    assert coach(["--replay=captures/03_right_rom.arrows", "--speed=0"]) == 0


WHOSE = {"subject": "03", "hand": "left"}


@pytest.fixture
def study(tmp_path: Path) -> Path:
    assert new_study([str(tmp_path / "piano")]) == 0
    return tmp_path / "piano/study.yaml"


def test_sizes_measurements_and_wanted_errors_are_the_studys(study: Path) -> None:
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
    assert (*hand.sizes_mm.values(), hand.layout.wanted_mm) == (190.0, 85.0, 1.5)
    assert hand.measurements == (Measurement("index_middle", 23.5, 0.4),)
    assert (hand.layout.name, hand.model.name, dict(hand.whose)) == ("liberty16", "whole-hand", WHOSE)


def test_a_recording_is_appended_to_the_sheet_as_the_next_trial(study: Path) -> None:
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
    sheet.write_text(refused := "subject\thand\ttask\trole\tfile\n03\tup\trom\tboth\ta.csv\n")
    with pytest.raises(InputError, match="hand"):
        enter_recording(study, WHOSE, archive)
    assert sheet.read_text() == refused


def test_a_new_archive_never_replaces_another(tmp_path: Path) -> None:
    first = new_archive(tmp_path, WHOSE, "left")
    assert first.relative_to(tmp_path).as_posix() == "captures/03_left_rom.arrows"
    first.parent.mkdir()
    first.touch()
    assert new_archive(tmp_path, WHOSE, "left").name == "03_left_rom_2.arrows"
    assert new_archive(tmp_path, {}, "right").name == "right_rom.arrows"
