"""What is said of a recording when it has ended. No I/O here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MOST_ABSENCES = 3


def lines(out: str, reason: str, totals: Mapping[str, Any], notices: tuple[str, ...] = ()) -> list[str]:
    """Give the summary: what was kept, of each receiver, and what to know of it."""
    told = [f"{out}: ended after {totals['seconds']:.1f} s ({reason})", *table(totals)]
    told += [f"no data at all: {_stretch(*silence)}" for silence in totals["silent_s"]]
    return told + [f"note: {notice}" for notice in notices]


def table(totals: Mapping[str, Any]) -> list[str]:
    """Say what came, in all and of each receiver."""
    told = [
        f"{totals['records']} records in {totals['cycles']} cycles, {totals['lost_frames']} lost; "
        f"{totals['partial_cycles']} cycles partial",
        f"{totals['received_bytes']} bytes, {totals['skipped_bytes']} of them in no record",
        "receiver  records    lost  errors  distortion  hemisphere  absent",
    ]
    return told + [_receiver(station, one) for station, one in totals["receivers"].items()]


def _receiver(station: str, one: Mapping[str, Any]) -> str:
    margin = one["least_hemisphere_margin"]
    absent = [_stretch(*stretch) for stretch in one["absent_s"]]
    more = len(absent) - MOST_ABSENCES
    shown = ", ".join(absent[:MOST_ABSENCES]) + (f" and {more} more" if more > 0 else "")
    return (
        f"{station:>8}  {one['records']:7d}  {one['lost_frames']:6d}  {one['records_with_error']:6d}  "
        f"{one['worst_distortion']:10d}  {'-' if margin is None else f'{margin:+.2f}':>10}  {shown or '-'}"
    )


def _stretch(start_s: float, end_s: float | None) -> str:
    return f"{start_s:.1f} s to {'the end' if end_s is None else f'{end_s:.1f} s'}"
