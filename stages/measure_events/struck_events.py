"""Choose the events that a fingertip makes: those that name a pitch or a digit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.study import Recording
from shukotsu.stages.subject_stage import timed_events

MOST_ONSET_SD_MS = 10.0
"""Events that are known less well tell no stroke from the next."""

_PITCH = re.compile(r"\bnote (\d{1,3})\b")
_SAME_CLOCK = "same clock"


@dataclass(frozen=True)
class StruckEvent:
    """An event that a fingertip made. pitch : MIDI number, NaN where it names none. digit : as it names it,
    empty where it names none. refusal : why it cannot be used; empty where it can. row : of the events table.
    """

    number: int
    onset_s: float
    duration_s: float
    pitch: float
    digit: str
    refusal: str
    row: Mapping[str, Any]


def struck_events(
    plan: SubjectPlan, hand: str, events: Path, clocks: Path | None
) -> dict[Recording, list[StruckEvent]]:
    """Events of a hand's evaluated recordings that a fingertip made, in order of time.

    events, clocks : as `timed_events` takes them. Events on a clock that is not sure are refused.
    """
    by_recording: dict[tuple[str, ...], list[tuple[Mapping[str, Any], str]]] = {}
    for row, doubt in timed_events(plan, hand, events, clocks):
        by_recording.setdefault((row["task"], row["trial"]), []).append((row, doubt))
    found = {}
    for recording in plan.evaluated(hand):
        rows = by_recording.get((recording.task, recording.trial), [])
        pulses = {part.strip() for part in recording.pulses.split("=")} - {"", _SAME_CLOCK}
        digits = plan.layouts[hand].digits
        strokes = _strokes((own for own in rows if own[0]["name"] not in pulses), [*digits])
        if strokes:
            found[recording] = strokes
    return found


def _strokes(rows: Iterable[tuple[Mapping[str, Any], str]], digits: Sequence[str]) -> list[StruckEvent]:
    found = []
    for row, doubt in rows:
        pitch, words = _PITCH.search(row["name"]), row["name"].lower().split()
        digit = next((own for own in digits if own.lower() in words), "")
        if not digit and pitch is None:
            continue
        sd_ms = row["onset_sd_ms"]
        refusal = f"its clock is not sure: {doubt}" if doubt else ""
        if not refusal and sd_ms is not None and sd_ms > MOST_ONSET_SD_MS:
            refusal = f"its onset is known to {sd_ms:.0f} ms, more than {MOST_ONSET_SD_MS:.0f}"
        duration_s = float("nan") if row["duration_s"] is None else row["duration_s"]
        number = float(pitch[1]) if pitch else float("nan")
        found.append(StruckEvent(row["event"], row["onset_s"], duration_s, number, digit, refusal, row))
    return sorted(found, key=lambda one: one.onset_s)
