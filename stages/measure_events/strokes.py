"""Measure the strokes of one recording under one model: which digit, when, how fast, from how high."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shukotsu.anatomy.recorded_movement import FingertipPath, RecordedMovement
from shukotsu.skeleton.rotations import Array, conjugate, multiply, rotate
from shukotsu.stages.measure_events.struck_events import StruckEvent
from shukotsu.stages.measure_events.struck_fingers import Approach, StruckFingers, find_fingers
from shukotsu.stages.measure_events.turning_points import (
    SOFT_S,
    TurningPoint,
    one_sided,
    turning_point,
    velocity_before,
)

BACK_S, AHEAD_S = 0.45, 0.35
"""How much of a recording before and after an event, and its duration, belongs to a stroke at most."""

LONGEST_S = 2.0
"""A key that is held longer has no time at which it went up."""

SEARCH_S: Array = np.arange(-7.0, 8.0) * 0.004
"""About an event's onset the fingertip's own contact is looked for."""

LEAST_PROBABILITY = 0.8
"""Of a digit that was found, to be used."""

MOST_CONTACT_SD_S = 0.01
SHAPE_SHARE = 0.03
"""1-sigma, of a contact's speed: strokes are no parabolas."""

OF_THE_WAY, BEFORE_S = 0.4, (0.025, 0.05)
"""How much of the way down, and from and to how long, says how fast the tip was at its end."""

RISE_MM = 4.0
"""So far the tip must rise for the key to be up."""

AT_THE_TOP = 0.95
"""Of the height that a tip comes from: where it is left, the way down begins."""

NO_TIMES = "the recording has no times"
NO_FRAME = "no frame of the recording is there"
NO_HAND = "no digit of this hand went down: another hand's, or no stroke"

BUSY_S = 0.1
"""A finger that so shortly before or after goes down or up itself does not go along with another."""

_BRIDGED_S, _PEAK_S, _AFTER_S = 0.02, 0.0167, 0.15
_PEAK_NOISE = 76.0
"""Speed, mm/s, that noise of 1 mm leaves over _PEAK_S at 240 Hz."""


@dataclass(frozen=True)
class Window:
    """Frames about an event, n of them. tips_mm, in_hand_mm : (n, D, 3) in the transmitter frame and in the
    hand's; pointing : (n, D, 3); tip_sd_mm : (n, D); base : (n, 7) pose of the first digit's base bone.
    """

    rows: slice
    time_s: Array
    tips_mm: Array
    in_hand_mm: Array
    pointing: Array
    tip_sd_mm: Array
    base: Array


@dataclass
class Stroke:
    """A stroke of a digit. way : the frames in which it went down, of its window. values : columns of
    event_strokes. ratios : by digit, its movement of the striker's.
    """

    event: StruckEvent
    digit: str
    window: slice
    contact: TurningPoint | None
    way: tuple[float, float] = (np.nan, np.nan)
    values: dict[str, Any] = field(default_factory=dict)
    ratios: dict[str, float] = field(default_factory=dict)

    @property
    def used(self) -> bool:
        """Whether means are made of it."""
        return bool(self.values["used"])


def measure_strokes(
    movement: RecordedMovement, events: Sequence[StruckEvent]
) -> tuple[list[Stroke], StruckFingers | None]:
    """Measure every event, and find the keyboard; None where the recording tells nothing of it."""
    digits = list(movement.fingertips)
    if not digits or np.isfinite(movement.time_s).sum() < 2:
        reason = NO_TIMES if digits else "this model has no fingertips"
        return [_refused(own, own.refusal or reason) for own in events], None
    reader = _WindowReader(movement)
    approaches = {own.number: reader.approach(own) for own in events if not own.refusal}
    kept = [own for own in events if approaches.get(own.number) is not None]
    found, place = None, {own.number: index for index, own in enumerate(kept)}
    if kept:
        sides = zip(*(approaches[own.number] or () for own in kept), strict=True)
        given = np.array([digits.index(own.digit) if own.digit in digits else -1 for own in kept], np.int64)
        pitch = np.array([own.pitch for own in kept])
        found = find_fingers(Approach(*(np.stack(own) for own in sides)), pitch, given)
    strokes: list[Stroke] = []
    last_s = {"": np.nan}
    for event in events:
        if found is None or event.number not in place:
            strokes.append(_refused(event, event.refusal or NO_FRAME))
            continue
        stroke = _stroke(reader, event, found, place[event.number], last_s)
        strokes.append(stroke)
        if stroke.digit:
            last_s[stroke.digit] = last_s[""] = event.onset_s
    _leave_out_busy(strokes)
    return strokes, found


def _stroke(
    reader: _WindowReader,
    event: StruckEvent,
    found: StruckFingers,
    place: int,
    last_s: Mapping[str, float],
) -> Stroke:
    """Measure an event by the digit that made it. last_s : by digit, and of any as '', the stroke before."""
    digit = int(found.probability[place].argmax())
    name, probability = reader.digits[digit], float(found.probability[place, digit])
    if name != event.digit and (event.digit or probability < 0.5):
        reason = f"the tip of the {event.digit} is not known here" if event.digit else NO_HAND
        return _refused(event, reason, digit_probability=probability)
    gaps = {
        "since_digit_s": event.onset_s - last_s.get(name, np.nan),
        "since_any_s": event.onset_s - last_s[""],
    }
    window = reader.about(event)
    assert window is not None  # there was an approach
    at_s = event.onset_s + SEARCH_S[found.best[place, digit]]
    stroke = Stroke(event, name, window.rows, turning_point(window.time_s, window.tips_mm[:, digit], at_s))
    stroke.values = {"digit": name, "digit_probability": probability} | gaps
    _measure(stroke, window, digit, found.down)
    if np.isfinite(stroke.way[0]):
        stroke.ratios = _ratios(window, stroke.way, digit, reader.digits)
    _judge(stroke, probability)
    return stroke


def _refused(event: StruckEvent, reason: str, **values: Any) -> Stroke:
    values |= {"digit": "", "used": False, "status": "failed", "message": reason}
    return Stroke(event, "", slice(0, 0), None, values=values)


class _WindowReader:
    """Reads a recording's fingertips about events."""

    def __init__(self, movement: RecordedMovement) -> None:
        self._movement, self._tips = movement, list(movement.fingertips.items())
        self.digits = list(movement.fingertips)
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
        movement = self._movement
        bases = {base: own[rows][..., 0] for base, own in movement.bases.items()}
        tips = [self._placed(time_s, name, own, rows, bases) for name, own in self._tips]
        in_room, in_hand, pointing, sd_mm = (np.stack(own, 1) for own in zip(*tips, strict=True))
        base = bases[movement.posed.layout.digits[self._tips[0][0]].base]
        return Window(rows, time_s, in_room, in_hand, pointing, sd_mm, base)

    def approach(self, event: StruckEvent) -> tuple[Array, Array, Array] | None:
        """How the tips move about an event (see `Approach`); None where hardly any frame is there."""
        window = self.about(event)
        if window is None:
            return None
        return one_sided(window.time_s, window.tips_mm, event.onset_s + SEARCH_S)

    def _placed(
        self, time_s: Array, name: str, tip: FingertipPath, rows: slice, bases: Mapping[str, Array]
    ) -> tuple[Array, Array, Array, Array]:
        base = bases[self._movement.posed.layout.digits[name].base]
        place = tip.place_mm[rows][..., 0]
        in_room = rotate(base[:, 3:], place) + base[:, :3]
        bridged = (_bridged(time_s, own) for own in (in_room, place, tip.pointing[rows][..., 0]))
        in_room, in_hand, pointing = bridged
        return in_room, in_hand, pointing, tip.sd_mm[rows][:, 0, 0]


def _bridged(time_s: Array, values: Array) -> Array:
    """Values (n, 3), gaps of at most _BRIDGED_S filled by straight lines."""
    known = np.flatnonzero(np.isfinite(values).all(-1))
    if len(known) in (0, len(values)):
        return values
    out = np.stack([np.interp(time_s, time_s[known], own) for own in values[known].T], -1)
    after = np.searchsorted(known, np.arange(len(values)))
    inside = (after > 0) & (after < len(known))
    wide = np.full(len(values), np.inf)
    wide[inside] = time_s[known[after[inside]]] - time_s[known[after[inside] - 1]]
    out[(wide > _BRIDGED_S) & ~np.isfinite(values).all(-1)] = np.nan
    return out


def _measure(stroke: Stroke, window: Window, digit: int, down: Array) -> None:
    """Measure a stroke's way down before its contact and the rise after it, as far as there are any."""
    time_s, tip, contact = window.time_s, window.tips_mm[:, digit], stroke.contact
    if contact is None:
        return
    at_s = contact.time_s
    height = (contact.place_mm - tip) @ down
    begins_s = at_s - np.fmin(BACK_S, stroke.values["since_digit_s"] - 0.02)
    way = np.flatnonzero((time_s >= begins_s) & (time_s < at_s) & np.isfinite(height))
    if len(way) < 3 or not height[way].max() > 0:
        return
    top = float(height[way].max())
    way = way[np.flatnonzero(height[way] >= AT_THE_TOP * top)[-1] :]
    first, last = int(way[0]), int(way[-1])
    before_s = float(np.clip(OF_THE_WAY * (at_s - time_s[first]), *BEFORE_S))
    contact = stroke.contact = turning_point(time_s, tip, at_s, before_s) or contact
    at_s = contact.time_s
    stroke.way = (float(time_s[first]), at_s)
    up_s = _key_up_s(time_s, tip, height, at_s)
    end_s = (at_s if np.isnan(up_s) else up_s) + _AFTER_S
    turned = multiply(conjugate(window.base[first, 3:]), window.base[last, 3:])
    sd_mm = window.tip_sd_mm[:, digit]
    off_mm = float(np.nanmedian(sd_mm)) / np.sqrt(3.0) if np.isfinite(sd_mm).any() else np.nan
    stroke.values |= {
        "key_down_s": at_s,
        "key_down_sd_ms": 1e3 * float(np.hypot(contact.sd_s, SOFT_S)),
        "key_down_lag_ms": 1e3 * (at_s - stroke.event.onset_s),
        "key_up_s": up_s,
        "peak_speed_after_mm_s": _peak_speed(time_s, tip, at_s, end_s),
        "touch_height_mm": top,
        "touch_height_sd_mm": float(
            np.hypot(
                np.sqrt(2) * contact.noise_mm,
                off_mm * np.linalg.norm(np.diff(window.pointing[[first, last], digit], axis=0)),
            )
        ),
        "hand_displacement_mm": float(np.linalg.norm(window.base[last, :3] - window.base[first, :3])),
        "hand_turn_deg": float(np.degrees(2 * np.arccos(np.clip(abs(turned[0]), 0, 1)))),
        **_speeds(window, digit, contact, before_s, off_mm),
    }
    before = _peak_speed(time_s, tip, stroke.way[0], at_s)
    stroke.values["peak_speed_before_mm_s"] = np.fmax(before, stroke.values["contact_speed_mm_s"])


def _speeds(
    window: Window, digit: int, contact: TurningPoint, before_s: float, off_mm: float
) -> dict[str, float]:
    """Speeds at contact; off_mm : a tip that is off by so much is so much faster, or slower, as it turns."""
    in_hand, turning = (
        float(np.linalg.norm(velocity_before(window.time_s, own[:, digit], contact.time_s, before_s)))
        for own in (window.in_hand_mm, window.pointing)
    )
    speed = float(np.linalg.norm(contact.before_mm_s))
    return {
        "contact_speed_mm_s": speed,
        "contact_speed_sd_mm_s": float(
            np.linalg.norm([contact.speed_sd_mm_s, off_mm * turning, SHAPE_SHARE * speed])
        ),
        "contact_speed_in_hand_mm_s": in_hand,
        "peak_speed_sd_mm_s": float(np.hypot(_PEAK_NOISE * contact.noise_mm, off_mm * turning)),
    }


def _peak_speed(time_s: Array, place_mm: Array, first_s: float, last_s: float) -> float:
    """Largest speed between two times, of straight lines through _PEAK_S that do not reach beyond them."""
    own = (time_s >= first_s) & (time_s <= last_s)
    at_s, place = time_s[own], place_mm[own]
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


def _key_up_s(time_s: Array, tip_mm: Array, height_mm: Array, at_s: float) -> float:
    """When the tip began to rise from where it had struck; NaN where it did not within the window."""
    up = np.flatnonzero((time_s > at_s + 0.01) & (height_mm > RISE_MM))
    if not len(up):
        return float("nan")
    about_s: Array = time_s[up[0]] - np.arange(15.0) * 0.004
    before, after, _ = one_sided(time_s, tip_mm, about_s[about_s > at_s])
    gain = np.linalg.norm(after, axis=-1) - np.linalg.norm(before, axis=-1)
    if not np.isfinite(gain).any():
        return float("nan")
    corner = turning_point(time_s, tip_mm, float(about_s[np.nanargmax(gain)]))
    return float("nan") if corner is None else corner.time_s


def _judge(stroke: Stroke, probability: float) -> None:
    """Say whether a stroke is used, and why not."""
    values, message = stroke.values, ""
    if np.isnan(stroke.way[0]) or stroke.contact is None:
        status, message = (
            "failed",
            "the fingertip has no way down here: it did not move, or poses are missing",
        )
    elif probability < LEAST_PROBABILITY:
        status, message = "weak", f"which digit struck is known to {probability:.2f} alone"
    elif stroke.contact.sd_s > MOST_CONTACT_SD_S:
        sd_ms = 1e3 * stroke.contact.sd_s
        status, message = "weak", f"the fingertip shows no sharp contact: its time is known to {sd_ms:.0f} ms"
    else:
        status = "ok"
    values |= {"used": status == "ok", "status": status, "message": message}


def _ratios(window: Window, way: tuple[float, float], digit: int, digits: Sequence[str]) -> dict[str, float]:
    """Give how far every other tip moved on a digit's way down, of what the digit's own did.

    A tip's movement is that in the direction in which the striker's moved, in the hand's frame, by least
    squares over the way down (Haeger-Ross & Schieber 2000).
    """
    own = (window.time_s >= way[0]) & (window.time_s <= way[1])
    moved = window.in_hand_mm[own] - window.in_hand_mm[own][:1]
    end = moved[-1, digit]
    along = moved @ (end / max(float(np.linalg.norm(end)), 1e-9))  # (n, D)
    striker = along[:, digit]
    ratios = along.T @ striker / max(float(striker @ striker), 1e-9)
    return {
        name: float(ratio)
        for index, (name, ratio) in enumerate(zip(digits, ratios, strict=True))
        if index != digit and np.isfinite(ratio)
    }


def _leave_out_busy(strokes: Sequence[Stroke]) -> None:
    """Leave out of every stroke's ratios the digits that are at a stroke of their own."""
    busy: dict[str, list[tuple[float, float]]] = {}
    for stroke in (own for own in strokes if np.isfinite(own.way[0])):
        ends_s = np.fmax(stroke.way[1], stroke.values["key_up_s"])
        busy.setdefault(stroke.digit, []).append((stroke.way[0] - BUSY_S, ends_s + BUSY_S))
    spans = {digit: np.array(own) for digit, own in busy.items()}
    for stroke in strokes:
        first_s, last_s = stroke.way
        for other in [own for own in stroke.ratios if own in spans]:
            begins_s, ends_s = spans[other].T
            if ((begins_s < last_s) & (ends_s > first_s)).any():
                del stroke.ratios[other]
