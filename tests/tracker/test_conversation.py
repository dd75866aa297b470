"""Conversations with a port that floods: bounded memory and bounded questions."""

import time
from contextlib import closing

import pytest
from tracker_processes import PATIENCE_S

from shukotsu.errors import InputError
from shukotsu.tracker import conversation
from shukotsu.tracker.conversation import Conversation
from shukotsu.tracker.port import Port

PIECE = b"\xc3junk\r\n" * 1000


class FloodedPort(Port):
    """A port that always has more data than can be read, and accepts all that is sent."""

    def read(self) -> bytes:
        """Return junk at once."""
        return PIECE

    def write(self, data: bytes) -> None:
        """Accept a command."""

    def close(self) -> None:
        """Do nothing."""


@pytest.fixture
def small_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conversation, "MOST_WAITING_BYTES", 10 * len(PIECE))
    monkeypatch.setattr(conversation, "MOST_BEFORE_FRAMES_BYTES", 100 * len(PIECE))


@pytest.mark.usefixtures("small_limits")
def test_unread_data_is_dropped_and_counted() -> None:
    reader = Conversation(FloodedPort("flood"))
    end = time.monotonic() + PATIENCE_S
    while not reader.dropped_bytes and time.monotonic() < end:
        time.sleep(0.01)
    assert reader.dropped_bytes % len(PIECE) == 0 < reader.dropped_bytes
    reader.close()
    dropped = reader.dropped_bytes
    assert len(reader.keep()) == 11
    assert not reader.keep(), "all data that was not dropped has been returned"
    assert reader.dropped_bytes == dropped


@pytest.mark.usefixtures("small_limits")
def test_a_question_without_an_answer_ends() -> None:
    lengths: list[int] = []
    with closing(Conversation(FloodedPort("flood"))) as reader:
        with pytest.raises(InputError, match=r"^flood: the device there is not a tracker: it sent \d+ MB be"):
            reader.ask(b"?", lambda data: lengths.append(len(data)), PATIENCE_S)
        assert max(lengths) <= conversation.ANSWER_BYTES + 11 * len(PIECE)
        reader.frames_began = True
        assert reader.receive(PATIENCE_S), "the number of frames is not limited"
