"""The metacarpals of one digit over one recording, as columns of the metacarpals table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from kinematics.long_sample import LongSample
from kinematics.recordings import Recordings
from kinematics.rotations import Array, about_axis, conjugate, from_matrix, multiply, rotate
from kinematics.skeleton import DigitChain, all_valid, turned
from schemas.layout import Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses
from schemas.table_rows import Joined
from stages.estimate_metacarpals.bones import Bone, metacarpal_vectors
from stages.estimate_metacarpals.posture import Posture, Reference, bone_frame, estimate_posture

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Placed:
    """A digit whose metacarpal is posed. mode : see `metacarpal_mode`."""

    chain: DigitChain
    mode: str
    bone: Bone


def metacarpal_blocks(
    placed: Placed, layout: Layout, model: SkeletonModel, recording: Recordings, fitted: Joined | None = None
) -> Iterator[dict[str, Any]]:
    """Give frame, quaternion (qw..qz), swing_deg, twist_deg, length_mm and flags of one recording, a block of
    frames at a time.

    fitted : (T, 4) the posture that the fit of the whole hand gives, NaN in gaps, where that is the mode.
    """
    chain, mode = placed.chain, placed.mode
    estimate = _estimate(chain, layout, model, recording) if mode == "estimated" else None
    seen = (chain.digit.base, chain.digit.segments[1])
    for poses in recording.blocks(*seen, *_needed(chain, mode), placed.bone.driven_by):
        usable = all_valid(poses, _needed(chain, mode))
        block = None
        if mode == "estimated":
            quaternion = np.full((len(poses.frame), 4), np.nan)
            if estimate is not None:
                block = estimate.block(poses)
                quaternion = estimate.quaternion(block)
        elif mode == "fitted":
            assert fitted is not None, "the fit of the whole hand poses this metacarpal"
            quaternion = fitted.take(len(poses.frame))
            usable = np.isfinite(quaternion[:, 0])
        else:
            quaternion = _carried(placed, layout, model, poses)
        vector = metacarpal_vectors(chain, poses) if block is None else block.vector_mm
        length_mm = np.linalg.norm(vector, axis=-1)
        yield {
            "frame": poses.frame,
            **{f"q{part}": _where(usable, quaternion[:, index]) for index, part in enumerate("wxyz")},
            "length_mm": _where(all_valid(poses, seen), length_mm),
            **_angles(usable, None if block is None else block.posture),
        }


def _where(known: Bools, values: Array) -> Array:
    return np.where(known, values, np.nan)


def _angles(usable: Bools, posture: Posture | None) -> dict[str, Any]:
    """Columns of swing, twist and flags; of a metacarpal that was not estimated the angles are not known."""
    if posture is None:
        nothing = np.full(len(usable), np.nan)
        return {"swing_deg": nothing, "twist_deg": nothing, "flags": _flags(~usable, False, False)}
    return {
        "swing_deg": _where(usable, np.degrees(posture.swing_rad)),
        "twist_deg": _where(usable, np.degrees(posture.twist_rad)),
        "flags": _flags(~usable, usable & posture.twist_singular, usable & posture.swing_singular),
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


def _carried(placed: Placed, layout: Layout, model: SkeletonModel, poses: Poses) -> Array:
    """Postures (T, 4) of a metacarpal that something carries: a receiver, the hand, or nothing at all."""
    if placed.mode == "rest":
        direction = np.array(model.rest_direction)
        upright = np.eye(3)[2] if np.abs(direction[:2]).any() else np.eye(3)[1]
        return np.tile(from_matrix(bone_frame(direction, upright)), (len(poses.frame), 1))
    bone = placed.bone
    assert bone.vector_mm is not None, "a bone that is carried has a vector"
    own = from_matrix(bone_frame(bone.vector_mm, np.array(layout.segments[bone.driven_by].dorsal)))
    return multiply(turned(poses, bone.driven_by), own)


@dataclass(frozen=True)
class _Block:
    """Some frames by Eq. 8-11. hand : (T, 4) its receiver's posture; vector_mm : (T, 3) v(k)."""

    hand: Array
    vector_mm: Array
    posture: Posture


class _Estimate:
    """One digit's metacarpal by Eq. 8-11 over one recording, whose first frame that shows all is frame 1.

    first : that frame alone. The posture is neutral at the recording's mean twist.
    """

    def __init__(self, chain: DigitChain, layout: Layout, model: SkeletonModel, first: Poses) -> None:
        self._chain, self._layout, self._model = chain, layout, model
        hand, vector_mm, normal = self._seen(first)
        metacarpal = chain.digit.segments[0]
        dorsal = np.array(layout.segments[chain.digit.base].dorsal)
        if metacarpal in chain.receivers:
            dorsal = _dorsal_seen_from(hand, metacarpal, layout, first)[0]
        start = bone_frame(vector_mm[0], dorsal)
        self._start = from_matrix(start)
        self._reference = Reference.of(vector_mm[0], start[:, 2], normal[0])
        self._last: tuple[Poses, _Block] | None = None

    def mean_twist(self, recording: Recordings) -> None:
        """Find the mean twist over all frames that show hand and phalanx."""
        ends = (self._chain.digit.base, self._chain.digit.segments[1])
        twist_rad = LongSample()
        for poses in recording.blocks(*ends):
            twist_rad.add(self.block(poses).posture.twist_rad[all_valid(poses, ends)])
        neutral = about_axis(np.eye(3)[0], -twist_rad.circular_mean_rad())
        self._bone = multiply(self._start, neutral)

    def block(self, poses: Poses) -> _Block:
        """Go through a block of frames; the last one is kept, as a short recording is but one."""
        if self._last is None or self._last[0] is not poses:
            hand, vector_mm, normal = self._seen(poses)
            posture = estimate_posture(vector_mm, normal, self._reference, self._model.twist_factor)
            self._last = poses, _Block(hand, vector_mm, posture)
        return self._last[1]

    def quaternion(self, block: _Block) -> Array:
        """Postures (T, 4), bone to transmitter frame."""
        return multiply(block.hand, multiply(block.posture.change, self._bone))

    def _seen(self, poses: Poses) -> tuple[Array, Array, Array]:
        """The hand's posture (T, 4), v(k) (T, 3) and the phalanx's dorsal direction (T, 3) seen from it."""
        hand = turned(poses, self._chain.digit.base)
        normal = _dorsal_seen_from(hand, self._chain.digit.segments[1], self._layout, poses)
        return hand, metacarpal_vectors(self._chain, poses), normal


def _estimate(
    chain: DigitChain, layout: Layout, model: SkeletonModel, recording: Recordings
) -> _Estimate | None:
    """The estimate over a recording; None where no frame shows all of the digit's receivers and its base."""
    first = _first_frame(recording, (chain.digit.base, *chain.receivers))
    if first is None:
        return None
    found = _Estimate(chain, layout, model, first)
    found.mean_twist(recording)
    return found


def _first_frame(recording: Recordings, segments: tuple[str, ...]) -> Poses | None:
    """The first frame in which all of the segments are valid, alone."""
    for poses in recording.blocks(*segments):
        whole = all_valid(poses, segments)
        if whole.any():
            first = int(np.argmax(whole))
            return poses.take(slice(first, first + 1))
    return None


def _dorsal_seen_from(hand: Array, segment: str, layout: Layout, poses: Poses) -> Array:
    """A segment's dorsal direction, (T, 3), in the hand receiver's frame; hand : (T, 4)."""
    turn = multiply(conjugate(hand), turned(poses, segment))
    return rotate(turn, np.array(layout.segments[segment].dorsal))


_WORDS = ("gap", "twist-near-singular", "swing-near-singular")
_FLAGS = pa.array([";".join(w for i, w in enumerate(_WORDS) if code >> i & 1) for code in range(8)])


def _flags(gap: Bools, twist_bad: Bools | bool, swing_bad: Bools | bool) -> pa.Array:
    """The words of every frame, of which there are eight choices."""
    code = gap + 2 * np.asarray(twist_bad, np.int8) + 4 * np.asarray(swing_bad, np.int8)
    return _FLAGS.take(pa.array(code))
