"""Whether a serial line carries what is asked for, said before the recording and not after it."""

from __future__ import annotations

from shukotsu.errors import InputError
from shukotsu.trackers.families import FAMILIES
from shukotsu.trackers.liberty.items import SHORT_LIST, list_of_all, record_type
from shukotsu.trackers.protocols.stream_settings import StreamSettings

BITS_PER_BYTE = 10
"""8N1: a start bit, eight data bits, a stop bit."""

VIPER_HEAD_BYTES, VIPER_RECORD_BYTES = 28, 32

MUCH_MISSING_PERCENT = 20.0


def line_bytes_per_s(baud: int) -> float:
    """Bytes that a line of that speed carries in a second."""
    return baud / BITS_PER_BYTE


def cycle_bytes(settings: StreamSettings) -> int:
    """Bytes of one record of every station."""
    count = len(settings.stations)
    if not settings.items:
        return VIPER_HEAD_BYTES + VIPER_RECORD_BYTES * count
    return record_type(list_of_all(settings.items)).itemsize * count


def needed_bytes_per_s(settings: StreamSettings) -> float:
    """Bytes of the stream in a second."""
    return cycle_bytes(settings) * settings.rate_hz


def arithmetic(settings: StreamSettings, baud: int) -> str:
    """Compare the bytes that the stream needs with those that the line carries."""
    count, size = len(settings.stations), cycle_bytes(settings)
    return (
        f"{count} receivers x {size / count:.4g} bytes x {settings.rate_hz:g} Hz = "
        f"{needed_bytes_per_s(settings):.0f} bytes/s, and {baud} baud carries {line_bytes_per_s(baud):.0f}"
    )


def check_line(settings: StreamSettings, baud: int | None, name: str) -> None:
    """Raise InputError, with the arithmetic and what would fit, where the line cannot carry the stream."""
    if baud is None or needed_bytes_per_s(settings) <= line_bytes_per_s(baud):
        return
    fits = what_fits(settings, baud)
    raise InputError(
        f"{name}: the line is too slow: {arithmetic(settings, baud)}; "
        f"{f'what fits is {fits}' if fits else 'not one receiver fits'}; or use the tracker's USB"
    )


def too_slow(settings: StreamSettings, bytes_per_s: float, missing_percent: float) -> str | None:
    """Say that the line is too slow by what it has brought; None where it is not to blame.

    missing_percent : of all records. Where they are missing and the bytes are not, something damages them.
    """
    need = needed_bytes_per_s(settings)
    enough = bytes_per_s > (1 - MUCH_MISSING_PERCENT / 100) * need
    remedies = FAMILIES[settings.family].remedies
    if missing_percent <= MUCH_MISSING_PERCENT or enough:
        return None
    count = len(settings.stations)
    who = f"{count} receivers need" if count > 1 else "1 receiver needs"
    return (
        f"the line brought {bytes_per_s / 1000:.3g} kB/s of the {need / 1000:.3g} kB/s that {who}: "
        f"it is too slow; see {remedies}"
    )


def what_fits(settings: StreamSettings, baud: int) -> str:
    """Format how many receivers of LIBERTY and PATRIOT fit with this list and the short one, at each rate."""
    if not settings.items:
        return ""
    listed, short = (record_type(items).itemsize for items in (list_of_all(settings.items), SHORT_LIST))
    sizes = {"with this list": listed} | ({"with --items short": short} if short < listed else {})
    fits = []
    for how, size in sizes.items():
        counts = [
            (int(line_bytes_per_s(baud) // (size * rate)), rate)
            for rate in FAMILIES[settings.family].rates_hz
        ]
        choices = [f"{count} receiver{'s'[: count > 1]} at {rate} Hz" for count, rate in counts if count]
        if choices:
            fits.append(f"{' or '.join(choices)} {how}")
    return ", ".join(fits)
