"""Whether a serial line carries what is asked for, said before the recording and not after it."""

from __future__ import annotations

from shukotsu.errors import InputError
from shukotsu.trackers.families import FAMILIES, output_items
from shukotsu.trackers.protocols.stream_settings import StreamSettings

BITS_PER_BYTE = 10
"""8N1: a start bit, eight data bits, a stop bit."""

MUCH_MISSING_PERCENT = 20.0


def line_bytes_per_s(baud: int) -> float:
    """Bytes that a line of that speed carries in a second."""
    return baud / BITS_PER_BYTE


def cycle_bytes(settings: StreamSettings) -> int:
    """Bytes of one record of every station; in text the most that they can be."""
    family = FAMILIES[settings.family]
    items = output_items(settings.family)
    if items is not None:
        own = items.one_list(settings.items)
        return items.record_bytes(own, settings.mode) * len(settings.stations)
    address_bytes = int(bool(settings.options.get("group")))  # of a trakSTAR with several receivers
    return family.cycle_bytes + (family.record_bytes + address_bytes) * len(settings.stations)


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


def overload(settings: StreamSettings, baud: int | None, name: str, allowed: bool) -> str | None:
    """Give a warning where the line cannot carry the stream and that is allowed; None where it can.

    Raises InputError, with the arithmetic and what would fit, where it is not allowed.
    """
    if baud is None or needed_bytes_per_s(settings) <= line_bytes_per_s(baud):
        return None
    cycles = int(line_bytes_per_s(baud) // cycle_bytes(settings))
    too_slow = f"the line is too slow: {arithmetic(settings, baud)}"
    if allowed:
        return f"{too_slow}; the tracker will leave frames out, about {cycles} a second come through"
    fits = what_fits(settings, baud)
    raise InputError(
        f"{name}: {too_slow}; {f'what fits is {fits}' if fits else 'not one receiver fits'}; use the "
        f"tracker's USB, or --allow-slower to record what comes through, about {cycles} frames a second"
    )


def too_slow(settings: StreamSettings, bytes_per_s: float, missing_percent: float) -> str | None:
    """Say that the line is too slow by what it has brought; None where it is not to blame.

    missing_percent : of all records. Where they are missing and the bytes are not, something damages them.
    """
    need = needed_bytes_per_s(settings)
    enough = bytes_per_s > (1 - MUCH_MISSING_PERCENT / 100) * need
    remedies = FAMILIES[settings.family].remedies
    if missing_percent <= MUCH_MISSING_PERCENT or enough or not remedies:
        return None
    count = len(settings.stations)
    who = f"{count} receivers need" if count > 1 else "1 receiver needs"
    return (
        f"the line brought {bytes_per_s / 1000:.3g} kB/s of the {need / 1000:.3g} kB/s that {who}: "
        f"it is too slow; see {remedies}"
    )


def what_fits(settings: StreamSettings, baud: int) -> str:
    """Write how many receivers fit with this list and the short one, at each rate; of LIBERTY and PATRIOT."""
    items, family = output_items(settings.family), FAMILIES[settings.family]
    if items is None or not family.remedies:
        return ""
    ascii_mode = settings.mode == "ascii"
    own = items.record_bytes(items.one_list(settings.items), settings.mode)
    short = items.decodable(items.short, settings.mode)
    sizes = {"with this list": own}
    if items.record_bytes(short, settings.mode) < own:
        sizes["with --items short"] = items.record_bytes(short, settings.mode)
    if ascii_mode and items.record_bytes(items.short) < own:
        sizes["with --items short and without --ascii"] = items.record_bytes(items.short)
    fits = []
    for how, size in sizes.items():
        counts = [(int(line_bytes_per_s(baud) // (size * rate)), rate) for rate in family.rates_hz]
        choices = [f"{count} receiver{'s'[: count > 1]} at {rate} Hz" for count, rate in counts if count]
        if choices:
            fits.append(f"{' or '.join(choices)} {how}")
    return ", ".join(fits)
