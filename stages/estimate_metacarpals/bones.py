"""A digit's bones in the least-squares binding: vectors fixed in their receivers, and their errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kinematics.long_sample import LongSample
from kinematics.recordings import blocks_with
from kinematics.rotations import Array
from kinematics.skeleton import DigitChain, Rows, all_valid, seen_from
from schemas.layout import Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses


@dataclass(frozen=True)
class Bone:
    """One bone. vector_mm : (3,) proximal to distal end in the frame of driven_by, or None where the
    bone's direction is estimated frame by frame. Lengths in mm; sd_over_frames_mm for metacarpals; bone_mm
    and bone_sd_mm of the bone itself, joint to joint or to its tip, where the whole hand was fitted.
    """

    segment: str
    length_mm: float
    sd_mm: float
    sd_over_frames_mm: float | None
    vector_mm: Array | None
    driven_by: str
    bone_mm: float | None = None
    bone_sd_mm: float | None = None

    def row(self) -> dict[str, Any]:
        """Give the bone's row of the bone_lengths table (subject, hand, model and digit left out)."""
        vector = (None, None, None) if self.vector_mm is None else self.vector_mm.tolist()
        return {
            "bone": self.segment,
            "length_mm": self.length_mm,
            "sd_mm": self.sd_mm,
            "bone_mm": self.bone_mm,
            "bone_sd_mm": self.bone_sd_mm,
            "sd_over_frames_mm": self.sd_over_frames_mm,
            **dict(zip(("x_mm", "y_mm", "z_mm"), vector, strict=True)),
            "driven_by": self.driven_by,
            "message": "",
        }


def as_fitted(bone: Bone, fitted: Mapping[str, Any] | None, *, last: bool) -> Bone:
    """The bone with what the fit of the whole hand says of it; fitted : its row there.

    A metacarpal is as long as the fit says. A phalanx keeps the vector between its joints, which the fit gave
    too, with the fit's sd; a digit's last one ends at the receiver here and at its tip there, so that its
    sd stays that of its joint.
    """
    if fitted is None:
        return bone
    known = replace(bone, bone_mm=fitted["length_mm"], bone_sd_mm=fitted["sd_mm"])
    if bone.sd_over_frames_mm is not None:
        return replace(known, length_mm=fitted["length_mm"], sd_mm=fitted["sd_mm"])
    return known if last else replace(known, sd_mm=fitted["sd_mm"])


def metacarpal_mode(chain: DigitChain, layout: Layout, model: SkeletonModel) -> str:
    """How the digit's metacarpal is posed: rest, rigid, estimated, receiver or fitted; none: it has none."""
    if not chain.digit.metacarpal:
        return "none"
    return model.measured if layout.segments[chain.digit.segments[0]].measured else model.unmeasured


def metacarpal_vectors(chain: DigitChain, poses: Poses) -> Array:
    """v(k), (T, 3) mm from the metacarpal's base to the MCP joint, seen from the base receiver.

    The MCP joint is taken from the proximal phalanx (its child half), else v would be rigid.
    """
    own = chain.child_mm[1]
    assert own is not None, "a metacarpal is followed by a measured phalanx"
    return seen_from(poses, chain.digit.base, chain.digit.segments[1], own) - chain.base_point_mm


def digit_bones(
    chain: DigitChain, mode: str, rows: Rows, layout: Layout, calibration: Iterable[Poses]
) -> list[Bone]:
    """Give the digit's bones from the base outward, lengths from the calibration recordings.

    calibration : poses in blocks of frames, which are gone through more than once.
    """
    bones = []
    for index, segment in enumerate(chain.digit.segments):
        if index == 0 and mode != "none":
            bones.append(_metacarpal(chain, mode, rows, layout, calibration))
            continue
        own = chain.child_mm[index]
        assert own is not None, "only a metacarpal may lack a joint of its own"
        vector = chain.parent_mm[index] - own
        ends = [_half(rows, chain.digit.joints[index], "child")]
        if index + 1 < len(chain.digit.joints):
            ends.append(_half(rows, chain.digit.joints[index + 1], "parent"))
        sd_mm = _sd_along(vector, ends)
        bones.append(Bone(segment, float(np.linalg.norm(vector)), sd_mm, None, vector, segment))
    return bones


def _metacarpal(
    chain: DigitChain, mode: str, rows: Rows, layout: Layout, calibration: Iterable[Poses]
) -> Bone:
    segment, mcp = chain.digit.segments[0], chain.digit.joints[1]
    length, spread = _length_over_frames(chain, calibration)
    base = layout.wrist.joint if chain.at_wrist and layout.wrist else chain.digit.joints[0]
    ends = [_half(rows, base, "child" if chain.at_wrist else "parent"), _half(rows, mcp, "child")]
    sd_mm = float(np.sqrt(sum(np.trace(end) for end in ends) / 3))
    vector, driver = None, ""
    if mode == "rigid":
        vector, driver = chain.parent_mm[0] - chain.base_point_mm, chain.digit.base
    elif mode == "receiver":
        own = chain.child_mm[0]
        vector = chain.parent_mm[0] - (_base_seen_from(segment, chain, calibration) if own is None else own)
        driver = segment
    if vector is not None:
        length = float(np.linalg.norm(vector))
    return Bone(segment, length, sd_mm, spread, vector, driver)


def _length_over_frames(chain: DigitChain, calibration: Iterable[Poses]) -> tuple[float, float]:
    """Mean and SD of |v(k)| over the calibration frames; NaN where there is none."""
    lengths_mm, ends = LongSample(), (chain.digit.base, chain.digit.segments[1])
    for poses in blocks_with(calibration, *ends):
        length_mm = np.linalg.norm(metacarpal_vectors(chain, poses), axis=-1)
        lengths_mm.add(length_mm[all_valid(poses, ends)])
    if not len(lengths_mm):
        return float("nan"), float("nan")
    return lengths_mm.mean(), lengths_mm.sd()


def _base_seen_from(segment: str, chain: DigitChain, calibration: Iterable[Poses]) -> Array:
    """Mean position (3,) of the digit's base in a segment's receiver frame, mm."""
    total, count = np.zeros((1, 3)), 0
    for poses in blocks_with(calibration, chain.digit.base, segment):
        seen = seen_from(poses, segment, chain.digit.base, chain.base_point_mm)
        seen = np.ascontiguousarray(seen[all_valid(poses, (chain.digit.base, segment))])
        total = np.concatenate([total, seen]).sum(0, keepdims=True)
        count += len(seen)
    return np.asarray(total[0] / count)


def _half(rows: Rows, joint: str, side: str) -> Array:
    """Covariance (3, 3) of one half of a joint centre, mm^2; zero where the point was given."""
    covariance = rows[joint]["covariance_mm2"]
    if covariance is None:
        return np.zeros((3, 3))
    whole = np.reshape(covariance, (6, 6))
    return np.asarray(whole[:3, :3] if side == "parent" else whole[3:, 3:])


def _sd_along(vector: Array, ends: Sequence[Array]) -> float:
    length = np.linalg.norm(vector)
    if not length:
        return float(np.sqrt(sum(np.trace(end) for end in ends)))
    along = vector / length
    return float(np.sqrt(sum(along @ end @ along for end in ends)))
