"""Digits of a layout whose anatomy is known, and their bones' rest orientations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from shukotsu.hand.average_hand import DIGITS, DigitAnatomy
from shukotsu.hand.joint_angles import mirror_rotations
from shukotsu.hand.rotations import Array, from_matrix
from shukotsu.study.layout import Digit, Layout
from shukotsu.study.model import SkeletonModel


def root_of(layout: Layout) -> str:
    """The segment from which the first digit hangs: the root of every chain."""
    return next(iter(layout.digits.values())).base


def known_digits(layout: Layout) -> list[Digit]:
    """Digits of the layout whose anatomy is known."""
    return [
        digit
        for digit in layout.digits.values()
        if digit.name in DIGITS
        and digit.base == root_of(layout)
        and len(digit.segments) == len(DIGITS[digit.name].lengths_mm)
    ]


def leading_model(models: Mapping[str, SkeletonModel], layouts: Iterable[Layout]) -> str:
    """The recommended model of a study: the first that fits the whole hand, else the last without manual
    corrections that its layouts allow.
    """
    whole = [name for name, model in models.items() if model.fitting is not None]
    if whole and any(map(known_digits, layouts)):
        return whole[0]
    uncorrected = [name for name, model in models.items() if not model.planes.corrections]
    joint_by_joint = [name for name in uncorrected if name not in whole]
    return (joint_by_joint or uncorrected or list(models))[-1]


def no_whole_hand(layout: Layout, model: str) -> str:
    """Why a model that fits the whole hand cannot be taken for a layout; empty where it can."""
    if known_digits(layout):
        return ""
    return (
        f"model {model} fits a whole hand, and layout {layout.name} is none, as no digit in it is a thumb or "
        "a finger whose anatomy is known; take model paper-fig4, which solves each joint by itself"
    )


def refusal(layout: Layout, name: str, model: SkeletonModel) -> str:
    """Why a model cannot be taken for a layout; empty where it can."""
    return no_whole_hand(layout, name) if model.fitting is not None else ""


def rest_rotations(
    layout: Layout, hand: str, anatomy: Mapping[str, DigitAnatomy] = DIGITS
) -> dict[str, Array]:
    """Quaternion (4,) of joints of known anatomy, child to parent, straight and flat, by joint."""
    turns = {}
    for digit in known_digits(layout):
        above = np.eye(3)
        for joint, frame in zip(digit.joints, anatomy[digit.name].frames(), strict=True):
            turns[joint] = above.T @ frame
            above = frame
    rests = from_matrix(np.array([*turns.values()]).reshape(-1, 3, 3))
    return dict(zip(turns, mirror_rotations(rests) if hand == "left" else rests, strict=True))
