"""Show a tracker's answers and two seconds of its stream; nothing is recorded."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

from shukotsu.errors import InputError
from shukotsu.trackers.decode.stream import ChunkDecoder
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record import display
from shukotsu.trackers.record.conversation import Conversation, StoppedError
from shukotsu.trackers.record.line_load import arithmetic, line_bytes_per_s, needed_bytes_per_s, what_fits
from shukotsu.trackers.record.port import Port, PortGoneError, perhaps_taken
from shukotsu.trackers.record.request import RecordingRequest
from shukotsu.trackers.record.session import DRIVERS
from shukotsu.trackers.record.statistics import Statistics
from shukotsu.trackers.record.stop_request import StopRequest
from shukotsu.trackers.record.tracker_driver import Driver

STREAM_S = 2.0

VALUE_NAMES = {"units": {0: "inch", 1: "cm"}, "rate": {3: "120 Hz", 4: "240 Hz"}}
"""Setting -> what its number stands for."""


def check(port: Port, request: RecordingRequest, stop: StopRequest) -> Iterator[str]:
    """Set a tracker up, say what it answers and sends, a line at a time, and set it back.

    Raises InputError where it does not answer as it must.
    """
    conversation = Conversation(port, stopped=lambda: bool(stop))
    try:
        driver = DRIVERS[request.family](conversation, request)
        try:
            settings = driver.set_up()
            yield from answer_lines(settings, driver.warnings)
            yield from line_lines(settings, port.line_baud)
            yield from _stream_lines(driver, conversation, settings)
        finally:
            conversation.finish()
            driver.put_back()
    except PortGoneError as error:
        raise InputError(f"{port.name}: the port is gone ({error}){perhaps_taken(port.name)}") from error
    except StoppedError:
        yield f"ended ({stop.reason})"
    finally:
        conversation.close()


def answer_lines(settings: StreamSettings, warnings: list[str]) -> list[str]:
    """List the tracker's answers."""
    before: Mapping[str, Any] = settings.options.get("before", {})
    after: Mapping[str, Any] = settings.options.get("after", {})
    names = [name for name in after if name != "stations"]
    return [
        f"tracker     {settings.options.get('whoami') or settings.family}",
        f"receivers   {', '.join(map(str, settings.stations))}",
        *(_setting(name, before.get(name), after.get(name), settings.stations) for name in names),
        *(f"note: {warning}" for warning in warnings),
    ]


def line_lines(settings: StreamSettings, baud: int | None) -> list[str]:
    """Describe how full the line is, and what fits where it is too slow."""
    need = needed_bytes_per_s(settings)
    if baud is None:
        return [f"line        needs {need / 1000:.1f} kB/s; the port's own rate is not known"]
    carried = line_bytes_per_s(baud)
    lines = [f"line        {arithmetic(settings, baud)}: {100 * need / carried:.0f} %"]
    if need > carried:
        lines.append(f"            too slow; what fits is {what_fits(settings, baud) or 'not one receiver'}")
    return lines


def _stream_lines(driver: Driver, conversation: Conversation, settings: StreamSettings) -> list[str]:
    """Let it stream for a while, and say what came."""
    decoder = ChunkDecoder(settings)
    statistics = Statistics(settings, time.perf_counter_ns())
    driver.start()
    end = time.perf_counter() + STREAM_S
    while time.perf_counter() < end:
        for chunk in conversation.listen(0.1):
            decoder.add(chunk.data, chunk.host_ns)
        received_bytes = decoder.waiting_bytes
        statistics.add(decoder.decode(final=False), received_bytes, time.perf_counter_ns())
    driver.stop()
    totals = statistics.totals(time.perf_counter_ns())
    if not totals["records"]:
        name = conversation.port.name
        raise InputError(f"{name}: the tracker was told to stream, and no record has come")
    notes = [f"note: {notice}" for notice in display.advice(totals, settings)]
    return ["", *display.totals_table(totals), *notes]


def _setting(name: str, before: Any, after: Any, stations: tuple[int, ...]) -> str:
    """Say one setting, as it was and as it is; of each receiver where it has its own."""
    title = name.replace("_", " ")
    if isinstance(after, Mapping):
        earlier = before if isinstance(before, Mapping) else {}
        values = {station: (earlier.get(str(station)), after.get(str(station))) for station in stations}
        if len({str(value) for value in values.values()}) > 1:
            each = [f"{station}: {_change(*value)}" for station, value in values.items()]
            return f"{title:<18}{'; '.join(each)}"
        before, after = next(iter(values.values()))
    names = VALUE_NAMES.get(name, {})
    return f"{title:<18}{_change(names.get(before, before), names.get(after, after))}"


def _change(before: Any, after: Any) -> str:
    return _shown(after) if before == after else f"{_shown(before)} -> {_shown(after)}"


def _shown(value: Any) -> str:
    if value is None:
        return "not said"
    if isinstance(value, tuple) and not any(value):
        return " ".join(["0"] * min(len(value), 3))
    if isinstance(value, tuple):
        return " ".join(f"{part:g}" for part in value)
    return str(value)
