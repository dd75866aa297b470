"""A hand on another rig: its names, without the bones that the rig lacks."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from shukotsu.errors import InputError
from shukotsu.skeleton.posing import PosedRecording, SkeletonJoint
from shukotsu.skeleton.rotations import Array, multiply, rotate
from shukotsu.stages.export.motion import RECEIVER_TIP, SKIN_TIP
from shukotsu.stages.export.rig_names import RIGS


def on_rig(motion: PosedRecording, name: str) -> PosedRecording:
    """The hand with the names of that rig (`stages.export.rig_names.RIGS`) and no bone that it lacks.

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
    motion = folded(replace(folded(motion, other_tips), notes=motion.notes), lacking)
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
    """The same, but a hand that has the layout's names gets those of WebXR."""
    names = RIGS["webxr"].names(motion.hand)
    own = all(_is_named(joint, names) for joint in motion.joints[1:])
    return on_rig(motion, "webxr") if own else motion


def folded(motion: PosedRecording, lacking: Collection[str]) -> PosedRecording:
    """The motion without those joints; their children hang from what they hung from.

    Exact: every other joint keeps its position and rotation in every frame, so that what the bone did is in
    the motion of its children against the bone before. Of these the axis (NaN) and the degrees of freedom (0)
    are no longer known. The root cannot be left out.
    """
    gone = {i for i, joint in enumerate(motion.joints) if joint.name in lacking}
    if not gone:
        return motion
    assert 0 not in gone, "a skeleton needs its root"
    kept = [i for i in range(len(motion.joints)) if i not in gone]
    place = {-1: -1} | {old: new for new, old in enumerate(kept)}
    orphans = np.array([motion.joints[i].parent in gone for i in kept])
    hung = [_hung(motion, i, gone) for i in kept]
    joints = [
        replace(motion.joints[i], parent=place[above]) for i, (above, *_) in zip(kept, hung, strict=True)
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
    """A joint's nearest parent that stays, and in its frame the offset, rest and neutral rotation.

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
