"""Cycles of a hand's recordings, from the subject's events."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.schemas.movement_tables import CLOCKS, EVENTS
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import pose_blocks
from shukotsu.schemas.study import Recording
from shukotsu.schemas.tables import read_table, rows_of
from shukotsu.stages.measure_movement.cycles import Cycle, cut_cycles, within_recording
from shukotsu.stages.measure_movement.sampling import grid_of


def cycles_of(
    plan: SubjectPlan, hand: str, events: Path | None, clocks: Path | None = None
) -> dict[Recording, list[list[Cycle]]]:
    """Cycles of each evaluated recording, by its events' names in turn; none without events or times.

    events, clocks : the subject's tables; without clocks every event's is trusted. Raises InputError where
    they are none.
    """
    rows = [] if clocks is None else rows_of(read_table(clocks, CLOCKS))
    weak = {_place(row) for row in rows if row["status"] == "weak"}
    by_recording: dict[tuple[str, str], dict[str, list[tuple[float, float, float]]]] = {}
    for row in [] if events is None else rows_of(read_table(events, EVENTS)):
        if (row["session"], row["hand"]) == (plan.session, hand) and row["onset_s"] is not None:
            own = by_recording.setdefault((row["task"], row["trial"]), {})
            duration_s, sd_ms = (
                np.nan if row[name] is None else row[name] for name in ("duration_s", "onset_sd_ms")
            )
            sd_s = np.inf if _place(row) in weak else sd_ms / 1e3
            own.setdefault(row["name"], []).append((row["onset_s"], duration_s, sd_s))
    return {
        recording: _cycles(plan, recording, by_recording.get((recording.task, recording.trial), {}))
        for recording in plan.evaluated(hand)
    }


def _place(row: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(row[name] for name in CLOCKS.key)


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
