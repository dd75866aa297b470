"""Whatever comes, and however fast: memory has a bound, questions have an end, and no empty file is left."""

import io
import json
import time
from pathlib import Path

import pytest
from tracker_processes import PATIENCE_S

from schemas.errors import InputError
from trackers.archive import EVENT, RECEIVED, open_archive
from trackers.protocols.stream_settings import StreamSettings
from trackers.record import conversation, session
from trackers.record.conversation import Conversation
from trackers.record.driver import Driver
from trackers.record.port import Port
from trackers.record.recording_terminal import StopRequest, Terminal
from trackers.record.request import RecordingRequest
from trackers.record.session import RecordingPlan, record

PIECE = b"\xc3junk\r\n" * 1000


class FloodedPort(Port):
    """A port that always has more, faster than anybody can take it; it takes what is sent."""

    def __init__(self) -> None:
        self.name = "flood"
        self.baud = self.line_baud = None
        self.stop: StopRequest | None = None

    def read(self) -> bytes:
        """Give junk at once."""
        return PIECE

    def write(self, data: bytes) -> None:
        """Take a command; somebody may ask for the end just then."""
        del data
        if self.stop is not None:
            self.stop.ask("SIGTERM")


@pytest.fixture
def small_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conversation, "MOST_WAITING_BYTES", 10 * len(PIECE))
    monkeypatch.setattr(conversation, "MOST_BEFORE_FRAMES_BYTES", 100 * len(PIECE))


@pytest.mark.usefixtures("small_limits")
def test_what_nobody_takes_is_dropped_and_counted() -> None:
    reader = Conversation(FloodedPort())
    end = time.monotonic() + PATIENCE_S
    while not reader.dropped_bytes and time.monotonic() < end:
        time.sleep(0.01)
    assert reader.dropped_bytes % len(PIECE) == 0 < reader.dropped_bytes
    reader.close()
    dropped = reader.dropped_bytes
    assert len(reader.keep()) == 11
    assert not reader.keep(), "all that was not dropped has been given"
    assert reader.dropped_bytes == dropped


@pytest.mark.usefixtures("small_limits")
def test_no_question_goes_on_for_ever() -> None:
    """Nor does it search through all that has come again and again."""
    reader, longest = Conversation(FloodedPort()), 0

    def answer_in(data: bytes) -> None:
        nonlocal longest
        longest = max(longest, len(data))

    try:
        with pytest.raises(InputError, match=r"^flood: what answers is no tracker: it sent \d+ MB before it"):
            reader.ask(b"?", answer_in, PATIENCE_S)
        assert longest <= conversation.ANSWER_BYTES + 11 * len(PIECE)
        reader.frames_began = True
        assert reader.receive(PATIENCE_S), "frames may be as many as they are"
    finally:
        reader.close()


@pytest.mark.parametrize("family", ["liberty", "fastrak", "viper", "trakstar"])
def test_a_flood_is_no_tracker_and_leaves_no_file(family: str, tmp_path: Path) -> None:
    plan = RecordingPlan(tmp_path / "rom.arrows", RecordingRequest(family))
    with pytest.raises(InputError, match=r"^flood: what answers is no tracker"):
        record(plan, FloodedPort(), Terminal(io.StringIO(), io.StringIO()), StopRequest(), {})
    assert not plan.out.exists()


def test_a_stop_is_heard_through_a_flood(tmp_path: Path) -> None:
    plan = RecordingPlan(tmp_path / "rom.arrows", RecordingRequest("liberty"))
    port = FloodedPort()
    port.stop = stop = StopRequest()
    ending = record(plan, port, Terminal(io.StringIO(), io.StringIO()), stop, {})
    assert (ending.reason, ending.failed, ending.totals) == ("SIGTERM", False, None)
    assert not plan.out.exists()


class SetUpAlready(Driver):
    """A driver that has nothing to do."""

    def set_up(self) -> StreamSettings:
        """Say how the stream would be."""
        return StreamSettings("viper", "binary", "cm", 240.0, (1,))

    def start(self) -> dict[str, object]:
        """Say nothing of it."""
        return {}

    def stop(self) -> None:
        """Stop nothing."""

    def put_back(self) -> None:
        """Put nothing back."""


@pytest.mark.usefixtures("small_limits")
def test_what_a_recording_drops_is_counted_in_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every byte that came is in the archive or in its count."""
    plan, port, stop = (
        RecordingPlan(tmp_path / "rom.arrows", RecordingRequest("viper")),
        FloodedPort(),
        StopRequest(),
    )
    left = 1000

    def read() -> bytes:
        nonlocal left
        if not left:
            stop.ask("key q")
            time.sleep(0.001)
            return b""
        left -= 1
        return PIECE

    monkeypatch.setattr(port, "read", read)
    monkeypatch.setattr(session, "driver_of", SetUpAlready)
    ending = record(plan, port, Terminal(io.StringIO(), io.StringIO()), stop, {})
    assert (ending.reason, ending.failed) == ("key q", False)
    pieces = list(open_archive(plan.out).pieces())
    kept = sum(len(d) for p in pieces for kind, d in zip(p.kind, p.data, strict=True) if kind == RECEIVED)
    events = [json.loads(d) for p in pieces for kind, d in zip(p.kind, p.data, strict=True) if kind == EVENT]
    dropped = sum(event["bytes"] for event in events if event["event"] == "bytes-dropped")
    assert ending.notices[-1] == f"{dropped} bytes came faster than they could be kept; lost"
    assert kept > 0
    assert dropped > 0
    assert kept + dropped == 1000 * len(PIECE)
