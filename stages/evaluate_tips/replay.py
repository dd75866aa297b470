"""Replay a digit from its base outward, each bone turned by what drives it.

Two bindings (how the bones are fixed to what turns them):
first-frame, the paper's: bones are the vectors between the joints in the first frame, so that the tip is
exact in that frame; least-squares: bones are constant in their receivers and no frame is special.
The error of either is a sum of joint gaps (docs/method.md, "what the tip error says").
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, conjugate, multiply, rotate
from kinematics.skeleton import DigitChain, all_valid, ride
from schemas.poses import Poses


def usable_frames(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> npt.NDArray[np.bool_]:
    """Frames, (T,), in which everything that the digit's replay needs is there.

    metacarpal : (T, 4) its posture, NaN in gaps; None for a digit without one.
    """
    usable = all_valid(poses, (chain.digit.base, *chain.receivers))
    return usable if metacarpal is None else usable & np.isfinite(metacarpal[:, 0])


def replay_least_squares(
    chain: DigitChain, bones: Mapping[str, Mapping[str, Any]], poses: Poses, metacarpal: Array | None
) -> Array:
    """Tip positions (T, 3) mm in the transmitter frame; NaN where something is missing.

    bones : the digit's rows of bone_lengths, by segment. metacarpal : see `usable_frames`.
    """
    tip = ride(poses, chain.digit.base, chain.base_point_mm)
    for index, segment in enumerate(chain.digit.segments):
        bone = bones[segment]
        if index == 0 and metacarpal is not None:
            tip = tip + rotate(metacarpal, np.array([bone["length_mm"], 0.0, 0.0]))
        else:
            vector = np.array([bone[f"{axis}_mm"] for axis in "xyz"])
            tip = tip + rotate(poses.quaternion[:, poses.index(bone["driven_by"])], vector)
    return np.where(usable_frames(chain, poses, metacarpal)[:, None], tip, np.nan)


def replay_first_frame(chain: DigitChain, poses: Poses, metacarpal: Array | None, *, at_rest: bool) -> Array:
    """Tip positions (T, 3) mm in the transmitter frame, bound in the first usable frame.

    In that frame the joints are where the child halves put them and the tip is the distal receiver, so
    the error there is zero; except with a metacarpal `at_rest`, which was never bound to anything.
    """
    usable = usable_frames(chain, poses, metacarpal)
    tip = np.full((len(usable), 3), np.nan)
    if not usable.any():
        return tip
    first = int(np.argmax(usable))
    base = ride(poses, chain.digit.base, chain.base_point_mm)
    points = [base[first], *_joints_in_frame(chain, poses, first)]
    replayed = base[usable]
    for index, segment in enumerate(chain.digit.segments):
        bone = points[index + 1] - points[index]
        if index == 0 and metacarpal is not None:
            turn = metacarpal[usable]
            if at_rest:
                replayed = replayed + rotate(turn, np.array([np.linalg.norm(bone), 0.0, 0.0]))
                continue
            start = metacarpal[first]
        else:
            turn = poses.quaternion[usable, poses.index(segment)]
            start = poses.quaternion[first, poses.index(segment)]
        replayed = replayed + rotate(multiply(turn, conjugate(start)), bone)
    tip[usable] = replayed
    return tip


def _joints_in_frame(chain: DigitChain, poses: Poses, frame: int) -> list[Array]:
    """Every joint after the base by its child half, and the tip, in one frame."""
    points = []
    for segment, own in zip(chain.digit.segments[1:], chain.child_mm[1:], strict=True):
        assert own is not None, "only a metacarpal may lack a joint of its own"
        points.append(ride(poses, segment, own)[frame])
    points.append(poses.position_mm[frame, poses.index(chain.digit.tip)])
    return points


def tip_error_mm(tip: Array, chain: DigitChain, poses: Poses) -> Array:
    """Distances (T,) of replayed tips (T, 3) to the distal receiver; NaN in gaps."""
    return np.asarray(np.linalg.norm(tip - poses.position_mm[:, poses.index(chain.digit.tip)], axis=-1))


def error_statistics(error_mm: Array) -> dict[str, Any]:
    """Max, min, mean, SD (divided by n), median and 95th percentile over the frames that have an error."""
    known = error_mm[np.isfinite(error_mm)]
    if not len(known):
        return {"n_frames": 0}
    return {
        "max_mm": float(known.max()),
        "min_mm": float(known.min()),
        "mean_mm": float(known.mean()),
        "sd_mm": float(known.std()),
        "median_mm": float(np.median(known)),
        "p95_mm": float(np.percentile(known, 95)),
        "n_frames": len(known),
    }
