"""Locate the fingertips of a fitted hand in the frames of its distal receivers: bone, soft tip and
pad.

The fit knows where the last bone of a digit ends. What touches is skin: the soft tip beyond that end, or the
pad under it. Each is off the end of the bone by an offset that no recording of receivers shows. Its mean and
sd are those of the population until a touch informs it (`touching`); offsets and the unknowns of the hand
then have a joint covariance.

On paper: docs/whole-hand.md, section 7.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shukotsu.arrays import Float
from shukotsu.errors import InputError
from shukotsu.fit.chain_builder import bone, receiver
from shukotsu.fit.fit import HandFit
from shukotsu.fit.posterior import SolvedFit, places_of
from shukotsu.hand.average_hand import DIGITS
from shukotsu.hand.known_digits import known_digits
from shukotsu.hand.rotations import Array, rotate
from shukotsu.study.layout import Digit
from shukotsu.tables.poses import Poses

BONE, TIP, PAD = "bone", "tip", "pad"
"""Parts of a fingertip: the end of the last bone, the end of the digit, and the contact point of its pulp."""

SOFT_PARTS = (TIP, PAD)

TIP_SD_MM = (0.6, 0.5, 0.5)
"""Sd of the soft tip about the end of the bone, along, across and in height: Buryanov & Kotiuk 2010 have 0.59
to 0.62 mm along; across, whoever touches with the end of a finger meets its middle line by eye (our
choice)."""

PAD_DEPTH_MM: Mapping[str, float] = {"thumb": 7.5}
OTHER_PAD_DEPTH_MM = 6.5
"""Depth of the pad's skin under the bone's long axis: half of a finger's end, which is 10 to 16 mm thick."""

PAD_SHARE = 0.25
"""Share of the last bone's length beyond the pad: pulps meet under the bone's broad end (our choice)."""

PAD_SD_MM = (2.0, 1.0, 1.0)
"""Sd of the pad's place along, across and in depth: 5 to 8 mm deep, and one pinches more with the end of the
finger than another (our choice)."""


@dataclass(frozen=True)
class Fingertip:
    """The last bone's end, the digit's, its pad: (3,) mm in the receiver's frame, with covariances."""

    receiver: str
    point_mm: Array
    covariance_mm2: Array
    soft_tip_mm: Array
    soft_tip_covariance_mm2: Array
    pad_mm: Array
    pad_covariance_mm2: Array


@dataclass(frozen=True)
class Fingertips:
    """The fingertips of a hand, with the fit that they were computed from.

    offsets_mm : (D, 2, 3) of soft tip and pad from the bone's end, in the bone's frame of a right hand, in
    the order of digits. covariance : (G + 6 D, G + 6 D) of unknowns and offsets. refused : touches left out,
    and why.
    """

    fit: HandFit
    offsets_mm: Array
    covariance: Array
    digits: Mapping[str, Fingertip]
    refused: tuple[str, ...] = ()

    @cached_property
    def root(self) -> Array:
        """A square root of the covariance."""
        return square_root(self.covariance)

    def __getitem__(self, digit: str) -> Fingertip:
        """The fingertip of one digit; InputError where it has none."""
        if digit not in self.digits:
            raise InputError(f"digit {digit!r} has no fingertip; expected one of {', '.join(self.digits)}")
        return self.digits[digit]

    def in_transmitter(self, poses: Poses, part: str = BONE) -> Array:
        """Positions of the digits' ends as the distal receivers carry them.

        Parameters
        ----------
        poses : Poses
            T frames.
        part : str
            BONE, TIP or PAD.

        Returns
        -------
        array, shape (T, D, 3)
            In the transmitter frame, mm; NaN where the receiver is not valid.

        """
        out = np.full((len(poses.frame), len(self.digits), 3), np.nan)
        for i, tip in enumerate(self.digits.values()):
            column = poses.index(tip.receiver)
            ok = poses.valid[:, column]
            point = {BONE: tip.point_mm, TIP: tip.soft_tip_mm, PAD: tip.pad_mm}[part]
            out[ok, i] = poses.position_mm[ok, column] + rotate(poses.quaternion[ok, column], point)
        return out


def square_root(covariance: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """Compute a square root of a covariance by its eigenvectors.

    Parameters
    ----------
    covariance : array, shape (n, n)
        Symmetric; eigenvalues below zero, which are rounding errors, count as zero.

    Returns
    -------
    array, shape (n, n)
        L with L L^T = covariance.

    """
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def fingertips(fit: HandFit) -> Fingertips:
    """Locate a hand's fingertips by the fit and the population's soft parts, before any touch (section 7).

    Parameters
    ----------
    fit : HandFit
        The hand.

    Returns
    -------
    Fingertips
        Ends of bones, soft tips and pads, mm in the distal receivers' frames, with their joint covariance.

    """
    offsets, n_unknowns = _average_offsets_mm(fit), len(fit.posterior.x)
    covariance = np.zeros((n_unknowns + offsets.size,) * 2)
    covariance[:n_unknowns, :n_unknowns] = fit.posterior.covariance
    variance = np.broadcast_to(np.square([TIP_SD_MM, PAD_SD_MM]), offsets.shape)
    covariance[n_unknowns:, n_unknowns:] = np.diag(variance.ravel())
    return fingertips_of(fit, offsets, covariance)


def fingertips_of(
    fit: HandFit, offsets_mm: Array, covariance: Array, refused: tuple[str, ...] = ()
) -> Fingertips:
    """Locate a hand's fingertips by the fit and given offsets of the soft parts.

    Parameters
    ----------
    fit : HandFit
        The hand.
    offsets_mm : array, shape (D, 2, 3)
        Soft tip and pad from the bone's end, in the bone's frame of a right hand.
    covariance : array, shape (G + 6 D, G + 6 D)
        Of unknowns and offsets together.
    refused : tuple of str
        Touches left out, and why.

    Returns
    -------
    Fingertips
        In the order of the layout's digits.

    """
    seen = seen_parts(fit, fit.posterior.x, offsets_mm)
    digits = {}
    for digit in tipped_digits(fit):
        parts = []
        for part in (BONE, *SOFT_PARTS):
            point, by_all = seen[digit.name, part]
            parts += [point, by_all @ covariance @ by_all.T]
        digits[digit.name] = Fingertip(digit.tip, *parts)
    return Fingertips(fit, offsets_mm, covariance, digits, refused)


def tipped_digits(fit: SolvedFit) -> list[Digit]:
    """Digits of known anatomy whose last bone carries a receiver."""
    return [d for d in known_digits(fit.layout) if d.tip in fit.model.receivers]


def seen_parts(fit: SolvedFit, x: Array, offsets_mm: Array) -> dict[tuple[str, str], tuple[Array, Array]]:
    """Locate bones' ends, soft tips and pads at the mean posture, with their derivatives.

    Parameters
    ----------
    fit : SolvedFit
        The hand.
    x : array, shape (G,)
        Unknowns, which may differ from the fit's.
    offsets_mm : array, shape (D, 2, 3)
        Soft tips and pads from the bones' ends.

    Returns
    -------
    dict
        By digit and part: point (3,), mm in the distal receiver's frame, and derivative (3, G + 6 D).

    """
    model = fit.model
    places = places_of(model, fit.posterior.moved_to(x, fit.posterior.covariance))
    seen = {}
    for i, digit in enumerate(tipped_digits(fit)):
        worn, last = places[receiver(digit.tip)], places[bone(digit.tip)]
        to_receiver = fit.convention.point_matrix(digit.tip)
        length = model.length[digit.tip]
        longer = np.zeros((3, len(x)))
        longer[0] = length.row(len(x))
        end = np.array([length.constant, 0.0, 0.0]) + longer @ x
        for k, part in enumerate((BONE, *SOFT_PARTS)):
            offset = offsets_mm[i, k - 1] if k else np.zeros(3)
            point, moved = worn.sees(last.carrying(end + offset, longer))
            by_offset = np.zeros((3, *offsets_mm.shape))
            if k:
                by_offset[:, i, k - 1] = to_receiver @ worn.R.T @ last.R
            seen[digit.name, part] = (
                to_receiver @ point,
                np.hstack([to_receiver @ moved, by_offset.reshape(3, -1)]),
            )
    return seen


def _average_offsets_mm(fit: HandFit) -> Array:
    """Offsets (D, 2, 3) of soft tips and pads in a hand of this size."""
    average = {
        segment: float(length)
        for digit in known_digits(fit.layout)
        for segment, length in zip(digit.segments, DIGITS[digit.name].lengths_mm, strict=True)
    }
    size = sum(fit.bones[segment].length_mm for segment in average) / max(sum(average.values()), 1.0)
    digits = tipped_digits(fit)
    offsets = np.zeros((len(digits), len(SOFT_PARTS), 3))
    for i, digit in enumerate(digits):
        offsets[i, 0, 0] = DIGITS[digit.name].soft_tip_mm
        offsets[i, 1, 0] = -PAD_SHARE * average[digit.tip]
        offsets[i, 1, 2] = -PAD_DEPTH_MM.get(digit.name, OTHER_PAD_DEPTH_MM)
    return offsets * size
