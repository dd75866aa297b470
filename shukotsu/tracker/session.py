"""A recording session: all bytes are archived; they are decoded only for the display.

A thread reads and time-stamps chunks; the main loop stores them a few times per second, and decodes and
counts them once per second. Only the thread is time-critical.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.tables.line_printer import LinePrinter
from shukotsu.tracker import display
from shukotsu.tracker.archive import ArchiveWriter
from shukotsu.tracker.conversation import Chunk, Conversation, RecordingRequest, StoppedError, StopRequest
from shukotsu.tracker.liberty_driver import LibertyDriver
from shukotsu.tracker.port import Port, PortGoneError, perhaps_taken
from shukotsu.tracker.records import StreamSettings
from shukotsu.tracker.stream import ABSENT_S, ChunkDecoder
from shukotsu.tracker.viper_driver import ViperDriver

DRIVERS: Mapping[str, type[LibertyDriver | ViperDriver]]
DRIVERS = {"liberty": LibertyDriver, "patriot": LibertyDriver, "viper": ViperDriver}

TICK_S, FLUSH_S, LOOK_S = 0.05, 0.25, 1.0
LAST_BYTES_S, SILENCE_S, CLOCK_JUMP_S = 0.5, 0.3, 0.1
MOST_WAITING_BYTES = 8 << 20
"""Number of waiting bytes above which they are stored and decoded at once, to limit memory."""
PORT_GONE, DISK_FULL = "the port is gone", "the disk takes no more"


@dataclass(frozen=True)
class RecordingPlan:
    """What to record. duration_s : None to record until stopped. quiet : whether to print only notes."""

    out: Path
    request: RecordingRequest
    duration_s: float | None = None
    notes: tuple[str, ...] = ()
    quiet: bool = False


@dataclass(frozen=True)
class Ending:
    """How a recording ended.

    failed : whether it ended before a stop was requested. totals : counts; None if it ended before the first
    frame.
    """

    reason: str
    failed: bool
    totals: Mapping[str, Any] | None
    notices: tuple[str, ...] = ()


def record(
    plan: RecordingPlan,
    port: Port,
    printer: LinePrinter,
    stop: StopRequest,
    about: Mapping[str, Any],
    utc_offset_ns: Callable[[], int] = lambda: time.time_ns() - time.perf_counter_ns(),
) -> Ending:
    """Record a tracker until the time is up, a stop is requested, or recording cannot continue.

    Raises InputError if nothing could be recorded; then no archive is left.
    """
    archive = ArchiveWriter(plan.out, about, utc_offset_ns)
    with closing(Conversation(port, archive, lambda: bool(stop))) as conversation:
        try:
            printer.say(f"setting up the tracker at {port.name} ...")
            driver = DRIVERS[plan.request.family](conversation, plan.request)
            settings = driver.set_up()
            display.check_line(settings, port.line_baud, port.name)
            archive.flush()
        except BaseException as error:  # without a frame, remove the archive
            archive.discard()
            if isinstance(error, StoppedError):
                return Ending(stop.reason, False, None)
            if isinstance(error, PortGoneError):
                taken = perhaps_taken(port.name)
                message = f"{port.name}: the port is gone before the first frame ({error}){taken}"
                raise InputError(message) from error
            if isinstance(error, OSError):
                raise InputError(f"{plan.out}: cannot be written ({error.strerror})") from error
            raise
        session = _Session(plan, conversation, driver, settings, archive, printer, stop, utc_offset_ns)
        try:
            return session.run()
        except BaseException as error:  # keep what was received, whatever ended the session
            with suppress(Exception):
                driver.stop()
            with suppress(Exception):
                conversation.keep()
                archive.close({"reason": f"internal error ({error!r})"}, time.perf_counter_ns())
            raise


@dataclass
class _Session:
    """A recording from its first to its last frame."""

    _plan: RecordingPlan
    _conversation: Conversation
    _driver: LibertyDriver | ViperDriver
    _settings: StreamSettings
    _archive: ArchiveWriter
    _printer: LinePrinter
    _stop: StopRequest
    _utc_offset_ns: Callable[[], int]
    _view_failed: bool = False
    _failure: str = ""
    _dropped_bytes: int = 0
    _announced: int = 0

    def __post_init__(self) -> None:
        self._offset_ns = self._utc_offset_ns()
        self._decoder = ChunkDecoder(self._settings)
        self._notices: list[str] = []
        for warning in self._driver.warnings:
            self._notice(warning)
        self._begin()

    def _begin(self) -> None:
        self._kept_ns = self._start_ns = time.perf_counter_ns()
        self._statistics = display.Statistics(self._settings, self._start_ns)
        self._totals = self._statistics.totals(self._start_ns)

    def run(self) -> Ending:
        """Record until the end; return how it ended."""
        self._start()
        flush_at = time.perf_counter()
        look_at = flush_at + LOOK_S
        while not self._over():
            time.sleep(TICK_S)
            self._keep()
            clock_s = (self._utc_offset_ns() - self._offset_ns) * 1e-9
            if abs(clock_s) > CLOCK_JUMP_S:  # the clock was set
                self._offset_ns += round(clock_s * 1e9)
                self._archive.event("clock-jumped", time.perf_counter_ns(), seconds=clock_s)
                jump = f"the host's clock was set by {clock_s:+.1f} s"
                self._notice(f"{jump}; times of frames are not affected")
            now = time.perf_counter()
            if now >= flush_at:
                flush_at = now + FLUSH_S
                self._flush()
            if now >= look_at:
                look_at = max(look_at + LOOK_S, now)
                self._guarded(self._look)
        self._printer.clear()
        return self._end()

    def _start(self) -> None:
        self._conversation.frames_began = True
        self._conversation.keep()
        now_ns = time.perf_counter_ns()
        for note in self._plan.notes:
            self._archive.event("note", now_ns, text=note)
        self._archive.settings(self._settings.to_json(), now_ns)
        try:
            self._driver.start()
            self._begin()
            self._archive.event("started", self._start_ns)
        except PortGoneError as error:
            self._fail(PORT_GONE, str(error))

    def _over(self) -> bool:
        """Return whether the recording is over; record a loss of the port as its failure."""
        duration_s, elapsed_ns = self._plan.duration_s, time.perf_counter_ns() - self._start_ns
        if duration_s is not None and elapsed_ns * 1e-9 >= duration_s:
            self._stop.ask(f"--duration {duration_s:g}")
        if self._conversation.gone and not self._failure:
            self._fail(PORT_GONE, self._conversation.gone[0])
        return bool(self._failure or self._stop)

    def _fail(self, what: str, why: str) -> None:
        self._failure = f"{what} ({why})"
        self._archive.event("failed", time.perf_counter_ns(), reason=self._failure)

    def _flush(self) -> None:
        try:
            self._archive.flush()
            self._kept_ns = time.perf_counter_ns()
        except OSError as error:
            self._fail(DISK_FULL, error.strerror or str(error))

    def _keep(self, wait_s: float = 0.0) -> list[Chunk]:
        """Store the chunks received, pass them to the display's decoder, and note dropped bytes."""
        chunks = self._conversation.keep(wait_s)
        if not self._view_failed:
            for chunk in chunks:
                self._decoder.add(chunk.data, chunk.host_ns)
        if self._archive.waiting_bytes > MOST_WAITING_BYTES:
            self._flush()
        if self._decoder.waiting_bytes > MOST_WAITING_BYTES:
            self._guarded(self._look)
        if dropped_bytes := self._conversation.dropped_bytes - self._dropped_bytes:
            if not self._dropped_bytes:
                self._notice("bytes arrive faster than they can be stored; some are lost")
            self._dropped_bytes += dropped_bytes
            self._archive.event("bytes-dropped", time.perf_counter_ns(), bytes=dropped_bytes)
        return chunks

    def _guarded(self, work: Callable[[], None]) -> None:
        """Run a step of the display; an error is reported and ends the display, not the recording."""
        if self._view_failed:
            return
        try:
            work()
        except Exception as error:  # any error of the display
            self._view_failed = True
            reason = f"{type(error).__name__}: {error}"
            self._archive.event("view-failed", time.perf_counter_ns(), reason=reason)
            self._notice(f"the display has failed ({reason}); every byte is still recorded")

    def _look(self) -> None:
        """Count the records since the last call and print the state."""
        self._count(final=False)
        for receiver, from_s, to_s in self._statistics.silences[self._announced :]:
            if receiver == 0:
                self._notice(f"no record at all from {from_s:.1f} s to {to_s:.1f} s")
        self._announced = len(self._statistics.silences)
        if self._plan.quiet:
            return
        now_ns = time.perf_counter_ns()
        silent_s = (now_ns - self._statistics.heard_ns) * 1e-9
        if silent_s > ABSENT_S:
            self._printer.show(f"NO DATA for {silent_s:.0f} s: is the tracker on, its cable in?")
            return
        totals = self._statistics.totals(now_ns)
        self._printer.show(display.state_line(self._statistics, totals, self._totals))
        self._totals = totals

    def _count(self, *, final: bool) -> None:
        received_bytes = self._decoder.waiting_bytes
        self._statistics.add(self._decoder.decode(final=final), received_bytes, time.perf_counter_ns())

    def _notice(self, text: str) -> None:
        self._notices.append(text)
        self._printer.say(f"note: {text}")

    def _end(self) -> Ending:
        """Stop the tracker, store its last bytes, close the archive."""
        gone = self._conversation.gone
        end_ns = gone[1] if gone else time.perf_counter_ns()
        self._archive.event("stopped", end_ns)
        try:
            self._driver.stop()
            self._keep_last()
        except PortGoneError as error:
            if not self._failure:
                self._fail(PORT_GONE, str(error))
        self._guarded(lambda: self._count(final=True))
        totals = self._statistics.totals(end_ns)
        self._notices += display.advice(totals, self._settings)
        if dropped := self._dropped_bytes:
            self._notices.append(f"{dropped} bytes arrived faster than they could be stored; lost")
        reason = self._failure or self._stop.reason
        ending = {"reason": reason, "notices": self._notices, **totals}
        try:
            self._archive.close(ending, time.perf_counter_ns())
        except OSError as error:
            self._failure = reason = self._failure or f"{DISK_FULL} ({error.strerror})"
        if self._failure.startswith(DISK_FULL):
            totals["seconds_kept"] = (self._kept_ns - self._start_ns) * 1e-9
        return Ending(reason, bool(self._failure), totals, tuple(self._notices))

    def _keep_last(self) -> None:
        """Store bytes until the tracker is silent, for at most LAST_BYTES_S."""
        heard = start = now = time.perf_counter()
        dropped = self._conversation.dropped_bytes
        while now - start < LAST_BYTES_S and now - heard < SILENCE_S:
            chunks = self._keep(TICK_S)
            now = time.perf_counter()
            heard = now if chunks else heard
            if self._conversation.dropped_bytes != dropped or (self._conversation.gone and not chunks):
                return


STREAM_S = 2.0

VALUE_NAMES = {"units": {0: "inch", 1: "cm"}, "rate": {3: "120 Hz", 4: "240 Hz"}}
"""Setting -> meaning of its numbers."""


def check(port: Port, request: RecordingRequest, stop: StopRequest) -> Iterator[str]:
    """Set up a tracker as for a recording, without recording; yield its answers and counts, line by line.

    Raises InputError if it does not answer as expected.
    """
    with closing(Conversation(port, stopped=lambda: bool(stop))) as conversation:
        try:
            driver = DRIVERS[request.family](conversation, request)
            settings = driver.set_up()
            yield from answer_lines(settings, driver.warnings, port.line_baud)
            decoder, statistics = ChunkDecoder(settings), display.Statistics(settings, time.perf_counter_ns())
            try:
                driver.start()
                end = time.perf_counter() + STREAM_S
                while time.perf_counter() < end:
                    for chunk in conversation.listen(0.1):
                        decoder.add(chunk.data, chunk.host_ns)
                    received_bytes = decoder.waiting_bytes
                    statistics.add(decoder.decode(final=False), received_bytes, time.perf_counter_ns())
            finally:
                driver.stop()
            totals = statistics.totals(time.perf_counter_ns())
            if not totals["records"]:
                raise InputError(f"{port.name}: the tracker was told to stream, but sent no record")
            notes = [f"note: {notice}" for notice in display.advice(totals, settings)]
            yield from ["", *display.totals_table(totals), *notes]
        except PortGoneError as error:
            raise InputError(f"{port.name}: the port is gone ({error}){perhaps_taken(port.name)}") from error
        except StoppedError:
            yield f"ended ({stop.reason})"


def answer_lines(settings: StreamSettings, warnings: list[str], baud: int | None) -> list[str]:
    """Return the tracker's answers, the load of the line, and what would fit if it is too slow."""
    before, after = settings.options["before"], settings.options["after"]
    names = [name for name in after if name != "stations"]
    need = display.needed_bytes_per_s(settings)
    lines = [f"line        needs {need / 1000:.1f} kB/s; the port's rate is unknown"]
    if baud is not None:
        carried = baud / display.BITS_PER_BYTE
        lines = [f"line        {display.arithmetic(settings, baud)}: {100 * need / carried:.0f} %"]
        lines += [f"            too slow; {display.what_fits(settings, baud)}"] if need > carried else []
    return [
        f"tracker     {settings.options['whoami'] or settings.family}",
        f"receivers   {', '.join(map(str, settings.stations))}",
        *(_setting(name, before[name], after[name], settings.stations) for name in names),
        *(f"note: {warning}" for warning in warnings),
        *lines,
    ]


def _setting(name: str, before: Any, after: Any, stations: tuple[int, ...]) -> str:
    """Format a setting before and after set-up; by receiver if receivers differ."""
    if isinstance(after, Mapping):
        changes = [_change(name, before[str(station)], after[str(station)]) for station in stations]
    else:
        changes = [_change(name, before, after)]
    if len(set(changes)) > 1:
        changes = ["; ".join(f"{station}: {text}" for station, text in zip(stations, changes, strict=True))]
    return f"{name.replace('_', ' '):<18}{changes[0]}"


def _change(name: str, before: Any, after: Any) -> str:
    texts = []
    for value in (before, after):
        if isinstance(value, tuple):
            texts.append(" ".join(f"{part:g}" for part in value) if any(value) else "0 0 0")
        else:
            texts.append(str("no answer" if value is None else VALUE_NAMES.get(name, {}).get(value, value)))
    return texts[1] if before == after else " -> ".join(texts)
