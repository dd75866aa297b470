"""Events of one recording, wherever they come from, on the recording's clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError, guess, listed, reading_what_was_brought
from shukotsu.files.parquet_files import column_ends
from shukotsu.files.whole_files import file_sha256
from shukotsu.schemas.catalogue import POSES
from shukotsu.schemas.tables import open_table, read_metadata
from shukotsu.stages.align_events.clock_fit import ClockFit, fit_clock
from shukotsu.stages.align_events.event_list import FARTHEST_S, Array, Clock, Events, events_of_rows

READERS = {
    (".mid", ".midi", ".smf"): "shukotsu.stages.align_events.midi_file:read_midi",
    (".xdf", ".xdfz", ".xdf.gz"): "shukotsu.stages.align_events.marker_streams:read_markers",
    (".arrows",): "shukotsu.stages.align_events.tracker_events:read_tracker_events",
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
    """Hold what there is of a recording's events.

    poses : its poses table. recording : its own file, None where not known. file : its file of events, None
    where it has none. pulses : which events of the file both clocks have, `NAME` or `NAME = NAME OF THE
    RECORDING`, or SAME_CLOCK; empty where nothing says. rows : its rows of the study's sheet.
    """

    poses: Path
    recording: Path | None = None
    file: Path | None = None
    pulses: str = ""
    rows: Sequence[Mapping[str, Any]] = field(default=())

    def aligned(self) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """Return the rows of events, in order of time, and of clocks, both without what names the recording.

        Raises InputError where the file cannot be read or nothing says how its clock is to be brought over.
        """
        sheet = events_of_rows(self.rows)
        events, clocks = _event_rows(sheet, sheet.time_s, np.full(len(sheet), np.nan)), []
        if self.file is not None:
            more, clock = self._brought_over(read_events(self.file), sheet)
            events, clocks = events + more, [clock]
        events.sort(key=lambda row: row["onset_s"])
        return [{**row, "event": number} for number, row in enumerate(events)], clocks

    def _brought_over(self, events: Events, sheet: Events) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        """Rows of the file's events and of its clock."""
        span_s = _span_s(self.poses)
        if events.clock is Clock.OWN and self.pulses != SAME_CLOCK and not self._is_the_recording():
            return self._fitted(events, sheet, span_s)
        offset_s = span_s[0] if events.clock is Clock.START else 0.0
        if np.isnan(offset_s):
            raise InputError(f"{self.poses}: has no times, so onsets from its start say nothing; give time_s")
        declared = events.clock is Clock.OWN and self.pulses == SAME_CLOCK
        clock = {"scale_ppm": 0.0, "offset_s": offset_s, "status": "ok"} | dict.fromkeys(_COUNTS, 0)
        clock["message"] = "declared to be the recording's own clock" if declared else ""
        if (events.sd_s > 0).any():
            clock["clock_sd_ms"] = 1e3 * float(events.sd_s.max())
        time_s = events.time_s + offset_s
        rows = _event_rows(events, time_s, np.where(events.sd_s > 0, events.sd_s, np.nan))
        return rows, _with_notes(clock, events, time_s, span_s)

    def _is_the_recording(self) -> bool:
        """Whether the poses were imported from the very file of events: all its streams share one clock."""
        assert self.file is not None
        inputs = read_metadata(self.poses)["inputs"]
        return file_sha256(self.file) in [entry["sha256"] for entry in inputs]

    def _fitted(
        self, events: Events, sheet: Events, span_s: tuple[float, float]
    ) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        if not self.pulses:
            raise InputError(
                f"{self.file}: runs on a clock of its own; say which of its events the recording has as well "
                f"(pulses, e.g. {events.names[0] if events.names else 'note 24'!r}), or {SAME_CLOCK!r}"
            )
        name, _, other = (part.strip() for part in self.pulses.partition("="))
        pulses = events.named(name)
        if not pulses.any():
            known = list(dict.fromkeys(events.names))
            raise InputError(f"{self.file}: has no event named {name!r}; it has {listed(known)}")
        if pulses.sum() > MOST_PULSES:
            raise InputError(
                f"{self.file}: has {pulses.sum()} events {name!r}; expected at most {MOST_PULSES} pulses"
            )
        fit = fit_clock(np.sort(self._reference_s(sheet, name, other)), events.time_s[pulses])
        if isinstance(fit, str):
            failed = {"status": "failed", "message": f"{self.file}: {fit}", "source": events.source}
            return [], failed | dict.fromkeys(_COUNTS, 0)
        time_s, sd_s = fit.mapped(events.time_s)
        rows = _event_rows(events, time_s, np.hypot(sd_s, fit.jitter_s))
        return rows, _with_notes(_clock_row(fit), events, time_s, span_s)

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
    for endings, place in READERS.items():
        if path.name.lower().endswith(endings):
            module, _, function = place.partition(":")
            read: Callable[[Path], Events] = getattr(import_module(module), function)
            with reading_what_was_brought():
                return _checked(path, read(path))
    known = [ending for endings in READERS for ending in endings]
    raise InputError(f"{path}: is no file of events; {guess(path.suffix, known)}")


def _checked(path: Path, events: Events) -> Events:
    """The events; InputError where one has no time that a clock shows."""
    bad = np.flatnonzero(~(np.abs(events.time_s) < FARTHEST_S))
    if len(bad):
        raise InputError(
            f"{path}: event {bad[0] + 1}: its time is {events.time_s[bad[0]]:g} s; copy the file again"
        )
    return events


def _event_rows(events: Events, time_s: Array, sd_s: Array) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "onset_s": float(onset_s),
            "duration_s": float(duration_s),
            "value": float(value),
            "channel": int(channel) or None,
            "source": events.source,
            "onset_sd_ms": 1e3 * float(sd),
        }
        for name, onset_s, duration_s, value, channel, sd in zip(
            events.names, time_s, events.duration_s, events.value, events.channel, sd_s, strict=True
        )
    ]


def _clock_row(fit: ClockFit) -> dict[str, Any]:
    return {
        "scale_ppm": fit.line.rate * 1e6,
        "offset_s": float(fit.line(np.zeros(1))[0]),
        "residual_ms": 1e3 * fit.residual_s,
        "clock_sd_ms": 1e3 * fit.clock_sd_s,
        **{name: getattr(fit, name) for name in _COUNTS},
        "status": "weak" if fit.message else "ok",
        "message": fit.message,
    }


def _with_notes(
    clock: dict[str, Any], events: Events, time_s: Array, span_s: tuple[float, float]
) -> dict[str, Any]:
    """The row with the reader's notes; weak where every event lies outside the recording."""
    first_s, last_s = span_s
    if len(events) and not ((time_s >= first_s) & (time_s <= last_s)).any() and not np.isnan(first_s):
        clock["status"] = "weak"
        outside = f"no event lies within the recording ({first_s:.1f} to {last_s:.1f} s), but from "
        clock["message"] = f"{outside}{time_s.min():.1f} to {time_s.max():.1f} s; is it of this recording?"
    message = "; ".join(filter(None, (clock["message"], *events.notes)))
    return {**clock, "source": events.source, "message": message}


def _span_s(poses: Path) -> tuple[float, float]:
    """First and last time of a recording, as the table's footer has them; NaN where it has no times."""
    with open_table(poses, POSES) as file:
        place = file.schema_arrow.get_field_index("time_s")
        known = (column_ends(poses, file, n, place, with_nulls=True) for n in range(file.num_row_groups))
        ends = [own for own in known if own is not None]
    low, high = ([end[side] for end in ends] or [np.nan] for side in (0, 1))
    return min(low) + 0.0, max(high)  # Parquet's least zero is -0
