"""What two receivers on a rigid bar say of each other: their distance and their turn, which do not change.

What both are off alike does not show: a shift or a turn of all the room. For a hand that is no loss, as its
joints too are found from receivers beside each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shukotsu.checks.mirror_jumps import own_sides
from shukotsu.errors import InputError
from shukotsu.skeleton.rotations import Array, conjugate, mean_rotation, multiply

Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]

LENGTHS_MM = (20.0, 500.0)
"""Of a bar that a hand moves; outside, positions are in another unit."""

NO_BAR = (10.0, 30.0)
"""mm and deg that half of the frames are off, from which on the two are on no bar."""

MOST_MIRRORED = 0.01
"""Share of frames on the wrong side of the transmitter that are left out without a refusal."""

SPIKE, SPIKE_FRAMES = (1.5, 2.0), 9
"""mm and deg that a pose is off those about it, in so many frames: no field changes as fast."""

LOOSE, LOOSE_SE, SIDE_S, HANDLED = 1.0, 4.0, 0.05, 0.1
"""mm or deg, and standard errors, by which a receiver that came loose within so many seconds is elsewhere at
all places; in this first share of a recording it was put on, which is left out."""

SITE_MM, FEWEST_SITES, FEWEST_POSES = 50.0, 8, 5
"""Places that are as near count as one; a step in time must show at so many, seen so often on either side."""


@dataclass(frozen=True)
class Bar:
    """Two receivers in T frames, both valid: time_s (T,) device time, position_mm (T, 2, 3), quaternion
    (T, 2, 4) from the receiver's to the transmitter's frame.
    """

    names: tuple[str, str]
    time_s: Array
    position_mm: Array
    quaternion: Array

    @property
    def period_s(self) -> float:
        """Time from frame to frame."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def site(self) -> Integers:
        """Number (T,) of the place where the bar's middle is."""
        return np.unique(np.floor(self.position_mm.mean(1) / SITE_MM), axis=0, return_inverse=True)[1].ravel()


@dataclass(frozen=True)
class Deviations:
    """How far a bar is from what is usual: longer_mm (T, 1) than length_mm, and turned_deg (T, 3) of its
    second receiver in the first one's frame.
    """

    length_mm: float
    longer_mm: Array
    turned_deg: Array

    @classmethod
    def of(cls, bar: Bar) -> Deviations:
        """Compare each frame with the usual one: the median over places of the median at each."""
        turn = multiply(conjugate(bar.quaternion[:, 0]), bar.quaternion[:, 1])
        off = np.linalg.norm(_vectors_deg(mean_rotation(turn), turn), axis=1)
        turned_deg = _vectors_deg(mean_rotation(turn[off <= max(1.0, float(np.median(off)))]), turn)
        length_mm = np.linalg.norm(np.diff(bar.position_mm, axis=1), axis=-1)
        usual_mm, usual_deg = (
            np.median([np.median(own[bar.site == site], axis=0) for site in np.unique(bar.site)], axis=0)
            for own in (length_mm, turned_deg)
        )
        return cls(float(usual_mm[0]), length_mm - usual_mm, turned_deg - usual_deg)


def _vectors_deg(origin: Array, quaternion: Array) -> Array:
    """Rotations (T, 4) as small vectors (T, 3) from one (4,)."""
    rest = multiply(conjugate(origin), quaternion)
    return np.asarray(np.degrees(2.0 * np.where(rest[:, :1] < 0, -1.0, 1.0) * rest[:, 1:]))


def usable_bar(bar: Bar) -> tuple[Bar, Deviations, list[str]]:
    """Give the frames that can be believed, their deviations, and what was left out, in words.

    Raises InputError where the two are not on one rigid bar, are mirrored, or in another unit.
    """
    both, notes = f"receivers {' and '.join(bar.names)}", list[str]()
    apart_mm = float(np.median(np.linalg.norm(np.diff(bar.position_mm, axis=1), axis=-1)))
    if not LENGTHS_MM[0] <= apart_mm <= LENGTHS_MM[1]:
        raise InputError(
            f"{both} are {apart_mm:.4g} mm apart; expected {LENGTHS_MM[0]:.0f} to {LENGTHS_MM[1]:.0f}: look "
            "whether positions are in mm, and both receivers on the bar"
        )
    bar = _kept(bar, _on_one_side(bar), "on the transmitter's other side", notes)
    found = Deviations.of(bar)
    off = [float(np.median(np.linalg.norm(own, axis=1))) for own in (found.longer_mm, found.turned_deg)]
    if off[0] > NO_BAR[0] or off[1] > NO_BAR[1]:
        raise InputError(
            f"{both} move by {off[0]:.0f} mm and {off[1]:.0f} deg against each other, which no rigid bar "
            "lets them; fix both to one bar, and keep it in the tracker's hemisphere"
        )
    bar = _kept(bar, _no_spike(found), "with a spike", notes)
    bar = _kept(bar, _while_fixed(bar, Deviations.of(bar)), "before both receivers were fixed", notes)
    return bar, Deviations.of(bar), notes


def _kept(bar: Bar, keep: Bools, what: str, notes: list[str]) -> Bar:
    if not keep.all():
        notes.append(f"{(~keep).sum()} frames {what} were left out")
    arrays = {name: getattr(bar, name)[keep] for name in ("time_s", "position_mm", "quaternion")}
    return replace(bar, **arrays)


def _on_one_side(bar: Bar) -> Bools:
    """Frames in which both are on their side of the transmitter; InputError where many are not."""
    frame = np.round((bar.time_s - bar.time_s[0]) / bar.period_s).astype(np.int64)
    keep = np.ones(len(frame), bool)
    for one, name in enumerate(bar.names):
        sides = own_sides(frame, bar.time_s, bar.position_mm[:, one])
        sign = sides.sign[sides.piece_at(frame)]
        wrong = sign != (1 if sign.sum() >= 0 else -1)
        if wrong.mean() > MOST_MIRRORED:
            raise InputError(
                f"receiver {name} jumps to the other side of the transmitter "
                f"{bar.time_s[np.argmax(wrong)] - bar.time_s[0]:.1f} s after the start; keep the bar in the "
                "tracker's hemisphere and record again"
            )
        keep &= ~wrong
    return keep


def _no_spike(found: Deviations) -> Bools:
    from scipy.ndimage import median_filter

    keep = np.ones(len(found.longer_mm), bool)
    for own, most in zip((found.longer_mm, found.turned_deg), SPIKE, strict=True):
        noise = 1.5 * np.median(np.abs(np.diff(own, 2, axis=0)), axis=0) / np.sqrt(6.0)
        beyond = np.abs(own - median_filter(own, (SPIKE_FRAMES, 1)))
        keep &= (beyond <= np.maximum(most, 6.0 * noise)).all(1)
    return keep


def _while_fixed(bar: Bar, found: Deviations) -> Bools:
    """Frames after the receivers were fixed to the bar; InputError where one came loose later.

    What is loose differs before and after at all places alike and all at once, a field from place to place.
    """
    values, side = np.hstack([found.longer_mm, found.turned_deg]), max(3, round(SIDE_S / bar.period_s))
    ends = np.arange(side, len(values) - side, max(1, side // 3))
    jumps = [np.median(values[e : e + side], 0) - np.median(values[e - side : e], 0) for e in ends]
    start = 0
    for largest in np.argsort([-np.linalg.norm(jump) for jump in jumps])[:FEWEST_SITES]:
        end = int(ends[largest])
        shift, error = _everywhere(values, bar.site, end)
        size = float(np.linalg.norm(shift))
        if size < max(LOOSE, LOOSE_SE * error) or np.linalg.norm(jumps[largest] - shift) > 0.5 * size:
            continue
        if end > HANDLED * len(values):
            when_s, moved = bar.time_s[end] - bar.time_s[0], (abs(shift[0]), np.linalg.norm(shift[1:]))
            raise InputError(
                f"a receiver came loose {when_s:.1f} s after the start: from then on it is {moved[0]:.1f} mm "
                f"and {moved[1]:.1f} deg elsewhere, at all places; fix both receivers and record again"
            )
        start = max(start, end + side)
    return np.asarray(np.arange(len(values)) >= start)


def _everywhere(values: Array, site: Integers, end: int) -> tuple[Array, float]:
    """By how much (4,) values differ after a moment from before it at the same places, and the error."""
    half = np.arange(len(values)) >= end
    steps = [
        values[own & half].mean(0) - values[own & ~half].mean(0)
        for own in (site == one for one in np.unique(site))
        if min((own & half).sum(), (own & ~half).sum()) >= FEWEST_POSES
    ]
    if len(steps) < FEWEST_SITES:
        return np.zeros(4), np.inf
    shift = np.median(steps, axis=0)
    return shift, float(1.5 * np.median(np.linalg.norm(steps - shift, axis=1)) / np.sqrt(len(steps)))
