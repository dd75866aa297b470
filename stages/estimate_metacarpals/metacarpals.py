"""The metacarpal of one digit over one recording, as columns of the metacarpals table."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from shukotsu.schemas.layout import Layout
from shukotsu.schemas.model import SkeletonModel
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.digit_chain import DigitChain, all_valid, turned
from shukotsu.skeleton.rotations import (
    Array,
    about_axis,
    bone_frame,
    conjugate,
    from_matrix,
    multiply,
    rotate,
)
from shukotsu.stages.estimate_metacarpals.bones import MetacarpalBone, metacarpal_vectors
from shukotsu.stages.estimate_metacarpals.posture import Posture, Reference, estimate_posture

Bools = npt.NDArray[np.bool_]


def metacarpal_columns(
    metacarpal: MetacarpalBone, layout: Layout, model: SkeletonModel, poses: Poses, fitted: Array | None
) -> dict[str, Any]:
    """Give frame, quaternion (qw..qz), swing_deg, twist_deg, length_mm and flags of one recording, (T,) each.

    fitted : (T, 4) the posture that the fit of the whole hand gives, NaN in gaps, where that is the mode.
    """
    chain, mode = metacarpal.chain, metacarpal.mode
    vector_mm = metacarpal_vectors(chain, poses)
    usable = all_valid(poses, _needed(chain, mode))
    posture = None
    if mode == "estimated":
        quaternion, posture = _estimated(chain, layout, model, poses, vector_mm)
    elif mode == "fitted":
        assert fitted is not None, "the fit of the whole hand poses this metacarpal"
        quaternion, usable = fitted, np.isfinite(fitted[:, 0])
    else:
        quaternion = _carried(metacarpal, layout, model, poses)
    seen = all_valid(poses, (chain.digit.base, chain.digit.segments[1]))
    return {
        "frame": poses.frame,
        **{f"q{part}": np.where(usable, quaternion[:, index], np.nan) for index, part in enumerate("wxyz")},
        "length_mm": np.where(seen, np.linalg.norm(vector_mm, axis=-1), np.nan),
        **_angles(usable, posture),
    }


def _needed(chain: DigitChain, mode: str) -> tuple[str, ...]:
    """Segments whose poses the metacarpal's posture needs."""
    first, proximal = chain.digit.segments[:2]
    return {
        "rest": (),
        "rigid": (chain.digit.base,),
        "receiver": (first,),
        "fitted": (),
        "estimated": (chain.digit.base, proximal),
    }[mode]


def _carried(metacarpal: MetacarpalBone, layout: Layout, model: SkeletonModel, poses: Poses) -> Array:
    """Postures (T, 4) of a metacarpal that a receiver or the hand carries, or that stays at rest."""
    if metacarpal.mode == "rest":
        direction = np.array(model.metacarpals.rest_direction)
        upright = np.eye(3)[2] if np.abs(direction[:2]).any() else np.eye(3)[1]
        return np.tile(from_matrix(bone_frame(direction, upright)), (len(poses.frame), 1))
    bone = metacarpal.bone
    assert bone.vector_mm is not None, "a bone that is carried has a vector"
    own = from_matrix(bone_frame(bone.vector_mm, np.array(layout.segments[bone.driven_by].dorsal)))
    return multiply(turned(poses, bone.driven_by), own)


def _estimated(
    chain: DigitChain, layout: Layout, model: SkeletonModel, poses: Poses, vector_mm: Array
) -> tuple[Array, Posture | None]:
    """Postures (T, 4) by Eq. 8-11, bone to transmitter frame, and their angles.

    Frame 1 is the first that shows all of the digit's receivers and its base; without one nothing is known.
    The posture is neutral at the recording's mean twist. vector_mm : (T, 3) v(k).
    """
    whole = all_valid(poses, (chain.digit.base, *chain.receivers))
    if not whole.any():
        return np.full((len(poses.frame), 4), np.nan), None
    first = slice(int(np.argmax(whole)), int(np.argmax(whole)) + 1)
    metacarpal, proximal = chain.digit.segments[:2]
    hand = turned(poses, chain.digit.base)
    normal = _dorsal_seen_from(hand, proximal, layout, poses)
    dorsal = np.array(layout.segments[chain.digit.base].dorsal)
    if metacarpal in chain.receivers:
        dorsal = _dorsal_seen_from(hand[first], metacarpal, layout, poses.take(first))[0]
    start = bone_frame(vector_mm[first][0], dorsal)
    reference = Reference.of(vector_mm[first][0], start[:, 2], normal[first][0])
    posture = estimate_posture(vector_mm, normal, reference, model.metacarpals.twist_factor)
    seen = all_valid(poses, (chain.digit.base, proximal))
    mean_twist_rad = float(np.angle(np.mean(np.exp(1j * posture.twist_rad[seen]))))
    bone = multiply(from_matrix(start), about_axis(np.eye(3)[0], -mean_twist_rad))
    return multiply(hand, multiply(posture.change, bone)), posture


def _dorsal_seen_from(hand: Array, segment: str, layout: Layout, poses: Poses) -> Array:
    """A segment's dorsal direction, (T, 3), in the hand receiver's frame; hand : (T, 4)."""
    turn = multiply(conjugate(hand), turned(poses, segment))
    return rotate(turn, np.array(layout.segments[segment].dorsal))


def _angles(usable: Bools, posture: Posture | None) -> dict[str, Any]:
    """Columns of swing, twist and flags; of a metacarpal that was not estimated the angles are not known."""
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
_FLAG_TEXTS = pa.array(
    [";".join(flag for bit, flag in enumerate(_FLAGS) if code >> bit & 1) for code in range(8)]
)


def _flags(gap: Bools, twist_singular: Bools, swing_singular: Bools) -> pa.Array:
    """The flags of every frame, joined by ';'."""
    return _FLAG_TEXTS.take(pa.array(gap + 2 * twist_singular.astype(np.int8) + 4 * swing_singular))
