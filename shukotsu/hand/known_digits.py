"""Digits of a layout with known anatomy, their bones' rest orientations, and models that a layout allows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from shukotsu.hand.average_hand import DIGITS, DigitAnatomy
from shukotsu.hand.joint_angles import mirror_rotations
from shukotsu.hand.rotations import Array, from_matrix
from shukotsu.study.layout import Digit, Layout
from shukotsu.study.model import SkeletonModel


def root_of(layout: Layout) -> str:
    """Return the segment at which the first digit starts: the root of every chain."""
    return next(iter(layout.digits.values())).base


def known_digits(layout: Layout) -> list[Digit]:
    """List the digits of the layout whose anatomy is known."""
    return [
        digit
        for digit in layout.digits.values()
        if digit.name in DIGITS
        and digit.base == root_of(layout)
        and len(digit.segments) == len(DIGITS[digit.name].lengths_mm)
    ]


def leading_model(models: Mapping[str, SkeletonModel], layouts: Iterable[Layout]) -> str:
    """Return the recommended model of a study.

    It is the first that fits the whole hand, if a layout allows it; otherwise the last one without manual
    corrections, preferably one that solves joint by joint.
    """
    whole = [name for name, model in models.items() if model.fitting is not None]
    if whole and any(map(known_digits, layouts)):
        return whole[0]
    uncorrected = [name for name, model in models.items() if not model.planes.corrections]
    joint_by_joint = [name for name in uncorrected if name not in whole]
    return (joint_by_joint or uncorrected or list(models))[-1]


def no_whole_hand(layout: Layout, model: str) -> str:
    """Return why a model that fits the whole hand cannot be used with a layout; empty if it can."""
    if known_digits(layout):
        return ""
    return (
        f"model {model} fits a whole hand, but layout {layout.name} does not describe one: no digit of it is "
        "a thumb or finger of known anatomy; use model paper-fig4, which solves each joint separately"
    )


def refusal(layout: Layout, name: str, model: SkeletonModel) -> str:
    """Return why a model cannot be used with a layout; empty if it can."""
    return no_whole_hand(layout, name) if model.fitting is not None else ""


def rest_rotations(
    layout: Layout, hand: str, anatomy: Mapping[str, DigitAnatomy] = DIGITS
) -> dict[str, Array]:
    """Return quaternions (4,), child to parent, of joints of known anatomy in the flat hand, by joint."""
    turns = {}
    for digit in known_digits(layout):
        above = np.eye(3)
        for joint, frame in zip(digit.joints, anatomy[digit.name].frames(), strict=True):
            turns[joint] = above.T @ frame
            above = frame
    rests = from_matrix(np.array([*turns.values()]).reshape(-1, 3, 3))
    return dict(zip(turns, mirror_rotations(rests) if hand == "left" else rests, strict=True))
