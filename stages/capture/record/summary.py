"""What is said of a recording when it has ended. No I/O here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from stages.capture.record.line import too_slow
from stages.capture.trackers.settings import StreamSettings

MOST_ABSENCES = 3
AT_THE_EDGE = 0.05
"""A receiver whose direction came so close to the edge of its half of space may have been beyond it."""


def lines(out: str, reason: str, totals: Mapping[str, Any], notices: tuple[str, ...] = ()) -> list[str]:
    """Give the summary: what was kept, of each receiver, and what to know of it."""
    told = [f"{out}: ended after {totals['seconds']:.1f} s ({reason})", *table(totals)]
    told += [f"no data at all: {_stretch(*silence)}" for silence in totals["silent_s"]]
    return told + [f"note: {notice}" for notice in notices]


def table(totals: Mapping[str, Any]) -> list[str]:
    """Say what came, in all and of each receiver."""
    told = [
        f"{totals['records']} records in {totals['cycles']} cycles; "
        f"{totals['lost_cycles']} frames lost ({totals['lost_frames']} records), "
        f"{totals['partial_cycles']} cycles partial",
        f"{totals['received_bytes']} bytes, {totals['skipped_bytes']} of them in no record",
        "receiver  records    lost  errors  distortion  hemisphere  absent",
    ]
    return told + [_receiver(station, one) for station, one in totals["receivers"].items()]


def advice(totals: Mapping[str, Any], settings: StreamSettings) -> list[str]:
    """Say what was wrong with a recording and can be bettered."""
    slow = too_slow(
        settings,
        totals["received_bytes"] / max(totals["seconds"], 1e-9),
        100 * totals["lost_frames"] / max(totals["records"] + totals["lost_frames"], 1),
    )
    margins = {s: one["least_hemisphere_margin"] for s, one in totals["receivers"].items()}
    edge = [station for station, margin in margins.items() if margin is not None and margin < AT_THE_EDGE]
    told = [slow] if slow else []
    if edge:
        told.append(
            f"receiver {', '.join(edge)}: came to the edge of the hemisphere: positions may have jumped; "
            "`decode` marks it; consider --hemisphere"
        )
    return told


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
