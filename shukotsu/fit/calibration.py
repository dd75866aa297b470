"""A hand's calibration: its recordings, thinned where they are long, and what was measured on it.

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
"""Frames of a calibration, four minutes at 240 Hz; of a longer one every n-th frame is used."""

REFERENCE_FRAMES = 80
"""Number of evenly spaced frames in which the hand that anatomy expects is posed. Motions repeat themselves:
with 200 frames the mean errors, which are millimetres, change by 0.001 mm and the 95th percentiles by 0.02
mm.
"""


Calibrated = tuple[HandFit, Mapping[RecordingName, Poses], Unsteady]
"""A hand fitted by itself, the recordings it was fitted to, and the receivers displaced in them."""
Fits = dict[tuple[str, ...], Calibrated]
"""Fitted hands of a person, by the recordings that they were fitted to."""


class CalibratedHand(NamedTuple):
    """A fitted hand with its fingertips.

    unsteady : receivers displaced in its calibration. alone : why it was fitted without the other hand's bone
    lengths though the model shares them; empty where it was not.
    """

    tips: Fingertips
    unsteady: Unsteady
    alone: str


def calibrated_hand(plan: SubjectPlan, part: Part, fits: Fits) -> CalibratedHand:
    """Fit a part's hand, condition it on the other hand's bone lengths, on touches and on contacts.

    Parameters
    ----------
    plan : SubjectPlan
        What the study knows of the person.
    part : Part
        Hand, model, and the task left out.
    fits : dict
        Hands of this person that are fitted already; missing ones are added.

    Returns
    -------
    CalibratedHand
        The hand with its fingertips.

    Raises
    ------
    InputError
        Where a finding refused all recordings to calibrate on, and as `fit_calibration` does.

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

    While a recording of either hand has a finding or cannot be read, no lengths are shared between them.

    Parameters
    ----------
    plan : SubjectPlan
        What the study knows of the person.
    part : Part
        Hand, model, and the task left out.

    Returns
    -------
    paths : list of Path
        Poses files; empty where no lengths are shared.
    reason : str
        Why they are not shared though the model asks for it; else empty.

    Raises
    ------
    InputError
        Where the model fits no whole hand, or the layout is none.

    """
    layout = plan.layouts[part.hand]
    partner = next((hand for hand in plan.hands if hand != part.hand and plan.layouts[hand] == layout), "")
    if not partner or not _fitting(plan, part).share_lengths:
        return [], ""
    for hand in (partner, part.hand):
        if doubted := plan.doubted(hand):
            why = f"there is a finding on the {hand} hand's {doubted}"
            return [], f"fitted without the {partner} hand's bone lengths: {why}"
    recorded = [
        plan.poses(recording)
        for recording in plan.recordings
        if recording.hand.hand == partner and not recording.exclude
    ]
    if reasons := usable_poses(recorded)[1]:
        return [], f"fitted without the {partner} hand's bone lengths: {reasons[0]}"
    return [
        plan.poses(recording) for recording in plan.calibrating(partner, part.model, part.made_without)
    ], ""


def _fitting(plan: SubjectPlan, part: Part) -> HandFitting:
    fitting = plan.models[part.model].fitting
    if fitting is None:
        raise InputError(
            f"model {part.model} fits no whole hand; expected fit: {{whole_hand: true}} in its file"
        )
    if reason := no_whole_hand(plan.layouts[part.hand], part.model):
        raise InputError(reason)
    return fitting


def fit_calibration(
    plan: SubjectPlan, part: Part, hand: str, poses: Sequence[Path], fits: Fits
) -> Calibrated:
    """Fit one of the person's hands to its calibration, as thinned, and to what a calliper measured on it.

    Frames in which a receiver was displaced are left out where they make centres worse.

    Parameters
    ----------
    plan, part
        As in `calibrated_hand`.
    hand : str
        right or left: the part's hand, or the other one.
    poses : sequence of Path
        Recordings that calibrate it.
    fits : dict
        Hands that are fitted already; this one is added.

    Returns
    -------
    Calibrated
        The hand, the recordings that it was fitted to, and what was displaced in them.

    Raises
    ------
    InputError
        Where no recording can be read or the sheet names something that is absent, and as `fit_hand` does.

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
        measurements=_measurements(plan, hand, layout),
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
    """Read a recording's poses, evenly thinned where it is long.

    Parameters
    ----------
    path : Path
        Poses file.
    segments : sequence of str
        Segments to read.
    most_frames : int
        Most frames that are kept.

    Returns
    -------
    Poses
        Every n-th frame, the first one included.

    """
    return read_every(path, segments, -(-frame_count(path) // most_frames))


def _measurements(plan: SubjectPlan, hand: str, layout: Layout) -> list[Measurement]:
    """Measurements of the hand; InputError where the sheet names what cannot be measured."""
    quantities = measurable(layout)
    rows = [row for row in plan.rows["measurements"] if row["hand"] == hand]
    for row in rows:
        if row["quantity"] not in quantities:
            raise InputError(
                f"{_place(plan, 'measurements', row, 'quantity')}: {row['quantity']!r} is nothing that is "
                f"measured on layout {layout.name}; {guess(row['quantity'], quantities)}"
            )
    return [Measurement(row["quantity"], row["value_mm"], row["sd_mm"]) for row in rows]


def _touches(
    plan: SubjectPlan, hand: str, by_name: Mapping[RecordingName, Poses], tips: Fingertips
) -> list[Touch]:
    """The sheet's touches in recordings that calibrate the hand."""
    recordings = {(name.task, name.trial): poses for name, poses in by_name.items()}
    sheet_rows = [
        r for r in plan.rows["touches"] if r["hand"] == hand and (r["task"], r["trial"]) in recordings
    ]
    met = Counter(frozenset((row["digit"], row["meets"])) for row in sheet_rows if not row["sd_mm"])
    touches = []
    for row in sheet_rows:
        poses = recordings[row["task"], row["trial"]]
        # a person pinches in the same way each time, so all contacts of a pair share the weight of one
        shared_mm = CONTACT_SD_MM * met[frozenset((row["digit"], row["meets"]))] ** 0.5
        rows = np.flatnonzero((poses.time_s >= row["from_s"]) & (poses.time_s <= row["to_s"]))
        try:
            touches.append(_touch(tips, poses, rows, row, row["sd_mm"] or shared_mm))
        except InputError as error:
            raise InputError(f"{_place(plan, 'touches', row)}: {error}") from None
    return touches


def _touch(tips: Fingertips, poses: Poses, rows: Index, row: Row, sd_mm: float) -> Touch:
    """Return the touch that a row of the sheet has in those frames: of a point, or of two digits."""
    if not row["meets"]:
        point_mm = np.array([row["x_mm"], row["y_mm"], row["z_mm"]])
        return touch_in(tips, poses, rows, (row["digit"],), sd_mm, row["part"] or TIP, point_mm)
    digits = (row["digit"], row["meets"])
    if digits[0] == digits[1]:
        raise InputError(f"column meets: is {digits[1]!r} as column digit is; expected another digit")
    return touch_in(tips, poses, rows, digits, sd_mm, row["part"] or PAD)


def _place(plan: SubjectPlan, sheet: str, row: Row, column: str = "") -> str:
    """File, row and column of a sheet, as a message begins; a study's plan does not know rows by number."""
    place = str(plan.sheets.get(sheet, sheet))
    if row.line:
        place += f": row {row.line}"
    if column:
        place += f"{', ' if row.line else ': '}column {column}"
    return place
