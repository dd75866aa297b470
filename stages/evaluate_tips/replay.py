"""Replay a digit from its base outward, each bone turned by what drives it, and measure its tip.

Two bindings (how the bones are fixed to what turns them):
first-frame, the paper's: bones are the vectors between the joints in the first frame, so that the tip is
exact in that frame; least-squares: bones are constant in their receivers and no frame is special
(`skeleton.posing`). The error of either is a sum of joint gaps (docs/method.md, "what the tip error says").
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.digit_chain import DigitChain, all_valid, carried_mm, turned
from shukotsu.skeleton.posing import PosedRecording, rigid_positions
from shukotsu.skeleton.rotations import Array, conjugate, multiply, rotate

FirstFrame = tuple[Poses, Array | None]
"""A recording's first usable frame, and the metacarpal's posture (1, 4) in it."""


def usable_frames(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> npt.NDArray[np.bool_]:
    """Frames, (T,), in which all that the digit's replay needs is there; metacarpal : (T, 4), NaN in gaps."""
    usable = all_valid(poses, (chain.digit.base, *chain.receivers))
    return usable if metacarpal is None else usable & np.isfinite(metacarpal[:, 0])


def tips_least_squares(bones: PosedRecording) -> dict[str, Array]:
    """Tip positions (T, 3) mm of every digit in the transmitter frame, bones constant; NaN in gaps."""
    position_mm = rigid_positions(
        [joint.parent for joint in bones.joints], bones.position_mm, bones.quaternion, bones.rest_offset_mm
    )
    return {joint.digit: position_mm[:, index] for index, joint in enumerate(bones.joints) if joint.tip}


def first_frame(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> FirstFrame | None:
    """The first usable frame and the metacarpal's posture (1, 4) in it; None where no frame is usable."""
    usable = usable_frames(chain, poses, metacarpal)
    if not usable.any():
        return None
    first = slice(int(np.argmax(usable)), int(np.argmax(usable)) + 1)
    return poses.take(first), None if metacarpal is None else metacarpal[first]


def tip_first_frame(
    chain: DigitChain, poses: Poses, metacarpal: Array | None, first: FirstFrame | None, *, at_rest: bool
) -> Array:
    """Tip positions (T, 3) mm in the transmitter frame, bones bound in the first frame; NaN in gaps.

    There joints are where the child halves put them and the tip is the distal receiver, so that the error is
    zero; except with a metacarpal `at_rest`, which was never bound to anything.
    """
    usable = usable_frames(chain, poses, metacarpal)
    if first is None:
        return np.full((len(poses.frame), 3), np.nan)
    frame, posture = first
    points = [carried_mm(frame, chain.digit.base, chain.base_point_mm)[0], *_joints(chain, frame)]
    tip = carried_mm(poses, chain.digit.base, chain.base_point_mm)
    for index, (segment, (start, end)) in enumerate(zip(chain.digit.segments, pairwise(points), strict=True)):
        bone = end - start
        turn, start = metacarpal, posture
        if index or turn is None or start is None:
            turn, start = turned(poses, segment), turned(frame, segment)
        if turn is metacarpal and at_rest:
            tip = tip + rotate(turn, np.array([np.linalg.norm(bone), 0.0, 0.0]))
        else:
            tip = tip + rotate(multiply(turn, conjugate(start[0])), bone)
    return np.where(usable[:, None], tip, np.nan)


def _joints(chain: DigitChain, frame: Poses) -> list[Array]:
    """Every joint after the base by its child half, and the tip, in a single frame."""
    points = []
    for segment, own in zip(chain.digit.segments[1:], chain.child_mm[1:], strict=True):
        assert own is not None, "only a metacarpal may lack a joint of its own"
        points.append(carried_mm(frame, segment, own)[0])
    points.append(frame.position_mm[0, frame.index(chain.digit.tip)])
    return points


def tip_error_mm(tip: Array, chain: DigitChain, poses: Poses) -> Array:
    """Distances (T,) of replayed tips (T, 3) to the distal receiver; NaN in gaps."""
    return np.asarray(np.linalg.norm(tip - poses.position_mm[:, poses.index(chain.digit.tip)], axis=-1))


def error_statistics(error_mm: Array) -> dict[str, Any]:
    """Max, min, mean, SD (divided by n), median and 95th percentile of the errors (T,) that are known."""
    known_mm = error_mm[np.isfinite(error_mm)]
    if not len(known_mm):
        return {"n_frames": 0}
    return {
        "max_mm": float(known_mm.max()),
        "min_mm": float(known_mm.min()),
        "mean_mm": float(known_mm.mean()),
        "sd_mm": float(known_mm.std()),
        "median_mm": float(np.median(known_mm)),
        "p95_mm": float(np.percentile(known_mm, 95)),
        "n_frames": len(known_mm),
    }
