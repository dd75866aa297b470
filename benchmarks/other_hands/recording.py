"""A recording of a person's hand with its truth: skin, arm, and a magnetic tracker in a room.

Skin motion under a receiver is driven by the neighbouring joints. It follows a joint's angle with hysteresis,
which creep removes within seconds, and saturates. Skin and muscle over the thumb's metacarpal lag behind the
bone, so that the receiver follows only a share of the bone's rotation, and another share of its motion in
position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_hands.gestures import Motion, carry, move_arm, move_joints, move_points, wander
from benchmarks.other_hands.person import SKIN_SHARE, Person, Worn, unit
from shukotsu.arrays import Array
from shukotsu.tables.poses import Poses

MIRROR = np.array([1.0, -1.0, 1.0])
"""Mirror at the room's x-z plane, which converts a right hand to a left one."""


@dataclass(frozen=True)
class DrawnRecording:
    """A recording and its truth, mm in the transmitter's frame.

    Attributes
    ----------
    poses, true_pose : Poses
        Receivers as the tracker reports them, and their true poses.
    true_centre_mm : dict of str to array, shape (T, 3)
        By joint: centre.
    true_angles_deg : dict of str to array, shape (T, D)
        By joint: angles from the flat hand, flexion first.
    true_lengths_mm : dict of str to float
        By bone: length from its joint to the next, or to the skin's tip.

    """

    poses: Poses
    true_pose: Poses
    true_centre_mm: dict[str, Array]
    true_angles_deg: dict[str, Array]
    true_lengths_mm: dict[str, float]


@dataclass(frozen=True)
class Session:
    """Settings of a recording.

    forearm : whether a receiver is worn on the forearm. stiff : joints that hardly move. dropouts : whether
    the tracker loses poses for short times.
    """

    duration_s: float = 25.0
    rate_hz: float = 240.0
    forearm: bool = False
    stiff: tuple[str, ...] = ()
    dropouts: bool = False


def record(person: Person, side: str, task: str, seed: int, session: Session = Session()) -> DrawnRecording:
    """Record a person's hand during a task of `gestures`.

    Recordings of one person share bones, skin, receivers (`person.worn`) and room; `seed` determines movement
    and noise.
    """
    rate_hz, forearm = session.rate_hz, session.forearm
    moves, skins, tracker = (np.random.default_rng([seed, part]) for part in range(3))
    time_s = np.arange(round(session.duration_s * rate_hz)) / rate_hz
    angles_deg = move_joints(person, task, moves, time_s, session.stiff)
    stands = np.random.default_rng([person.seed, 35])  # table to transmitter, which may be upside down
    turns_deg = [stands.uniform(-180, 180), stands.choice([0.0, 180.0])]
    stands_so = Rotation.from_euler("zx", turns_deg, degrees=True)
    palm_mm, turned, on_table = move_arm(task, stands_so, moves, time_s)
    bones, centres = carry(person, angles_deg)
    worn = [receiver for receiver in person.worn[side] if forearm or receiver.bone != "forearm"]
    extras = [wander(skins, time_s, 6, (0.4, 3.0)) * ([0.12] * 3 + [0.0025] * 3) for _ in worn]
    followed = settle(angles_deg, person, time_s, skins)
    rides = [
        carry_receiver(person, receiver, bones, followed, on_table, extra)
        for receiver, extra in zip(worn, extras, strict=True)
    ]
    position_mm, turning = (np.stack(parts, axis=1) for parts in zip(*rides, strict=True))
    marks = {name: centre for name, centre in centres.items() if forearm or name != "wrist"}
    points = np.concatenate([position_mm, np.stack(list(marks.values()), axis=1)], axis=1)
    points -= move_points(bones["hand"], np.array([-2.0, 45.0, 0.0]))[:, None]  # the arm moves the palm
    points = np.einsum("tij,tkj->tki", turned.as_matrix(), points) + palm_mm[:, None]
    turning = turned.as_matrix()[:, None] @ turning
    if side == "left":  # mirror in y, which keeps the receivers' x (cable) and z (skin) axes
        points, turning = points * MIRROR, MIRROR[:, None] * turning * MIRROR
    names, position_mm = tuple(receiver.bone for receiver in worn), points[:, : len(worn)]
    facing = Rotation.from_matrix(turning.reshape(-1, 3, 3))
    frame, seen = np.arange(len(time_s), dtype=np.int64), np.ones(position_mm.shape[:2], bool)
    measured = measure(person, position_mm, facing, tracker)
    true_pose = Poses(names, frame, time_s, position_mm, quaternions(facing, seen.shape), seen)
    if session.dropouts:  # short gaps, some of them of all receivers at once
        seen = seen.copy()
        for _ in range(tracker.integers(4, 12)):
            first = int(tracker.integers(0, len(seen)))
            last = first + 1 + int(tracker.exponential(0.08) * rate_hz)
            which = slice(None) if tracker.random() < 0.2 else int(tracker.integers(0, len(names)))
            seen[first:last, which] = False
        for numbers in measured:
            numbers[~seen] = np.nan
    return DrawnRecording(
        Poses(names, frame, time_s, *measured, seen),
        true_pose,
        {name: points[:, len(names) + column] for column, name in enumerate(marks)},
        angles_deg,
        {name: bone.length_mm for name, bone in person.bones.items() if "_" in name},
    )


def true_centres(recording: DrawnRecording, joint: str, segment: str) -> Array:
    """Return a joint's mean centre (3,), mm, in the frame of a receiver, which moves on the skin."""
    pose = recording.true_pose
    at = pose.index(segment)
    turning = Rotation.from_quat(pose.quaternion[:, at], scalar_first=True)
    from_it = recording.true_centre_mm[joint] - pose.position_mm[:, at]
    return np.asarray(turning.inv().apply(from_it).mean(axis=0))


def settle(
    angles_deg: dict[str, Array], person: Person, time_s: Array, rng: np.random.Generator
) -> dict[str, Array]:
    """Return each angle (T,), rad, as the skin follows it: with hysteresis, which creep reduces."""
    names = [angle for joint in person.joints for angle in joint.angles]
    angles_rad = np.deg2rad(np.hstack([angles_deg[joint.name] for joint in person.joints]))
    play = rng.uniform(0.03, 0.12, angles_rad.shape[1])
    back = (time_s[1] - time_s[0]) / rng.uniform(1.5, 5.0, angles_rad.shape[1])
    followed = np.empty_like(angles_rad)
    now = angles_rad[0]
    for frame, angle in enumerate(angles_rad):
        now = np.minimum(np.maximum(now, angle - play), angle + play)
        now = now + back * (angle - now)
        followed[frame] = now
    return dict(zip(names, followed.T, strict=True))


def carry_receiver(
    person: Person,
    worn: Worn,
    bones: dict[str, Motion],
    followed: dict[str, Array],
    pressed: Array,
    extra: Array,
) -> Motion:
    """Return a receiver's positions (T, 3) and rotations (T, 3, 3) before the arm moves the hand.

    followed : each angle (T,), rad, as the skin follows it. pressed : (T,) share of the hand's weight on the
    table. extra : (T, 6) drift of the receiver in the skin's axes, mm and rad, which is reduced on nails.
    """
    bone, thumb = worn.bone, worn.bone == "thumb_metacarpal"
    number = [receiver.bone for receiver in person.worn["right"]].index(bone)
    rng = np.random.default_rng([person.seed, 32, number])  # the same skin in all recordings of the person
    share = SKIN_SHARE[person.skin]
    share *= 1.5 if thumb or bone.startswith("little") else 1.0
    nail = bone.endswith("distal")
    share *= 0.3 if nail else 1.0
    near = {"hand": ("thumb_cmc", "middle_mcp", "index_mcp"), "forearm": ("wrist",)}.get(bone, ())
    inner = [joint for joint in person.joints if joint.child == bone]
    outer = [joint for joint in person.joints if joint.name in near or (not near and joint.parent == bone)]
    pulls, names = [], []  # shift along, across and off the bone, mm, and turn about these, rad, per rad
    for joint, towards in [*((j, -1.0) for j in inner), *((j, 1.0) for j in outer)]:
        for angle in joint.angles:
            bends = angle.endswith("bend")
            slide = rng.normal(0.6 * towards if bends else 0.0, 0.6 if bends else 0.3)
            sd = [0.25, 0.35, 0.03, 0.04, 0.02] if bends else [0.5, 0.35, 0.03, 0.02, 0.03]
            pulls.append(share * np.array([slide, *rng.normal(0, sd)]))
            names.append(angle)
    pull = np.array(pulls).T
    if bone == "hand":  # limit the total motion of the skin on the back of the hand
        pull *= rng.uniform(0.5, 1.3) / np.linalg.norm(pull[:3])
        pull[3:] *= np.deg2rad(1.0) / max(1e-9, np.abs(pull[3:]).sum(axis=1).max())
    by_weight = share * rng.normal(0, [0.2] * 3 + [0.006] * 3) * ([5.0] * 3 + [10.0] * 3 if thumb else 1.0)
    behind_turn, behind_place = rng.uniform([0.10, 0.04], [0.25, 0.16])
    full_rad = rng.uniform(0.5, 1.6, len(names))  # angle at which skin motion saturates
    pulled = np.column_stack([followed[name] for name in names])
    moved = (full_rad * np.tanh(pulled / full_rad)) @ pull.T
    moved = moved + pressed[:, None] * by_weight + extra * (0.4 if nail else 1.0)
    at = bones[bone]
    turning = at[0]
    if thumb:
        left = np.column_stack([followed[name] for name in inner[0].angles])
        left = left @ np.sum([axes for _, axes in inner[0].turns], axis=0).T
        outwards, centre = bones[inner[0].parent][0], inner[0].turns[-1][0]
        whole = Rotation.from_matrix(np.swapaxes(outwards, 1, 2) @ at[0]).as_rotvec()
        turning, less = (
            outwards @ Rotation.from_rotvec(whole - behind * left).as_matrix()
            for behind in (behind_turn, behind_place)
        )
        at = less, move_points(at, centre) - less @ centre
    position = move_points(at, worn.position_mm + moved[:, :3] @ worn.skin_axes.T)
    tilt = Rotation.from_rotvec(moved[:, 3:] @ worn.skin_axes.T).as_matrix() @ worn.axes
    return position, turning @ tilt


def measure(
    person: Person, place_mm: Array, turning: Rotation, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return positions (T, S, 3) and quaternions (T, S, 4) as the tracker measures them in the room.

    The field's error is a smooth function of position with long waves: about 3 mm per metre and 0.3 deg per
    50 mm for each component.
    """
    room, shape = np.random.default_rng([person.seed, 33]), place_mm.shape[:2]
    directions = unit(room.normal(size=(6, 3)))
    per_mm = 2 * np.pi / room.uniform(500, 1100, (6, 1))
    slopes = room.normal(0, [3e-3] * 3 + [np.deg2rad(0.3) / 50] * 3, (6, 6))
    phases = room.uniform(0, 2 * np.pi, 6)
    off = np.sin(place_mm @ (directions * per_mm).T + phases) @ (slopes / per_mm)
    noise_mm, noise_deg = rng.uniform(0.05, 0.15), rng.uniform(0.03, 0.10)
    grows = np.clip((np.linalg.norm(place_mm, axis=-1, keepdims=True) / 330) ** 2, 0.3, 4)
    position_mm = place_mm + off[..., :3] + grows * rng.normal(0, noise_mm, (*shape, 3))
    tilt = off[..., 3:] + grows * rng.normal(0, np.deg2rad(noise_deg), (*shape, 3))
    return position_mm, quaternions(Rotation.from_rotvec(tilt.reshape(-1, 3)) * turning, shape)


def quaternions(turning: Rotation, shape: tuple[int, ...]) -> Array:
    """Return quaternions (T, S, 4), (w, x, y, z), without sign changes between frames."""
    quaternion = turning.as_quat(scalar_first=True).reshape(*shape, 4)
    steps = np.sign(np.einsum("tsi,tsi->ts", quaternion[1:], quaternion[:-1]))
    quaternion[1:] *= np.cumprod(steps, axis=0)[..., None]
    return np.asarray(quaternion)
