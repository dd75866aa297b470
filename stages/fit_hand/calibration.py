"""A hand's calibration: its recordings, thinned where they are long, and what was measured on it."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from schemas.catalogue import POSES
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.model import HandFitting
from schemas.poses import Poses, RecordingName, pose_blocks, recording_name, usable_poses
from schemas.study import read_measurements, read_touches
from schemas.tables import open_table
from stages.fit_hand import NO_CALIBRATION
from stages.fit_hand.chain import known_digits
from stages.fit_hand.contacts import find_contacts
from stages.fit_hand.fingertips import Fingertips, fingertips
from stages.fit_hand.fit import HandFit, Settings, fit_hand
from stages.fit_hand.loose_receivers import LooseReceiver, loose_receivers, without_loose
from stages.fit_hand.measurements import Measurement, measurable
from stages.fit_hand.sharing import share_lengths
from stages.fit_hand.touching import Touch, touch_in, with_touches

MOST_FRAMES = 60_000
"""Of a calibration, four minutes at 240 Hz; of a longer one every n-th frame is looked at."""


@dataclass(frozen=True)
class Person:
    """Sizes that a tape measures, mm; None where nobody did."""

    hand_length_mm: float | None = None
    hand_breadth_mm: float | None = None


@dataclass(frozen=True)
class Asked:
    """What a hand is fitted with, besides its recordings; measurements, touches : sheets, None without."""

    layout: Layout
    fitting: HandFitting
    person: Person
    measurements: Path | None = None
    touches: Path | None = None


@dataclass(frozen=True)
class Calibration:
    """A fitted hand and the recordings that it was fitted to, thinned, without what was loose.

    loose : by segment, columns of `receivers` of one that came loose.
    """

    fit: HandFit
    names: Sequence[RecordingName]
    recordings: Sequence[Poses]
    loose: Mapping[str, Mapping[str, Any]]


def read_thinned(path: Path, layout: Layout, most_frames: int = MOST_FRAMES) -> Poses:
    """Read a recording's poses, evenly thinned to at most so many frames."""
    with open_table(path, POSES) as file:
        n_segments = max(1, len(layout.measured))
        step = max(1, -(-file.metadata.num_rows // (n_segments * most_frames)))
    first, kept = 0, []
    for block in pose_blocks(path, layout.measured):
        kept.append(block.take(slice((-first) % step, None, step)))
        first += len(block.frame)
    return joined(kept)


def joined(parts: Sequence[Poses]) -> Poses:
    """Poses of the same segments, one after the other."""
    names = ("frame", "time_s", "position_mm", "quaternion", "valid")
    arrays = [np.concatenate([getattr(part, name) for part in parts]) for name in names]
    return Poses(parts[0].segments, *arrays)


def fit_calibration(paths: Sequence[Path], asked: Asked, subject: str, hand: str) -> Calibration:
    """Fit a hand to its calibration recordings and to what a calliper measured on it.

    A receiver that came loose counts only while it sat in one place. Raises InputError where no recording can
    be read or the sheet names what is not there, and as `fit_hand` does.
    """
    usable, reasons = usable_poses(paths)
    if not usable:
        raise InputError(f"{NO_CALIBRATION}: {'; '.join(reasons) or 'the study names none'}")
    for reason in reasons:
        print(f"note: left out of the calibration: {reason}", file=sys.stderr)
    names = [recording_name(path) for path in usable]
    recordings = [read_thinned(path, asked.layout) for path in usable]
    measurements = measurements_of(asked, subject, hand)
    fit = _fit(recordings, asked, hand, measurements)
    watched = asked.fitting.steps and known_digits(asked.layout)
    loose = loose_receivers(fit, recordings) if watched else []  # what is usual of an arm's skin, nobody says
    if loose:
        recordings = without_loose(recordings, loose)
        fit = _fit(recordings, asked, hand, measurements)
    return Calibration(fit, names, recordings, _said_of_loose(loose, names))


def touched(calibration: Calibration, asked: Asked) -> Fingertips:
    """The hand with what its fingertips touched: points that are known, and in opposition each other."""
    tips = fingertips(calibration.fit)
    recordings = dict(zip(calibration.names, calibration.recordings, strict=True))
    tips = with_touches(tips, _touches(asked, recordings, tips))
    met = [
        contact
        for name, poses in recordings.items()
        if name.task in asked.fitting.contacts and asked.fitting.steps
        for contact in find_contacts(tips, poses)
    ]
    return with_touches(tips, contacts=met)


def _touches(asked: Asked, recordings: Mapping[RecordingName, Poses], tips: Fingertips) -> list[Touch]:
    """What the sheet of touches says of one hand, in those of its recordings that calibrate it."""
    touches = []
    for row in read_touches(asked.touches):
        name = RecordingName(row["subject"], row["hand"], row["task"], row["trial"])
        if name not in recordings:
            continue
        poses = recordings[name]
        rows = np.flatnonzero((poses.time_s >= row["from_s"]) & (poses.time_s <= row["to_s"]))
        point_mm = np.array([row["x_mm"], row["y_mm"], row["z_mm"]])
        try:
            touches.append(
                touch_in(tips, poses, rows, row["digit"], point_mm, sd_mm=row["sd_mm"], part=row["part"])
            )
        except InputError as error:
            raise InputError(f"{asked.touches}: row {row.line}: {error}") from None
    return touches


def _said_of_loose(loose: Sequence[LooseReceiver], names: Sequence[RecordingName]) -> dict[str, Any]:
    """Columns of `receivers` for each receiver that came loose: the largest of its moves."""
    said: dict[str, Any] = {}
    for one in sorted(loose, key=lambda one: one.shift_mm + one.turn_deg):
        name = names[one.recording]
        where = ", ".join(filter(None, (name.task, name.trial)))
        when = f"{one.time_s:.1f} s" if np.isfinite(one.time_s) else f"frame {one.frame}"
        said[one.segment] = {
            "loose_from_frame": one.frame,
            "loose_task": where,
            "loose_shift_mm": one.shift_mm,
            "loose_turn_deg": one.turn_deg,
            "status": "weak",
            "message": f"came loose in {where} at {when}: it moved {one.shift_mm:.1f} mm and turned "
            f"{one.turn_deg:.0f} deg on its bone; only the longer part, before or after, was used",
        }
    return said


def _fit(
    recordings: Sequence[Poses], asked: Asked, hand: str, measurements: Sequence[Measurement]
) -> HandFit:
    fitting = asked.fitting
    rounds = Settings.rounds if fitting.steps else 0
    return fit_hand(
        recordings,
        asked.layout,
        hand,
        hand_length_mm=asked.person.hand_length_mm,
        hand_breadth_mm=asked.person.hand_breadth_mm,
        measurements=measurements,
        settings=Settings(n_frames=fitting.frames, most_steps=fitting.steps, rounds=rounds),
    )


def shared(own: Calibration, other: Calibration) -> Calibration:
    """The hand with what the person's other one says of the lengths of bones."""
    return replace(own, fit=share_lengths(own.fit, other.fit)[0])


def measurements_of(asked: Asked, subject: str, hand: str) -> list[Measurement]:
    """What the sheet of measurements says of one hand; InputError where it names what cannot be measured.

    Checked row by row, as the fit itself knows no sheet.
    """
    known = measurable(asked.layout)
    taken = []
    for row in read_measurements(asked.measurements):
        if (row["subject"], row["hand"]) != (subject, hand):
            continue
        if row["quantity"] not in known:
            close = difflib.get_close_matches(row["quantity"], known, 1)
            guess = f"did you mean {close[0]!r}?" if close else f"expected one of {', '.join(known)}"
            raise InputError(
                f"{asked.measurements}: row {row.line}, column quantity: {row['quantity']!r} is nothing that "
                f"is measured on layout {asked.layout.name}; {guess}"
            )
        taken.append(Measurement(row["quantity"], row["value_mm"], row["sd_mm"]))
    return taken


def check_size(name: str, value_mm: float | None, least_mm: float, most_mm: float) -> None:
    """Raise InputError for a size, as given on a command line, that no hand has."""
    if value_mm is not None and not least_mm < value_mm < most_mm:
        raise InputError(f"{name}: is {value_mm:g}; expected millimetres, {least_mm:g} to {most_mm:g}")
