"""A law of the skin in which all of it comes late, and neighbouring digits pull each other's.

A receiver follows its own joints in proportion, through a first-order lag; and through the web and the palm
it is moved by joints of other digits, which an estimator that looks at a receiver's own two joints cannot
know of.
"""

from __future__ import annotations

import numpy as np

from shukotsu.anatomy.drawn_hands import (
    DISTAL_TILT,
    PALM_SHARE,
    PHASE_LAG_S,
    PHASE_SHARE,
    SLIDE_SD_MM,
    TILT_SD,
    WANDER_DEG,
    WANDER_MM,
    WEB_SHARE,
)
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.moving_skin import Skin, lagged, wander
from shukotsu.stages.simulate.random_hand import BONES, DIGITS, FLEXION, JOINTS


def phase_lag(
    angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Slide and turn in proportion to the late flexion of own joints and neighbours'; a slow wander."""
    share = shares(skin) * skin.looseness[:, None]
    shape = (*share.shape, 3)
    slide = share[..., None] * SLIDE_SD_MM * of_hand.standard_normal(shape)
    tilt = share[..., None] * TILT_SD * of_hand.standard_normal(shape)
    receivers = np.flatnonzero(skin.distal)
    tilt[receivers, skin.joint[receivers, 0], 1] += PHASE_SHARE * skin.scale * DISTAL_TILT
    flexion = angles_rad[..., FLEXION]
    late = flexion[:1] + lagged(flexion - flexion[:1], PHASE_LAG_S)
    off = wander(of_recording, len(late), len(skin.bone)) * skin.looseness[:, None]
    return (
        np.einsum("tj,sjx->tsx", late, slide) + WANDER_MM * off[0],
        np.einsum("tj,sjx->tsx", late, tilt) + np.radians(WANDER_DEG) * off[1],
    )


def shares(skin: Skin) -> Array:
    """Return how much each joint moves the skin under each receiver (S, J), over what one next to it does."""
    share = np.zeros((len(skin.bone), len(JOINTS)))
    for receiver, bone in enumerate(skin.bone):
        for joint, name in enumerate(JOINTS):
            share[receiver, joint] = _of_other_digit(BONES[bone], name)
        share[receiver, skin.joint[receiver, skin.present[receiver]]] = PHASE_SHARE
    return share


def _of_other_digit(bone: str, joint: str) -> float:
    """The share of a joint that is not next to the bone."""
    of_bone, _, bone_kind = bone.partition("_")
    of_joint, _, joint_kind = joint.partition("_")
    if joint_kind not in ("mcp", "pip") and joint != "thumb_cmc":
        return 0.0
    if bone == "hand":
        return 0.0 if joint_kind == "pip" else PALM_SHARE
    if of_bone not in DIGITS or of_joint not in DIGITS:
        return 0.0
    beside = abs(DIGITS.index(of_bone) - DIGITS.index(of_joint)) == 1
    return WEB_SHARE.get(bone_kind, 0.0) if beside else 0.0
