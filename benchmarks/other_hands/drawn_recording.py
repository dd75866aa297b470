"""A recording of somebody's hand, and what is true of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_hands.carriage import carry, placed
from benchmarks.other_hands.gestures import move_arm, move_joints, wander
from benchmarks.other_hands.person import Array, Person
from benchmarks.other_hands.room import draw_field, lost_frames, measure, quaternions, table_stands
from benchmarks.other_hands.taped_skin import carry_receiver, settle
from shukotsu.schemas.poses import Poses

MIRROR = np.array([1.0, -1.0, 1.0])
"""A left hand is a right hand in a mirror that stands in the room's x-z plane."""


@dataclass(frozen=True)
class Recording:
    """Hold what the tracker said, and what it should have said. World: the transmitter's frame, mm.

    poses : as measured; true_pose : the same receivers where they really were; true_centre_mm : by joint,
    (T, 3); true_angles_deg : by joint, (T, D) from the flat drawing, bending first; true_lengths_mm : by
    bone, from its joint to the next, the last to the skin's tip.
    """

    poses: Poses
    true_pose: Poses
    true_centre_mm: dict[str, Array]
    true_angles_deg: dict[str, Array]
    true_lengths_mm: dict[str, float]


def record(
    person: Person,
    side: str,
    task: str,
    *,
    seed: int,
    duration_s: float = 25.0,
    rate_hz: float = 240.0,
    forearm: bool = False,
    stiff: tuple[str, ...] = (),
    dropouts: bool = False,
) -> Recording:
    """Record a person's hand at a task of `gestures`, with the receivers as `person.worn` has them.

    Recordings of one person share bones, skin, receivers and room; `seed` draws the movement and the noise.
    stiff : joints of the layout that hardly move.
    """
    moves, skins, tracker = (np.random.default_rng([seed, part]) for part in range(3))
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    angles_deg = move_joints(person, task, moves, time_s, stiff)
    palm_mm, turned, on_table = move_arm(task, table_stands(person.seed), moves, time_s)
    bones, centres = carry(person, angles_deg)
    worn = [one for one in person.worn[side] if forearm or one.bone != "forearm"]
    slow = {one.bone: wander(skins, time_s, 6, (0.4, 3.0)) * ([0.12] * 3 + [0.0025] * 3) for one in worn}
    extras = {name: own * (0.4 if name.endswith("distal") else 1.0) for name, own in slow.items()}  # nails
    followed = settle(angles_deg, person, time_s, skins)
    rides = [carry_receiver(person, one, bones, followed, on_table, extras[one.bone]) for one in worn]
    place, turning = (np.stack(parts, axis=1) for parts in zip(*rides, strict=True))
    marks = {name: centre for name, centre in centres.items() if forearm or name != "wrist"}
    points = np.concatenate([place, np.stack(list(marks.values()), axis=1)], axis=1)
    points -= placed(bones["hand"], np.array([-2.0, 45.0, 0.0]))[:, None]  # the palm, which the arm holds
    points = np.einsum("tij,tkj->tki", turned.as_matrix(), points) + palm_mm[:, None]
    turning = turned.as_matrix()[:, None] @ turning
    if side == "left":  # cable and skin as on the right hand: so y is the axis that changes its side
        points, turning = points * MIRROR, MIRROR[:, None] * turning * MIRROR
    names = tuple(one.bone for one in worn)
    poses, true_pose = _track(person, names, time_s, points[:, : len(names)], turning, tracker)
    return Recording(
        poses=_without(poses, rate_hz, tracker) if dropouts else poses,
        true_pose=true_pose,
        true_centre_mm={name: points[:, len(names) + column] for column, name in enumerate(marks)},
        true_angles_deg=angles_deg,
        true_lengths_mm={name: bone.length_mm for name, bone in person.bones.items() if "_" in name},
    )


def true_centres(recording: Recording, joint: str, segment: str) -> Array:
    """Return a joint's centre (3,) in a receiver's frame as it rode: the mean over all frames, mm."""
    pose = recording.true_pose
    at = pose.index(segment)
    from_it = recording.true_centre_mm[joint] - pose.position_mm[:, at]
    turning = Rotation.from_quat(pose.quaternion[:, at], scalar_first=True)
    return np.asarray(turning.inv().apply(from_it).mean(axis=0))


def _track(
    person: Person,
    names: tuple[str, ...],
    time_s: Array,
    place: Array,
    turning: Array,
    rng: np.random.Generator,
) -> tuple[Poses, Poses]:
    """Return the poses as the tracker says them in this person's room, and as they are."""
    shape = place.shape[:2]
    facing = Rotation.from_matrix(turning.reshape(-1, 3, 3))
    off = draw_field(np.random.default_rng([person.seed, 33])).at(place)
    frame = np.arange(len(time_s), dtype=np.int64)
    position_mm, quaternion = measure(place, facing, off, rng)
    return (
        Poses(names, frame, time_s, position_mm, quaternion, np.ones(shape, bool)),
        Poses(names, frame, time_s, place, quaternions(facing, shape), np.ones(shape, bool)),
    )


def _without(poses: Poses, rate_hz: float, rng: np.random.Generator) -> Poses:
    """Return the poses with gaps, in which numbers are NaN."""
    lost = lost_frames(poses.valid.shape, rate_hz, rng)
    position, quaternion = poses.position_mm.copy(), poses.quaternion.copy()
    position[lost] = quaternion[lost] = np.nan
    return Poses(poses.segments, poses.frame, poses.time_s, position, quaternion, ~lost)
