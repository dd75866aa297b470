"""The metacarpals of one digit over one recording, as columns of the metacarpals table."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, about_axis, conjugate, from_matrix, multiply, rotate
from kinematics.skeleton import DigitChain, all_valid
from schemas.layout import Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses
from stages.estimate_metacarpals.bones import Bone, metacarpal_vectors
from stages.estimate_metacarpals.posture import (
    Posture,
    bone_frame,
    circular_mean_rad,
    estimate_posture,
)


def metacarpal_columns(
    chain: DigitChain,
    mode: str,
    bone: Bone,
    layout: Layout,
    model: SkeletonModel,
    poses: Poses,
    fitted: Array | None = None,
) -> dict[str, Any]:
    """Give frame, quaternion (qw..qz), swing_deg, twist_deg, length_mm and flags, each of length T.

    fitted : (T, 4) the posture that the fit of the whole hand gives, NaN in gaps, where that is the mode.
    """
    n = len(poses.frame)
    usable = all_valid(poses, _needed(chain, mode))
    swing_deg, twist_deg = np.full(n, np.nan), np.full(n, np.nan)
    swing_bad, twist_bad = np.zeros(n, bool), np.zeros(n, bool)
    if mode == "estimated":
        quaternion, posture = _estimated(chain, layout, model, poses, usable)
        if posture is not None:
            swing_deg[usable] = np.degrees(posture.swing_rad)
            twist_deg[usable] = np.degrees(posture.twist_rad)
            swing_bad[usable], twist_bad[usable] = posture.swing_singular, posture.twist_singular
    elif mode == "fitted":
        assert fitted is not None, "the fit of the whole hand poses this metacarpal"
        quaternion, usable = fitted, np.isfinite(fitted[:, 0])
    else:
        quaternion = _carried(mode, bone, layout, model, poses)
    quaternion = np.where(usable[:, None], quaternion, np.nan)
    seen = all_valid(poses, (chain.digit.base, chain.digit.segments[1]))
    length_mm = np.where(seen, np.linalg.norm(metacarpal_vectors(chain, poses), axis=-1), np.nan)
    return {
        "frame": poses.frame,
        **{f"q{part}": quaternion[:, index] for index, part in enumerate("wxyz")},
        "swing_deg": swing_deg,
        "twist_deg": twist_deg,
        "length_mm": length_mm,
        "flags": _flags(~usable, twist_bad, swing_bad),
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


def _carried(mode: str, bone: Bone, layout: Layout, model: SkeletonModel, poses: Poses) -> Array:
    """Postures (T, 4) of a metacarpal that something carries: a receiver, the hand, or nothing at all."""
    if mode == "rest":
        direction = np.array(model.rest_direction)
        upright = np.eye(3)[2] if np.abs(direction[:2]).any() else np.eye(3)[1]
        return np.tile(from_matrix(bone_frame(direction, upright)), (len(poses.frame), 1))
    assert bone.vector_mm is not None, "a bone that is carried has a vector"
    own = from_matrix(bone_frame(bone.vector_mm, np.array(layout.segments[bone.driven_by].dorsal)))
    return multiply(poses.quaternion[:, poses.index(bone.driven_by)], own)


def _estimated(
    chain: DigitChain,
    layout: Layout,
    model: SkeletonModel,
    poses: Poses,
    usable: npt.NDArray[np.bool_],
) -> tuple[Array, Posture | None]:
    """Postures (T, 4) by Eq. 8-11, and their parts over the usable frames."""
    quaternion = np.full((len(poses.frame), 4), np.nan)
    whole = usable & all_valid(poses, (chain.digit.base, *chain.receivers))
    if not whole.any():
        return quaternion, None
    reference = int(np.argmax(whole[usable]))
    hand = poses.quaternion[usable, poses.index(chain.digit.base)]
    proximal = chain.digit.segments[1]
    vector = metacarpal_vectors(chain, poses)[usable]
    normal = _dorsal_seen_from(hand, proximal, layout, poses, usable)
    first = chain.digit.segments[0]
    dorsal = np.array(layout.segments[chain.digit.base].dorsal)
    if first in chain.receivers:
        dorsal = _dorsal_seen_from(hand, first, layout, poses, usable)[reference]
    start = bone_frame(vector[reference], dorsal)
    posture = estimate_posture(vector, normal, start[:, 2], reference, model.twist_factor)
    neutral = about_axis(np.eye(3)[0], -circular_mean_rad(posture.twist_rad))
    bone = multiply(posture.change, multiply(from_matrix(start), neutral))
    quaternion[usable] = multiply(hand, bone)
    return quaternion, posture


def _dorsal_seen_from(
    hand: Array, segment: str, layout: Layout, poses: Poses, usable: npt.NDArray[np.bool_]
) -> Array:
    """A segment's dorsal direction, (T, 3), in the hand receiver's frame."""
    turn = multiply(conjugate(hand), poses.quaternion[usable, poses.index(segment)])
    return rotate(turn, np.array(layout.segments[segment].dorsal))


def _flags(
    gap: npt.NDArray[np.bool_], twist_bad: npt.NDArray[np.bool_], swing_bad: npt.NDArray[np.bool_]
) -> npt.NDArray[np.str_]:
    words = np.where(gap, "gap", "")
    for bad, word in ((twist_bad, "twist-near-singular"), (swing_bad, "swing-near-singular")):
        joined = np.where(words == "", word, np.char.add(words, f";{word}"))
        words = np.where(bad, joined, words)
    return words
