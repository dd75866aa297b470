"""Settings requested of a recording, and the dialogue with its tracker: every byte is kept, answers are
extracted.

One thread only reads and time-stamps, so that no other work can delay it. An answer is recognised by its
content and never by its position, since records of a stream that was left running may come in between.
"""

from __future__ import annotations

import math
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from shukotsu.errors import InputError
from shukotsu.tracker.archive import ArchiveWriter
from shukotsu.tracker.families import FAMILIES, check_family
from shukotsu.tracker.liberty import FULL_LIST, SHORT_LIST
from shukotsu.tracker.port import Port, PortGoneError

Answer = TypeVar("Answer")

LARGEST_STATION = 16
TRACK = (0.0, 0.0, 0.0)
"""Hemisphere of a tracker that follows the receiver."""
STOP_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
IGNORED_SIGNALS = ("SIGTSTP", "SIGTTOU")
"""Suspending by Ctrl-Z would let the tracker's bytes overflow a buffer."""


@dataclass(frozen=True)
class RecordingRequest:
    """Settings requested for a recording.

    short : only the frame count, position and quaternion of each record. asked_hz : None for the usual rate.
    stations : None for all that are connected. hemisphere : vector of the half of space, TRACK to have the
    tracker follow the receiver. Raises InputError for what the family cannot do.
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
            raise InputError(f"--rate: a {self.family} has a rate of its own; leave it out")
        if self.family == "viper" and self.stations is not None:
            raise InputError("--stations: a VIPER sends every sensor that is connected; leave it out")
        if self.family == "viper" and self.short:
            raise InputError("--items: a VIPER has no output lists; leave it out")

    @property
    def items(self) -> tuple[int, ...]:
        """Output list of LIBERTY and PATRIOT."""
        return SHORT_LIST if self.short else FULL_LIST

    @property
    def rate_hz(self) -> int:
        """Frames a second."""
        return self.asked_hz or FAMILIES[self.family].rates_hz[0]


def parse_stations(text: str) -> tuple[int, ...]:
    """Read --stations: numbers and stretches, such as 1-8,12. Raises InputError."""
    stations: set[int] = set()
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            stations.update(range(int(first), int(last or first) + 1))
    except ValueError as error:
        raise InputError(f"--stations: is {text!r}; expected numbers such as 1-8,12") from error
    if not stations or min(stations) < 1 or max(stations) > LARGEST_STATION:
        raise InputError(f"--stations: is {text!r}; expected numbers from 1 to {LARGEST_STATION}")
    return tuple(sorted(stations))


def parse_hemisphere(text: str) -> tuple[float, float, float]:
    """Read --hemisphere: three numbers with commas, or `track`. Raises InputError."""
    if text == "track":
        return TRACK
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError as error:
        raise InputError(f"--hemisphere: is {text!r}; expected x,y,z such as 1,0,0, or track") from error
    if not 0 < math.hypot(x, y, z) < math.inf:
        raise InputError(f"--hemisphere: {text} is no direction; `track` has the tracker follow the receiver")
    return (x, y, z)


class StopRequest:
    """Request to stop. reason : what asked first; empty while nothing did."""

    def __init__(self) -> None:
        self.reason = ""

    def ask(self, reason: str) -> None:
        """Request a stop; a second reason does not replace the first."""
        self.reason = self.reason or reason

    def __bool__(self) -> bool:
        return bool(self.reason)


@contextmanager
def stop_on_signals(stop: StopRequest) -> Iterator[None]:
    """Within the `with`, let signals request a stop instead of ending the program."""

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
"""Bytes that arrive while this many wait to be stored are dropped and counted: half a minute of the fastest
tracker."""
MOST_BEFORE_FRAMES_BYTES = 32 << 20
"""More bytes than any tracker sends during set-up, even one that was left streaming."""
ANSWER_BYTES = 1 << 16
"""Longest answer."""


@dataclass(frozen=True)
class Chunk:
    """Bytes that came together, and the host's monotonic time [ns] when they had come."""

    data: bytes
    host_ns: int


class StoppedError(Exception):
    """The user stopped the recording during the dialogue with the tracker."""


class Conversation:
    """A port that is read from now on until `close`, whoever listens.

    archive : keeps all that passes. stopped() : whether the user has asked for the end. gone : why the port
    is gone, and when [ns]; None while it is there. dropped_bytes : that came faster than they could be kept.
    frames_began : whether any number of bytes may come.
    """

    def __init__(
        self, port: Port, archive: ArchiveWriter | None = None, stopped: Callable[[], bool] = lambda: False
    ) -> None:
        self.port = port
        self.gone: tuple[str, int] | None = None
        self.dropped_bytes = 0
        self.frames_began = False
        self._queued_bytes = 0  # of the reader's thread alone, as the other is of the listener's
        self._taken_bytes = 0
        self._archive = archive
        self._stopped = stopped
        self._chunks: queue.SimpleQueue[Chunk] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop reading; the port is free to be closed when this returns."""
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

    def send(self, data: bytes) -> int:
        """Send; return the host's monotonic time [ns] just before. Raises PortGoneError."""
        host_ns = time.perf_counter_ns()
        if self._archive is not None:
            self._archive.sent(data, host_ns)
        self.port.write(data)
        return host_ns

    def keep(self, wait_s: float = 0.0) -> list[Chunk]:
        """Store and return all chunks received so far; wait at most this long for a first one."""
        chunks = []
        with suppress(queue.Empty):
            chunks.append(self._chunks.get(timeout=wait_s) if wait_s > 0 else self._chunks.get_nowait())
            chunks += [self._chunks.get_nowait() for _ in range(self._chunks.qsize())]
        self._taken_bytes += sum(len(chunk.data) for chunk in chunks)
        if self._archive is not None:
            for chunk in chunks:
                self._archive.received(chunk.data, chunk.host_ns)
        return chunks

    def receive(self, wait_s: float) -> bytes:
        """Return the bytes that came. Raises as `listen`."""
        return b"".join(chunk.data for chunk in self.listen(wait_s))

    def listen(self, wait_s: float) -> list[Chunk]:
        """Return the chunks that came, with their times.

        Raises PortGoneError where no more can come, StoppedError where none is wanted, InputError where more
        has come than a tracker sends while it is set up.
        """
        chunks = self.keep(wait_s)
        if not chunks and self.gone:
            raise PortGoneError(self.gone[0])
        if self._stopped():
            raise StoppedError
        if self._taken_bytes > MOST_BEFORE_FRAMES_BYTES and not self.frames_began:
            raise InputError(
                f"{self.port.name}: what answers is no tracker: it sent {self._taken_bytes >> 20} MB before "
                "it could be set up; check --port"
            )
        return chunks

    def drain(self, silence_s: float = SILENCE_S, cap_s: float = 5.0) -> tuple[bytes, bool]:
        """Wait for `silence_s` without a byte; return what came, and whether it ended within `cap_s`."""
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
        """Send a question; return what `answer_in` reads in the bytes since, None where that is nothing."""
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
LEAST_COSINE = 0.9999


class TrackerDriver:
    """Base of a family's driver. warnings : what the user should know of the tracker, once it is set up."""

    def __init__(self, conversation: Conversation, request: RecordingRequest) -> None:
        self.warnings: list[str] = []
        self._complaints: list[str] = []  # of the tracker, while it was set up
        self._conversation = conversation
        self._request = request
        self._port_name = conversation.port.name

    def _find(self, attempt: Callable[[], tuple[str | None, bytes]]) -> str:
        """Identify the tracker at the rate of the port or, where there is a serial line, at another.

        attempt() : what identifies the tracker, and what was heard at all. Raises InputError where nothing
        answers, or something that is not this tracker.
        """
        port = self._conversation.port
        first_baud, heard_at_first = port.baud, b""
        tries_others = port.line_baud is not None and first_baud is not None
        bauds = list(dict.fromkeys((first_baud, *OTHER_BAUDS))) if tries_others else [first_baud]
        for baud in bauds:
            if baud != first_baud and baud is not None:
                port.set_baud(baud)
            identity, heard = attempt()
            if identity is None and heard:  # a busy host may read the answer too late
                identity, heard = attempt()
            if identity is not None:
                if baud != first_baud:
                    self.warnings.append(
                        f"it answered at {baud} baud and not at {first_baud}; {baud} is used"
                    )
                return identity
            heard_at_first = heard_at_first or heard
        title = FAMILIES[self._request.family].title
        if heard_at_first:
            shown = heard_at_first[:24].decode("latin-1").encode("ascii", "backslashreplace").decode()
            raise InputError(
                f"{port.name}: what answers is no {title} (it sent {shown!r}); check --tracker and --port"
            )
        tried = f" at {', '.join(map(str, bauds))} baud" if tries_others else ""
        raise InputError(
            f"{port.name}: nothing answers{tried}; check that the {title} is switched on (just switched "
            "on? it takes 10 s), its cable (on RS-232 a null-modem one), that its USB is not "
            "connected too (that ends RS-232), and --port"
        )

    def _silence(self, first: bytes, again: bytes) -> bytes:
        """Send what stops a stream until it is silent, at most three times; return what was heard."""
        heard = b""
        for command, cap_s in ((first, 5.0), (again, 2.0), (again, 2.0)):
            self._conversation.send(command)
            piece, silent = self._conversation.drain(cap_s=cap_s)
            heard += piece
            if silent:
                break
        return heard

    def _require(self, what: str, reported: Any, sent: Any) -> None:
        """Raise InputError where a setting is not what was sent; reported : None where it does not say."""
        if not (isinstance(reported, tuple) and isinstance(sent, tuple)):
            same = reported == sent
        else:  # numbers to 0.01
            pairs = zip(reported, sent, strict=False)
            same = len(reported) == len(sent) and all(abs(a - b) < 0.01 for a, b in pairs)
        if same:
            return
        says = "says nothing about it" if reported is None else f"says {format_setting(reported)}"
        complained = f" (it complained: {', '.join(self._complaints)})" if self._complaints else ""
        raise InputError(
            f"{self._port_name}: the tracker did not take its {what}: sent was {format_setting(sent)}, and "
            f"when asked it {says}{complained}; switch it off and on, and try again"
        )


def format_setting(value: Any) -> str:
    """Format a setting for people."""
    if isinstance(value, tuple):
        return ", ".join(f"{round(part, 4):g}" for part in value) or "nothing"
    return str(value)


def same_direction(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two vectors point the same way, to 0.8 degrees; never where one is the zero vector."""
    lengths = math.hypot(*a) * math.hypot(*b)
    return lengths > 0 and sum(x * y for x, y in zip(a, b, strict=True)) / lengths > LEAST_COSINE


def is_zero(values: Sequence[float]) -> bool:
    """Whether an offset or a rotation is zero."""
    return all(abs(value) < 1e-4 for value in values)


def is_default_alignment(values: Sequence[float]) -> bool:
    """Whether an alignment (origin, a point on x, one on y: 9 numbers) is the transmitter's own frame.

    The points may be at any distance: it differs between trackers and with the unit.
    """
    along_x, along_y = same_direction(values[3:6], (1, 0, 0)), same_direction(values[6:9], (0, 1, 0))
    return math.hypot(*values[:3]) < 1e-3 and along_x and along_y
