"""Talking with a tracker: what is sent and what comes, all of it kept, and answers found in it.

An answer is found by what it says of itself and never by its place, for records of a stream that was left
running may stand anywhere between.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol, TypeVar

from stages.capture.record.port import Port, PortGoneError
from stages.capture.record.reader import Chunk, Reader

Answer = TypeVar("Answer")

SILENCE_S = 0.3
"""A tracker that sends nothing for so long does not stream."""


class Journal(Protocol):
    """Keeps what passes; an `ArchiveWriter` is one."""

    def received(self, data: bytes, host_ns: int) -> None:
        """Keep bytes that came."""
        ...

    def sent(self, data: bytes, host_ns: int) -> None:
        """Keep bytes that were sent."""
        ...


class NoJournal:
    """Keeps nothing."""

    def received(self, data: bytes, host_ns: int) -> None:
        """Let it go."""

    def sent(self, data: bytes, host_ns: int) -> None:
        """Let it go."""


class StoppedError(Exception):
    """The user ended the recording while the tracker was being talked to."""


class Conversation:
    """A port with its reader, and the journal of all that passes.

    stopped() : whether the user has asked for the end.
    """

    def __init__(
        self, port: Port, reader: Reader, journal: Journal, stopped: Callable[[], bool] = lambda: False
    ) -> None:
        self.port = port
        self.reader = reader
        self.journal = journal
        self._stopped = stopped

    def send(self, data: bytes) -> int:
        """Send; gives the host's monotonic time [ns] just before. Raises PortGoneError."""
        host_ns = time.monotonic_ns()
        self.journal.sent(data, host_ns)
        self.port.write(data)
        return host_ns

    def keep(self, wait_s: float = 0.0) -> list[Chunk]:
        """Keep all that came, and give it; waits so long for a first chunk."""
        chunks = self.reader.take(wait_s)
        for chunk in chunks:
            self.journal.received(chunk.data, chunk.host_ns)
        return chunks

    def receive(self, wait_s: float) -> bytes:
        """Give the bytes that came.

        Raises PortGoneError where no more can come, StoppedError where none is wanted.
        """
        return b"".join(chunk.data for chunk in self.listen(wait_s))

    def listen(self, wait_s: float) -> list[Chunk]:
        """Give what came, with its times. Raises as `receive`."""
        chunks = self.keep(wait_s)
        if not chunks and self.reader.gone:
            raise PortGoneError(self.reader.gone[0])
        if self._stopped():
            raise StoppedError
        return chunks

    def finish(self) -> None:
        """Go on to the end from here, whoever asks for it."""
        self._stopped = lambda: False

    def drain(self, silence_s: float = SILENCE_S, cap_s: float = 5.0) -> tuple[bytes, bool]:
        """Wait for `silence_s` without a byte; gives what came, and whether it ended within `cap_s`."""
        got = bytearray()
        start = heard = time.monotonic()
        while True:
            piece = self.receive(0.02)
            now = time.monotonic()
            if piece:
                got += piece
                heard = now
            elif now - heard >= silence_s:
                return bytes(got), True
            if now - start >= cap_s:
                return bytes(got), False

    def ask(self, question: bytes, found: Callable[[bytes], Answer | None], wait_s: float) -> Answer | None:
        """Send a question and give what `found` sees in the bytes since; None where that is nothing."""
        self.send(question)
        got = b""
        end = time.monotonic() + wait_s
        while (left := end - time.monotonic()) > 0:
            piece = self.receive(min(left, 0.1))
            if piece:
                got += piece
                answer = found(got)
                if answer is not None:
                    return answer
        return None
