"""The metacarpal of one digit over one recording, as columns of the metacarpals table."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from shukotsu.schemas.layout import Layout
from shukotsu.schemas.model import SkeletonModel
from shukotsu.schemas.poses import Poses, PosesReader
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
    metacarpal: MetacarpalBone,
    layout: Layout,
    model: SkeletonModel,
    poses: Poses,
    neutral: tuple[Reference, Array] | None,
    fitted: Array | None,
) -> dict[str, Any]:
    """Frame, quaternion (qw..qz), swing_deg, twist_deg, length_mm and flags at some frames, (T,) each.

    neutral : of the recording. fitted : (T, 4) the posture that the fit of the whole hand gives, NaN in gaps.
    """
    chain, mode = metacarpal.chain, metacarpal.mode
    vector_mm = metacarpal_vectors(chain, poses)
    usable = all_valid(poses, _needed(chain, mode))
    posture = None
    if mode == "estimated":
        quaternion = np.full((len(poses.frame), 4), np.nan)
        if neutral is not None:
            reference, bone = neutral
            posture = _posture(chain, layout, model, poses, reference)
            hand = turned(poses, chain.digit.base)
            quaternion = multiply(hand, multiply(posture.change, bone))
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
    align = from_matrix(bone_frame(bone.vector_mm, np.array(layout.segments[bone.driven_by].dorsal)))
    return multiply(turned(poses, bone.driven_by), align)


def neutral_posture(
    metacarpal: MetacarpalBone, layout: Layout, model: SkeletonModel, recording: PosesReader
) -> tuple[Reference, Array] | None:
    """Return where an estimated metacarpal starts: first whole frame, and its bone (4,) at the mean twist."""
    chain = metacarpal.chain
    needed = (chain.digit.base, *chain.receivers)
    if metacarpal.mode != "estimated":
        return None
    starts = ((poses, np.flatnonzero(all_valid(poses, needed))[:1]) for poses in recording(*needed))
    frame = next((poses.take(row) for poses, row in starts if len(row)), None)
    if frame is None:
        return None
    bone, proximal = chain.digit.segments[:2]
    vector_mm, hand = metacarpal_vectors(chain, frame)[0], turned(frame, chain.digit.base)
    dorsal = np.array(layout.segments[chain.digit.base].dorsal)
    if bone in chain.receivers:
        dorsal = _dorsal_seen_from(hand, bone, layout, frame)[0]
    start = bone_frame(vector_mm, dorsal)
    normal = _dorsal_seen_from(hand, proximal, layout, frame)[0]
    reference = Reference.of(vector_mm, start[:, 2], normal)
    twist_rad = np.concatenate(
        [
            _posture(chain, layout, model, poses, reference).twist_rad[
                all_valid(poses, (chain.digit.base, proximal))
            ]
            for poses in recording(*needed)
        ]
    )
    mean_twist_rad = float(np.angle(np.mean(np.exp(1j * twist_rad))))
    return reference, multiply(from_matrix(start), about_axis(np.eye(3)[0], -mean_twist_rad))


def _posture(
    chain: DigitChain, layout: Layout, model: SkeletonModel, poses: Poses, reference: Reference
) -> Posture:
    normal = _dorsal_seen_from(turned(poses, chain.digit.base), chain.digit.segments[1], layout, poses)
    vector_mm = metacarpal_vectors(chain, poses)
    return estimate_posture(vector_mm, normal, reference, model.metacarpals.twist_factor)


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
