"""Fit a hand to its calibration: its recordings, decimated if they are long, and measurements made on it.

On paper: docs/whole-hand.md, sections 5 and 7.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shukotsu.errors import InputError, TableError, guess, join_reasons
from shukotsu.fit.fingertips import PAD, TIP, Fingertips, fingertips
from shukotsu.fit.fit import FitSettings, HandFit, fit_hand, share_lengths
from shukotsu.fit.left_out import Unsteady, field_errors, is_elsewhere, share_left_out, without_displaced
from shukotsu.fit.loose_receivers import Displaced, displaced_in
from shukotsu.fit.measurements import Measurement, measurable
from shukotsu.fit.operations import Index
from shukotsu.fit.touches import CONTACT_SD_MM, Touch, find_contacts, touch_in, with_touches
from shukotsu.hand.known_digits import no_whole_hand
from shukotsu.hand.rotations import Array
from shukotsu.study.layout import Layout
from shukotsu.study.model import HandFitting
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.sheets import Row
from shukotsu.tables.parts import Part
from shukotsu.tables.poses import Poses, RecordingName, frame_count, read_every, recording_name, usable_poses

MOST_FRAMES = 60_000
"""Largest number of frames read from a recording, four minutes at 240 Hz; longer ones are decimated."""

REFERENCE_FRAMES = 80
"""Largest number of frames read from a recording for the hand that anatomy alone predicts. This is enough
because motions repeat: with 200 frames the mean errors, some millimetres, change by 0.001 mm and the 95th
percentiles by 0.02 mm.
"""


Calibrated = tuple[HandFit, Mapping[RecordingName, Poses], Unsteady]
"""A hand fitted by itself, the recordings it was fitted to, and the receivers displaced in them."""
Fits = dict[tuple[str, ...], Calibrated]
"""Fitted hands of a person, by the recordings that they were fitted to."""


class CalibratedHand(NamedTuple):
    """A fitted hand with its fingertips.

    Attributes
    ----------
    tips : Fingertips
        The fit and its fingertips.
    unsteady : Unsteady
        Receivers displaced in its calibration.
    alone : str
        Why the other hand's bone lengths were not used although the model shares them; otherwise empty.

    """

    tips: Fingertips
    unsteady: Unsteady
    alone: str


def calibrated_hand(plan: SubjectPlan, part: Part, fits: Fits) -> CalibratedHand:
    """Fit a part's hand and condition it on the other hand's bone lengths, on touches and on contacts.

    Parameters
    ----------
    plan : SubjectPlan
        Recordings, layouts, models and measurements of the subject.
    part : Part
        Hand, model, and the task left out.
    fits : dict
        Cache of this person's fitted hands; newly fitted ones are added.

    Returns
    -------
    CalibratedHand
        The hand with its fingertips.

    Raises
    ------
    InputError
        If findings exclude every calibration recording, and in the cases of `fit_calibration`.

    """
    plan.check_calibration_left(part.hand)
    fitting = _fitting(plan, part)
    other_poses, alone = partner_poses(plan, part)
    if alone:
        print(f"note: {alone}", file=sys.stderr)
    poses = [plan.poses(r) for r in plan.calibrating(part.hand, part.model, part.made_without)]
    fit, recordings, unsteady = fit_calibration(plan, part, part.hand, poses, fits)
    if other_poses:
        other_hand = "left" if part.hand == "right" else "right"
        try:
            fit = share_lengths(fit, fit_calibration(plan, part, other_hand, other_poses, fits)[0])[0]
        except TableError:
            raise
        except InputError as error:
            print(f"note: the other hand's lengths are not shared: {error}", file=sys.stderr)
    tips = fingertips(fit)
    if not fitting.steps:
        return CalibratedHand(tips, unsteady, alone)
    tips = with_touches(tips, _touches(plan, part.hand, recordings, tips))
    opposition = [poses for name, poses in recordings.items() if name.task in fitting.contacts]
    contacts = [contact for poses in opposition for contact in find_contacts(tips, poses)]
    return CalibratedHand(with_touches(tips, contacts), unsteady, alone)


def partner_poses(plan: SubjectPlan, part: Part) -> tuple[list[Path], str]:
    """Find the poses that calibrate the person's other hand under the part's model.

    No lengths are shared if a recording of either hand has a finding or cannot be read.

    Parameters
    ----------
    plan : SubjectPlan
        Recordings, layouts and models of the subject.
    part : Part
        Hand, model, and the task left out.

    Returns
    -------
    paths : list of Path
        Poses files; empty if no lengths are shared.
    reason : str
        Why they are not shared although the model asks for it; otherwise empty.

    Raises
    ------
    InputError
        If the model does not fit a whole hand, or the layout does not describe one.

    """
    layout = plan.layouts[part.hand]
    partner = next((hand for hand in plan.hands if hand != part.hand and plan.layouts[hand] == layout), "")
    if not partner or not _fitting(plan, part).share_lengths:
        return [], ""
    reasons = [
        f"there is a finding on the {hand} hand's {plan.doubted(hand)}"
        for hand in (partner, part.hand)
        if plan.doubted(hand)
    ]
    if not reasons:
        recorded = [r for r in plan.recordings if r.hand.hand == partner and not r.exclude]
        reasons = usable_poses([plan.poses(r) for r in recorded])[1]
    if reasons:
        return [], f"fitted without the {partner} hand's bone lengths: {reasons[0]}"
    return [plan.poses(r) for r in plan.calibrating(partner, part.model, part.made_without)], ""


def _fitting(plan: SubjectPlan, part: Part) -> HandFitting:
    fitting = plan.models[part.model].fitting
    if fitting is None:
        raise InputError(
            f"model {part.model} does not fit a whole hand; expected fit: {{whole_hand: true}} in its file"
        )
    if reason := no_whole_hand(plan.layouts[part.hand], part.model):
        raise InputError(reason)
    return fitting


def fit_calibration(
    plan: SubjectPlan, part: Part, hand: str, poses: Sequence[Path], fits: Fits
) -> Calibrated:
    """Fit one of the person's hands to its calibration recordings and to measurements made on the hand.

    Frames in which a receiver was displaced are left out if they move a joint centre by more than its sd.

    Parameters
    ----------
    plan, part
        As in `calibrated_hand`.
    hand : str
        The part's hand or the other one, right or left.
    poses : sequence of Path
        Poses files of its calibration recordings.
    fits : dict
        Cache of fitted hands; this one is added.

    Returns
    -------
    Calibrated
        The hand, the recordings to which it was fitted, and the displacements in them.

    Raises
    ------
    InputError
        If no recording can be read or the sheet of measurements names an unknown quantity, and in the cases
        of `fit_hand`.

    """
    layout, fitting = plan.layouts[part.hand], _fitting(plan, part)
    key = layout.name, part.model, hand, *map(str, poses)
    if key in fits:
        return fits[key]
    usable, reasons = usable_poses(poses)
    if not usable:
        raise InputError(f"no calibration recording: {join_reasons(reasons) or 'the study names none'}")
    for reason in reasons:
        print(f"note: left out of the calibration: {reason}", file=sys.stderr)
    names = [recording_name(path) for path in usable]
    most_frames = MOST_FRAMES if fitting.steps else REFERENCE_FRAMES
    recordings = [read_thinned(path, layout.measured, most_frames) for path in usable]
    fit_to = partial(
        fit_hand,
        layout=layout,
        hand=hand,
        hand_length_mm=plan.sizes_mm["hand_length_mm"],
        hand_breadth_mm=plan.sizes_mm["hand_breadth_mm"],
        measurements=measurements_of(plan, hand, layout),
        settings=FitSettings(fitting.frames, fitting.steps, FitSettings.rounds if fitting.steps else 0),
    )
    fit = fit_to(recordings)
    displaced, errors, left_out = Displaced(), dict[str, Array](), dict[str, float]()
    if fitting.steps:
        displaced = displaced_in(fit, recordings)
        errors = field_errors(fit, recordings, displaced.field)
        kept = without_displaced(fit, recordings, displaced)
        if share_left_out(recordings, kept):
            without = fit_to(kept)
            if is_elsewhere(fit, without):
                left_out = share_left_out(recordings, kept)
                fit, recordings = without, kept
    by_name = dict(zip(names, recordings, strict=True))
    fits[key] = fit, by_name, Unsteady(names, displaced, errors, left_out)
    return fits[key]


def read_thinned(path: Path, segments: Sequence[str], most_frames: int = MOST_FRAMES) -> Poses:
    """Read a recording's poses, evenly decimated if it is long.

    Parameters
    ----------
    path : Path
        Poses file.
    segments : sequence of str
        Segments to read.
    most_frames : int
        Largest number of frames to keep.

    Returns
    -------
    Poses
        Every n-th frame, the first one included.

    """
    return read_every(path, segments, -(-frame_count(path) // most_frames))  # rounded up


def measurements_of(plan: SubjectPlan, hand: str, layout: Layout) -> list[Measurement]:
    """Return the measurements of the hand; raise InputError if the sheet names an unknown quantity."""
    quantities = measurable(layout)
    rows = [row for row in plan.rows["measurements"] if row["hand"] == hand]
    for row in rows:
        if row["quantity"] not in quantities:
            raise InputError(
                f"{_place(plan, 'measurements', row, 'quantity')}: {row['quantity']!r} cannot be measured "
                f"on layout {layout.name}; {guess(row['quantity'], quantities)}"
            )
    return [Measurement(row["quantity"], row["value_mm"], row["sd_mm"]) for row in rows]


def _touches(
    plan: SubjectPlan, hand: str, by_name: Mapping[RecordingName, Poses], tips: Fingertips
) -> list[Touch]:
    """Return the sheet's touches that lie in the hand's calibration recordings."""
    recordings = {(name.task, name.trial): poses for name, poses in by_name.items()}
    sheet_rows = [
        r for r in plan.rows["touches"] if r["hand"] == hand and (r["task"], r["trial"]) in recordings
    ]
    met = Counter(frozenset((row["digit"], row["meets"])) for row in sheet_rows if not row["sd_mm"])
    touches = []
    for row in sheet_rows:
        poses = recordings[row["task"], row["trial"]]
        # a person pinches in the same way each time: all contacts of two digits together weigh as much as one
        shared_mm = CONTACT_SD_MM * met[frozenset((row["digit"], row["meets"]))] ** 0.5
        rows = np.flatnonzero((poses.time_s >= row["from_s"]) & (poses.time_s <= row["to_s"]))
        try:
            touches.append(_touch(tips, poses, rows, row, row["sd_mm"] or shared_mm))
        except InputError as error:
            raise InputError(f"{_place(plan, 'touches', row)}: {error}") from None
    return touches


def _touch(tips: Fingertips, poses: Poses, rows: Index, row: Row, sd_mm: float) -> Touch:
    """Return the touch that a row of the sheet describes: of a digit on a point, or of two digits."""
    if not row["meets"]:
        point_mm = np.array([row["x_mm"], row["y_mm"], row["z_mm"]])
        return touch_in(tips, poses, rows, (row["digit"],), sd_mm, row["part"] or TIP, point_mm)
    digits = (row["digit"], row["meets"])
    if digits[0] == digits[1]:
        raise InputError(f"column meets: is {digits[1]!r}, as is column digit; expected another digit")
    return touch_in(tips, poses, rows, digits, sd_mm, row["part"] or PAD)


def _place(plan: SubjectPlan, sheet: str, row: Row, column: str = "") -> str:
    """Return file, row and column as the start of a message; rows from a study's plan have no numbers."""
    place = str(plan.sheets.get(sheet, sheet))
    if row.line:
        place += f": row {row.line}"
    if column:
        place += f"{', ' if row.line else ': '}column {column}"
    return place
