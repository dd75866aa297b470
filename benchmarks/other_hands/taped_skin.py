"""Move receivers as skin does: straps from the joints around pull unevenly, stick and creep back.

A strap's pull follows the joint's angle with play (it sticks, then gives way) that the skin's creep takes
back within seconds, and saturates. The thumb's metacarpal is wrapped in skin and muscle that stay behind:
its receiver is carried through a share of the bone's turning only, another share of its place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.other_hands.carriage import Motion, placed
from benchmarks.other_hands.person import SKIN_SHARE, Array, Joint, Person, Worn


@dataclass(frozen=True)
class Straps:
    """One receiver's skin: (6, D) pull per radian (mm along, across, off the bone; radians about these), and
    the angle at which each saturates; shifts while the hand's weight lies on it; shares that stay behind.
    """

    names: tuple[str, ...]
    pull: Array
    full_rad: Array
    pressed: Array
    behind_turn: float
    behind_place: float


def _straps(person: Person, worn: Worn) -> Straps:
    """Draw the skin under a receiver: the person's own, at that place."""
    rng = np.random.default_rng(
        [person.seed, 32, [one.bone for one in person.worn["right"]].index(worn.bone)]
    )
    bone = worn.bone
    share = SKIN_SHARE[person.skin]
    if bone == "thumb_metacarpal" or bone.startswith("little"):
        share *= 1.5
    if bone.endswith("distal"):
        share *= 0.3  # nails
    near = {"hand": ("thumb_cmc", "middle_mcp", "index_mcp"), "forearm": ("wrist",)}.get(bone, ())
    inner = [joint for joint in person.joints if joint.child == bone]
    outer = [joint for joint in person.joints if joint.name in near or (not near and joint.parent == bone)]
    pulls, names = [], []
    for joint, towards in [*((j, -1.0) for j in inner), *((j, 1.0) for j in outer)]:
        for angle in joint.angles:
            bends = angle.endswith("bend")
            slide = rng.normal(0.6 * towards if bends else 0.0, 0.6 if bends else 0.3)
            sd = [0.25, 0.35, 0.03, 0.04, 0.02] if bends else [0.5, 0.35, 0.03, 0.02, 0.03]
            pulls.append(share * np.array([slide, *rng.normal(0, sd)]))
            names.append(angle)
    pull = np.array(pulls).T
    if bone == "hand":  # the whole back of the hand gives way by about this much, whoever pulls
        pull *= rng.uniform(0.5, 1.3) / np.linalg.norm(pull[:3])
        pull[3:] *= np.deg2rad(1.0) / max(1e-9, np.abs(pull[3:]).sum(axis=1).max())
    thumb = bone == "thumb_metacarpal"
    pressed = share * rng.normal(0, [0.2] * 3 + [0.006] * 3) * ([5.0] * 3 + [10.0] * 3 if thumb else 1.0)
    behind = rng.uniform([0.10, 0.04], [0.25, 0.16]) * thumb
    full = rng.uniform(0.5, 1.6, len(names))
    return Straps(tuple(names), pull, full, pressed, float(behind[0]), float(behind[1]))


def settle(
    angles_deg: dict[str, Array], person: Person, time_s: Array, rng: np.random.Generator
) -> dict[str, Array]:
    """Return each angle as the skin follows it, (T,) rad: with play, which creep takes back."""
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
    """Return a receiver's places (T, 3) and turnings (T, 3, 3), before the arm carries the whole hand.

    followed : each angle as the skin follows it, (T,) rad; pressed : (T,) the hand's weight on the table;
    extra : (T, 6) mm and radians by which the receiver moves on top, in the skin's axes.
    """
    straps = _straps(person, worn)
    pulled = np.column_stack([followed[name] for name in straps.names])
    moved = (straps.full_rad * np.tanh(pulled / straps.full_rad)) @ straps.pull.T
    moved = moved + pressed[:, None] * straps.pressed + extra
    at = bones[worn.bone]
    turning = at[0]
    if straps.behind_turn:
        joint = next(joint for joint in person.joints if joint.child == worn.bone)
        left = np.column_stack([followed[name] for name in joint.angles])
        left = left @ np.sum([axes for _, axes in joint.turns], axis=0).T
        turning, _ = _left_behind(bones[joint.parent], at, joint, straps.behind_turn * left)
        at = _left_behind(bones[joint.parent], at, joint, straps.behind_place * left)
    place = worn.place + moved[:, :3] @ worn.skin_axes.T
    tilt = Rotation.from_rotvec(moved[:, 3:] @ worn.skin_axes.T).as_matrix() @ worn.axes
    return placed(at, place), turning @ tilt


def _left_behind(parent: Motion, child: Motion, joint: Joint, left: Array) -> Motion:
    """Return the child's motion with a rotation vector (T, 3) of it, seen from the parent, taken off."""
    turning = np.swapaxes(parent[0], 1, 2) @ child[0]
    whole = Rotation.from_matrix(turning).as_rotvec()
    less = parent[0] @ Rotation.from_rotvec(whole - left).as_matrix()
    centre = joint.turns[-1][0]
    return less, placed(child, centre) - less @ centre
