"""A tracker's answers and two seconds of its stream; nothing is recorded."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

from shukotsu.errors import InputError
from shukotsu.trackers.decode.stream import ChunkDecoder
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record import display
from shukotsu.trackers.record.conversation import Conversation, StoppedError
from shukotsu.trackers.record.line_load import BITS_PER_BYTE, arithmetic, needed_bytes_per_s, what_fits
from shukotsu.trackers.record.port import Port, PortGoneError, perhaps_taken
from shukotsu.trackers.record.request import RecordingRequest, StopRequest
from shukotsu.trackers.record.session import DRIVERS, Driver
from shukotsu.trackers.record.statistics import Statistics

STREAM_S = 2.0

VALUE_NAMES = {"units": {0: "inch", 1: "cm"}, "rate": {3: "120 Hz", 4: "240 Hz"}}
"""Setting -> what its number stands for."""


def check(port: Port, request: RecordingRequest, stop: StopRequest) -> Iterator[str]:
    """Set a tracker up as a recording would; yield what it answers and sends, a line at a time.

    Raises InputError where it does not answer as it must.
    """
    conversation = Conversation(port, stopped=lambda: bool(stop))
    try:
        driver = DRIVERS[request.family](conversation, request)
        settings = driver.set_up()
        yield from answer_lines(settings, driver.warnings, port.line_baud)
        try:
            yield from _stream_lines(driver, conversation, settings)
        finally:
            driver.stop()
    except PortGoneError as error:
        raise InputError(f"{port.name}: the port is gone ({error}){perhaps_taken(port.name)}") from error
    except StoppedError:
        yield f"ended ({stop.reason})"
    finally:
        conversation.close()


def answer_lines(settings: StreamSettings, warnings: list[str], baud: int | None) -> list[str]:
    """Return the tracker's answers; how full the line is, and what fits where it is too slow."""
    before: Mapping[str, Any] = settings.options.get("before", {})
    after: Mapping[str, Any] = settings.options.get("after", {})
    names = [name for name in after if name != "stations"]
    need = needed_bytes_per_s(settings)
    lines = [f"line        needs {need / 1000:.1f} kB/s; the port's own rate is not known"]
    if baud is not None:
        carried = baud / BITS_PER_BYTE
        lines = [f"line        {arithmetic(settings, baud)}: {100 * need / carried:.0f} %"]
        lines += [f"            too slow; {what_fits(settings, baud)}"] if need > carried else []
    return [
        f"tracker     {settings.options.get('whoami') or settings.family}",
        f"receivers   {', '.join(map(str, settings.stations))}",
        *(_setting(name, before.get(name), after.get(name), settings.stations) for name in names),
        *(f"note: {warning}" for warning in warnings),
        *lines,
    ]


def _stream_lines(driver: Driver, conversation: Conversation, settings: StreamSettings) -> list[str]:
    """Let it stream for a while; return what came."""
    decoder = ChunkDecoder(settings)
    statistics = Statistics(settings, time.perf_counter_ns())
    driver.start()
    end = time.perf_counter() + STREAM_S
    while time.perf_counter() < end:
        for chunk in conversation.listen(0.1):
            decoder.add(chunk.data, chunk.host_ns)
        received_bytes = decoder.waiting_bytes
        statistics.add(decoder.decode(final=False), received_bytes, time.perf_counter_ns())
    totals = statistics.totals(time.perf_counter_ns())
    if not totals["records"]:
        name = conversation.port.name
        raise InputError(f"{name}: the tracker was told to stream, and no record has come")
    notes = [f"note: {notice}" for notice in display.advice(totals, settings)]
    return ["", *display.totals_table(totals), *notes]


def _setting(name: str, before: Any, after: Any, stations: tuple[int, ...]) -> str:
    """Format a setting, as it was and as it is; of each receiver where these differ."""
    changes = {}
    if isinstance(after, Mapping):
        earlier = before if isinstance(before, Mapping) else {}
        for station in stations:
            changes[station] = _change(name, earlier.get(str(station)), after.get(str(station)))
    texts = list(dict.fromkeys(changes.values())) or [_change(name, before, after)]
    text = "; ".join(f"{station}: {change}" for station, change in changes.items())
    return f"{name.replace('_', ' '):<18}{texts[0] if len(texts) == 1 else text}"


def _change(name: str, before: Any, after: Any) -> str:
    texts = []
    for value in (before, after):
        if isinstance(value, tuple):
            texts.append(" ".join(f"{part:g}" for part in value) if any(value) else "0 0 0")
        else:
            texts.append(str("not said" if value is None else VALUE_NAMES.get(name, {}).get(value, value)))
    return texts[1] if before == after else " -> ".join(texts)
