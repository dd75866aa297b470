"""Joining servers of OpenIGTLink: what is found out of one, and what is recorded."""

import re
import signal
from pathlib import Path

import numpy as np
import pytest
from fuzzing.tracker_streams import igtl_frame, igtl_message
from tracker_processes import PATIENCE_S, capture, emulator, started, until_lines

from shukotsu.errors import InputError
from shukotsu.schemas.tables import read_metadata
from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.records_table import flagged_records
from shukotsu.trackers.decode.survey import survey_archive
from shukotsu.trackers.emulate.pose_sources import built_in_motion
from shukotsu.trackers.protocols.records import concatenated
from shukotsu.trackers.record.request import RecordingRequest


class Server:
    """A server without stamps at 100 Hz, whose tools come in an order of its own; a third one comes late."""

    period_s = 0.01
    streaming = True

    def __init__(self, kind: bytes = b"TRANSFORM") -> None:
        self.kind, self.frame, self.asked = kind, 0, b""

    def take(self, data: bytes) -> bytes:
        """Keep what it is asked."""
        self.asked += data
        return b""

    def cycle(self) -> bytes:
        """Give a frame, cut in the midst of a message."""
        self.frame += 1
        stations = (10, 2, 30)[: 2 + (self.frame > 170)]
        return igtl_message(b"STATUS", b"", b"fine") + b"".join(
            igtl_frame(self.kind, self.frame, stations, stamped=False)
        )


@pytest.mark.parametrize("kind", [b"TRANSFORM", b"TDATA"])
def test_tools_are_found_and_one_that_comes_late_is_too(kind: bytes, recorded) -> None:
    server = Server(kind)
    records, settings, tally = recorded(server, RecordingRequest("openigtlink"))
    assert settings.names | {3: "Tool 30"} == {1: "Tool 2", 2: "Tool 10", 3: "Tool 30"}
    assert settings.stations == (1, 2)
    assert settings.rate_hz == pytest.approx(100, rel=0.2)
    assert settings.options["stamps"] is False
    assert {*records.station.tolist()} == {1, 2, 3}
    assert "does not tell the times" in tally.summary["notices"][0]
    assert tally.summary["skipped_bytes"] == 0
    for word in (b"STT_TDATA", b"STT_QTDATA", b"STP_TDATA", b"STP_QTDATA"):
        assert word in server.asked


def test_what_sends_no_pose_is_refused(recorded) -> None:
    with pytest.raises(InputError, match=r"no pose came, and \d+ bytes of other kinds"):
        recorded(Server(b"STRING"), RecordingRequest("openigtlink"))


@pytest.mark.slow
@pytest.mark.parametrize("message", ["transform", "tdata", "qtdata", "position"])
def test_a_recording_that_is_served_is_recorded_and_imported(message: str, tmp_path: Path) -> None:
    """The poses are those of the emulator's motion; the same archive gives the same bytes."""
    out = tmp_path / "rom.arrows"
    with emulator("--message", message, port=("--igtl", "0")) as server:
        done = capture("record", "--port", server.name, "--out", str(out), "--duration", "5")
        assert done.returncode == 0, done.stderr
    names = "--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"
    tables = [tmp_path / f"{name}.parquet" for name in "ab"]
    for table in tables:
        assert capture("import", "--in", str(out), "--out", str(table), *names).returncode == 0
    assert tables[0].read_bytes() == tables[1].read_bytes()
    told = read_metadata(tables[0])["parameters"]
    assert (told["tracker"], told["missing_frames"], told["losses"]) == ("OpenIGTLink", 0, [])
    archive, motion = open_archive(out), built_in_motion()
    records = concatenated([part.records for part in flagged_records(archive, survey_archive(archive))])
    off_mm = np.abs(motion.position_mm[:, records.station[0] - 1] - records.position_mm[0]).max(1)
    cycle, column = (records.frame + int(np.argmin(off_mm))) % motion.cycles, records.station - 1
    assert records.position_mm == pytest.approx(motion.position_mm[cycle, column], abs=1e-4)
    turned = np.einsum("ij,ij->i", records.quaternion, motion.quaternion[cycle, column])
    assert np.abs(turned) == pytest.approx(1, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("killed", ["recorder", "server"])
def test_whoever_is_killed_what_came_is_kept(killed: str, tmp_path: Path) -> None:
    out = str(tmp_path / "rom.arrows")
    with (
        started("emulate", "--igtl", "0") as server,
        started("record", "--port", str(server.stdout.readline()).strip(), "--out", out) as recorder,  # type: ignore[union-attr]
    ):
        until_lines(recorder, 2)
        (recorder if killed == "recorder" else server).kill()
        _, told = recorder.communicate(timeout=PATIENCE_S)
    assert recorder.returncode == {"recorder": -signal.SIGKILL, "server": 3}[killed]
    assert killed == "recorder" or "the port is gone (it was closed at the other end) after" in told
    inspected = capture("inspect", out).stdout
    assert int(re.findall(r"1: (\d+),", inspected)[0]) > 200
    assert "skipped" not in inspected
