"""Measure the strokes of one recording under one model: which digit, when, how fast."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shukotsu.anatomy.recorded_movement import FingertipPath, RecordedMovement
from shukotsu.skeleton.rotations import Array, rotate
from shukotsu.stages.measure_movement.events import StruckEvent
from shukotsu.stages.measure_movement.struck_fingers import Approach, StruckFingers, find_fingers
from shukotsu.stages.measure_movement.turning_points import (
    SOFT_S,
    TurningPoint,
    one_sided,
    turning_point,
    velocity_before,
)

Row = dict[str, Any]

BACK_S, AHEAD_S = 0.45, 0.35
"""How much of a recording before and after an event, and its duration, belongs to a stroke at most."""

LONGEST_S = 2.0
"""Of an event's duration, what belongs to a stroke at most."""

SEARCH_S: Array = np.arange(-7.0, 8.0) * 0.004
"""About an event's onset the fingertip's own contact is looked for."""

LEAST_PROBABILITY = 0.8
"""Of a digit that was found, to be used."""

MOST_CONTACT_SD_S = 0.01
SHAPE_SHARE = 0.03
"""1-sigma, of a contact's speed: strokes are no parabolas."""

OF_THE_WAY, BEFORE_S = 0.4, (0.025, 0.05)
"""How much of the way down, and from and to how long, says how fast the tip was at its end."""

AT_THE_TOP = 0.95
"""Of the height that a tip comes from: where it is left, the way down begins."""

NO_TIMES = "the recording has no times"
NO_FRAME = "no frame of the recording is there"
NO_HAND = "no digit of this hand went down: another hand's, or no stroke"

_BRIDGED_S, _PEAK_S = 0.02, 0.0167
_PEAK_NOISE = 76.0
"""Speed, mm/s, that noise of 1 mm leaves over _PEAK_S at 240 Hz."""


@dataclass(frozen=True)
class Window:
    """Frames about an event, n of them. tips_mm, pointing : (n, D, 3) in the transmitter frame and in the
    hand's; tip_sd_mm : (n, D).
    """

    time_s: Array
    tips_mm: Array
    pointing: Array
    tip_sd_mm: Array


def stroke_rows(movement: RecordedMovement, events: Sequence[StruckEvent]) -> Iterator[Row]:
    """Rows of event_strokes, one an event; the digits of all are told together."""
    digits = list(movement.fingertips)
    windows: dict[int, Window] = {}
    if digits and np.isfinite(movement.time_s).sum() >= 2:
        reader = _WindowReader(movement)
        read = {event.number: reader.about(event) for event in events if not event.refusal}
        windows = {number: window for number, window in read.items() if window is not None}
        missing = NO_FRAME
    else:
        missing = NO_TIMES if digits else "this model has no fingertips"
    kept = [event for event in events if event.number in windows]
    if kept:
        sides = zip(
            *(
                one_sided(
                    windows[event.number].time_s, windows[event.number].tips_mm, event.onset_s + SEARCH_S
                )
                for event in kept
            ),
            strict=True,
        )
        given = np.array([digits.index(event.digit) if event.digit in digits else -1 for event in kept])
        pitch = np.array([event.pitch for event in kept])
        struck = find_fingers(Approach(*(np.stack(side) for side in sides)), pitch, given)
    last_s: dict[str, float] = {}
    index = 0
    for event in events:
        row: Row = {"event": event.number, "used": False, "digit": "", "status": "failed"}
        row |= {name: event.row[name] for name in ("name", "onset_s", "onset_sd_ms")}
        if event.number not in windows:
            yield row | {"message": event.refusal or missing}
            continue
        row |= _stroke(event, windows[event.number], digits, struck, index, last_s)
        index += 1
        if row["digit"]:
            last_s[row["digit"]] = event.onset_s
        yield row


def _stroke(
    event: StruckEvent,
    window: Window,
    digits: Sequence[str],
    struck: StruckFingers,
    index: int,
    last_s: Mapping[str, float],
) -> Row:
    """Measure an event by the digit that made it. last_s : by digit, the stroke before."""
    digit = int(struck.probability[index].argmax())
    name, probability = digits[digit], float(struck.probability[index, digit])
    row: Row = {"digit_probability": probability}
    if name != event.digit and (event.digit or probability < 0.5):
        reason = f"the tip of the {event.digit} is not known here" if event.digit else NO_HAND
        return row | {"message": reason}
    at_s = event.onset_s + SEARCH_S[struck.best[index, digit]]
    contact = turning_point(window.time_s, window.tips_mm[:, digit], at_s)
    since_s = event.onset_s - last_s.get(name, np.nan)
    found = None if contact is None else _measured(window, digit, contact, struck.down, since_s)
    row |= {"digit": name}
    if found is None:
        return row | {"message": "the fingertip has no way down here: it did not move, or poses are missing"}
    contact, values = found
    message = ""
    if probability < LEAST_PROBABILITY:
        message = f"which digit struck is known to {probability:.2f} alone"
    elif contact.sd_s > MOST_CONTACT_SD_S:
        sd_ms = 1e3 * contact.sd_s
        message = f"the fingertip shows no sharp contact: its time is known to {sd_ms:.0f} ms"
    return row | values | {"used": not message, "status": "weak" if message else "ok", "message": message}


class _WindowReader:
    """Reads a recording's fingertips about events."""

    def __init__(self, movement: RecordedMovement) -> None:
        self._movement = movement
        # times that run on, where a frame has none
        known = np.flatnonzero(np.isfinite(movement.time_s))
        self._time_s = np.interp(np.arange(len(movement.time_s)), known, movement.time_s[known])

    def about(self, event: StruckEvent) -> Window | None:
        """Frames about an event; None where hardly any is there."""
        held = event.duration_s if event.duration_s > 0 else 0.0
        ends = event.onset_s - BACK_S, event.onset_s + min(held, LONGEST_S) + AHEAD_S
        first, last = np.searchsorted(self._time_s, ends)
        rows = slice(int(first), int(last))
        time_s = self._time_s[rows]
        if len(time_s) < 8 or not time_s[0] < event.onset_s < time_s[-1]:
            return None
        tips = [self._placed(time_s, name, tip, rows) for name, tip in self._movement.fingertips.items()]
        return Window(time_s, *(np.stack(parts, 1) for parts in zip(*tips, strict=True)))

    def _placed(
        self, time_s: Array, name: str, tip: FingertipPath, rows: slice
    ) -> tuple[Array, Array, Array]:
        base = self._movement.bases[self._movement.posed.layout.digits[name].base][rows][..., 0]
        in_room = rotate(base[:, 3:], tip.place_mm[rows][..., 0]) + base[:, :3]
        pointing = tip.pointing[rows][..., 0]
        return _bridged(time_s, in_room), _bridged(time_s, pointing), tip.sd_mm[rows][:, 0, 0]


def _bridged(time_s: Array, values: Array) -> Array:
    """Values (n, 3), gaps of at most _BRIDGED_S filled by straight lines."""
    known = np.flatnonzero(np.isfinite(values).all(-1))
    if len(known) in (0, len(values)):
        return values
    out = np.stack([np.interp(time_s, time_s[known], column) for column in values[known].T], -1)
    after = np.searchsorted(known, np.arange(len(values)))
    inside = (after > 0) & (after < len(known))
    wide = np.full(len(values), np.inf)
    wide[inside] = time_s[known[after[inside]]] - time_s[known[after[inside] - 1]]
    out[(wide > _BRIDGED_S) & ~np.isfinite(values).all(-1)] = np.nan
    return out


def _measured(
    window: Window, digit: int, contact: TurningPoint, down: Array, since_s: float
) -> tuple[TurningPoint, Row] | None:
    """Measure a stroke's way down to its contact; None without one. since_s : the digit's last stroke."""
    time_s, tip = window.time_s, window.tips_mm[:, digit]
    at_s = contact.time_s
    height = (contact.place_mm - tip) @ down
    begins_s = at_s - np.fmin(BACK_S, since_s - 0.02)
    way = np.flatnonzero((time_s >= begins_s) & (time_s < at_s) & np.isfinite(height))
    if len(way) < 3 or not height[way].max() > 0:
        return None
    first = way[np.flatnonzero(height[way] >= AT_THE_TOP * height[way].max())[-1]]
    before_s = float(np.clip(OF_THE_WAY * (at_s - time_s[first]), *BEFORE_S))
    contact = turning_point(time_s, tip, at_s, before_s) or contact
    sd_mm = window.tip_sd_mm[:, digit]
    # a tip that is off by so much along a direction is so much faster, or slower, as it turns
    off_mm = float(np.nanmedian(sd_mm)) / np.sqrt(3.0) if np.isfinite(sd_mm).any() else np.nan
    pointing = window.pointing[:, digit]
    turning = off_mm * float(np.linalg.norm(velocity_before(time_s, pointing, contact.time_s, before_s)))
    speed = float(np.linalg.norm(contact.before_mm_s))
    peak = _peak_speed(time_s, tip, float(time_s[first]), contact.time_s)
    return contact, {
        "key_down_s": contact.time_s,
        "key_down_sd_ms": 1e3 * float(np.hypot(contact.sd_s, SOFT_S)),
        "contact_speed_mm_s": speed,
        "contact_speed_sd_mm_s": float(np.linalg.norm([contact.speed_sd_mm_s, turning, SHAPE_SHARE * speed])),
        "peak_speed_before_mm_s": float(np.fmax(peak, speed)),
        "peak_speed_sd_mm_s": float(np.hypot(_PEAK_NOISE * contact.noise_mm, turning)),
    }


def _peak_speed(time_s: Array, place_mm: Array, first_s: float, last_s: float) -> float:
    """Largest speed between two times, of straight lines through _PEAK_S that do not reach beyond them."""
    inside = (time_s >= first_s) & (time_s <= last_s)
    at_s, place = time_s[inside], place_mm[inside]
    step_s = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
    width = max(3, 1 + round(_PEAK_S / step_s))
    if len(at_s) < width:
        return float("nan")
    times = np.lib.stride_tricks.sliding_window_view(at_s, width)
    places = np.lib.stride_tricks.sliding_window_view(place, width, axis=0)  # (m, 3, width)
    times = times - times.mean(1, keepdims=True)
    slope = (places * times[:, None]).sum(-1) / (times**2).sum(1, keepdims=True)
    speed = np.linalg.norm(slope, axis=-1)
    return float(np.nanmax(speed)) if np.isfinite(speed).any() else float("nan")
