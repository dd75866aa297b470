"""A digit of a solved skeleton: the points that it runs through, and their positions in a recording.

A chain starts at a base point that the base receiver carries (the wrist, or the digit's first joint), and has
one bone per segment. A joint has two positions, its parent half p, carried from the body's side, and its
child half q, carried from the finger's side; their distance is the joint's gap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.arrays import Array, Bools
from shukotsu.errors import InputError
from shukotsu.hand.rotations import conjugate, rotate
from shukotsu.study.layout import Digit, Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.tables.poses import Poses
from shukotsu.tables.typed_table import vector_of

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow

Rows = Mapping[str, "JointCentresRow"]
"""Rows of a joint_centres table of one hand and model, by joint."""


@dataclass(frozen=True)
class DigitChain:
    """One digit with its points, mm, each in the frame of the receiver that carries it.

    Attributes
    ----------
    digit : Digit
        The digit in the layout.
    at_wrist : bool
        Whether it starts at the wrist.
    receivers : tuple of str
        Segments of the digit that carry a receiver.
    base_point_mm : array, shape (3,)
        Base point in the base receiver's frame.
    child_mm : tuple of array, shape (3,), or None
        For each segment, the centre of its proximal joint in the segment's receiver; None if the chain does
        not use it (a metacarpal that starts at the wrist).
    parent_mm : tuple of array, shape (3,)
        For each segment, the centre of the next joint in that joint's parent receiver; for the last one the
        tip, (0, 0, 0).

    """

    digit: Digit
    at_wrist: bool
    receivers: tuple[str, ...]
    base_point_mm: Array
    child_mm: tuple[Array | None, ...]
    parent_mm: tuple[Array, ...]


def starts_at_wrist(digit: Digit, layout: Layout, model: SkeletonModel) -> bool:
    """Return whether the digit starts at the wrist (Fig. 3) rather than at a CMC joint (Fig. 4)."""
    if layout.wrist is None or digit.base != layout.wrist.segment:
        return False
    return digit.joints[0] not in model.own_cmc


def digit_chain(digit: Digit, layout: Layout, model: SkeletonModel, rows: Rows) -> DigitChain | str:
    """Build a digit's chain, or return the reason if one of its joints failed.

    Parameters
    ----------
    digit : Digit
        The digit.
    layout, model : Layout, SkeletonModel
        Layout of the hand, and skeleton model.
    rows : mapping
        Rows of joint_centres of one hand and model by joint, including the wrist point.

    Returns
    -------
    DigitChain or str
        The chain, or the reason why there is none.

    Raises
    ------
    InputError
        If the model names a CMC joint that no receiver measures and that no whole-hand fit can find.

    """
    at_wrist = starts_at_wrist(digit, layout, model)
    first = layout.joints[digit.joints[0]]
    unseen = not layout.segments[first.child].measured
    if not at_wrist and unseen and model.fitting is None:
        raise InputError(
            f"model {model.name}: own_cmc names {first.name}, but {first.child} carries no receiver in "
            f"layout {layout.name}, so that joint cannot be found; remove it from own_cmc"
        )
    base = layout.wrist.joint if at_wrist and layout.wrist else first.name
    later = zip(digit.joints[1:], digit.segments[1:], strict=True)
    needed = [base, *(joint for joint, segment in later if layout.segments[segment].measured)]
    for joint in needed:
        if joint not in rows or rows[joint]["status"] == "failed":
            reason = rows[joint]["message"] if joint in rows else "receivers on both sides were not worn"
            return f"{joint} failed: {reason}"
    base_point = vector_of(rows[base], "child_" if at_wrist else "parent_", "_mm")
    child = tuple(
        vector_of(rows[joint], "child_", "_mm")
        if joint in needed and layout.segments[segment].measured
        else None
        for joint, segment in zip(digit.joints, digit.segments, strict=True)
    )
    after = tuple(vector_of(rows[joint], "parent_", "_mm") for joint in digit.joints[1:])
    receivers = tuple(segment for segment in digit.segments if layout.segments[segment].measured)
    return DigitChain(digit, at_wrist, receivers, base_point, child, (*after, np.zeros(3)))


def segment_quaternions(poses: Poses, segment: str) -> Array:
    """Return the rotations of one segment's receiver, each component contiguous in memory.

    Parameters
    ----------
    poses : Poses
        T frames.
    segment : str
        The segment.

    Returns
    -------
    array, shape (T, 4)
        Quaternions (w, x, y, z), receiver to transmitter frame.

    """
    return np.asfortranarray(poses.quaternion[:, poses.index(segment)])


def carried_mm(poses: Poses, segment: str, point_mm: Array) -> Array:
    """Compute the positions of a point that a segment's receiver carries.

    Parameters
    ----------
    poses : Poses
        T frames.
    segment : str
        The segment.
    point_mm : array, shape (3,)
        The point in the segment's receiver frame.

    Returns
    -------
    array, shape (T, 3)
        Positions in the transmitter frame, mm.

    """
    return np.asarray(
        rotate(segment_quaternions(poses, segment), point_mm) + poses.position_mm[:, poses.index(segment)]
    )


def seen_from(poses: Poses, base: str, segment: str, point_mm: Array) -> Array:
    """Compute the positions, in one receiver's frame, of a point that another receiver carries.

    Parameters
    ----------
    poses : Poses
        T frames.
    base : str
        Segment in whose receiver frame the point is expressed.
    segment : str
        Segment whose receiver carries it.
    point_mm : array, shape (3,)
        The point in the segment's receiver frame.

    Returns
    -------
    array, shape (T, 3)
        Positions in the base's receiver frame, mm.

    """
    offset = carried_mm(poses, segment, point_mm) - poses.position_mm[:, poses.index(base)]
    return rotate(conjugate(segment_quaternions(poses, base)), offset)


def all_valid(poses: Poses, segments: tuple[str, ...]) -> Bools:
    """Find the frames in which all of some segments have a valid pose.

    Parameters
    ----------
    poses : Poses
        T frames.
    segments : tuple of str
        The segments.

    Returns
    -------
    array of bool, shape (T,)
        Whether all are valid.

    """
    return np.asarray(poses.valid[:, [poses.index(segment) for segment in segments]].all(1))
