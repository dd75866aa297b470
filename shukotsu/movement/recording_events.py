"""Events of one recording, wherever they come from, on the recording's clock."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu import command_line
from shukotsu.errors import InputError, guess, listed, reading_what_was_brought
from shukotsu.movement.clock_fit import fit_clock
from shukotsu.movement.event_files import (
    FARTHEST_S,
    Array,
    Events,
    read_markers,
    read_midi,
    read_tracker_events,
)
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.parts import Part
from shukotsu.tables.poses import recording_name, usable_poses
from shukotsu.tables.typed_table import open_table, read_metadata
from shukotsu.tables.whole_files import file_sha256

READERS = {
    (".mid", ".midi", ".smf"): read_midi,
    (".xdf", ".xdfz", ".xdf.gz"): read_markers,
    (".arrows",): read_tracker_events,
}
"""Endings of files of events, and what reads them."""

SAME_CLOCK = "same clock"
"""What stands for the name of the pulses where a file's times are the recording's own."""

MOST_PULSES = 200_000
"""What an hour has at 55 Hz, far more than can be told apart."""

_TRACKER_ENDING = ".arrows"
_COUNTS = ("n_pulses", "n_missing", "n_extra")


@dataclass(frozen=True)
class RecordingEvents:
    """What there is of a recording's events.

    poses : its poses table. recording : its own file, None where not known. file : its file of events, None
    where it has none. pulses : which events of the file both clocks have, `NAME` or `NAME = NAME OF THE
    RECORDING`, or SAME_CLOCK; empty where nothing says. rows : its rows of the study's sheet. key : its name
    in tables.
    """

    poses: Path
    recording: Path | None = None
    file: Path | None = None
    pulses: str = ""
    rows: Sequence[Mapping[str, Any]] = ()
    key: Mapping[str, str] = field(default_factory=dict)

    def aligned(self) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """Return the rows of events, in order of time, and of clocks, both without what names the recording.

        Raises InputError where the file cannot be read or nothing says how its clock is to be brought over.
        """
        sheet_rows = (
            (row.get("name") or "event", *(_or_nan(row.get(n)) for n in ("onset_s", "duration_s", "value")))
            for row in self.rows
        )
        sheet = Events.of("sheet", False, sheet_rows)
        rows, clocks = _event_rows(sheet, sheet.time_s, sheet.sd_s), []
        if self.file is not None:
            events = read_events(self.file)
            if events.own_clock and self.pulses != SAME_CLOCK and not self._is_the_recording():
                time_s, sd_s, clock = self._fitted(events, sheet)
            else:
                time_s, sd_s = events.time_s, events.sd_s
                declared = events.own_clock and self.pulses == SAME_CLOCK
                clock = {"scale_ppm": 0.0, "offset_s": 0.0, "status": "ok"} | dict.fromkeys(_COUNTS, 0)
                clock["message"] = "declared to be the recording's own clock" if declared else ""
                clock["clock_sd_ms"] = 1e3 * float(sd_s.max()) if (sd_s > 0).any() else None
            if clock["status"] != "failed":
                rows += _event_rows(events, time_s, sd_s)
                clock = self._with_notes(clock, events, time_s)
            clocks = [{**clock, "source": events.source}]
        rows.sort(key=lambda row: row["onset_s"])
        return [{**row, "event": number} for number, row in enumerate(rows)], clocks

    def _is_the_recording(self) -> bool:
        """Whether the poses were imported from the very file of events: all its streams share one clock."""
        assert self.file is not None
        inputs = read_metadata(self.poses)["inputs"]
        return file_sha256(self.file) in [entry["sha256"] for entry in inputs]

    def _fitted(self, events: Events, sheet: Events) -> tuple[Array, Array, dict[str, Any]]:
        """Times of the events on the recording's clock, their 1-sigma errors, and the row of that clock."""
        if not self.pulses:
            raise InputError(
                f"{self.file}: runs on a clock of its own; say which of its events the recording has as well "
                f"(pulses, e.g. {events.names[0] if events.names else 'note 24'!r}), or {SAME_CLOCK!r}"
            )
        name, _, other = (part.strip() for part in self.pulses.partition("="))
        pulses = events.named(name)
        if not pulses.any():
            names = list(dict.fromkeys(events.names))
            raise InputError(f"{self.file}: has no event named {name!r}; it has {listed(names)}")
        if pulses.sum() > MOST_PULSES:
            raise InputError(
                f"{self.file}: has {pulses.sum()} events {name!r}; expected at most {MOST_PULSES} pulses"
            )
        fit = fit_clock(np.sort(self._reference_s(sheet, name, other)), events.time_s[pulses])
        if isinstance(fit, str):
            failed = {"status": "failed", "message": f"{self.file}: {fit}"}
            return events.time_s, events.sd_s, failed | dict.fromkeys(_COUNTS, 0)
        return *fit.mapped(events.time_s), {
            "scale_ppm": fit.line.rate * 1e6,
            "offset_s": float(fit.line(np.zeros(1))[0]),
            "residual_ms": 1e3 * fit.residual_s,
            "clock_sd_ms": 1e3 * fit.clock_sd_s,
            **{name: getattr(fit, name) for name in _COUNTS},
            "status": "weak" if fit.message else "ok",
            "message": fit.message,
        }

    def _with_notes(self, clock: dict[str, Any], events: Events, time_s: Array) -> dict[str, Any]:
        """The row with the reader's notes; weak where every event lies outside the recording."""
        with open_table(self.poses, POSES) as file:  # the table's footer has the ends
            of_groups = (file.ends(group, "time_s", with_nulls=True) for group in range(len(file.group_rows)))
            ends = [end for end in of_groups if end is not None]
        if len(time_s) and ends:
            first_s, last_s = min(low for low, _ in ends) + 0.0, max(high for _, high in ends)
            if not ((time_s >= first_s) & (time_s <= last_s)).any() and np.isfinite([first_s, last_s]).all():
                clock["status"] = "weak"
                clock["message"] = (
                    f"no event lies within the recording ({first_s:.1f} to {last_s:.1f} s), but from "
                    f"{time_s.min():.1f} to {time_s.max():.1f} s; is it of this recording?"
                )
        return {**clock, "message": "; ".join(filter(None, (clock["message"], *events.notes)))}

    def _reference_s(self, sheet: Events, name: str, other: str) -> Array:
        """Times of the pulses on the recording's clock: of the sheet's events, else of the tracker's own."""
        if sheet.named(other or name).any():
            return sheet.time_s[sheet.named(other or name)]
        if self.recording is None or not self.recording.name.endswith(_TRACKER_ENDING):
            raise InputError(
                f"{self.file}: pulses {name!r}: the recording has no events named {other or name!r} to bring "
                "them to; give them in the sheet of events, or a raw capture with the tracker's sync input"
            )
        tracker = read_events(self.recording)
        wanted = other or "sync"
        if not tracker.named(wanted).any():
            raise InputError(
                f"{self.recording}: has no {wanted} pulse; it has {listed(sorted(set(tracker.names)))}"
            )
        return tracker.time_s[tracker.named(wanted)]


def read_events(path: Path) -> Events:
    """Read a file of events by its ending; InputError where no reader knows it."""
    for endings, reader in READERS.items():
        if path.name.lower().endswith(endings):
            with reading_what_was_brought():
                events = reader(path)
            bad = np.flatnonzero(~(np.abs(events.time_s) < FARTHEST_S))
            if len(bad):
                time_s = events.time_s[bad[0]]
                raise InputError(f"{path}: event {bad[0] + 1}: its time is {time_s:g} s; copy the file again")
            return events
    expected = [ending for endings in READERS for ending in endings]
    raise InputError(f"{path}: is no file of events; {guess(path.suffix, expected)}")


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _event_rows(events: Events, time_s: Array, sd_s: Array) -> list[dict[str, Any]]:
    """Rows of events; an sd of 0 is not known."""
    return [
        {
            "name": name,
            "onset_s": float(onset_s),
            "duration_s": float(duration_s),
            "value": float(value),
            "channel": int(channel) or None,
            "source": events.source,
            "onset_sd_ms": 1e3 * float(sd) if sd > 0 else None,
        }
        for name, onset_s, duration_s, value, channel, sd in zip(
            events.names, time_s, events.duration_s, events.value, events.channel, sd_s, strict=True
        )
    ]


def of_plan(plan: SubjectPlan) -> dict[Part, list[RecordingEvents]]:
    """Return the recordings of a plan that hold poses, and their events, by the hand's part."""
    by_part: dict[Part, list[RecordingEvents]] = {plan.part(hand): [] for hand in plan.hands}
    for recording in plan.recordings:
        if recording.exclude or not usable_poses([plan.poses(recording)])[0]:
            continue
        key = recording.key
        rows = [row.values for row in plan.events if all(row[name] in ("", key[name]) for name in key)]
        files = (plan.poses(recording), recording.file, recording.events, recording.pulses)
        by_part[plan.part(recording.hand.hand)].append(RecordingEvents(*files, rows, key))
    return by_part


def recording_alone(
    poses: Path, recording: Path | None, events: Path, pulses: str
) -> dict[Part, list[RecordingEvents]]:
    """Return a recording that a command line names, and its events, by the hand's part."""
    name = recording_name(poses)
    key = {**vars(name.of_hand), "task": name.task, "trial": name.trial}
    part = Part(name.hand, subject=name.subject, session=name.session)
    return {part: [RecordingEvents(poses, recording, events, pulses, key=key)]}


def aligned_rows(
    arguments: Namespace, recording: RecordingEvents
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return a recording's rows of events and clocks; with --record-failure why there are none."""
    event_rows: list[dict[str, Any]] = []
    clock_rows: list[dict[str, Any]] = []
    key = recording.key
    with command_line.recorded(arguments, arguments.record_failure) as messages:
        event_rows, clock_rows = recording.aligned()
    for message in messages:
        failed = {"source": "", "n_pulses": 0, "n_missing": 0, "n_extra": 0}
        clock_rows = [{**failed, "status": "failed", "message": message}]
    for row in clock_rows:
        if row["message"]:
            where = ", ".join(filter(None, (key["hand"], key["task"], key["trial"])))
            print(f"{row['status']}: {where}: {row['message']}", file=sys.stderr)
    return [{**key, **row} for row in event_rows], [{**key, **row} for row in clock_rows]
