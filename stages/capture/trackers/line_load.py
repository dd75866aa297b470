"""What a serial line can carry: bytes a second against the bytes that a stream needs."""

from __future__ import annotations

BITS_PER_BYTE = 10
"""8N1: a start bit, eight data bits, a stop bit."""


def line_bytes_per_s(baud: int) -> float:
    """Bytes that a line of that speed carries in a second."""
    return baud / BITS_PER_BYTE


def stream_bytes_per_s(stations: int, record_bytes: int, rate_hz: float) -> float:
    """Bytes of a stream in a second."""
    return stations * record_bytes * rate_hz


def load_percent(stations: int, record_bytes: int, rate_hz: float, baud: int) -> float:
    """How full the line is, in percent; above 100 the tracker drops frames."""
    return 100 * stream_bytes_per_s(stations, record_bytes, rate_hz) / line_bytes_per_s(baud)


def full_cycles_per_s(stations: int, record_bytes: int, baud: int) -> int:
    """Whole cycles of all stations that the line carries in a second."""
    return int(line_bytes_per_s(baud) // (stations * record_bytes))
