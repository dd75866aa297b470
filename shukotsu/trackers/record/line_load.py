"""Whether a serial line carries what is asked for, said before the recording and not after it."""

from __future__ import annotations

from shukotsu.errors import InputError
from shukotsu.trackers.families import FAMILIES
from shukotsu.trackers.liberty.replies import SHORT_LIST, list_of_all, record_type
from shukotsu.trackers.protocols.stream_settings import StreamSettings

BITS_PER_BYTE = 10
"""8N1: a start bit, eight data bits, a stop bit."""

VIPER_HEAD_BYTES, VIPER_RECORD_BYTES = 28, 32
MUCH_MISSING_PERCENT = 20.0


def needed_bytes_per_s(settings: StreamSettings) -> float:
    """Bytes of the stream in a second."""
    count = len(settings.stations)
    cycle_bytes = VIPER_HEAD_BYTES + VIPER_RECORD_BYTES * count
    if settings.items:
        cycle_bytes = record_type(list_of_all(settings.items)).itemsize * count
    return cycle_bytes * settings.rate_hz


def arithmetic(settings: StreamSettings, baud: int) -> str:
    """Format the bytes that the stream needs beside those that the line carries."""
    count, need = len(settings.stations), needed_bytes_per_s(settings)
    return (
        f"{count} receivers x {need / settings.rate_hz / count:.4g} bytes x {settings.rate_hz:g} Hz = "
        f"{need:.0f} bytes/s, and {baud} baud carries {baud / BITS_PER_BYTE:.0f}"
    )


def check_line(settings: StreamSettings, baud: int | None, name: str) -> None:
    """Raise InputError, with the arithmetic and what would fit, where the line cannot carry the stream."""
    if baud is not None and needed_bytes_per_s(settings) > baud / BITS_PER_BYTE:
        raise InputError(
            f"{name}: the line is too slow: {arithmetic(settings, baud)}; {what_fits(settings, baud)}; or "
            "use the tracker's USB"
        )


def too_slow(settings: StreamSettings, bytes_per_s: float, missing_percent: float) -> str | None:
    """The sentence that the line is too slow by what it has brought; None where it is not to blame.

    missing_percent : of all records. Where they are missing and the bytes are not, something damages them.
    """
    need, count = needed_bytes_per_s(settings), len(settings.stations)
    if missing_percent <= MUCH_MISSING_PERCENT or bytes_per_s > (1 - MUCH_MISSING_PERCENT / 100) * need:
        return None
    who = f"{count} receivers need" if count > 1 else "1 receiver needs"
    return (
        f"the line brought {bytes_per_s / 1000:.3g} kB/s of the {need / 1000:.3g} kB/s that {who}: "
        f"it is too slow; see {FAMILIES[settings.family].remedies}"
    )


def what_fits(settings: StreamSettings, baud: int) -> str:
    """Format how many receivers of LIBERTY and PATRIOT fit with this list and the short one, at each rate."""
    lists = {"with this list": list_of_all(settings.items)} if settings.items else {}
    if lists and record_type(SHORT_LIST).itemsize < record_type(lists["with this list"]).itemsize:
        lists["with --items short"] = SHORT_LIST
    fits = []
    for how, items in lists.items():
        choices = [
            f"{count} receiver{'s'[: count > 1]} at {rate_hz} Hz"
            for rate_hz in FAMILIES[settings.family].rates_hz
            if (count := int(baud / BITS_PER_BYTE // (record_type(items).itemsize * rate_hz)))
        ]
        fits += [f"{' or '.join(choices)} {how}"] if choices else []
    return f"what fits is {', '.join(fits)}" if fits else "not one receiver fits"
