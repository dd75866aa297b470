"""Leave out the frames of a calibration in which receivers were displaced or the field was disturbed.

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.fit.field_test import Disturbance
from shukotsu.fit.fit import HandFit
from shukotsu.fit.loose_receivers import Displaced, LooseReceiver, recording_of_rows
from shukotsu.hand.rotations import Array
from shukotsu.tables.poses import Poses, RecordingName, joined_poses

SAME_PLACE = (1.5, float(np.radians(3.0)))
"""Offset, mm and rad, up to which it is regarded as skin motion, not as a displacement."""

FELT_ERROR, HARMFUL_ERROR = (2.0, float(np.radians(4.0))), (4.0, float(np.radians(8.0)))
"""Error of a disturbed field, mm and rad, above which a receiver is reported as disturbed, and above which
its frames are left out; poses with smaller errors still carry information."""

MOST_LEFT_OUT = 0.5
"""Largest share of a receiver's frames that may be left out because of metal; with less than the rest the
hand would not be determined either."""

ELSEWHERE_SD = 1.0
"""Shift of a joint centre, in units of its sd, above which frames are left out: the error that they cause is
then larger than the loss of information."""

_REFERENCES = 60


@dataclass(frozen=True)
class Unsteady:
    """Displacements in a calibration.

    Attributes
    ----------
    recordings : sequence of RecordingName
        Recordings of the calibration.
    displaced : Displaced
        Loose receivers, or a disturbed field.
    field_errors : mapping of str to array, shape (6,)
        Largest error of the disturbed field at each receiver, mm and rad.
    left_out : mapping of str to float
        Share of each receiver's frames that were left out.

    """

    recordings: Sequence[RecordingName]
    displaced: Displaced
    field_errors: Mapping[str, Array]
    left_out: Mapping[str, float]


def without_displaced(fit: HandFit, recordings: Sequence[Poses], displaced: Displaced) -> list[Poses]:
    """Mark displaced receivers as not valid, except while each was in the place where it stayed longest.

    Parameters
    ----------
    fit : HandFit
        The hand as fitted to all frames.
    recordings : sequence of Poses
        Recordings to which it was fitted.
    displaced : Displaced
        Displacements in them.

    Returns
    -------
    list of Poses
        The recordings without these receivers, and without receivers in frames in which a disturbed field has
        a harmful error (unless these are more than half of a receiver's frames).

    """
    recording, valid = recording_of_rows(recordings), joined_poses(recordings).valid.copy()
    for segment in {receiver.segment for receiver in displaced.loose}:
        moves = [receiver for receiver in displaced.loose if receiver.segment == segment]
        column = valid[:, recordings[0].index(segment)]
        way = _way(recordings, moves)
        stops = way[np.linspace(0, len(way) - 1, min(_REFERENCES, len(way))).round().astype(int)]
        near = [_size(way - stop, SAME_PLACE) <= 1.0 for stop in stops]
        column &= near[int(np.argmax([(rows & column).sum() for rows in near]))]
    if displaced.field is not None:
        harmless = _size(_errors(fit, recordings, displaced.field), HARMFUL_ERROR) <= 1.0
        if ((valid & harmless).sum(0) >= (1.0 - MOST_LEFT_OUT) * valid.sum(0)).all():
            valid &= harmless
    return [replace(poses, valid=valid[recording == r]) for r, poses in enumerate(recordings)]


def share_left_out(before: Sequence[Poses], after: Sequence[Poses]) -> dict[str, float]:
    """Compute the share of each receiver's valid frames that were left out.

    Parameters
    ----------
    before, after : sequence of Poses
        Recordings of a calibration, complete and with frames left out.

    Returns
    -------
    dict
        Segment -> share, 0 to 1, of receivers that lost any frame.

    """
    was, left = (joined_poses(recordings).valid.sum(0) for recordings in (before, after))
    return {
        segment: float(1.0 - now / then)
        for segment, then, now in zip(before[0].segments, was, left, strict=True)
        if now < then
    }


def is_elsewhere(before: HandFit, after: HandFit) -> bool:
    """Return whether any joint's centre moved by more than its sd, in either receiver's frame."""
    both = [(joint, after.joints[name]) for name, joint in before.joints.items() if name in after.joints]
    shifts_mm = [(new.parent_mm - old.parent_mm, new.child_mm - old.child_mm) for old, new in both]
    sds_mm = [np.sqrt(np.diag(new.covariance_mm2).reshape(2, 3).sum(1)) for _, new in both]
    return bool((np.linalg.norm(shifts_mm, axis=-1) > ELSEWHERE_SD * np.array(sds_mm)).any())


def field_errors(fit: HandFit, recordings: Sequence[Poses], field: Disturbance | None) -> dict[str, Array]:
    """Find the largest error of a disturbed field at each receiver that it reaches.

    Parameters
    ----------
    fit : HandFit
        The hand.
    recordings : sequence of Poses
        Recordings of its calibration.
    field : Disturbance or None
        The disturbance, if any.

    Returns
    -------
    dict
        Segment -> error (6,), mm and rad, for receivers with an error larger than `FELT_ERROR`.

    """
    if field is None:
        return {}
    errors, valid = _errors(fit, recordings, field), joined_poses(recordings).valid
    size = np.where(valid, _size(errors, FELT_ERROR), 0.0)
    worst = np.argmax(size, axis=0)
    return {
        segment: errors[worst[s], s]
        for s, segment in enumerate(recordings[0].segments)
        if size[worst[s], s] > 1.0
    }


def _errors(fit: HandFit, recordings: Sequence[Poses], field: Disturbance) -> Array:
    """Return the field's error (T, S, 6) at every receiver, in the order of the recordings' segments."""
    position = joined_poses(recordings).position_mm
    error = field.at(fit.convention.world(np.eye(3), position)[1])
    return np.where(np.isfinite(error), error, 0.0)


def _way(recordings: Sequence[Poses], loose: Sequence[LooseReceiver]) -> Array:
    """Return the offset (T, 6) of a receiver from its first position in every row of all recordings."""
    first_row = np.cumsum([0, *(len(poses.frame) for poses in recordings)])
    row = np.arange(first_row[-1])
    way = np.zeros((len(row), 6))
    for receiver in loose:
        start, end = (
            int(first_row[at.recording] + np.flatnonzero(recordings[at.recording].frame == at.frame)[0])
            for at in (receiver.start, receiver.end)
        )
        way += np.clip((row + 1.0 - start) / max(1, end - start), 0.0, 1.0)[:, None] * receiver.step
    return way


def _size(error: Array, unit: tuple[float, float]) -> Array:
    """Return the larger one of shift and rotation (...,) of errors (..., 6), relative to these units."""
    parts = np.linalg.norm(error.reshape(*error.shape[:-1], 2, 3), axis=-1) / unit
    return np.asarray(parts.max(-1))
