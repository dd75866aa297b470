"""A digit's bones in the least-squares binding: vectors fixed in their receivers, and their errors.

A bone's length is from its joint's centre to the next; of a digit's last to its tip, which is the distal
receiver where no fit of the whole hand says where the bone ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shukotsu.schemas.catalogue import DISTAL_RECEIVER
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.model import SkeletonModel
from shukotsu.schemas.poses import Poses, PosesReader
from shukotsu.skeleton.digit_chain import DigitChain, Rows, all_valid, seen_from
from shukotsu.skeleton.rotations import Array

LENGTHS = ("starts_at", "ends_at", "length_mm", "sd_mm")
"""Columns of a bone that the fit of the whole hand knows better than the replay."""


@dataclass(frozen=True)
class Bone:
    """One bone from joint to joint, or to where a digit ends.

    vector_mm : (3,) in the frame of driven_by, as the replay has it; None where estimated frame by frame.
    sd_over_frames_mm : of metacarpals.
    """

    segment: str
    starts_at: str
    ends_at: str
    length_mm: float
    sd_mm: float
    sd_over_frames_mm: float | None
    vector_mm: Array | None
    driven_by: str

    def row(self) -> dict[str, Any]:
        """The bone's row of the bone_lengths table (subject, hand, model and digit left out)."""
        vector = (None, None, None) if self.vector_mm is None else self.vector_mm.tolist()
        return {
            "bone": self.segment,
            "starts_at": self.starts_at,
            "ends_at": self.ends_at,
            "length_mm": self.length_mm,
            "sd_mm": self.sd_mm,
            "sd_over_frames_mm": self.sd_over_frames_mm,
            **dict(zip(("x_mm", "y_mm", "z_mm"), vector, strict=True)),
            "driven_by": self.driven_by,
            "message": "",
        }


@dataclass(frozen=True)
class MetacarpalBone:
    """A digit whose metacarpal is posed. mode : see `metacarpal_mode`."""

    chain: DigitChain
    mode: str
    bone: Bone


def with_fitted_lengths(bone: Bone, fitted: Mapping[str, Any] | None) -> Bone:
    """Return the bone as long as its row of the fit says; its vector stays the replay's."""
    if fitted is None:
        return bone
    return replace(bone, **{name: fitted[name] for name in LENGTHS})


def metacarpal_mode(chain: DigitChain, layout: Layout, model: SkeletonModel) -> str:
    """Return how a digit's metacarpal is posed: rest, rigid, estimated, receiver or fitted, else none."""
    if not chain.digit.metacarpal:
        return "none"
    measured = layout.segments[chain.digit.segments[0]].measured
    return model.metacarpals.measured if measured else model.metacarpals.unmeasured


def metacarpal_vectors(chain: DigitChain, poses: Poses) -> Array:
    """v(k), (T, 3) mm from the metacarpal's base to the MCP's child half, seen from the base receiver."""
    mcp_mm = chain.child_mm[1]
    assert mcp_mm is not None, "a metacarpal is followed by a measured phalanx"
    return seen_from(poses, chain.digit.base, chain.digit.segments[1], mcp_mm) - chain.base_point_mm


def digit_bones(
    chain: DigitChain, mode: str, rows: Rows, layout: Layout, calibration: PosesReader
) -> list[Bone]:
    """Return the digit's bones from the base outward, lengths from the calibration recordings."""
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
    segment, mcp = chain.digit.segments[0], chain.digit.joints[1]
    both, lengths_mm = (chain.digit.base, chain.digit.segments[1]), [np.empty(0)]
    for poses in calibration(*both):
        length_mm = np.linalg.norm(metacarpal_vectors(chain, poses), axis=-1)
        lengths_mm.append(length_mm[all_valid(poses, both)])
    known_mm = np.concatenate(lengths_mm)
    length, spread = (float(known_mm.mean()), float(known_mm.std())) if len(known_mm) else (np.nan, np.nan)
    base = layout.wrist.joint if chain.at_wrist and layout.wrist else chain.digit.joints[0]
    ends = [_half(rows, base, "child" if chain.at_wrist else "parent"), _half(rows, mcp, "child")]
    sd_mm = float(np.sqrt(sum(np.trace(end) for end in ends) / 3))
    vector, driver = None, ""
    if mode == "rigid":
        vector, driver = chain.parent_mm[0] - chain.base_point_mm, chain.digit.base
    elif mode == "receiver":
        start_mm, driver = chain.child_mm[0], segment
        if start_mm is None:  # the mean of the digit's base as the segment's receiver sees it
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
    """Covariance (3, 3) of one half of a joint centre, mm^2; zero where the point was given."""
    covariance = rows[joint]["covariance_mm2"]
    if covariance is None:
        return np.zeros((3, 3))
    whole = np.reshape(covariance, (6, 6))
    return np.asarray(whole[:3, :3] if side == "parent" else whole[3:, 3:])
