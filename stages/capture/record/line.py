"""Whether a serial line carries what is asked for, said before the recording and not after it."""

from __future__ import annotations

from schemas.errors import InputError
from stages.capture.record.wishes import text_list
from stages.capture.trackers.liberty.items import SHORT_LIST, record_bytes
from stages.capture.trackers.line_load import full_cycles_per_s, line_bytes_per_s
from stages.capture.trackers.settings import StreamSettings

MUCH_MISSING_PERCENT = 20.0
REMEDIES = {
    "liberty": "--stations, --items short, --rate 120",
    "patriot": "--stations, --items short",
    "viper": "--rate 120",
}
"""What makes a stream smaller, of the trackers that count their frames."""

VIPER_FRAME_BYTES, VIPER_SENSOR_BYTES = 28, 32


def cycle_bytes(settings: StreamSettings) -> int:
    """Bytes of one record of every station; in text the most that they can be."""
    count = len(settings.stations)
    if settings.family == "viper":
        return VIPER_FRAME_BYTES + VIPER_SENSOR_BYTES * count
    if settings.family == "trakstar":
        return count * (15 if settings.options.get("group") else 14)
    if settings.family == "fastrak":
        from stages.capture.trackers.fastrak.items import record_bytes as fastrak_record_bytes

        return sum(fastrak_record_bytes(settings.items[s], settings.mode) for s in settings.stations)
    return sum(record_bytes(settings.items[station], settings.mode) for station in settings.stations)


def load_percent(settings: StreamSettings, baud: int | None) -> float | None:
    """How full the line is; None where its rate is not known."""
    if baud is None:
        return None
    return 100 * cycle_bytes(settings) * settings.rate_hz / line_bytes_per_s(baud)


def arithmetic(settings: StreamSettings, baud: int) -> str:
    """Say what the stream needs and what the line carries."""
    count, size = len(settings.stations), cycle_bytes(settings)
    need, carried = size * settings.rate_hz, line_bytes_per_s(baud)
    return (
        f"{count} receivers x {size / count:.4g} bytes x {settings.rate_hz:g} Hz = {need:.0f} bytes/s, "
        f"and {baud} baud carries {carried:.0f}"
    )


def overload(settings: StreamSettings, baud: int | None, name: str, allowed: bool) -> str | None:
    """Give a warning where the line cannot carry the stream and that is allowed; None where it can.

    Raises InputError, with the arithmetic and what would fit, where it is not allowed.
    """
    percent = load_percent(settings, baud)
    if percent is None or baud is None or percent <= 100:
        return None
    cycles = full_cycles_per_s(1, cycle_bytes(settings), baud)
    told = f"the line is too slow: {arithmetic(settings, baud)}"
    if allowed:
        return f"{told}; the tracker will leave frames out, about {cycles} a second come through"
    fits = what_fits(settings, baud)
    raise InputError(
        f"{name}: {told}; {f'what fits is {fits}' if fits else 'not one receiver fits'}; use the tracker's "
        f"USB, or --allow-slower to record what comes through, about {cycles} frames a second"
    )


def too_slow(settings: StreamSettings, bytes_per_s: float, missing_percent: float) -> str | None:
    """Say that the line is too slow by what it has brought; None where it is not to blame.

    missing_percent : of all records. Where they are missing and the bytes are not, something damages them.
    """
    need = cycle_bytes(settings) * settings.rate_hz
    enough = bytes_per_s > (1 - MUCH_MISSING_PERCENT / 100) * need
    if missing_percent <= MUCH_MISSING_PERCENT or enough or settings.family not in REMEDIES:
        return None
    count = len(settings.stations)
    who = f"{count} receivers need" if count > 1 else "1 receiver needs"
    return (
        f"the line brought {bytes_per_s / 1000:.3g} kB/s of the {need / 1000:.3g} kB/s that {who}: "
        f"it is too slow; see {REMEDIES[settings.family]}"
    )


def what_fits(settings: StreamSettings, baud: int) -> str:
    """Say how many receivers fit with this list and the short one, at each rate of LIBERTY."""
    if settings.family not in ("liberty", "patriot"):
        return ""
    rates = (240, 120) if settings.family == "liberty" else (60,)
    own = max(record_bytes(settings.items[station], settings.mode) for station in settings.stations)
    short = record_bytes(text_list(SHORT_LIST) if settings.mode == "ascii" else SHORT_LIST, settings.mode)
    lists = [(own, "with this list"), (short, "with --items short")]
    if settings.mode == "ascii":
        lists.append((record_bytes(SHORT_LIST), "with --items short and without --ascii"))
    lists = [pair for pair in lists if pair[0] < own or pair == lists[0]]
    fits = []
    for size, how in lists:
        counts = [(int(line_bytes_per_s(baud) // (size * rate)), rate) for rate in rates]
        told = [f"{count} receiver{'s'[: count > 1]} at {rate} Hz" for count, rate in counts if count]
        if told:
            fits.append(f"{' or '.join(told)} {how}")
    return ", ".join(fits)
