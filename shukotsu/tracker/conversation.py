"""Requested settings of a recording, and the dialogue with its tracker, of which all bytes are kept.

A separate thread only reads and time-stamps, so that no other work delays it. An answer is recognised by its
content and not by its position, since records of a stream that is still running may come in between.
"""

from __future__ import annotations

import math
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from shukotsu.errors import InputError
from shukotsu.tracker.archive import ArchiveWriter
from shukotsu.tracker.families import FAMILIES, check_family
from shukotsu.tracker.liberty import FULL_LIST, SHORT_LIST, STATIONS
from shukotsu.tracker.port import Port, PortGoneError
from shukotsu.tracker.records import TRACK

Answer = TypeVar("Answer")

STOP_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
IGNORED_SIGNALS = ("SIGTSTP", "SIGTTOU")
"""Signals that suspend the program, for example Ctrl-Z; the tracker's bytes would overflow a buffer."""


@dataclass(frozen=True)
class RecordingRequest:
    """Settings requested for a recording.

    short : whether to record only frame count, position and quaternion. asked_hz : frame rate, None for the
    default. stations : None for all connected ones. hemisphere : vector into the half of space of the
    receivers, or TRACK. Raises InputError for settings that the family does not support.
    """

    family: str
    short: bool = False
    asked_hz: int | None = None
    stations: tuple[int, ...] | None = None
    hemisphere: tuple[float, float, float] = (1.0, 0.0, 0.0)
    no_filters: bool = False

    def __post_init__(self) -> None:
        check_family(self.family, "--tracker")
        if self.asked_hz is not None and len(FAMILIES[self.family].rates_hz) < 2:
            raise InputError(f"--rate: a {self.family} has a fixed rate; leave it out")
        if self.family == "viper" and self.stations is not None:
            raise InputError("--stations: a VIPER sends every sensor that is connected; leave it out")
        if self.family == "viper" and self.short:
            raise InputError("--items: a VIPER has no output lists; leave it out")

    @property
    def items(self) -> tuple[int, ...]:
        """Output list for LIBERTY and PATRIOT."""
        return SHORT_LIST if self.short else FULL_LIST

    @property
    def rate_hz(self) -> int:
        """Frames per second."""
        return self.asked_hz or FAMILIES[self.family].rates_hz[0]


def parse_stations(text: str) -> tuple[int, ...]:
    """Parse --stations: numbers and ranges such as 1-8,12. Raises InputError if it is invalid."""
    ranges = []
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            ranges.append(range(int(first), int(last or first) + 1))
    except ValueError as error:
        raise InputError(f"--stations: is {text!r}; expected numbers such as 1-8,12") from error
    if not all(each and each[0] in STATIONS and each[-1] in STATIONS for each in ranges):
        raise InputError(f"--stations: is {text!r}; expected numbers from 1 to {STATIONS[-1]}")
    return tuple(sorted(set().union(*ranges)))


def parse_hemisphere(text: str) -> tuple[float, float, float]:
    """Parse --hemisphere: three numbers separated by commas, or `track`. Raises InputError if invalid."""
    if text == "track":
        return TRACK
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError as error:
        raise InputError(f"--hemisphere: is {text!r}; expected x,y,z such as 1,0,0, or track") from error
    if not 0 < math.hypot(x, y, z) < math.inf:
        raise InputError(f"--hemisphere: {text} has no direction; expected x,y,z such as 1,0,0, or track")
    return (x, y, z)


class StopRequest:
    """A request to stop; true once requested. reason : reason of the first request, or ""."""

    def __init__(self) -> None:
        self.reason = ""

    def ask(self, reason: str) -> None:
        """Request a stop; only the first reason is kept."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return bool(self.reason)


@contextmanager
def stop_on_signals(stop: StopRequest) -> Iterator[None]:
    """Let signals request a stop instead of ending the program, within the `with` block."""

    def ask(number: int, _frame: Any) -> None:
        stop.ask(signal.Signals(number).name)

    handlers = dict.fromkeys(STOP_SIGNALS, ask) | dict.fromkeys(IGNORED_SIGNALS, signal.SIG_IGN)
    there = {getattr(signal, name): handler for name, handler in handlers.items() if hasattr(signal, name)}
    before = {number: signal.signal(number, handler) for number, handler in there.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


SILENCE_S = 0.3
"""A tracker that is silent for this long is not streaming."""
MOST_WAITING_BYTES = 16 << 20
"""Largest backlog of bytes to be stored, half a minute of the fastest tracker; further bytes are dropped and
counted."""
MOST_BEFORE_FRAMES_BYTES = 32 << 20
"""More bytes than any tracker sends during set-up, even if it was left streaming."""
ANSWER_BYTES = 1 << 16
"""Length of the longest answer."""


@dataclass(frozen=True)
class Chunk:
    """Bytes of one read, and the host's monotonic time of their arrival in ns."""

    data: bytes
    host_ns: int


class StoppedError(Exception):
    """Raised if the user stops the recording during the dialogue with the tracker."""


class Conversation:
    """Dialogue over a port, which a thread reads until `close`.

    archive : stores all bytes sent and received. stopped : returns whether the user has requested the end.
    gone : reason and host time in ns of the port's loss; None while it is open. dropped_bytes : number of
    bytes that arrived faster than they could be stored. frames_began : whether streaming has begun; before,
    the amount of data is limited.
    """

    def __init__(
        self, port: Port, archive: ArchiveWriter | None = None, stopped: Callable[[], bool] = lambda: False
    ) -> None:
        self.port = port
        self.gone: tuple[str, int] | None = None
        self.dropped_bytes = 0
        self.frames_began = False
        self._queued_bytes = 0  # changed only by the reader's thread
        self._taken_bytes = 0  # changed only by the caller's thread
        self._archive = archive
        self._stopped = stopped
        self._chunks: queue.SimpleQueue[Chunk] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop reading; the port may be closed when this returns."""
        self._ended.set()
        self._thread.join(timeout=5)

    def _read(self) -> None:
        while not self._ended.is_set():
            try:
                data = self.port.read()
            except PortGoneError as error:
                self.gone = (str(error), time.perf_counter_ns())
                return
            if self._queued_bytes - self._taken_bytes > MOST_WAITING_BYTES:
                self.dropped_bytes += len(data)
            elif data:
                self._queued_bytes += len(data)
                self._chunks.put(Chunk(data, time.perf_counter_ns()))

    def send(self, data: bytes) -> None:
        """Send data. Raises PortGoneError."""
        if self._archive is not None:
            self._archive.sent(data, time.perf_counter_ns())
        self.port.write(data)

    def keep(self, wait_s: float = 0.0) -> list[Chunk]:
        """Store and return all chunks received so far; wait_s : longest time to wait for the first one."""
        chunks = []
        with suppress(queue.Empty):
            chunks.append(self._chunks.get(timeout=wait_s))
            chunks += [self._chunks.get_nowait() for _ in range(self._chunks.qsize())]
        self._taken_bytes += sum(len(chunk.data) for chunk in chunks)
        if self._archive is not None:
            for chunk in chunks:
                self._archive.received(chunk.data, chunk.host_ns)
        return chunks

    def receive(self, wait_s: float) -> bytes:
        """Return the bytes received. Raises the errors of `listen`."""
        return b"".join(chunk.data for chunk in self.listen(wait_s))

    def listen(self, wait_s: float) -> list[Chunk]:
        """Store and return the chunks received; wait_s : longest time to wait for the first one.

        Raises PortGoneError if the port is gone, StoppedError if the user requested a stop, InputError if
        more bytes arrived than a tracker sends during set-up.
        """
        chunks = self.keep(wait_s)
        if not chunks and self.gone:
            raise PortGoneError(self.gone[0])
        if self._stopped():
            raise StoppedError
        if self._taken_bytes > MOST_BEFORE_FRAMES_BYTES and not self.frames_began:
            raise InputError(
                f"{self.port.name}: the device there is not a tracker: it sent {self._taken_bytes >> 20} MB "
                "before it could be set up; check --port"
            )
        return chunks

    def drain(self, silence_s: float = SILENCE_S, cap_s: float = 5.0) -> tuple[bytes, bool]:
        """Read until no byte arrives for `silence_s`; return the bytes, and whether `cap_s` sufficed."""
        came = b""
        start = heard = now = time.perf_counter()
        while now - start < cap_s:
            piece = self.receive(0.02)
            now = time.perf_counter()
            came, heard = came + piece, now if piece else heard
            if now - heard >= silence_s:
                return came, True
        return came, False

    def ask(
        self, question: bytes, answer_in: Callable[[bytes], Answer | None], wait_s: float
    ) -> Answer | None:
        """Send a question and return the answer, or None if there is none within `wait_s`.

        answer_in : extracts the answer from the bytes received since, or returns None.
        """
        self.send(question)
        came = b""
        end = time.perf_counter() + wait_s
        while (left := end - time.perf_counter()) > 0:
            if piece := self.receive(min(left, 0.1)):
                came = came[-ANSWER_BYTES:] + piece
                if (answer := answer_in(came)) is not None:
                    return answer
        return None


OTHER_BAUDS = (115200, 57600, 38400, 19200, 9600)


class TrackerDriver:
    """Base class of the drivers. warnings : sentences for the user on the tracker's state after set-up."""

    def __init__(self, conversation: Conversation, request: RecordingRequest) -> None:
        self.warnings: list[str] = []
        self._complaints: list[str] = []  # errors that the tracker reported during set-up
        self._conversation = conversation
        self._request = request
        self._port_name = conversation.port.name

    def _find(self, attempt: Callable[[], tuple[str | None, bytes]]) -> str:
        """Identify the tracker at the port's baud rate or, on a serial line, at any other.

        attempt : returns the tracker's identification, or None, and all bytes received. Raises InputError if
        nothing answers, or a device that is not this tracker.
        """
        port = self._conversation.port
        first_baud, heard_at_first = port.line_baud, b""
        bauds = [] if first_baud is None else [baud for baud in OTHER_BAUDS if baud != first_baud]
        for baud in (None, *bauds):  # None: at the rate that the port has
            if baud is not None:
                port.set_baud(baud)
            identity, heard = attempt()
            if identity is None and heard:  # on a busy host the answer may have come too late
                identity, heard = attempt()
            if identity is not None:
                if baud is not None:
                    warning = f"it answered at {baud} baud and not at {first_baud}; {baud} is used"
                    self.warnings.append(warning)
                return identity
            heard_at_first = heard_at_first or heard
        title = FAMILIES[self._request.family].title
        if heard_at_first:
            shown = heard_at_first[:24].decode("latin-1").encode("ascii", "backslashreplace").decode()
            raise InputError(
                f"{port.name}: the device there is not a {title} (it sent {shown!r}); check --tracker and "
                "--port"
            )
        tried = f" at {', '.join(map(str, (first_baud, *bauds)))} baud" if bauds else ""
        raise InputError(
            f"{port.name}: nothing answers{tried}; check that the {title} is switched on (just switched "
            "on? it takes 10 s), its cable (on RS-232 a null-modem one), that its USB is not "
            "connected too (that ends RS-232), and --port"
        )

    def _silence(self, first: bytes, again: bytes) -> bytes:
        """Send a stop command, at most three times, until the stream is silent; return the bytes received."""
        heard = b""
        for command, cap_s in ((first, 5.0), (again, 2.0), (again, 2.0)):
            self._conversation.send(command)
            piece, silent = self._conversation.drain(cap_s=cap_s)
            heard += piece
            if silent:
                break
        return heard

    def _require(self, what: str, reported: Any, sent: Any) -> None:
        """Raise InputError if a setting differs from the value sent; reported : None without an answer."""
        same = reported == sent
        if isinstance(reported, tuple) and isinstance(sent, tuple) and len(reported) == len(sent):
            # numbers are compared to 0.01
            same = all(abs(a - b) < 0.01 for a, b in zip(reported, sent, strict=True))
        if same:
            return
        says = "reports nothing" if reported is None else f"reports {format_setting(reported)}"
        complained = f" (its errors: {', '.join(self._complaints)})" if self._complaints else ""
        raise InputError(
            f"{self._port_name}: the tracker did not accept its {what}: sent {format_setting(sent)}, but it "
            f"{says}{complained}; switch it off and on, and try again"
        )


def format_setting(value: Any) -> str:
    """Format the value of a setting for display."""
    if isinstance(value, tuple):
        return ", ".join(f"{round(part, 4):g}" for part in value) or "nothing"
    return str(value)
