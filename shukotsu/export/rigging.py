"""Adaptation of a hand to another rig: joints get the rig's names, and bones that it lacks are removed.

WebXR Hand Input has 25 names. VRM 1.0, Unity's HumanBodyBones and Mixamo have no finger metacarpals; Unreal's
mannequin (Unreal Engine 5) has them. If a rig has no names for tips, they are named after the last bone, with
`_end`. The tips of WebXR are on the skin; those of the other rigs are the ends of the last bones.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.errors import InputError
from shukotsu.export.exported_motion import RECEIVER_TIP, SKIN_TIP
from shukotsu.hand.posing import PosedRecording, SkeletonJoint
from shukotsu.hand.rotations import multiply, rotate
from shukotsu.study.config_files import export_constants

FINGERS = ("index", "middle", "ring", "little")
_FINGER = ("cmc", "mcp", "pip", "dip", "tip")
_THUMB = ("cmc", "mcp", "ip", "tip")


@dataclass(frozen=True)
class Rig:
    """A rig's names of a hand's joints.

    root, thumb (4), finger (5) : names of the root and of the joints from a digit's base to its tip; empty if
    the rig lacks the joint. Placeholders are {side}, right or left; {s}, its first letter; {digit}, a
    finger's name; {pinky}, the same with pinky for little; and {Side}, {Digit}, {Pinky}, which are
    capitalised. Finger metacarpals that the rig lacks are merged into the bones after them (`fold_joints`).
    skin_tips : whether the rig's tips are on the skin; else they are the ends of the last bones.
    """

    description: str
    root: str
    thumb: Sequence[str]
    finger: Sequence[str]
    skin_tips: bool = False

    def names(self, hand: str) -> dict[str, str]:
        """Return the rig's names for a right or left hand by joint; the root's key is an empty string."""
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
    """Return the hand with the names of a rig in RIGS, without the bones that it lacks.

    Raises InputError if there is no such rig, or if the skeleton has joints that are not a hand's.
    """
    if name not in RIGS:
        raise InputError(f"--rig: there is no rig {name!r}; expected one of {', '.join(RIGS)}")
    rig = RIGS[name]
    names = rig.names(motion.hand)
    tips = {  # a digit's tip on the skin comes after the end of its bone, and so replaces it here
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
    # removing a tip changes no bone, so it needs no note
    motion = fold_joints(replace(fold_joints(motion, other_tips), notes=motion.notes), lacking)
    joints = tuple(replace(j, name=new[j.name]) for j in motion.joints)
    at = "at the ends of the last bones"
    if any(tip.endswith(RECEIVER_TIP) for tip in tips.values()):
        at = "at the origins of the distal receivers, since this skeleton has no other tips"
    elif any(tip.endswith(SKIN_TIP) for tip in tips.values()):
        at = "at the ends of the digits including the skin, as these names are defined"
    return replace(motion, joints=joints).noting(f"tips are {at}", f"joints named as in {rig.description}")


def _is_named(joint: SkeletonJoint, names: Mapping[str, str]) -> bool:
    return (f"{joint.digit}_tip" if joint.tip else joint.name) in names


def with_webxr_names(motion: PosedRecording) -> PosedRecording:
    """Return a hand that has the layout's names with those of WebXR; other names are left unchanged."""
    names = RIGS["webxr"].names(motion.hand)
    layouts = all(_is_named(joint, names) for joint in motion.joints[1:])
    return on_rig(motion, "webxr") if layouts else motion


def fold_joints(motion: PosedRecording, lacking: Collection[str]) -> PosedRecording:
    """Remove joints and attach their children to the removed joints' parents.

    Every other joint keeps exactly its position and rotation in every frame, so the motion of a removed bone
    becomes part of its children's motion. The axis (NaN) and degrees of freedom (0) of the children are then
    unknown. The root cannot be removed.
    """
    gone = np.array([joint.name in lacking for joint in motion.joints])
    if not gone.any():
        return motion
    assert not gone[0], "a skeleton needs its root"
    joints, axis = list(motion.joints), motion.axis.copy()
    offset_mm, rest, neutral = motion.rest_offset_mm.copy(), motion.rest.copy(), motion.neutral.copy()
    unknown = gone & np.isnan(neutral).any(1)  # of these the rest rotation takes part
    neutral[unknown] = rest[unknown]
    for index, joint in enumerate(joints):
        above = joint.parent
        if above >= 0 and gone[above]:  # hung from the removed joint's parent, which comes before both
            joints[index] = replace(joint, parent=joints[above].parent, dof=0)
            offset_mm[index] = offset_mm[above] + rotate(rest[above], offset_mm[index])
            rest[index] = multiply(rest[above], rest[index])
            neutral[index] = multiply(neutral[above], neutral[index])
            axis[index] = np.nan
    kept = np.flatnonzero(~gone).tolist()
    folded = replace(motion, joints=tuple(joints), rest_offset_mm=offset_mm, axis=axis).only(kept)
    names = ", ".join(np.array(motion.names, object)[gone])
    return replace(folded, rest=rest[kept], neutral=neutral[kept]).noting(
        f"{names} merged into the bones after them"
    )
