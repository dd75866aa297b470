"""Assembly of one hand: joints solved and fitted, wrist point, bones, and metacarpals over time.

Bones use the least-squares binding: a bone is a constant vector in its receiver's frame. A bone runs from its
joint's centre to the next. The last bone of a digit ends at the bone tip if a whole-hand fit locates it,
otherwise at the distal receiver.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from shukotsu.arrays import Array, Bools, Index
from shukotsu.hand.digit_chain import DigitChain, Rows, all_valid, digit_chain, seen_from, segment_quaternions
from shukotsu.hand.rotations import about_axis, bone_frame, conjugate, from_matrix, multiply, rotate
from shukotsu.paper.posture import Posture, Reference, estimate_posture
from shukotsu.paper.wrist import wrist_row
from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.tables.catalogue import DISTAL_RECEIVER
from shukotsu.tables.poses import Poses, PosesReader

if TYPE_CHECKING:
    from shukotsu.tables.rows import BoneLengthsRow, JointCentresRow

LENGTHS = ("starts_at", "ends_at", "length_mm", "sd_mm")
"""Columns of a bone for which the whole-hand fit takes precedence over the replay."""


@dataclass(frozen=True)
class Bone:
    """One bone from joint to joint, or to the end of a digit.

    Attributes
    ----------
    segment : str
        Name of the bone.
    starts_at, ends_at : str
        Joint at which it starts; joint at which it ends, or `DISTAL_RECEIVER`.
    length_mm, sd_mm : float
        Length and its standard deviation.
    sd_over_frames_mm : float or None
        Standard deviation over frames of the length of a metacarpal, |v(k)|; None for other bones.
    vector_mm : array, shape (3,), or None
        Bone vector in the receiver frame of driven_by, as the replay uses it; None if the posture is
        estimated frame by frame.
    driven_by : str
        Segment whose receiver rotates the bone; empty if the posture is estimated.

    """

    segment: str
    starts_at: str
    ends_at: str
    length_mm: float
    sd_mm: float
    sd_over_frames_mm: float | None
    vector_mm: Array | None
    driven_by: str

    def row(self) -> BoneLengthsRow:
        """Build the row of the bone_lengths table, without subject, hand, model and digit."""
        x_mm, y_mm, z_mm = (None, None, None) if self.vector_mm is None else self.vector_mm.tolist()
        row: BoneLengthsRow = {"bone": self.segment, "x_mm": x_mm, "y_mm": y_mm, "z_mm": z_mm, "message": ""}
        numbers: Any = {name: getattr(self, name) for name in (*LENGTHS, "sd_over_frames_mm", "driven_by")}
        row |= numbers
        return row


@dataclass(frozen=True)
class MetacarpalBone:
    """Metacarpal of a digit under a model, with the mode by which it is posed (`metacarpal_mode`)."""

    chain: DigitChain
    mode: str
    bone: Bone
    layout: Layout
    model: SkeletonModel


def metacarpal_mode(chain: DigitChain, layout: Layout, model: SkeletonModel) -> str:
    """Return how a digit's metacarpal is posed: rest, rigid, estimated, receiver, fitted, or none."""
    if not chain.digit.metacarpal:
        return "none"
    measured = layout.segments[chain.digit.segments[0]].measured
    return model.metacarpals.measured if measured else model.metacarpals.unmeasured


def metacarpal_vectors(chain: DigitChain, poses: Poses) -> Array:
    """Compute v(k) of section 5: from the metacarpal's base to the MCP joint, in the base receiver's frame.

    Parameters
    ----------
    chain : DigitChain
        Digit with its joint centres.
    poses : Poses
        T frames with the base receiver and that of the proximal phalanx.

    Returns
    -------
    array, shape (T, 3)
        Vectors, mm; the MCP centre is the child half, carried by the proximal phalanx.

    """
    mcp_mm = chain.child_mm[1]
    assert mcp_mm is not None, "a metacarpal is followed by a measured phalanx"
    return seen_from(poses, chain.digit.base, chain.digit.segments[1], mcp_mm) - chain.base_point_mm


def digit_bones(
    chain: DigitChain, mode: str, rows: Rows, layout: Layout, calibration: PosesReader
) -> list[Bone]:
    """Measure the bones of a digit from the base outward, with lengths from the calibration recordings.

    Parameters
    ----------
    chain : DigitChain
        Digit with its joint centres.
    mode : str
        Metacarpal mode of the digit (`metacarpal_mode`).
    rows : mapping
        Rows of joint_centres by joint, for the covariances.
    layout : Layout
        Layout of the hand.
    calibration : PosesReader
        Calibration recordings.

    Returns
    -------
    list of Bone
        One bone for each segment.

    """
    bones = []
    joints = (*chain.digit.joints, DISTAL_RECEIVER)
    for index, segment in enumerate(chain.digit.segments):
        if index == 0 and mode != "none":
            bones.append(_metacarpal(chain, mode, rows, layout, calibration))
            continue
        start_mm = chain.child_mm[index]
        assert start_mm is not None, "only a metacarpal may lack a joint of its own"
        vector = chain.parent_mm[index] - start_mm
        ends = [_half(rows, chain.digit.joints[index], "child")]
        if index + 1 < len(chain.digit.joints):
            ends.append(_half(rows, chain.digit.joints[index + 1], "parent"))
        length_mm = float(np.linalg.norm(vector))
        along = vector / length_mm if length_mm else vector
        variance = sum(along @ end @ along if length_mm else np.trace(end) for end in ends)
        sd_mm = float(np.sqrt(variance))
        bones.append(Bone(segment, joints[index], joints[index + 1], length_mm, sd_mm, None, vector, segment))
    return bones


def _metacarpal(chain: DigitChain, mode: str, rows: Rows, layout: Layout, calibration: PosesReader) -> Bone:
    """Measure the digit's metacarpal: length from v(k) over the calibration, or from its constant vector."""
    segment, mcp = chain.digit.segments[0], chain.digit.joints[1]
    receivers = (chain.digit.base, chain.digit.segments[1])
    blocks_mm = [np.empty(0)]
    for poses in calibration(*receivers):
        length_mm = np.linalg.norm(metacarpal_vectors(chain, poses), axis=-1)
        blocks_mm.append(length_mm[all_valid(poses, receivers)])
    lengths_mm = np.concatenate(blocks_mm)
    length, spread = np.nan, np.nan
    if len(lengths_mm):
        length, spread = float(lengths_mm.mean()), float(lengths_mm.std())
    base = layout.wrist.joint if chain.at_wrist and layout.wrist else chain.digit.joints[0]
    ends = [_half(rows, base, "child" if chain.at_wrist else "parent"), _half(rows, mcp, "child")]
    sd_mm = float(np.sqrt(sum(np.trace(end) for end in ends) / 3))
    vector, driver = None, ""
    if mode == "rigid":
        vector, driver = chain.parent_mm[0] - chain.base_point_mm, chain.digit.base
    elif mode == "receiver":
        start_mm, driver = chain.child_mm[0], segment
        if start_mm is None:  # use the mean position of the digit's base in this receiver's frame
            seen_mm = []
            for poses in calibration(chain.digit.base, segment):
                base_mm = seen_from(poses, segment, chain.digit.base, chain.base_point_mm)
                seen_mm.append(base_mm[all_valid(poses, (chain.digit.base, segment))])
            start_mm = np.concatenate(seen_mm).mean(0)
        vector = chain.parent_mm[0] - start_mm
    if vector is not None:
        length = float(np.linalg.norm(vector))
    return Bone(segment, base, mcp, length, sd_mm, spread, vector, driver)


def _half(rows: Rows, joint: str, side: str) -> Array:
    """Return the covariance (3, 3), mm^2, of the parent or child half of a centre; zero if configured."""
    covariance = rows[joint]["covariance_mm2"]
    if covariance is None:
        return np.zeros((3, 3))
    whole = np.reshape(covariance, (6, 6))
    return np.asarray(whole[:3, :3] if side == "parent" else whole[3:, 3:])


def metacarpal_columns(
    metacarpal: MetacarpalBone, poses: Poses, neutral: tuple[Reference, Array] | None, fitted: Array | None
) -> dict[str, Any]:
    """Compute the posture of one metacarpal in some frames, as columns of the table metacarpals.

    Parameters
    ----------
    metacarpal : MetacarpalBone
        The metacarpal and its mode.
    poses : Poses
        T frames.
    neutral : tuple or None
        Reference frame and neutral bone quaternion (4,) of the recording (`neutral_posture`).
    fitted : array, shape (T, 4), or None
        Posture from the whole-hand fit, unit quaternions (w, x, y, z), NaN in gaps; needed in mode fitted.

    Returns
    -------
    dict
        frame, qw to qz (bone to transmitter frame), swing_deg, twist_deg, length_mm and flags, each (T,).

    """
    chain, mode = metacarpal.chain, metacarpal.mode
    vector_mm = metacarpal_vectors(chain, poses)
    usable = all_valid(poses, _posture_segments(chain, mode))
    posture = None
    if mode == "estimated":
        quaternion = np.full((len(poses.frame), 4), np.nan)
        if neutral is not None:
            reference, bone = neutral
            posture = _posture(metacarpal, poses, reference)
            hand = segment_quaternions(poses, chain.digit.base)
            quaternion = multiply(hand, multiply(posture.change, bone))
    elif mode == "fitted":
        assert fitted is not None, "the fit of the whole hand poses this metacarpal"
        quaternion, usable = fitted, np.isfinite(fitted[:, 0])
    else:
        quaternion = _carried_postures(metacarpal, poses)
    seen = all_valid(poses, (chain.digit.base, chain.digit.segments[1]))
    return {
        "frame": poses.frame,
        **{f"q{part}": np.where(usable, quaternion[:, index], np.nan) for index, part in enumerate("wxyz")},
        "length_mm": np.where(seen, np.linalg.norm(vector_mm, axis=-1), np.nan),
        **_angles(usable, posture),
    }


def _posture_segments(chain: DigitChain, mode: str) -> tuple[str, ...]:
    """List the segments whose receivers must be valid for the metacarpal's posture."""
    first, proximal = chain.digit.segments[:2]
    return {
        "rest": (),
        "rigid": (chain.digit.base,),
        "receiver": (first,),
        "fitted": (),
        "estimated": (chain.digit.base, proximal),
    }[mode]


def _carried_postures(metacarpal: MetacarpalBone, poses: Poses) -> Array:
    """Return quaternions (T, 4) of a metacarpal that a receiver or the hand carries, or that is at rest."""
    if metacarpal.mode == "rest":
        direction = np.array(metacarpal.model.metacarpals.rest_direction, float)
        upright = np.eye(3)[2] if np.abs(direction[:2]).any() else np.eye(3)[1]
        return np.tile(from_matrix(bone_frame(direction, upright)), (len(poses.frame), 1))
    bone = metacarpal.bone
    assert bone.vector_mm is not None, "a bone that is carried has a vector"
    dorsal = np.array(metacarpal.layout.segments[bone.driven_by].dorsal)
    align = from_matrix(bone_frame(bone.vector_mm, dorsal))
    return multiply(segment_quaternions(poses, bone.driven_by), align)


def neutral_posture(metacarpal: MetacarpalBone, recording: PosesReader) -> tuple[Reference, Array] | None:
    """Find the reference frame of an estimated metacarpal, and its neutral orientation.

    The neutral twist is the circular mean over the recording, so that it does not depend on a single frame
    (docs/method.md).

    Parameters
    ----------
    metacarpal : MetacarpalBone
        The metacarpal and its mode.
    recording : PosesReader
        The recording to pose.

    Returns
    -------
    tuple or None
        Reference (the first frame in which all receivers are valid) and the bone's quaternion (4,) in the
        hand's frame at the mean twist; None in other modes or without such a frame.

    """
    chain, layout = metacarpal.chain, metacarpal.layout
    needed = (chain.digit.base, *chain.receivers)
    if metacarpal.mode != "estimated":
        return None
    starts = ((poses, np.flatnonzero(all_valid(poses, needed))[:1]) for poses in recording(*needed))
    frame = next((poses.take(row) for poses, row in starts if len(row)), None)
    if frame is None:
        return None
    bone, proximal = chain.digit.segments[:2]
    vector_mm, hand = metacarpal_vectors(chain, frame)[0], segment_quaternions(frame, chain.digit.base)
    dorsal = np.array(layout.segments[chain.digit.base].dorsal)
    if bone in chain.receivers:
        dorsal = _dorsal_seen_from(hand, bone, layout, frame)[0]
    start = bone_frame(vector_mm, dorsal)
    normal = _dorsal_seen_from(hand, proximal, layout, frame)[0]
    reference = Reference.of(vector_mm, start[:, 2], normal)
    both = (chain.digit.base, proximal)
    twists_rad = [
        _posture(metacarpal, poses, reference).twist_rad[all_valid(poses, both)]
        for poses in recording(*needed)
    ]
    mean_twist_rad = float(np.angle(np.mean(np.exp(1j * np.concatenate(twists_rad)))))
    return reference, multiply(from_matrix(start), about_axis(np.eye(3)[0], -mean_twist_rad))


def _posture(metacarpal: MetacarpalBone, poses: Poses, reference: Reference) -> Posture:
    """Compute the change of the metacarpal's posture since the reference frame, in some frames."""
    chain, twist_factor = metacarpal.chain, metacarpal.model.metacarpals.twist_factor
    hand = segment_quaternions(poses, chain.digit.base)
    normal = _dorsal_seen_from(hand, chain.digit.segments[1], metacarpal.layout, poses)
    return estimate_posture(metacarpal_vectors(chain, poses), normal, reference, twist_factor)


def _dorsal_seen_from(hand: Array, segment: str, layout: Layout, poses: Poses) -> Array:
    """Return a segment's dorsal directions (T, 3) in the hand receiver's frame; hand : (T, 4) quaternions."""
    turn = multiply(conjugate(hand), segment_quaternions(poses, segment))
    return rotate(turn, np.array(layout.segments[segment].dorsal))


def _angles(usable: Bools, posture: Posture | None) -> dict[str, Any]:
    """Build the columns of swing, twist and flags; angles are null in frames without an estimated posture."""
    if posture is None:
        unknown = np.full(len(usable), np.nan)
        none = np.zeros(len(usable), bool)
        return {"swing_deg": unknown, "twist_deg": unknown, "flags": _flags(~usable, none, none)}
    return {
        "swing_deg": np.where(usable, np.degrees(posture.swing_rad), np.nan),
        "twist_deg": np.where(usable, np.degrees(posture.twist_rad), np.nan),
        "flags": _flags(~usable, usable & posture.twist_singular, usable & posture.swing_singular),
    }


_FLAGS = ("gap", "twist-near-singular", "swing-near-singular")
# the text of each combination of flags, by its bit code
_FLAG_TEXTS = pa.array(
    [";".join(flag for bit, flag in enumerate(_FLAGS) if code >> bit & 1) for code in range(8)]
)


def _flags(gap: Bools, twist_singular: Bools, swing_singular: Bools) -> pa.Array:
    """Return the flags of every frame, joined by ';', looked up by their bit code."""
    code = gap.astype(np.int8) | twist_singular.astype(np.int8) << 1 | swing_singular.astype(np.int8) << 2
    return _FLAG_TEXTS.take(pa.array(code))


@dataclass(frozen=True)
class BuiltHand:
    """Rows of joint_centres and bone_lengths, and the digits whose metacarpal is posed."""

    joints: list[JointCentresRow]
    bones: list[BoneLengthsRow]
    metacarpals: list[MetacarpalBone]


def build_hand(
    rows: Rows,
    layout: Layout,
    model: SkeletonModel,
    calibration: PosesReader,
    fitted_bones: Mapping[str, BoneLengthsRow] | None = None,
) -> BuiltHand:
    """Assemble a hand: add the wrist point to its joints and measure its bones.

    Parameters
    ----------
    rows : mapping
        Rows of joint_centres by joint.
    layout, model : Layout, SkeletonModel
        Layout of the hand, and skeleton model.
    calibration : PosesReader
        Calibration recordings.
    fitted_bones : mapping, optional
        Rows of bone_lengths by segment from a whole-hand fit, whose lengths take precedence.

    Returns
    -------
    BuiltHand
        The hand. If a joint of a digit failed, its bones have the reason instead of a length, unless the fit
        provides the length.

    """
    joints = dict(rows)
    wrist = wrist_row(rows, layout, model, calibration)
    if wrist is not None:
        joints[wrist["joint"]] = {"covariance_mm2": None, **wrist}
    lengths: dict[str, Any] = {
        segment: {name: value for name, value in row.items() if name in LENGTHS}
        for segment, row in (fitted_bones or {}).items()
    }
    bones: list[BoneLengthsRow] = []
    metacarpals = []
    for digit in layout.digits.values():
        chain = digit_chain(digit, layout, model, joints)
        if isinstance(chain, str):
            for segment in digit.segments:
                bone: BoneLengthsRow = {"digit": digit.name, "bone": segment, "message": chain}
                bone |= {"starts_at": "", "ends_at": "", "length_mm": None, "driven_by": ""}
                bones.append(bone | lengths.get(segment, {}))
            continue
        mode = metacarpal_mode(chain, layout, model)
        measured = digit_bones(chain, mode, joints, layout, calibration)
        if mode != "none":
            metacarpals.append(MetacarpalBone(chain, mode, measured[0], layout, model))
        # vectors remain those of the replay
        bones += [{"digit": digit.name, **bone.row(), **lengths.get(bone.segment, {})} for bone in measured]
    return BuiltHand(list(joints.values()), bones, metacarpals)


def pose_metacarpals(
    hand: BuiltHand, recording: PosesReader, fitted: Callable[[str, Index], Array | None]
) -> Iterator[dict[str, Any]]:
    """Pose every metacarpal of a hand in a recording, digit by digit and block by block.

    Parameters
    ----------
    hand : BuiltHand
        The assembled hand.
    recording : PosesReader
        The recording.
    fitted : callable
        (segment, frames (T,)) -> quaternions (T, 4) of the whole-hand fit; called only in mode fitted.

    Yields
    ------
    dict
        Columns of the table metacarpals.

    """
    for metacarpal in hand.metacarpals:
        neutral = neutral_posture(metacarpal, recording)
        for poses in recording(metacarpal.chain.digit.base, *metacarpal.chain.receivers):
            posed = fitted(metacarpal.bone.segment, poses.frame) if metacarpal.mode == "fitted" else None
            columns = metacarpal_columns(metacarpal, poses, neutral, posed)
            yield {"digit": metacarpal.chain.digit.name, **columns}
