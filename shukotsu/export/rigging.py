"""Adaptation of a hand to another rig: its names, without the bones that the rig lacks.

WebXR Hand Input has 25 names. VRM 1.0, Unity's HumanBodyBones and Mixamo have no metacarpals for the fingers;
Unreal's mannequin has (Unreal Engine 5). Where a rig names no tips, they are called after the last bone, with
`_end`. The tips of WebXR are at the skin's surface, those of the others end the last bone.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.errors import InputError
from shukotsu.export.motion import RECEIVER_TIP, SKIN_TIP
from shukotsu.hand.posing import PosedRecording, SkeletonJoint
from shukotsu.hand.rotations import Array, multiply, rotate
from shukotsu.study.config_files import export_constants

FINGERS = ("index", "middle", "ring", "little")
_FINGER = ("cmc", "mcp", "pip", "dip", "tip")
_THUMB = ("cmc", "mcp", "ip", "tip")


@dataclass(frozen=True)
class Rig:
    """A rig's names of a hand's joints.

    root, thumb (4), finger (5) : of the root and of the joints from a digit's base to its tip; empty where
    the rig has no such joint. In them {side} is right or left, {s} its first letter, {digit} a finger, or
    {pinky} where the little one is called so; {Side}, {Digit}, {Pinky} in such letters. Finger metacarpals
    that it lacks are folded into the bones after them (`fold_joints`). skin_tips : whether its tips
    are on the skin; else they are the ends of the last bones.
    """

    description: str
    root: str
    thumb: Sequence[str]
    finger: Sequence[str]
    skin_tips: bool = False

    def names(self, hand: str) -> dict[str, str]:
        """Names of a right or left hand's joints by joint, the root's by ""."""
        patterns = {"": ("", self.root)}
        for digit in ("thumb", *FINGERS):
            parts, texts = (_THUMB, self.thumb) if digit == "thumb" else (_FINGER, self.finger)
            patterns |= {f"{digit}_{p}": (digit, text) for p, text in zip(parts, texts, strict=True)}
        side = {"side": hand, "Side": hand.capitalize(), "s": hand[0]}
        names = {}
        for joint, (digit, text) in patterns.items():
            pinky = "pinky" if digit == "little" else digit
            capitals = {"Digit": digit.capitalize(), "Pinky": pinky.capitalize()}
            if text:
                names[joint] = text.format(**side, **capitals, digit=digit, pinky=pinky)
        return names


RIGS: Mapping[str, Rig] = {name: Rig(**keys) for name, keys in export_constants()["rigs"].items()}


def on_rig(motion: PosedRecording, name: str) -> PosedRecording:
    """Return the hand with the names of that rig (one of RIGS) and no bone that it lacks.

    Raises InputError where there is no such rig, or the skeleton is not that of a hand that it names.
    """
    if name not in RIGS:
        raise InputError(f"--rig: there is no rig {name!r}; expected one of {', '.join(RIGS)}")
    rig = RIGS[name]
    names = rig.names(motion.hand)
    tips = {  # that on the skin comes after that of the bone
        joint.digit: joint.name
        for joint in motion.joints
        if joint.tip and (rig.skin_tips or not joint.name.endswith(SKIN_TIP))
    }
    strange = [j.name for j in motion.joints[1:] if not _is_named(j, names) and not j.name.endswith("_cmc")]
    if strange:
        raise InputError(
            f"--rig {name}: names the joints of a hand, and layout {motion.origin.layout} has "
            f"{strange[0]}; leave --rig out to keep the layout's own names"
        )
    new = {motion.names[0]: names[""], **names}
    new |= {tip: names[f"{digit}_tip"] for digit, tip in tips.items()}
    other_tips = {j.name for j in motion.joints if j.tip} - set(tips.values())
    lacking = {j.name for j in motion.joints if j.name not in new and not j.tip}
    # bones stay as they are without a tip, so that nothing is to be noted
    motion = fold_joints(replace(fold_joints(motion, other_tips), notes=motion.notes), lacking)
    joints = tuple(replace(j, name=new[j.name]) for j in motion.joints)
    at = "at the ends of the last bones"
    if any(tip.endswith(RECEIVER_TIP) for tip in tips.values()):
        at = "the origins of the distal receivers, as this skeleton knows no other"
    elif any(tip.endswith(SKIN_TIP) for tip in tips.values()):
        at = "at the ends of the digits, skin and all, as the names' definition has them"
    return replace(motion, joints=joints).noting(f"tips are {at}", f"joints named as by {rig.description}")


def _is_named(joint: SkeletonJoint, names: Mapping[str, str]) -> bool:
    return (f"{joint.digit}_tip" if joint.tip else joint.name) in names


def with_webxr_names(motion: PosedRecording) -> PosedRecording:
    """Give a hand with the layout's names those of WebXR; leave other names."""
    names = RIGS["webxr"].names(motion.hand)
    layouts = all(_is_named(joint, names) for joint in motion.joints[1:])
    return on_rig(motion, "webxr") if layouts else motion


def fold_joints(motion: PosedRecording, lacking: Collection[str]) -> PosedRecording:
    """Remove joints; their children are attached to the removed joints' parents.

    Exact: every other joint keeps its position and rotation in every frame, so that what the bone did is in
    the motion of its children against the bone before. Of these the axis (NaN) and the degrees of freedom (0)
    are no longer known. The root cannot be left out.
    """
    gone = {i for i, joint in enumerate(motion.joints) if joint.name in lacking}
    if not gone:
        return motion
    assert 0 not in gone, "a skeleton needs its root"
    kept = [i for i in range(len(motion.joints)) if i not in gone]
    new_index = {-1: -1} | {old: new for new, old in enumerate(kept)}
    orphans = np.array([motion.joints[i].parent in gone for i in kept])
    hung = [_hung(motion, i, gone) for i in kept]
    joints = [
        replace(motion.joints[i], parent=new_index[above]) for i, (above, *_) in zip(kept, hung, strict=True)
    ]
    names = ", ".join(motion.names[i] for i in sorted(gone))
    return replace(
        motion,
        joints=tuple(replace(j, dof=0) if orphan else j for j, orphan in zip(joints, orphans, strict=True)),
        rest_offset_mm=np.stack([offset for _, offset, _, _ in hung]),
        rest=np.stack([rest for _, _, rest, _ in hung]),
        neutral=np.stack([neutral for _, _, _, neutral in hung]),
        axis=np.where(orphans[:, None], np.nan, motion.axis[kept]),
        position_mm=motion.position_mm[:, kept],
        quaternion=motion.quaternion[:, kept],
    ).noting(f"{names} folded into the bones after them")


def _hung(motion: PosedRecording, index: int, gone: Collection[int]) -> tuple[int, Array, Array, Array]:
    """A joint's nearest remaining ancestor, and in its frame the offset, rest and neutral rotation.

    A bone between them that has no neutral rotation counts as it stands at rest.
    """
    offset, rest = motion.rest_offset_mm[index], motion.rest[index]
    neutral, above = motion.neutral[index], motion.joints[index].parent
    while above in gone:
        own_rest, own_neutral = motion.rest[above], motion.neutral[above]
        offset = motion.rest_offset_mm[above] + rotate(own_rest, offset)
        rest = multiply(own_rest, rest)
        neutral = multiply(own_neutral if np.isfinite(own_neutral).all() else own_rest, neutral)
        above = motion.joints[above].parent
    return above, offset, rest, neutral
