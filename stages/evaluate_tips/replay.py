"""Replay a digit from its base outward, each bone turned by what drives it.

Two bindings (how the bones are fixed to what turns them):
first-frame, the paper's: bones are the vectors between the joints in the first frame, so that the tip is
exact in that frame; least-squares: bones are constant in their receivers and no frame is special.
The error of either is a sum of joint gaps (docs/method.md, "what the tip error says").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from kinematics.long_sample import LongSample
from kinematics.rotations import Array, conjugate, multiply, rotate
from kinematics.skeleton import DigitChain, all_valid, ride, turned
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
            tip = tip + rotate(turned(poses, bone["driven_by"]), vector)
    return np.where(usable_frames(chain, poses, metacarpal)[:, None], tip, np.nan)


@dataclass(frozen=True)
class Binding:
    """Bones as they were in one frame: vectors_mm, (3,) from joint to joint in the transmitter frame, and how
    what turns each of them stood, (4,).
    """

    vectors_mm: tuple[Array, ...]
    turns: tuple[Array, ...]


def bind(chain: DigitChain, poses: Poses, metacarpal: Array | None) -> Binding | None:
    """Bind the bones in the first usable frame; None where there is none.

    metacarpal : see `usable_frames`.
    """
    usable = usable_frames(chain, poses, metacarpal)
    if not usable.any():
        return None
    first = int(np.argmax(usable))
    frame = poses.take(slice(first, first + 1))
    points = [ride(frame, chain.digit.base, chain.base_point_mm)[0], *_joints(chain, frame)]
    turns = [
        metacarpal[first]
        if index == 0 and metacarpal is not None
        else frame.quaternion[0, frame.index(segment)]
        for index, segment in enumerate(chain.digit.segments)
    ]
    return Binding(tuple(end - start for start, end in pairwise(points)), tuple(turns))


def replay_first_frame(
    chain: DigitChain,
    poses: Poses,
    metacarpal: Array | None,
    *,
    at_rest: bool,
    binding: Binding | None = None,
) -> Array:
    """Tip positions (T, 3) mm in the transmitter frame, bound in the first usable frame.

    In that frame the joints are where the child halves put them and the tip is the distal receiver, so
    the error there is zero; except with a metacarpal `at_rest`, which was never bound to anything.
    binding : of an earlier block of frames; None to bind in these.
    """
    binding = binding or bind(chain, poses, metacarpal)
    if binding is None:
        return np.full((len(poses.frame), 3), np.nan)
    tip = ride(poses, chain.digit.base, chain.base_point_mm)
    for index, segment in enumerate(chain.digit.segments):
        bone = binding.vectors_mm[index]
        turn = metacarpal if index == 0 and metacarpal is not None else turned(poses, segment)
        if turn is metacarpal and at_rest:
            tip = tip + rotate(turn, np.array([np.linalg.norm(bone), 0.0, 0.0]))
        else:
            tip = tip + rotate(multiply(turn, conjugate(binding.turns[index])), bone)
    return np.where(usable_frames(chain, poses, metacarpal)[:, None], tip, np.nan)


def _joints(chain: DigitChain, frame: Poses) -> list[Array]:
    """Every joint after the base by its child half, and the tip, in a single frame."""
    points = []
    for segment, own in zip(chain.digit.segments[1:], chain.child_mm[1:], strict=True):
        assert own is not None, "only a metacarpal may lack a joint of its own"
        points.append(ride(frame, segment, own)[0])
    points.append(frame.position_mm[0, frame.index(chain.digit.tip)])
    return points


def tip_error_mm(tip: Array, chain: DigitChain, poses: Poses) -> Array:
    """Distances (T,) of replayed tips (T, 3) to the distal receiver; NaN in gaps."""
    return np.asarray(np.linalg.norm(tip - poses.position_mm[:, poses.index(chain.digit.tip)], axis=-1))


def error_statistics(known_mm: LongSample) -> dict[str, Any]:
    """Max, min, mean, SD (divided by n), median and 95th percentile of the errors that are known."""
    if not len(known_mm):
        return {"n_frames": 0}
    least, largest = known_mm.extremes()
    return {
        "max_mm": largest,
        "min_mm": least,
        "mean_mm": known_mm.mean(),
        "sd_mm": known_mm.sd(),
        "median_mm": known_mm.median(),
        "p95_mm": known_mm.percentile(95),
        "n_frames": len(known_mm),
    }
