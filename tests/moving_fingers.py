"""Motions made by hand: a root and two fingers of which everything is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from shukotsu.export.motion import continuous
from shukotsu.hand.posing import Origin, PosedRecording, SkeletonJoint
from shukotsu.hand.rotations import about_axis, multiply, rotate
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
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def moving_fingers(
    n_frames: int, *, rate_hz: float = 100.0, seed: int = 1, slip_mm: float = 0.0
) -> PosedRecording:
    """A hand that turns and bends its fingers by more than a right angle; bones of constant length.

    slip_mm : how far each joint but the root leaves its rest offset, to and fro.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(n_frames) / rate_hz
    rest = np.tile(IDENTITY, (len(JOINTS), 1))
    rest[1] = about_axis(np.array([0.0, 1.0, 0.0]), 0.15)
    position = np.empty((n_frames, len(JOINTS), 3))
    turn = np.empty((n_frames, len(JOINTS), 4))
    for index, joint in enumerate(JOINTS):
        local = _local_turn(joint, index, time_s)
        if joint.parent < 0:
            position[:, 0] = 200 + 50 * np.sin(time_s[:, None] * [1.0, 1.3, 0.7] + [0, 1, 2])
            turn[:, 0] = local
            continue
        slip = slip_mm * np.sin(time_s[:, None] * rng.uniform(1, 3, 3) + rng.uniform(0, 6, 3))
        offset = OFFSETS[index] + slip
        position[:, index] = position[:, joint.parent] + rotate(turn[:, joint.parent], offset)
        turn[:, index] = multiply(turn[:, joint.parent], multiply(rest[index], local))
    receivers = Poses(
        ("hand", "index_proximal"),
        np.arange(n_frames) + 7,
        time_s,
        position[:, [0, 2]] + 5.0,
        turn[:, [0, 2]],
        np.ones((n_frames, 2), bool),
    )
    return PosedRecording(
        JOINTS,
        position,
        continuous(turn),
        receivers,
        OFFSETS,
        np.full((len(JOINTS), 3), np.nan),
        rest=rest,
        neutral=np.full((len(JOINTS), 4), np.nan),
        origin=Origin(RecordingName("01", "right", "wave"), "made", "made"),
        rate_hz=rate_hz,
    )


def timed(motion: PosedRecording, **times: Any) -> PosedRecording:
    """The motion with other frame numbers (frame) or device times (time_s)."""
    return replace(motion, receivers=replace(motion.receivers, **times))


def blanked(motion: PosedRecording, joints: Any = None, receivers: Any = None) -> PosedRecording:
    """The motion without some poses: joints, receivers index (T, J) and (T, R), such as np.s_[3:5, 2]."""
    place, turn, there = motion.position_mm.copy(), motion.quaternion.copy(), motion.receivers
    seen_mm, seen_turn, valid = there.position_mm.copy(), there.quaternion.copy(), there.valid.copy()
    if joints is not None:
        place[joints], turn[joints] = np.nan, np.nan
    if receivers is not None:
        seen_mm[receivers], seen_turn[receivers], valid[receivers] = np.nan, np.nan, False
    there = replace(there, position_mm=seen_mm, quaternion=seen_turn, valid=valid)
    return replace(motion, position_mm=place, quaternion=turn, receivers=there)


def _local_turn(joint: SkeletonJoint, index: int, time_s: np.ndarray) -> np.ndarray:
    if joint.tip:
        return np.tile(IDENTITY, (len(time_s), 1))
    if joint.parent < 0:
        about_z = about_axis(np.array([0.0, 0.0, 1.0]), 2.5 * time_s)
        return multiply(about_z, about_axis(np.array([0.0, 1.0, 0.0]), 1.9 * np.sin(time_s)))
    bent = about_axis(np.array([-1.0, 0.0, 0.0]), 1.1 * (1 - np.cos(time_s * (1 + 0.2 * index))))
    return multiply(bent, about_axis(np.array([0.0, 1.0, 0.0]), 0.2 * np.sin(2 * time_s + index)))
