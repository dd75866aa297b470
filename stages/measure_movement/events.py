"""Cycles of a hand's recordings, from the subject's events."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import pose_blocks
from shukotsu.schemas.study import Recording
from shukotsu.stages.measure_movement.cycles import Cycle, cut_cycles, within_recording
from shukotsu.stages.measure_movement.sampling import grid_of
from shukotsu.stages.subject_stage import timed_events


def cycles_of(
    plan: SubjectPlan, hand: str, events: Path | None, clocks: Path | None = None
) -> dict[Recording, list[list[Cycle]]]:
    """Cycles of each evaluated recording, by its events' names in turn; none without events or times.

    events, clocks : as `timed_events` takes them.
    """
    by_recording: dict[tuple[str, str], dict[str, list[tuple[float, float, float]]]] = {}
    for row, doubt in () if events is None else timed_events(plan, hand, events, clocks):
        own = by_recording.setdefault((row["task"], row["trial"]), {})
        duration_s, sd_ms = (
            np.nan if row[name] is None else row[name] for name in ("duration_s", "onset_sd_ms")
        )
        own.setdefault(row["name"], []).append((row["onset_s"], duration_s, np.inf if doubt else sd_ms / 1e3))
    return {
        recording: _cycles(plan, recording, by_recording.get((recording.task, recording.trial), {}))
        for recording in plan.evaluated(hand)
    }


def _cycles(
    plan: SubjectPlan, recording: Recording, events: dict[str, list[tuple[float, float, float]]]
) -> list[list[Cycle]]:
    if not events:
        return []
    try:
        blocks = pose_blocks(plan.poses(recording), plan.layouts[recording.hand.hand].measured)
        time_s = np.concatenate([poses.time_s for poses in blocks])
    except InputError:
        return []  # its import failed: the recordings table says why
    if grid_of(time_s) is None:
        return []
    known = time_s[np.isfinite(time_s)]
    found = (
        within_recording(cut_cycles(name, *zip(*own, strict=True)), known) for name, own in events.items()
    )
    return [own for own in found if own]
