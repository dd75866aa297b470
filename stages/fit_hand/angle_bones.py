"""Bones between which a fitted hand's joint angles are measured, the thumb's metacarpal facing its nail."""

from __future__ import annotations

from dataclasses import replace

from shukotsu.anatomy.known_digits import known_digits, rest_rotations
from shukotsu.skeleton.joint_angles import mirrored
from shukotsu.skeleton.rotations import Array, from_matrix, multiply
from shukotsu.stages.fit_hand.fit import HandFit
from shukotsu.stages.fit_hand.fitted_motion import PosedHand


def side_of(fit: HandFit) -> str:
    """Say whether the fitted hand is right or left."""
    return "left" if fit.evidence.convention.left else "right"


def angle_bones(fit: HandFit, posed: PosedHand) -> tuple[Array, dict[str, Array]]:
    """Give the bones' rotations (T, B, 4) and rests, the thumb's metacarpal facing as its phalanges do.

    So that its angles bear the right names, whichever way its receiver faces.
    """
    hand = side_of(fit)
    layout, own, bones = fit.evidence.layout, fit.evidence.model.anatomy, posed.bone_quaternion.copy()
    nails = {name: replace(digit, faces_nail=digit.second_axis is not None) for name, digit in own.items()}
    for digit in known_digits(layout):
        turn = from_matrix(own[digit.name].frames()[0].T @ nails[digit.name].frames()[0])
        index = posed.bones.index(digit.segments[0])
        bones[:, index] = multiply(bones[:, index], mirrored(turn) if hand == "left" else turn)
    return bones, rest_rotations(layout, hand, nails)
