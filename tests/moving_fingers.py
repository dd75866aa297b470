"""A synthetic motion of a root and two fingers with known poses."""

from dataclasses import replace
from typing import Any

import numpy as np

from shukotsu.hand.posing import Origin, PosedRecording, SkeletonJoint
from shukotsu.hand.rotations import about_axis, continuous, multiply, rotate
from shukotsu.tables.poses import Poses, RecordingName

JOINTS = (
    SkeletonJoint("wrist", -1, "hand"),
    SkeletonJoint("index_cmc", 0, "index_metacarpal", "index"),
    SkeletonJoint("index_mcp", 1, "index_proximal", "index"),
    SkeletonJoint("index_tip", 2, "index_proximal", "index", tip=True),
    SkeletonJoint("little_mcp", 0, "little_proximal", "little"),
    SkeletonJoint("little_tip", 4, "little_proximal", "little", tip=True),
)
OFFSETS = np.array([[0, 0, 0], [-10, 2, -20], [0, 0, -60], [0, 0, -40], [15, 0, -70], [0, 0, -35]], float)
X, Y, Z = np.eye(3)


def moving_fingers(
    n_frames: int, *, rate_hz: float = 100.0, seed: int = 1, slip_mm: float = 0.0
) -> PosedRecording:
    """Return a hand that turns and bends its fingers by more than a right angle, with bones of constant
    length.

    slip_mm : amplitude with which each joint but the root oscillates about its rest offset.
    """
    rng, time_s = np.random.default_rng(seed), np.arange(n_frames) / rate_hz
    rest = np.tile([1.0, 0.0, 0.0, 0.0], (len(JOINTS), 1))
    rest[1] = about_axis(Y, 0.15)
    position, turn = np.empty((n_frames, len(JOINTS), 3)), np.empty((n_frames, len(JOINTS), 4))
    position[:, 0] = 200 + 50 * np.sin(time_s[:, None] * [1.0, 1.3, 0.7] + [0, 1, 2])
    turn[:, 0] = multiply(about_axis(Z, 2.5 * time_s), about_axis(Y, 1.9 * np.sin(time_s)))
    for index, joint in enumerate(JOINTS[1:], 1):
        above = turn[:, joint.parent]
        slip = slip_mm * np.sin(time_s[:, None] * rng.uniform(1, 3, 3) + rng.uniform(0, 6, 3))
        position[:, index] = position[:, joint.parent] + rotate(above, OFFSETS[index] + slip)
        bent = about_axis(-X, 1.1 * (1 - np.cos(time_s * (1 + 0.2 * index))))
        local = multiply(bent, about_axis(Y, 0.2 * np.sin(2 * time_s + index)))
        turn[:, index] = above if joint.tip else multiply(above, multiply(rest[index], local))
    frame, valid = np.arange(n_frames) + 7, np.ones((n_frames, 2), bool)
    receivers = Poses(
        ("hand", "index_proximal"), frame, time_s, position[:, [0, 2]] + 5.0, turn[:, [0, 2]], valid
    )
    unknown = np.full((len(JOINTS), 4), np.nan)
    origin = Origin(RecordingName("01", "right", "wave"), "made", "made")
    bones = JOINTS, position, continuous(turn), receivers, OFFSETS, unknown[:, :3]
    return PosedRecording(*bones, rest=rest, neutral=unknown, origin=origin, rate_hz=rate_hz)


def timed(motion: PosedRecording, **times: Any) -> PosedRecording:
    """Return the motion with other frame numbers (frame) or device times (time_s)."""
    return replace(motion, receivers=replace(motion.receivers, **times))


def blanked(motion: PosedRecording, joints: Any = np.s_[:0], receivers: Any = np.s_[:0]) -> PosedRecording:
    """Return the motion without some poses; joints and receivers are indices into (T, J) and (T, R)."""
    seen = motion.receivers
    arrays = motion.position_mm, motion.quaternion, seen.position_mm, seen.quaternion
    bones_mm, bones, seen_mm, seen_turn = (values.copy() for values in arrays)
    valid = seen.valid.copy()
    for values, rows in ((bones_mm, joints), (bones, joints), (seen_mm, receivers), (seen_turn, receivers)):
        values[rows] = np.nan
    valid[receivers] = False
    seen = replace(seen, position_mm=seen_mm, quaternion=seen_turn, valid=valid)
    return replace(motion, position_mm=bones_mm, quaternion=bones, receivers=seen)
