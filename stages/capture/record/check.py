"""Command line: what a tracker answers, and two seconds of what it sends; nothing is recorded."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from schemas.errors import InputError
from stages.capture.record import exits

if TYPE_CHECKING:
    from stages.capture.record.conversation import Conversation
    from stages.capture.record.wishes import Driver
    from stages.capture.trackers.settings import StreamSettings

STREAM_S = 2.0


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = exits.parser(
        "check",
        "Set a tracker up as `record` does, say what it answers and what two seconds of its stream\n"
        "hold, and set it back. Exit code: 0 where it works, 2 where it does not.",
        "python -m stages.capture check --port /dev/ttyUSB0",
    )
    exits.add_tracker(parser)
    return parser


def main(arguments: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return exits.run(build_parser().parse_args(arguments), check_tracker)


def check_tracker(arguments: argparse.Namespace) -> int:
    """Print what there is to say of the tracker."""
    from stages.capture.record.command import wishes_of
    from stages.capture.record.conversation import Conversation, NoJournal, StoppedError
    from stages.capture.record.families import driver_of
    from stages.capture.record.port import PortGoneError, open_port, perhaps_taken
    from stages.capture.record.reader import Reader
    from stages.capture.record.stopping import Stop, signals_ask

    wishes = wishes_of(arguments)
    stop = Stop()
    with signals_ask(stop):
        port = open_port(arguments.port, arguments.baud, arguments.line_rate)
        reader = Reader(port)
        talk = Conversation(port, reader, NoJournal(), lambda: bool(stop))
        try:
            driver = driver_of(talk, wishes)
            try:
                _tell(driver, talk)
            finally:
                talk.finish()
                driver.put_back()
        except PortGoneError as error:
            raise InputError(f"{port.name}: the port is gone ({error}){perhaps_taken(port.name)}") from error
        except StoppedError:
            print(f"ended ({stop.reason})")
        finally:
            reader.close()
            port.close()
    return 0


def _tell(driver: Driver, talk: Conversation) -> None:
    settings = driver.set_up()
    print("\n".join(found(settings, driver.warnings)))
    print("\n".join(line(settings, talk.port.line_baud)))
    print("\n".join(_stream(driver, talk, settings)))


def found(settings: StreamSettings, warnings: list[str]) -> list[str]:
    """Say what the tracker answered."""
    told = [
        f"tracker     {settings.options.get('whoami') or settings.family}",
        f"receivers   {', '.join(map(str, settings.stations))}",
    ]
    before: Mapping[str, Any] = settings.options.get("before", {})
    after: Mapping[str, Any] = settings.options.get("after", {})
    names = [name for name in after if name != "stations"]
    told += [_setting(name, before.get(name), after.get(name), settings.stations) for name in names]
    return told + [f"note: {warning}" for warning in warnings]


def line(settings: StreamSettings, baud: int | None) -> list[str]:
    """Say how full the line is, and what fits where it is too slow."""
    from stages.capture.record.line import arithmetic, cycle_bytes, what_fits

    need = cycle_bytes(settings) * settings.rate_hz
    if baud is None:
        return [f"line        needs {need / 1000:.1f} kB/s; the port's own rate is not known"]
    told = [f"line        {arithmetic(settings, baud)}: {100 * need / (baud / 10):.0f} %"]
    if need > baud / 10:
        told.append(f"            too slow; what fits is {what_fits(settings, baud) or 'not one receiver'}")
    return told


def _stream(driver: Driver, talk: Conversation, settings: StreamSettings) -> list[str]:
    """Let it stream for a while, and say what came."""
    from stages.capture.record import summary
    from stages.capture.record.following import Follower
    from stages.capture.record.statistics import Statistics

    follower = Follower(settings)
    statistics = Statistics(settings, time.monotonic_ns())
    driver.start()
    end = time.monotonic() + STREAM_S
    while time.monotonic() < end:
        chunks = talk.listen(0.1)
        seen = follower.look(chunks)
        statistics.add(seen, sum(len(chunk.data) for chunk in chunks), time.monotonic_ns())
    driver.stop()
    totals = statistics.totals(time.monotonic_ns())
    if not totals["records"]:
        raise InputError(f"{talk.port.name}: the tracker was told to stream, and no record has come")
    notes = [f"note: {notice}" for notice in summary.advice(totals, settings)]
    return ["", *summary.table(totals), *notes]


SHOWN = {"units": {0: "inch", 1: "cm"}, "rate": {3: "120 Hz", 4: "240 Hz"}}
"""Setting -> what its number stands for."""


def _setting(name: str, before: Any, after: Any, stations: tuple[int, ...]) -> str:
    """Say one setting, as it was and as it is; of each receiver where it has its own."""
    shown = name.replace("_", " ")
    if isinstance(after, Mapping):
        values = {station: (_of(before, station), after.get(str(station))) for station in stations}
        if len({str(value) for value in values.values()}) > 1:
            each = [f"{station}: {_change(*value)}" for station, value in values.items()]
            return f"{shown:<18}{'; '.join(each)}"
        before, after = next(iter(values.values()))
    words = SHOWN.get(name, {})
    return f"{shown:<18}{_change(words.get(before, before), words.get(after, after))}"


def _of(values: Any, station: int) -> Any:
    return values.get(str(station)) if isinstance(values, Mapping) else None


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
