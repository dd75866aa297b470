"""Alignment of a recording's events, from files and from the study's sheet, with the recording's clock."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu import command_line
from shukotsu.arrays import Array, Integers
from shukotsu.errors import InputError, guess, list_names, reading_user_tables
from shukotsu.movement.event_files import FARTHEST_S, Events, read_markers, read_midi, read_tracker_events
from shukotsu.study.plan import SubjectPlan
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.digests import file_sha256
from shukotsu.tables.parts import Part
from shukotsu.tables.poses import recording_name, usable_poses
from shukotsu.tables.typed_table import open_table, read_metadata

if TYPE_CHECKING:
    from shukotsu.tables.rows import ClocksRow, EventsRow

READERS = {
    (".mid", ".midi", ".smf"): read_midi,
    (".xdf", ".xdfz", ".xdf.gz"): read_markers,
    (".arrows",): read_tracker_events,
}
"""Readers of files of events by the files' endings."""

SAME_CLOCK = "same clock"
"""Value of `pulses` which states that a file's times are on the recording's clock."""

MOST_PULSES = 200_000
"""Number of pulses in an hour at 55 Hz, far more than can be matched."""

_TRACKER_ENDING = ".arrows"

_NO_PULSES: ClocksRow = {"n_pulses": 0, "n_missing": 0, "n_extra": 0}
_NO_CLOCK: ClocksRow = {"status": "failed", **_NO_PULSES}


@dataclass(frozen=True)
class RecordingEvents:
    """The sources of a recording's events.

    Attributes
    ----------
    poses
        The recording's poses table.
    recording
        The recording's original file, or None if unknown.
    file
        The file of events, or None.
    pulses
        The events that both clocks recorded, as `NAME` or `NAME = NAME IN THE RECORDING`, or SAME_CLOCK;
        empty if not stated.
    rows
        The recording's rows of the study's sheet of events.
    key
        The recording's key in tables.

    """

    poses: Path
    recording: Path | None = None
    file: Path | None = None
    pulses: str = ""
    rows: Sequence[Mapping[str, Any]] = ()
    key: Mapping[str, str] = field(default_factory=dict)

    def aligned(self) -> tuple[list[EventsRow], list[ClocksRow]]:
        """Return the rows of events, in order of time, and of clocks, both without the recording's key.

        Raises InputError if the file cannot be read or if it is not stated how to align its clock.
        """
        numbers = ("onset_s", "duration_s", "value")
        sheet_rows = (
            (row.get("name") or "event", *(np.nan if row.get(n) is None else row[n] for n in numbers))
            for row in self.rows
        )
        sheet = Events.of("sheet", False, sheet_rows)
        rows = _event_rows(sheet, sheet.time_s, sheet.sd_s)
        clocks: list[ClocksRow] = []
        if self.file is not None:
            events = read_events(self.file)
            on_its_own = events.own_clock and self.pulses != SAME_CLOCK
            if on_its_own:  # not if the poses come from the same file: its streams share one clock
                inputs = read_metadata(self.poses)["inputs"]
                on_its_own = file_sha256(self.file) not in [entry["sha256"] for entry in inputs]
            if on_its_own:
                time_s, sd_s, clock = self._fitted(events, sheet)
            else:
                time_s, sd_s = events.time_s, events.sd_s
                declared = events.own_clock and self.pulses == SAME_CLOCK
                clock = {**_NO_PULSES, "status": "ok", "scale_ppm": 0.0, "offset_s": 0.0}
                clock["message"] = "declared to be the recording's own clock" if declared else ""
                clock["clock_sd_ms"] = 1e3 * float(sd_s.max()) if (sd_s > 0).any() else None
            if clock["status"] != "failed":
                rows += _event_rows(events, time_s, sd_s)
                clock = self._with_notes(clock, events, time_s)
            clocks = [{**clock, "source": events.source}]
        rows.sort(key=lambda row: row["onset_s"])
        return [{**row, "event": number} for number, row in enumerate(rows)], clocks

    def _fitted(self, events: Events, sheet: Events) -> tuple[Array, Array, ClocksRow]:
        """Return the events' times on the recording's clock with 1-sigma errors, s, and the row of clocks."""
        if not self.pulses:
            raise InputError(
                f"{self.file}: has its own clock; state which of its events are also in the recording "
                f"(pulses, e.g. {events.names[0] if events.names else 'note 24'!r}), or {SAME_CLOCK!r}"
            )
        name, _, other = (part.strip() for part in self.pulses.partition("="))
        pulses = events.named(name)
        if not pulses.any():
            names = list(dict.fromkeys(events.names))
            raise InputError(f"{self.file}: has no event named {name!r}; it has {list_names(names)}")
        if pulses.sum() > MOST_PULSES:
            raise InputError(
                f"{self.file}: has {pulses.sum()} events {name!r}; expected at most {MOST_PULSES} pulses"
            )
        fit = fit_clock(np.sort(self._reference_s(sheet, name, other)), events.time_s[pulses])
        if isinstance(fit, str):
            return events.time_s, events.sd_s, {**_NO_CLOCK, "message": f"{self.file}: {fit}"}
        return *fit.mapped(events.time_s), {
            "scale_ppm": fit.line.rate * 1e6,
            "offset_s": float(fit.line(np.zeros(1))[0]),
            "residual_ms": 1e3 * fit.residual_s,
            "clock_sd_ms": 1e3 * fit.clock_sd_s,
            "n_pulses": fit.n_pulses,
            "n_missing": fit.n_missing,
            "n_extra": fit.n_extra,
            "status": "weak" if fit.message else "ok",
            "message": fit.message,
        }

    def _with_notes(self, clock: ClocksRow, events: Events, time_s: Array) -> ClocksRow:
        """Return the row of clocks with the reader's notes, weak if no event is within the recording."""
        with open_table(self.poses, POSES) as file:  # first and last times are in the table's footer
            of_groups = (file.ends(group, "time_s") for group in range(len(file.group_rows)))
            ends = [end for end in of_groups if end is not None]
        if len(time_s) and ends:
            first_s, last_s = min(low for low, _ in ends) + 0.0, max(high for _, high in ends)
            if not ((time_s >= first_s) & (time_s <= last_s)).any() and np.isfinite([first_s, last_s]).all():
                clock["status"] = "weak"
                clock["message"] = (
                    f"no event is within the recording ({first_s:.1f} to {last_s:.1f} s): they are at "
                    f"{time_s.min():.1f} to {time_s.max():.1f} s; do they belong to this recording?"
                )
        return {**clock, "message": "; ".join(filter(None, (clock["message"], *events.notes)))}

    def _reference_s(self, sheet: Events, name: str, other: str) -> Array:
        """Return the pulses' times on the recording's clock, s, from the sheet or else the raw capture."""
        if sheet.named(other or name).any():
            return sheet.time_s[sheet.named(other or name)]
        if self.recording is None or not self.recording.name.endswith(_TRACKER_ENDING):
            raise InputError(
                f"{self.file}: pulses {name!r}: the recording has no events named {other or name!r} to align "
                "them with; list these in the events sheet, or give a raw capture with the sync input"
            )
        tracker = read_events(self.recording)
        wanted = other or "sync"
        if not tracker.named(wanted).any():
            raise InputError(
                f"{self.recording}: has no {wanted} pulse; it has {list_names(sorted(set(tracker.names)))}"
            )
        return tracker.time_s[tracker.named(wanted)]


def read_events(path: Path) -> Events:
    """Read a file of events. Raises InputError if its ending is unknown or it cannot be read."""
    for endings, reader in READERS.items():
        if path.name.lower().endswith(endings):
            with reading_user_tables():
                events = reader(path)
            bad = np.flatnonzero(~(np.abs(events.time_s) < FARTHEST_S))
            if len(bad):
                time_s = events.time_s[bad[0]]
                raise InputError(f"{path}: event {bad[0] + 1}: its time is {time_s:g} s; copy the file again")
            return events
    expected = [ending for endings in READERS for ending in endings]
    raise InputError(f"{path}: is not a file of events; {guess(path.suffix, expected)}")


def _event_rows(events: Events, time_s: Array, sd_s: Array) -> list[EventsRow]:
    """Return rows of the events table without their number; an error sd_s of 0 is unknown."""
    columns = (events.names, time_s, events.duration_s, events.value, events.channel, sd_s)
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
        for name, onset_s, duration_s, value, channel, sd in zip(*columns, strict=True)
    ]


def of_plan(plan: SubjectPlan) -> dict[Part, list[RecordingEvents]]:
    """Return, for each hand's part, the sources of events of the plan's recordings that have poses."""
    by_part: dict[Part, list[RecordingEvents]] = {plan.part(hand): [] for hand in plan.hands}
    for recording in plan.recordings:
        if recording.exclude or not usable_poses([plan.poses(recording)])[0]:
            continue
        key = recording.key
        rows = [
            row.values for row in plan.rows["events"] if all(row[name] in ("", key[name]) for name in key)
        ]
        files = (plan.poses(recording), recording.source.file, recording.events, recording.pulses)
        by_part[plan.part(recording.hand.hand)].append(RecordingEvents(*files, rows, key))
    return by_part


def recording_alone(
    poses: Path, recording: Path | None, events: Path, pulses: str
) -> dict[Part, list[RecordingEvents]]:
    """Return the same as `of_plan` for a single recording that a command line names."""
    name = recording_name(poses)
    key = {**vars(name.of_hand), "task": name.task, "trial": name.trial}
    part = Part(name.hand, subject=name.subject, session=name.session)
    return {part: [RecordingEvents(poses, recording, events, pulses, key=key)]}


def aligned_rows(
    arguments: Namespace, recording: RecordingEvents
) -> tuple[list[Mapping[str, object]], list[Mapping[str, object]]]:
    """Return a recording's rows of events and clocks.

    With --record-failure, an error becomes a row of clocks with the reason.
    """
    event_rows: list[EventsRow] = []
    clock_rows: list[ClocksRow] = []
    key = recording.key
    with command_line.keep_failure(arguments, arguments.record_failure) as messages:
        event_rows, clock_rows = recording.aligned()
    for message in messages:
        clock_rows = [{**_NO_CLOCK, "source": "", "message": message}]
    for row in clock_rows:
        if row["message"]:
            where = ", ".join(filter(None, (key["hand"], key["task"], key["trial"])))
            print(f"{row['status']}: {where}: {row['message']}", file=sys.stderr)
    return [{**key, **row} for row in event_rows], [{**key, **row} for row in clock_rows]


TOLERANCE_S, SHORTEST_TOLERANCE_S = 0.05, 0.001
"""Largest and smallest limit on the distance of matching pulses from the line; between them, it is a quarter
of their usual interval."""

USUAL_JITTER_S = 0.01
"""1-sigma error assumed for a pulse's time before it can be estimated."""

RATE_SD = 250e-6
"""1-sigma prior on the relative difference between the rates of two clocks."""

WINDOW_PULSES, WINDOW_S, WINDOWS = 32, 60.0, 5
"""Largest number of pulses in a window that is matched to the other clock; longest duration of a window,
short enough for any difference in rate to be negligible; and number of windows tried."""

CHANCE = 0.01
"""Expected number of equally good matches by chance above which a match is not trusted."""

FEWEST_PULSES, LEAST_KEPT, AS_WELL = 3, 0.25, 0.6
"""Fewest pulses for a match to be trusted; smallest share of LOST_RUN successive pulses, while both clocks
ran, that must match, or else a clock was set; share of the hits that a match shifted by one period must have
for the shift to remain possible."""

LOST_RUN = 16
WAS_SET = "its pulses fit no single line: a clock was set or a recorder paused; align each part separately"


@dataclass(frozen=True)
class Line:
    """Map from another clock to the reference clock: reference = other + offset + rate * (other - at).

    at, offset : s. rate : relative difference between the rates. sd_offset_s, sd_rate : 1-sigma errors.
    """

    at: float
    offset: float
    rate: float
    sd_offset_s: float
    sd_rate: float

    @classmethod
    def through(cls, other_s: Array, reference_s: Array, sd_s: float = USUAL_JITTER_S) -> Line:
        """Fit the line to matched pulses, shape (M,), M >= 1, s; RATE_SD is a prior that draws the rate to 0.

        sd_s : 1-sigma error of a pulse's time.
        """
        at = float(other_s.mean())
        x, y = other_s - at, reference_s - other_s
        weight = float(x @ x) + sd_s**2 / RATE_SD**2
        rate = float(x @ (y - y.mean())) / weight
        return cls(at, float(y.mean()), rate, sd_s / np.sqrt(len(x)), sd_s / np.sqrt(weight))

    def __call__(self, other_s: Array) -> Array:
        """Convert times of the other clock to the reference clock, s."""
        return np.asarray(other_s + self.offset + self.rate * (other_s - self.at))

    def sd_s(self, other_s: Array) -> Array:
        """Return the 1-sigma error of the converted times, s, due to the line."""
        return np.hypot(self.sd_offset_s, self.sd_rate * (other_s - self.at))


@dataclass(frozen=True)
class ClockFit:
    """The line between two clocks, with statistics of the pulses.

    Attributes
    ----------
    line
        Map from the other clock to the reference clock.
    residual_s
        1-sigma scatter of a single pulse about the line.
    open_s
        Period of regular pulses, by which the line may be shifted undetected; 0 if pulses are irregular.
    clock_sd_s
        Largest 1-sigma error of the line between the first and the last matched pulse.
    n_pulses, n_missing, n_extra
        Numbers of matched pulses, and of those that only the reference clock or only the other clock has
        while both ran.
    message
        Why the line is uncertain, or empty.

    """

    line: Line
    residual_s: float
    open_s: float
    clock_sd_s: float
    n_pulses: int
    n_missing: int
    n_extra: int
    message: str

    def mapped(self, other_s: Array) -> tuple[Array, Array]:
        """Return times (N,) on the reference clock and their 1-sigma errors, with a pulse's scatter, s."""
        scatter_s = np.hypot(self.residual_s, self.open_s)
        return self.line(other_s), np.hypot(self.line.sd_s(other_s), scatter_s)


def fit_clock(r: Array, o: Array) -> ClockFit | str:
    """Match pulses between two clocks and fit the line from the other clock to the reference clock.

    The offset can have any size, and rates can differ by up to 600 ppm. Either clock may lack pulses or have
    additional ones.

    Parameters
    ----------
    r, o : array, shape (R,) and (O,)
        Times of the pulses on the reference clock, ascending, and on the other clock, in the order of its
        file, s.

    Returns
    -------
    ClockFit or str
        The fit, or a sentence that states why no single line fits.

    """
    if not len(r) or not len(o):
        return "no pulse " + ("in the file" if len(r) else "on the recording's clock")
    if (np.diff(o) < -10 * USUAL_JITTER_S).any():
        return WAS_SET
    o = np.sort(o)
    intervals_s = [float(np.median(np.diff(times))) for times in (r, o) if len(times) > 1]
    within_s = max(SHORTEST_TOLERANCE_S, min([TOLERANCE_S, *(interval / 4 for interval in intervals_s)]))
    i, j, chance = _best_window(r, o, within_s)
    if chance >= 1:
        counts = f"the {len(o)} pulses of the file match the {len(r)} of the recording at no offset"
        return f"{counts}; are they the same pulses?"
    i, j = _follow(r, o, i, j, within_s)
    sd_s = USUAL_JITTER_S
    for _ in range(3):
        line = Line.through(o[j], r[i], sd_s)
        if len(j) > 2 * FEWEST_PULSES:
            sd_s = max(1e-4, 1.4826 * float(np.median(np.abs(r[i] - line(o[j])))))
            within_s = min(within_s, max(5 * sd_s, 0.003))
        i, j = _nearest_pairs(r, line(o), within_s)
    line = Line.through(o[j], r[i], sd_s)
    error = r[i] - line(o[j])
    residual_s = float(np.sqrt(error @ error / (len(j) - 2))) if len(j) > 2 else USUAL_JITTER_S
    line = Line.through(o[j], r[i], residual_s)
    margin_s, at_s = 5 * residual_s, line(o)
    both_ran = [max(r[0], at_s[0]) - margin_s, min(r[-1], at_s[-1]) + margin_s]
    seen_r, seen = (slice(*np.searchsorted(times, both_ran)) for times in (r, at_s))
    n_missing, n_extra = (max(0, len(times) - len(j)) for times in (r[seen_r], at_s[seen]))
    if len(j) > 1 and (_left(len(o), j, seen) or _left(len(r), i, seen_r)):
        return WAS_SET
    open_s = intervals_s[-1] if len(j) > 1 and _is_periodic(r, at_s, intervals_s[-1], within_s) else 0.0
    clock_sd_s = float(np.hypot(line.sd_s(o[j[[0, -1]]]).max(), open_s))
    message = _doubt(len(j), min(n_missing, n_extra), open_s, chance)
    return ClockFit(line, residual_s, open_s, clock_sd_s, len(j), n_missing, n_extra, message)


def _best_window(r: Array, o: Array, within_s: float) -> tuple[Integers, Integers, float]:
    """Return the pairs of the window that matches best, and how many such matches to expect by chance.

    If equally many pulses match at several offsets, the one that shifts the pulses' numbering least is taken.
    """
    from scipy.stats import binom  # takes half a second to import

    first = np.zeros(1, np.int64)
    if len(r) == len(o) == 1:
        return first, first, 0.0
    best = first, first, 1.0
    share = min(1.0, 2 * within_s * len(r) / max(float(r[-1] - r[0]), within_s))
    for start in np.unique(np.linspace(0, max(0, len(o) - WINDOW_PULSES), WINDOWS).astype(int)).tolist():
        window = o[start : start + WINDOW_PULSES]
        window = window[: max(FEWEST_PULSES, int(np.searchsorted(window, window[0] + WINDOW_S)))]
        differences = np.sort((r[:, None] - window).ravel())
        ends = np.searchsorted(differences, differences + 2 * within_s, "right")
        count = ends - np.arange(len(differences))
        good = np.flatnonzero(count == count.max())
        moved = np.searchsorted(r, window[0] + differences[good] + within_s) - start
        at = int(good[np.abs(moved).argmin()])
        i, j = _nearest_pairs(r, window + float(differences[at : ends[at]].mean()), within_s)
        chance = len(r) * len(window) * float(binom.sf(len(j) - 2, len(window) - 1, share))
        if len(j) > 1 and chance < best[2]:
            best = i, start + j, chance
    return best


def _follow(r: Array, o: Array, i: Integers, j: Integers, within_s: float) -> tuple[Integers, Integers]:
    """Extend a window's pairs in both directions, refitting the line, as far as it predicts pulses."""
    while True:
        line = Line.through(o[j], r[i], min(USUAL_JITTER_S, within_s / 5))
        sure = np.flatnonzero((2.5 * line.sd_s(o) < within_s) | ((o >= o[j[0]]) & (o <= o[j[-1]])))
        more_i, more_j = _nearest_pairs(r, line(o[sure]), within_s)
        if len(more_j) <= len(j):
            return i, j
        i, j = more_i, sure[more_j]


def _nearest_pairs(reference_s: Array, expected_s: Array, within_s: float) -> tuple[Integers, Integers]:
    """Return the indices (i, j) of pulses and expected times that are nearest to each other; both ascend."""
    at = _nearest(reference_s, expected_s)
    mutual = _nearest(expected_s, reference_s)[at] == np.arange(len(expected_s))
    chosen = np.flatnonzero(mutual & (np.abs(reference_s[at] - expected_s) <= within_s))
    return at[chosen], chosen


def _nearest(times_s: Array, to_s: Array) -> Integers:
    """Return, for each of `to_s`, the index of the nearest of the ascending `times_s`."""
    return np.searchsorted((times_s[1:] + times_s[:-1]) / 2, to_s)


def _left(count: int, matched: Integers, ran: slice) -> bool:
    """Return whether a run of LOST_RUN of a clock's pulses hardly matches the line, while both clocks ran."""
    kept = np.isin(np.arange(count), matched)[ran]
    size = min(LOST_RUN, max(FEWEST_PULSES, len(kept) // 2))
    runs = np.convolve(kept, np.ones(size), "valid") if len(kept) >= size else np.full(1, size)
    return bool(runs.min() < LEAST_KEPT * size)


def _is_periodic(r: Array, at_s: Array, period_s: float, within_s: float) -> bool:
    """Return whether converted pulses (N,) match about as well when they are shifted by one period."""
    moved_s = at_s + period_s * np.array([[0.0], [-1.0], [1.0]])
    hit = np.abs(r[_nearest(r, moved_s.ravel())].reshape(moved_s.shape) - moved_s) <= within_s
    ran = (moved_s >= r[0] - within_s) & (moved_s <= r[-1] + within_s)
    share = hit.sum(1) / np.maximum(1, ran.sum(1))
    return bool((share[1:] >= AS_WELL * share[0]).any())


def _doubt(n: int, n_lost: int, open_s: float, by_chance: float) -> str:
    """Return why a line is weak, or an empty string."""
    if n < FEWEST_PULSES:
        return (
            f"only {n} common pulse{'s'[: n - 1]}: the clocks' rates are assumed to differ by less than "
            f"{2e6 * RATE_SD:.0f} ppm, or {2 * RATE_SD * 60e3:.0f} ms per minute"
        )
    if open_s > 0:
        return (
            "pulses at regular intervals match at several offsets, whole periods apart "
            f"({open_s:.2f} s); send pulses at irregular intervals"
        )
    if by_chance > CHANCE:
        return f"{n} pulses may match like this by chance; record more of them"
    if n < n_lost:
        return "fewer than half of the pulses are common to both clocks; are they the same pulses?"
    return ""
