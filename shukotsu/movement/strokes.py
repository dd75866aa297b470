"""Strokes of one recording under one model: which fingertip struck, when it stopped, and how fast it came.

The downward direction is estimated from all strokes of a recording. The tip that struck is the one that lost
most speed in this direction at the event. Its contact is the corner of its path. A filter across the corner
would mix the speed before it with the rest after it, so a separate parabola of position against time is
fitted to each side, and the time at which they meet is the one of the best fit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import savgol_filter

from shukotsu.hand.recorded_movement import RecordedMovement
from shukotsu.hand.rotations import Array, rotate, unit
from shukotsu.movement.cycles import TimedEvent
from shukotsu.movement.sampling import bridge_gaps, grid_of
from shukotsu.study.study import Recording

if TYPE_CHECKING:
    from shukotsu.tables.rows import EventStrokesRow

MOST_ONSET_SD_MS = 10.0
"""Largest usable 1-sigma error of an event's onset; less certain ones cannot be assigned to a stroke."""

_PITCH = re.compile(r"\bnote \d{1,3}\b")
_SAME_CLOCK = "same clock"


@dataclass(frozen=True)
class StruckEvent:
    """An event that a fingertip made. row : its row of the events table. digit : the digit in its name, or
    empty. refusal : why it cannot be used, or empty.
    """

    row: Mapping[str, Any]
    digit: str
    refusal: str


def struck_events(
    recording: Recording, events: Sequence[TimedEvent], digits: Sequence[str]
) -> list[StruckEvent]:
    """Return the events that name a pitch or a digit, in order of time, without those that align clocks."""
    pulses = {part.strip() for part in recording.pulses.split("=")} - {"", _SAME_CLOCK}
    struck = []
    for row, doubt in ((event.row, event.doubt) for event in events):
        words = row["name"].lower().split()
        digit = next((name for name in digits if name.lower() in words), "")
        if row["name"] in pulses or not (digit or _PITCH.search(row["name"])):
            continue
        sd_ms = row["onset_sd_ms"]
        refusal = f"its clock is uncertain: {doubt}" if doubt else ""
        if not refusal and sd_ms is not None and sd_ms > MOST_ONSET_SD_MS:
            refusal = f"1-sigma error of its onset: {sd_ms:.0f} ms, more than {MOST_ONSET_SD_MS:.0f} ms"
        struck.append(StruckEvent(row, digit, refusal))
    return sorted(struck, key=lambda event: float(event.row["onset_s"]))


BACK_S, AHEAD_S = 0.35, 0.15
"""Longest part of a recording before and after an event that can belong to its stroke."""

SEARCH_S, SLOPE_S = 0.028, 0.025
"""Largest distance of a fingertip's contact from the event's onset; length of the path on each side to which
a straight line is fitted to find the contact."""

LEAST_FALL_MM_S, ALIKE = 50.0, 0.7
"""Least speed that a striking tip loses; largest share of that loss in a second tip at which the first is
still certain to have struck."""

AFTER_S, FEWEST = 0.030, (5, 4)
"""Duration after contact to which the second parabola is fitted; fewest frames for the two parabolas."""

AT_THE_TOP, OF_THE_WAY, BEFORE_S = 0.95, 0.4, (0.025, 0.05)
"""The way down begins where the tip leaves this share of its starting height. The first parabola is fitted to
this share of the way's duration, but at least and at most to these durations."""

SOFT_S = 0.0015
"""Half the time for which finger pulp and felt give way at a contact. The corner is in the middle of it, so
the speed before contact is read this much earlier."""

MOST_CONTACT_SD_S, SHAPE_SHARE = 0.01, 0.03
"""Largest 1-sigma error of the time of a certain contact; additional 1-sigma error of the contact speed, as a
share of it, because strokes are not exactly parabolas."""

BRIDGED_S, _PEAK_S, _PEAK_NOISE = 0.02, 0.0167, 76.0
"""Longest gap that is bridged; duration over which the peak speed is averaged; error of the peak speed, mm/s
per mm of noise at 240 Hz."""


@dataclass(frozen=True)
class _Window:
    """n evenly spaced frames around an event, for D digits.

    tips_mm : (n, D, 3), transmitter frame. pointing : (n, D, 3), directions of the tips in the hand's frame.
    tip_sd_mm : (D,), 1-sigma errors of the tips.
    """

    time_s: Array
    tips_mm: Array
    pointing: Array
    tip_sd_mm: Array


@dataclass(frozen=True)
class _Corner:
    """The corner of a path of C columns.

    position_mm : (C,) at the corner. slope : (C,), per s, just before it. time_s, sd_s : its time and the
    1-sigma error of it. speed_sd_mm_s : error of the speed just before it. noise_mm : scatter of the path
    about the fit.
    """

    time_s: float
    sd_s: float
    position_mm: Array
    slope: Array
    speed_sd_mm_s: float
    noise_mm: float


def stroke_rows(movement: RecordedMovement, events: Sequence[StruckEvent]) -> Iterator[EventStrokesRow]:
    """Yield a row of event_strokes for each event."""
    digits = list(movement.fingertips)
    timed = np.flatnonzero(np.isfinite(movement.time_s))
    missing = "the recording has no frames at this time"
    windows: list[_Window | None] = [None] * len(events)
    if not digits or len(timed) < 2:
        missing = "the recording has no times" if digits else "this model has no fingertips"
    else:
        time_s = np.interp(np.arange(len(movement.time_s)), timed, movement.time_s[timed])
        windows = [None if event.refusal else _window(movement, time_s, event) for event in events]
    pairs = list(zip(events, windows, strict=True))
    losses = [None if window is None else _losses(window, event) for event, window in pairs]
    down = _way_down([loss for loss in losses if loss is not None])
    for (event, window), loss in zip(pairs, losses, strict=True):
        row: EventStrokesRow = {"digit": "", "used": False, "status": "failed"}
        named: Any = {name: event.row[name] for name in ("event", "name", "onset_s", "onset_sd_ms")}
        row |= named
        if window is None or loss is None:
            yield row | {"message": event.refusal or missing}
        else:
            yield row | _stroke(event, window, loss, digits, down)


def _window(movement: RecordedMovement, time_s: Array, event: StruckEvent) -> _Window | None:
    """Return the frames around an event with short gaps bridged, or None if there are too few."""
    onset_s = event.row["onset_s"]
    rows = slice(*np.searchsorted(time_s, [onset_s - BACK_S, onset_s + AHEAD_S]).tolist())
    own_s = time_s[rows]
    grid = grid_of(own_s) if len(own_s) >= 8 and own_s[0] < onset_s < own_s[-1] else None
    if grid is None:
        return None
    columns, sds = [], []
    for name, tip in movement.fingertips.items():
        base = movement.bases[movement.reader.layout.digits[name].base][rows][..., 0]
        columns.append(rotate(base[:, 3:], tip.place_mm[rows][..., 0]) + base[:, :3])
        columns.append(tip.pointing[rows][..., 0])
        sd_mm = tip.sd_mm[rows]
        sds.append(np.nanmedian(sd_mm) if np.isfinite(sd_mm).any() else np.nan)
    even = bridge_gaps(grid.spread(np.concatenate(columns, -1)), grid.step_s, BRIDGED_S)
    paths = even.reshape(grid.count, len(sds), 6)
    even_s = own_s[0] + grid.step_s * np.arange(grid.count)
    return _Window(even_s, paths[..., :3], paths[..., 3:], np.array(sds))


_Losses = tuple[Array, Array, Array]
"""Times (C,) near an event, and the tips' velocities (C, D, 3) just before and just after each of them."""


def _losses(window: _Window, event: StruckEvent) -> _Losses:
    """Return the velocities of all tips near an event, by which the tip that lost most speed is found."""
    step_s = float(window.time_s[1] - window.time_s[0])
    half = max(1, round(SLOPE_S / step_s / 2))
    wide = [(half, half), (0, 0), (0, 0)]
    tips_mm = np.pad(window.tips_mm, wide, constant_values=np.nan)
    slopes = savgol_filter(tips_mm, 2 * half + 1, 1, 1, step_s, 0, "constant", np.nan)
    near = np.flatnonzero(np.abs(window.time_s - event.row["onset_s"]) <= max(SEARCH_S, step_s))
    return window.time_s[near], slopes[near], slopes[near + 2 * half]


def _way_down(losses: Sequence[_Losses]) -> Array:
    """Return the direction (3,) in which tips lose speed, the median over all events."""
    ways = []
    for _, before, after in losses:
        lost = np.linalg.norm(before, axis=-1) - np.linalg.norm(after, axis=-1)
        if np.isfinite(lost).any():
            at = np.unravel_index(np.nanargmax(lost), lost.shape)
            ways.append(unit(before[at] - after[at]))
    return unit(np.median(ways, 0)) if ways else np.full(3, np.nan)


def _stroke(
    event: StruckEvent, window: _Window, losses: _Losses, digits: Sequence[str], down: Array
) -> EventStrokesRow:
    """Find the digit that made an event and measure its stroke; return columns of event_strokes."""
    time_s, before, after = losses
    fall = np.nan_to_num(before @ down - np.abs(after @ down), nan=-np.inf)
    best, most = fall.argmax(0), fall.max(0)
    digit = digits.index(event.digit) if event.digit in digits else int(most.argmax())
    if event.digit and (event.digit != digits[digit] or not np.isfinite(most[digit])):
        return {"message": f"the tip of the {event.digit} is not known at this time"}
    if not event.digit and not most[digit] >= LEAST_FALL_MM_S:
        return {"message": "no digit of this hand moved down: a stroke of the other hand, or none"}
    row: EventStrokesRow = {"digit": digits[digit]}
    measured = _measure_stroke(window, digit, float(time_s[best[digit]]), down)
    if measured is None:
        return row | {"message": "no downward path of the fingertip: it did not move, or poses are missing"}
    others = np.delete(most, digit)
    message = ""
    if not event.digit and (others > ALIKE * most[digit]).any():
        second = [name for name in digits if name != digits[digit]][int(others.argmax())]
        message = f"the tips of {digits[digit]} and {second} moved down alike; name the digit in the event"
    elif measured["key_down_sd_ms"] > 1e3 * MOST_CONTACT_SD_S:
        sd_ms = measured["key_down_sd_ms"]
        message = f"the fingertip shows no sharp contact: 1-sigma error of its time: {sd_ms:.0f} ms"
    return row | measured | {"used": not message, "status": "weak" if message else "ok", "message": message}


def _measure_stroke(window: _Window, digit: int, about_s: float, down: Array) -> EventStrokesRow | None:
    """Measure a stroke down to its contact; return None if the tip has no corner or no way down."""
    time_s, tip = window.time_s, window.tips_mm[:, digit]
    path = np.concatenate([tip, window.pointing[:, digit]], -1)
    corner = _corner(time_s, path, about_s, 0.03)
    if corner is None:
        return None
    height = (corner.position_mm[:3] - tip) @ down
    way = np.flatnonzero((time_s < corner.time_s) & np.isfinite(height))
    if len(way) < 3 or not height[way].max() > 0:
        return None
    first_s = float(time_s[way[height[way] >= AT_THE_TOP * height[way].max()][-1]])
    before_s = float(np.clip(OF_THE_WAY * (corner.time_s - first_s), *BEFORE_S))
    corner = _corner(time_s, path, corner.time_s, before_s) or corner
    # while the tip turns, an error of its position makes its speed too high or too low
    turning = window.tip_sd_mm[digit] / np.sqrt(3.0) * float(np.linalg.norm(corner.slope[3:]))
    speed = float(np.linalg.norm(corner.slope[:3]))
    falling = tip[way][time_s[way] >= first_s]
    step_s = float(time_s[1] - time_s[0])
    width = max(3, 1 + 2 * round(_PEAK_S / step_s / 2))
    peak = speed
    if len(falling) >= width:
        velocity = savgol_filter(falling, width, 1, 1, step_s, 0)
        peak = max(speed, float(np.linalg.norm(velocity, axis=-1).max()))
    return {
        "key_down_s": corner.time_s,
        "key_down_sd_ms": 1e3 * float(np.hypot(corner.sd_s, SOFT_S)),
        "contact_speed_mm_s": speed,
        "contact_speed_sd_mm_s": float(np.linalg.norm([corner.speed_sd_mm_s, turning, SHAPE_SHARE * speed])),
        "peak_speed_before_mm_s": peak,
        "peak_speed_sd_mm_s": float(np.hypot(_PEAK_NOISE * corner.noise_mm, turning)),
    }


def _corner(time_s: Array, path: Array, about_s: float, before_s: float) -> _Corner | None:
    """Fit the corner of a path within about 10 ms of a time; return None if there are too few frames.

    path : (n, 6), position, mm, and direction. before_s : duration before the corner to fit to.
    """
    step_s = float(time_s[1] - time_s[0])
    off_s = time_s - about_s
    span_s = max(before_s, (FEWEST[0] + 0.5) * step_s), max(AFTER_S, (FEWEST[1] + 0.5) * step_s)
    near = (off_s >= -span_s[0]) & (off_s <= span_s[1]) & np.isfinite(path).all(-1)
    off_s, path = off_s[near], path[near]
    if (off_s < 0).sum() < FEWEST[0] or (off_s >= 0).sum() < FEWEST[1]:
        return None

    def fitted(shift_s: float) -> tuple[Array, float, Array]:
        u = (off_s - shift_s) / step_s  # in frames, so that the equations are well conditioned
        early, late = np.minimum(u, 0.0), np.maximum(u, 0.0)
        design = np.stack([np.ones_like(u), early, early**2, late, late**2], -1)
        parameters = np.linalg.lstsq(design, path, rcond=None)[0]
        return parameters, float(((path - design @ parameters)[:, :3] ** 2).sum()), design

    grid_s = np.arange(-4, 5) * 0.002
    start_s = grid_s[np.argmin([fitted(shift_s)[1] for shift_s in grid_s])]
    bounds = start_s - 0.002, start_s + 0.002
    exact = {"xatol": 1e-5}
    best_s = float(minimize_scalar(lambda s: fitted(s)[1], bounds=bounds, method="bounded", options=exact).x)
    parameters, squares, design = fitted(best_s)
    noise_mm = float(np.sqrt(squares / max(1, 3 * len(path) - 16)))
    bend = (fitted(best_s - 1e-3)[1] + fitted(best_s + 1e-3)[1] - 2 * squares) / 1e-6
    sd_s = noise_mm * float(np.sqrt(2.0 / max(bend, 1e-9)))

    def slope(fit: Array) -> Array:
        return np.asarray((fit[1] - 2 * fit[2] * SOFT_S / step_s) / step_s)

    far_s = min(sd_s, 0.002)
    apart = [np.linalg.norm(slope(fitted(best_s + sign * far_s)[0])[:3]) for sign in (-1.0, 1.0)]
    own_sd = noise_mm * float(np.sqrt(np.linalg.pinv(design.T @ design)[1, 1])) / step_s
    by_time = float(apart[1] - apart[0]) / 2 * sd_s / max(far_s, 1e-9)
    speed_sd = float(np.hypot(own_sd, by_time))
    return _Corner(about_s + best_s, sd_s, parameters[0], slope(parameters), speed_sd, noise_mm)
