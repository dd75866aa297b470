"""Fingertips in a recording that the hand was not calibrated on: bones and digits against the truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.accuracy.estimators import WHOLE
from benchmarks.accuracy.trials import Trial
from shukotsu.skeleton.rotations import Array, conjugate, rotate
from shukotsu.stages.fit_hand.contacts import find_contacts
from shukotsu.stages.fit_hand.fingertips import TIP, Fingertips, fingertips
from shukotsu.stages.fit_hand.fit import HandFit
from shukotsu.stages.fit_hand.touches import TOUCH_SD_MM, touch_in, with_touches
from shukotsu.stages.simulate.random_hand import DIGITS, JOINTS, TIP_BONES
from shukotsu.stages.simulate.simulated_truth import Truth

TIP_EVERY = 10
TOUCHED, CONTACTS = "whole-hand + one touch a digit", "whole-hand + pad contacts"
SKIN = ": end of the digit"
"""Of a row that is about the end of the digit, skin and all, and not about that of its last bone."""

RECEIVER, TRUE = "distal receiver alone (the paper's tip)", "true point of the distal receiver"
TOUCH_FRAME = 30


@dataclass(frozen=True)
class TipError:
    """One digit in one recording: mean distance, its constant part and the rest (rms), mm.

    The constant part is the mean error as the true distal bone sees it: what one touch of a known point
    could take away.
    """

    skeleton: str
    digit: str
    mean_mm: float
    constant_mm: float
    moving_mm: float


def tip_errors(calibration: Trial, held_out: Trial, fits: Mapping[str, HandFit]) -> Iterator[TipError]:
    """Errors of all digits in the held-out recording's second half, by each fit and the receivers alone.

    Its first half is looked at for pads in contact, and for nothing else.
    """
    poses = held_out.poses.take(judged_rows(held_out))
    receivers = [poses.index(f"{digit}_distal") for digit in DIGITS]
    carried, turned = poses.position_mm[:, receivers], poses.quaternion[:, receivers]
    yield from _held_against(held_out, RECEIVER, carried)
    yield from _held_against(held_out, TRUE, carried + rotate(turned, _true_points_mm(held_out.truth)))
    known = {name: fingertips(fit) for name, fit in fits.items()}
    soft = soft_parts_mm(calibration)
    if WHOLE in fits:
        known[TOUCHED] = touched(known[WHOLE], calibration, soft)
        first_half = slice(0, len(held_out.poses.frame) // 2)
        contacts = find_contacts(known[WHOLE], held_out.poses.take(first_half))
        known[CONTACTS] = with_touches(known[WHOLE], contacts)
    for name, tips in known.items():
        yield from _held_against(held_out, name, tips.in_transmitter(poses))
    for name in {WHOLE, TOUCHED, CONTACTS} & set(known):
        yield from _held_against(held_out, name + SKIN, known[name].in_transmitter(poses, TIP), soft)


def _true_points_mm(truth: Truth) -> Array:
    """Return the last bones' ends (5, 3) in the distal receivers' frames, as those sat on average."""
    on = [truth.mounts.segments.index(f"{digit}_distal") for digit in DIGITS]
    joint_mm = np.array([truth.joints[JOINTS[bone - 1]].child_mm for bone in TIP_BONES])
    return np.asarray(joint_mm + truth.hand.length_mm[TIP_BONES][:, None] * truth.along[on])


def judged_rows(held_out: Trial) -> slice:
    """In which fingertips are held against the truth: the second half, one frame in TIP_EVERY."""
    return slice(len(held_out.poses.frame) // 2, None, TIP_EVERY)


def soft_parts_mm(trial: Trial) -> Array:
    """The end of each digit from that of its last bone, (5, 3) in the bone's frame."""
    return np.outer(trial.truth.hand.soft_tip_mm, [1.0, 0.0, 0.0])


def touched(tips: Fingertips, calibration: Trial, soft_mm: Array) -> Fingertips:
    """The fingertips after every digit's end touched a known point once as the recording began."""
    rng = np.random.default_rng([calibration.seed, calibration.hand == "left", 3])
    truth, touches = calibration.truth, []
    for i, digit in enumerate(DIGITS):
        bone = truth.bone_quaternion[TOUCH_FRAME, TIP_BONES[i]]
        point = truth.tip_mm[TOUCH_FRAME, i] + rotate(bone, soft_mm[i])
        point = point + TOUCH_SD_MM * rng.standard_normal(3)
        touches.append(touch_in(tips, calibration.poses, np.array([TOUCH_FRAME]), digit, point))
    return with_touches(tips, touches)


def _held_against(
    held_out: Trial, skeleton: str, tips_mm: Array, soft_mm: Array | None = None
) -> Iterator[TipError]:
    """Errors of the ends of the bones, or of the digits, where it is known how soft they are."""
    some = judged_rows(held_out)
    for i, digit in enumerate(DIGITS):
        bone = held_out.truth.bone_quaternion[some, TIP_BONES[i]]
        true_mm = held_out.truth.tip_mm[some, i]
        if soft_mm is not None:
            true_mm = true_mm + rotate(bone, soft_mm[i])
        yield tip_error(skeleton, digit, rotate(conjugate(bone), tips_mm[:, i] - true_mm))


def tip_error(skeleton: str, digit: str, off_mm: Array) -> TipError:
    """Sum up the errors (T, 3) of one tip, in the frame of its own bone; NaN does not count."""
    off = off_mm[np.isfinite(off_mm).all(-1)]
    constant = off.mean(0)
    moving = float(np.sqrt(((off - constant) ** 2).sum(-1).mean()))
    return TipError(
        skeleton,
        digit,
        float(np.linalg.norm(off, axis=-1).mean()),
        float(np.linalg.norm(constant)),
        moving,
    )
