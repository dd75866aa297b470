"""Leave out the frames of a calibration in which receivers were displaced, where they make centres worse.

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
"""mm and rad within which an offset counts as skin motion, not as a displacement."""

FELT_ERROR, HARMFUL_ERROR = (2.0, float(np.radians(4.0))), (4.0, float(np.radians(8.0)))
"""mm and rad by which a disturbed field must be off for a receiver to be in it, and for a frame to be better
left out: poses that are off by less still carry information."""

MOST_LEFT_OUT = 0.5
"""Largest share of a receiver's frames that may be left out: with metal near for longer, the rest does not
determine the hand either."""

ELSEWHERE_SD = 1.0
"""Sd of a centre by which it must move, when frames are left out, for them to be worth leaving out: then what
they add to its error is more than what is lost with them."""

_REFERENCES = 60


@dataclass(frozen=True)
class Unsteady:
    """What was displaced; a field's largest error (6,) and share of frames left out, by receiver."""

    recordings: Sequence[RecordingName]
    displaced: Displaced
    field_errors: Mapping[str, Array]
    left_out: Mapping[str, float]


def without_displaced(fit: HandFit, recordings: Sequence[Poses], displaced: Displaced) -> list[Poses]:
    """Make displaced receivers not valid, so that each is left in the place where it sat longest.

    Parameters
    ----------
    fit : HandFit
        The hand as fitted to all frames.
    recordings : sequence of Poses
        What it was fitted to.
    displaced : Displaced
        What was displaced in them.

    Returns
    -------
    list of Poses
        The recordings, with receivers not valid elsewhere, and where a disturbed field harms (unless that
        were more than half of a receiver's frames).

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
    """Share of each receiver's valid frames that were left out.

    Parameters
    ----------
    before, after : sequence of Poses
        Recordings of a calibration, whole and with frames left out.

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
    """Whether a joint's centre moved by more than its sd, in either receiver's frame."""
    for name, joint in before.joints.items():
        other = after.joints.get(name)
        if other is None:
            continue
        sd_mm = np.sqrt(np.diag(other.covariance_mm2).reshape(2, 3).sum(1))
        moved_mm = np.linalg.norm(
            [other.parent_mm - joint.parent_mm, other.child_mm - joint.child_mm], axis=1
        )
        if (moved_mm > ELSEWHERE_SD * sd_mm).any():
            return True
    return False


def field_errors(fit: HandFit, recordings: Sequence[Poses], field: Disturbance | None) -> dict[str, Array]:
    """Find the largest error of a disturbed field at each receiver that it reaches.

    Parameters
    ----------
    fit : HandFit
        The hand.
    recordings : sequence of Poses
        Its calibration.
    field : Disturbance or None
        The disturbance; None where there is none.

    Returns
    -------
    dict
        Segment -> error (6,), mm and rad, where it is larger than `FELT_ERROR`.

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
    """The field's error (T, S, 6) at every receiver of the recordings, as they name them."""
    position = joined_poses(recordings).position_mm
    error = field.at(fit.convention.world(np.eye(3), position)[1])
    return np.where(np.isfinite(error), error, 0.0)


def _way(recordings: Sequence[Poses], loose: Sequence[LooseReceiver]) -> Array:
    """Return the offset (T, 6) of a receiver from its first place in every row of all recordings."""
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
    """The larger one (...,) of the shift and the turn of errors (..., 6), in these units."""
    parts = np.linalg.norm(error.reshape(*error.shape[:-1], 2, 3), axis=-1) / unit
    return np.asarray(parts.max(-1))
