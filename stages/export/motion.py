"""What every format is written from: one hand's skeleton and its motion over a recording.

Bone frames. Every joint carries the frame of the bone that starts there, as WebXR Hand Input and OpenXR
define it: -Z along the bone, away from the wrist; +Y out of the back of the bone (of a thumb, the nail's
side); +X = Y x Z, which is to the right of a hand that points forward with its back up, right and left hand
alike. No frame is mirrored: a left hand is left because its joints are. In the frames of our tables (x
distal, z dorsal, y = z x x) these are X = -y, Y = z, Z = -x: `BONE_TO_WEBXR`.

World. Positions and rotations are in the transmitter's frame, mm, as measured; `stages.export.axes` turns
them to what a format expects.

Tree. Joint 0 is the root, the wrist of a hand; parents come before children. A digit ends in tips, which
have its last bone's rotation. Of a fitted hand these are `<digit>_tip`, the end of the bone, and after it
`<digit>_skin_tip`, the end of the digit, skin and all; of other skeletons `<digit>_receiver_tip`, the origin
of the distal receiver (docs/conventions.md).

Translations. Bones are as long as the tables say (`rest_offset_mm`), but joint centres that were solved
joint by joint leave a gap, and skin leaves one in a fitted hand: what is in a frame beyond the rest offset
is a joint's own small translation. `position_mm` holds it, so that every joint is where the tables have it.
`stiffened` gives the skeleton without: the bones' rotations, every bone as long as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.schemas.poses import RecordingName
from shukotsu.skeleton.posing import SkeletonJoint, rigid_positions
from shukotsu.skeleton.rotations import Array, conjugate, from_matrix, multiply, rotate

Bools = npt.NDArray[np.bool_]
Whole = npt.NDArray[np.int64]

BONE_TO_WEBXR = from_matrix(np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""Quaternion (4,) from the WebXR frame of a bone to its frame in our tables: q_webxr = q_bone * this."""

DISTAL = np.array([0.0, 0.0, -1.0])
"""Along a bone, in its own frame."""

SKIN_TIP, RECEIVER_TIP = "_skin_tip", "_receiver_tip"
"""How the names of tips end that are not the end of a bone."""

BLOCK_FRAMES = 4096
"""Frames that a table is written of at a time."""

MOVES_MM = 1e-5
"""A joint that leaves its rest offset by more than this moves against the bone before."""


@dataclass(frozen=True)
class Receivers:
    """The R receivers that the skeleton comes from, over the same T frames.

    segments : what each rides on. position_mm : (T, R, 3), quaternion : (T, R, 4) receiver to transmitter
    frame, in the receivers' own axes (docs/conventions.md); both NaN where not valid. valid : (T, R).
    """

    segments: tuple[str, ...]
    position_mm: Array
    quaternion: Array
    valid: Bools


@dataclass(frozen=True)
class Origin:
    """Hold whose motion it is and what it was made from.

    inputs : SHA-256 of the tables, by their path in the results folder. licence : the words that the user
    gave, may be empty.
    """

    subject: str
    hand: str
    task: str
    trial: str
    model: str
    layout: str
    inputs: Mapping[str, str] = field(default_factory=dict)
    licence: str = ""
    session: str = ""

    @property
    def recording(self) -> RecordingName:
        """The recording that it is the motion of."""
        return RecordingName(self.subject, self.hand, self.task, self.trial, self.session)

    def __str__(self) -> str:
        parts = (str(self.recording), self.model)
        return ", ".join(part for part in parts if part)


@dataclass(frozen=True)
class SkeletonMotion:
    """The skeleton of one hand with J joints over T frames; T may be 0.

    rest_offset_mm : (J, 3) each joint from its parent in the parent's bone frame, this person's bones; zeros
    for the root. rest_rotation : (J, 4) each bone's frame in its parent's at rest: straight digits, the
    first bone of each as it stands on average; identity for root and tips.
    neutral : (J, 4) each bone's frame in its parent's where its joint angles are zero
    (docs/joint-angles.md), NaN where no anatomy says. axis : (J, 3) unit, the estimated axis of a joint of
    one degree of freedom in its own bone frame, NaN where there is none.
    frame : (T,) as recorded; where resampled, that of the recorded frame nearest in time. time_s : (T,)
    device time, NaN where the recording has none. rate_hz : frames a second, the median as recorded; NaN
    where the times do not tell.
    position_mm : (T, J, 3), quaternion : (T, J, 4) unit (w, x, y, z) of bone frame to transmitter frame
    (or that which `shukotsu.stages.export.axes` turned to), signs continuous over time; NaN in gaps.
    notes : sentences, in order, on what is left out and what was done to the motion since it was read.
    """

    joints: tuple[SkeletonJoint, ...]
    rest_offset_mm: Array
    rest_rotation: Array
    neutral: Array
    axis: Array
    frame: Whole
    time_s: Array
    rate_hz: float
    position_mm: Array
    quaternion: Array
    receivers: Receivers
    origin: Origin
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def parents(self) -> Whole:
        """Index of each joint's parent (J,), -1 for the root."""
        return np.array([joint.parent for joint in self.joints], np.int64)

    @property
    def kind(self) -> str:
        """Return its name in a scene: hand, or the layout's name where no anatomy is known."""
        return "hand" if np.isfinite(self.neutral).any() else self.origin.layout

    @cached_property
    def known(self) -> Bools:
        """Return which joints have a whole pose in which frames, (T, J)."""
        return known_points(self.position_mm, self.quaternion)

    @property
    def whole(self) -> Bools:
        """Frames (T,) in which every joint has a pose."""
        return np.asarray(self.known.all(1))

    def index(self, name: str) -> int:
        """Return the place of the joint of that name; ValueError where there is none."""
        return self.names.index(name)

    def carrier(self, tip: int) -> tuple[int, Array]:
        """Index of the joint whose bone a tip ends, and where on the bone it rests, (3,)."""
        place_mm, above = self.rest_offset_mm[tip], self.joints[tip].parent
        while self.joints[above].tip:  # tips have the bone's own rotation
            place_mm, above = place_mm + self.rest_offset_mm[above], self.joints[above].parent
        return above, place_mm

    def mapped(
        self, place: Callable[[Array], Array], turn: Callable[[Array], Array], valid: Bools | None = None
    ) -> SkeletonMotion:
        """Return the motion with other positions and rotations of joints and receivers; valid : (T, R)."""
        there = self.receivers
        return replace(
            self,
            position_mm=place(self.position_mm),
            quaternion=turn(self.quaternion),
            receivers=replace(
                there,
                position_mm=place(there.position_mm),
                quaternion=turn(there.quaternion),
                valid=there.valid if valid is None else valid,
            ),
        )

    def take(self, rows: slice | Whole | Bools) -> SkeletonMotion:
        """Return only some of the frames."""
        taken = self.mapped(lambda array: array[rows], lambda array: array[rows], self.receivers.valid[rows])
        return replace(taken, frame=self.frame[rows], time_s=self.time_s[rows])

    def blocks(self, size: int = BLOCK_FRAMES) -> Iterator[SkeletonMotion]:
        """The motion so many frames at a time, in order; none where there is no frame."""
        for start in range(0, len(self.frame), size):
            yield self.take(slice(start, start + size))

    def noting(self, *sentences: str) -> SkeletonMotion:
        """The same with more notes."""
        return replace(self, notes=(*self.notes, *sentences))


def without_receivers(motion: SkeletonMotion) -> SkeletonMotion:
    """Return the motion without any receiver."""
    return _with_receivers(motion, np.zeros(len(motion.receivers.segments), bool))


def with_seen_receivers(motion: SkeletonMotion) -> tuple[SkeletonMotion, tuple[str, ...]]:
    """Return the motion without receivers that have no pose in any frame, and a sentence where it had some.

    A layout may name receivers that a recording was made without, a forearm's for one.
    """
    seen = np.asarray(motion.receivers.valid.any(0))
    if seen.all():
        return motion, ()
    absent = ", ".join(np.array(motion.receivers.segments, object)[~seen])
    return _with_receivers(motion, seen), (f"receivers that have no pose in any frame: {absent}",)


def _with_receivers(motion: SkeletonMotion, kept: Bools) -> SkeletonMotion:
    there = motion.receivers
    segments = tuple(np.array(there.segments, object)[kept])
    arrays = (there.position_mm[:, kept], there.quaternion[:, kept], there.valid[:, kept])
    return replace(motion, receivers=Receivers(segments, *arrays))


def local_motion(motion: SkeletonMotion) -> tuple[Array, Array]:
    """Return each joint's pose in its parent's bone frame, of the root in the world: (T, J, 3), (T, J, 4).

    The offset is the rest offset plus the joint's own translation in that frame; signs of the quaternions are
    continuous; NaN in gaps of either bone.
    """
    parents, position, turn = motion.parents, motion.position_mm, motion.quaternion
    back = conjugate(turn[:, parents])
    offset, local = rotate(back, position - position[:, parents]), multiply(back, turn)
    offset[:, parents < 0], local[:, parents < 0] = position[:, parents < 0], turn[:, parents < 0]
    return offset, continuous(local)


def known_points(position_mm: Array, quaternion: Array) -> Bools:
    """Return which points have a whole pose in which frames, (T, N)."""
    return np.asarray(np.isfinite(position_mm).all(-1) & np.isfinite(quaternion).all(-1))


def rest_pose(motion: SkeletonMotion) -> tuple[Array, Array]:
    """Positions (J, 3) mm and rotations (J, 4) of all bone frames at rest, in the root's bone frame."""
    position, turn = np.zeros((len(motion.joints), 3)), motion.rest_rotation.copy()
    for index, joint in enumerate(motion.joints[1:], 1):
        above = turn[joint.parent]
        position[index] = position[joint.parent] + rotate(above, motion.rest_offset_mm[index])
        turn[index] = multiply(above, motion.rest_rotation[index])
    return position, turn


def stiffened(motion: SkeletonMotion) -> SkeletonMotion:
    """The motion with rotations only: every joint at its rest offset from its parent, the root where it is.

    For programs that know no stretching bones. Rotations stay; a note says how far a joint is moved at
    most. Of a skeleton that is no fitted hand this is the replay with the least-squares binding, and its tips
    are those of the tips table.
    """
    position = rigid_positions(
        motion.parents.tolist(), motion.position_mm, motion.quaternion, motion.rest_offset_mm
    )
    moved_mm = np.linalg.norm(position - motion.position_mm, axis=-1)
    note = "bones kept at their length"
    if np.isfinite(moved_mm).any():
        largest = np.nan_to_num(moved_mm, nan=-1.0).max(0)
        note += (
            f", which moves joints by up to {largest.max():.3f} mm ({motion.names[int(largest.argmax())]}), "
            f"rms {np.sqrt(np.nanmean(moved_mm**2)):.3f} mm"
        )
    return replace(motion, position_mm=position).noting(note)


def continuous(quaternion: Array) -> Array:
    """Return quaternions (T, N, 4) of every point as `continuous_series` has them."""
    out = quaternion.copy()
    for index in range(quaternion.shape[1]):
        out[:, index] = continuous_series(quaternion[:, index])
    return out


def continuous_series(quaternion: Array) -> Array:
    """Quaternions (T, 4) with signs such that no two known neighbours in time are more than 90 deg apart as
    4-vectors; the first known has w >= 0. NaN stays.
    """
    out, known = quaternion.copy(), np.flatnonzero(np.isfinite(quaternion).all(-1))
    if len(known):
        series = quaternion[known]
        start = -1.0 if series[0, 0] < 0 else 1.0
        turns = np.where(np.sum(series[1:] * series[:-1], -1) < 0, -1.0, 1.0)
        out[known] = series * np.cumprod(np.concatenate([[start], turns]))[:, None]
    return out


def nominal_rate_hz(frame: Whole, time_s: Array) -> float:
    """Frames a second: the median over neighbours; NaN where there are none with times that grow."""
    step = np.diff(frame)
    usual = step == (np.median(step) if len(step) else 0)
    interval = np.diff(time_s)[usual]
    interval = interval[np.isfinite(interval) & (interval > 0)]
    return float(1.0 / np.median(interval)) if len(interval) else float("nan")


def require_whole(motion: SkeletonMotion, path: Path, name: str) -> None:
    """Raise InputError where the motion has no frame, or one without a pose of every joint.

    name : of the format, in the sentence.
    """
    if not len(motion.frame) or not motion.whole.all():
        raise InputError(
            f"{path}: {name} holds no frame without a pose and no file without a frame; choose --gaps hold, "
            "cut or interpolate"
        )


def require_times(motion: SkeletonMotion, times: npt.NDArray[np.floating], path: Path, name: str) -> None:
    """Raise InputError where the frames have no device time, or it does not grow.

    times : (T,) as the format holds them, from the motion's device time.
    """
    if len(times) < 2:
        return
    if not np.isfinite(motion.time_s).all():
        raise InputError(
            f"{path}: the recording has no device time, and {name} needs it; give its rate_hz in a mapping"
        )
    still = np.flatnonzero(~(np.diff(times) > 0))
    if len(still):
        raise InputError(
            f"{path}: device time does not grow from frame {motion.frame[still[0]]} to the next, as in "
            f"{name} it must; choose --frames that leave this out"
        )
