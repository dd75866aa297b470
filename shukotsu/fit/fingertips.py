"""Locate the fingertips of a fitted hand in the frames of its distal receivers: bone, soft tip and
pad.

The fit locates the end of a digit's last bone. Contact is made by skin, which is the soft tip beyond that end
or the pad below it. The offset of either from the end of the bone is not shown by any recording of receivers.
Its mean and sd are those of the population until a touch informs it (`touches`); offsets and the unknowns of
the hand then have a joint covariance.

On paper: docs/whole-hand.md, section 7.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

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
"""Sd of the soft tip relative to the end of the bone: along (0.59 to 0.62 mm, Buryanov & Kotiuk 2010), across
and in height (our choice; people touch with the middle of the fingertip as they see it)."""

PAD_DEPTH_MM: Mapping[str, float] = {"thumb": 7.5}
OTHER_PAD_DEPTH_MM = 6.5
"""Depth of the pad's skin below the bone's long axis, for the digits listed and for all others: half the
thickness of a fingertip, which is 10 to 16 mm."""

PAD_SHARE = 0.25
"""Distance of the pad from the end of the last bone, as a share of the bone's length: pulps meet below its
broad end (our choice)."""

PAD_SD_MM = (2.0, 1.0, 1.0)
"""Sd of the pad's position along, across and in depth: pads are 5 to 8 mm deep, and people differ in how
close to the end of the finger they pinch (our choice)."""


@dataclass(frozen=True)
class Fingertip:
    """End of a digit's last bone, its soft tip and pad, (3,) mm in the receiver's frame, with covariances."""

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

    Attributes
    ----------
    fit : HandFit
        The hand.
    offsets_mm : array, shape (D, 2, 3)
        Soft tip and pad relative to the bone's end, in the bone's frame of a right hand, in the order of
        digits.
    covariance : array, shape (G + 6 D, G + 6 D)
        Joint covariance of unknowns and offsets.
    digits : mapping of str to Fingertip
        Fingertip of each digit.
    refused : tuple of str
        Touches that were left out, and why.

    """

    fit: HandFit
    offsets_mm: Array
    covariance: Array
    digits: Mapping[str, Fingertip]
    refused: tuple[str, ...] = ()

    @cached_property
    def root(self) -> Array:
        """Square root L of the covariance, L L^T = covariance; negative eigenvalues are rounding errors."""
        try:
            return np.asarray(np.linalg.cholesky(self.covariance), float)
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(self.covariance)
            return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    def __getitem__(self, digit: str) -> Fingertip:
        """Return the fingertip of a digit; raise InputError if it has none."""
        if digit not in self.digits:
            raise InputError(f"digit {digit!r} has no fingertip; expected one of {', '.join(self.digits)}")
        return self.digits[digit]

    def in_transmitter(self, poses: Poses, part: str = BONE) -> Array:
        """Return the positions of the digits' ends as the distal receivers carry them.

        Parameters
        ----------
        poses : Poses
            T frames.
        part : str
            BONE, TIP or PAD.

        Returns
        -------
        array, shape (T, D, 3)
            Positions in the transmitter frame, mm; NaN if the receiver is not valid.

        """
        out = np.full((len(poses.frame), len(self.digits), 3), np.nan)
        for i, tip in enumerate(self.digits.values()):
            column = poses.index(tip.receiver)
            ok = poses.valid[:, column]
            point = {BONE: tip.point_mm, TIP: tip.soft_tip_mm, PAD: tip.pad_mm}[part]
            out[ok, i] = poses.position_mm[ok, column] + rotate(poses.quaternion[ok, column], point)
        return out


def fingertips(fit: HandFit) -> Fingertips:
    """Locate a hand's fingertips by the fit and average offsets of soft parts, before any touch (section 7).

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
        Soft tip and pad relative to the bone's end, in the bone's frame of a right hand.
    covariance : array, shape (G + 6 D, G + 6 D)
        Joint covariance of unknowns and offsets.
    refused : tuple of str
        Touches left out, and why.

    Returns
    -------
    Fingertips
        Fingertips in the order of the layout's digits.

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
    """List the digits of known anatomy whose last bone carries a receiver."""
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
        Soft tips and pads relative to the bones' ends.

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
            by_all = np.hstack([to_receiver @ moved, by_offset.reshape(3, -1)])
            seen[digit.name, part] = to_receiver @ point, by_all
    return seen


def _average_offsets_mm(fit: HandFit) -> Array:
    """Return average offsets (D, 2, 3) of soft tips and pads in a hand of this size, mm."""
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
