"""Add touches to a fitted hand's posterior: a fingertip on a known point, a thumb's pad on a finger's.

As receiver poses are measured during a touch, it is an observation of three numbers that depend only on the
hand's unknowns and the soft parts' offsets. The posterior is normal and the observation nearly linear, so it
is included by conditioning, linearised a few times at the updated values (iterated Kalman update, Bell &
Cathey 1993).

A touch is one observation however many frames it lasts. Its errors (skin under the receiver, field, position
of the finger on the point) are constant while it lasts; only the tracker's noise averages out, and that is a
tenth of a millimetre. In opposition tasks, contacts of two pads are found from the poses alone.

On paper: docs/whole-hand.md, section 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.fit.fingertips import BONE, PAD, TIP, Fingertips, fingertips_of, seen_parts
from shukotsu.fit.operations import Index
from shukotsu.hand.rotations import Array, matrix
from shukotsu.tables.poses import Poses

CONTACT_SD_MM = 1.5
"""Sd of a contact of two pads, per direction: pulps yield by 1 to 2 mm and do not meet centre on centre."""

SKIN_SD_MM = 0.3
"""Sd of a nail's receiver relative to its bone, per direction: skin elsewhere slides by about a millimetre
per rad of the joint, that of the nail by a third of that."""

WORST = 16.27
"""Squared misfit of a touch, in sd, relative to all other data, above which it is left out: exceeded by 1 in
1000 (chi-squared, 3 degrees of freedom)."""

FAR = 100.0
"""Squared misfit relative to the fit alone above which a touch is left out even if other touches agree with
it, as linearisation would not be valid so far away."""

_ROUNDS = 5

THUMB = "thumb"

NEAR_SD = 3.37
"""Predicted distance of two pads, in sd, below which they may be in contact: 99 % of the chi distribution
with 3 degrees of freedom."""

SLOW_SHARE = 0.15
"""Relative speed of thumb and finger in a contact, as a share of its 90th percentile: pads in contact are
held for a moment, pads that only pass each other are not."""

HELD_MM = 1.0
"""Distance of the pads beyond the smallest one of a contact up to which frames belong to it."""

MOST_EACH = 3
"""Largest number of contacts of one finger that are used, those that are held stillest."""

_SPEED_FRAMES = 4
"""Half of the number of frames over which speed is computed, so that the tracker's noise does not dominate
it."""


@dataclass(frozen=True)
class Touch:
    """A fingertip on a known point, a stylus's tip on the fingertip, or two fingertips that meet.

    Attributes
    ----------
    digits : tuple of str
        One digit, or two that meet.
    receiver_mm, receiver_quaternion : array, shape (N, D, 3) and (N, D, 4)
        Poses of the D distal receivers in the N frames of the touch.
    part : str
        tip, pad or bone.
    sd_mm : float
        1-sigma error per direction.
    point_mm : array, shape (3,), optional
        Point in the transmitter frame; None if two digits meet.

    """

    digits: tuple[str, ...]
    receiver_mm: Array
    receiver_quaternion: Array
    part: str
    sd_mm: float
    point_mm: Array | None = None


def touch_in(
    tips: Fingertips,
    poses: Poses,
    rows: Index,
    digits: tuple[str, ...],
    sd_mm: float,
    part: str,
    point_mm: Array | None = None,
) -> Touch:
    """Build a touch, or a contact of two digits, from the distal receivers' poses while it lasted.

    Parameters
    ----------
    tips : Fingertips
        The hand.
    poses : Poses
        The recording.
    rows : array of int
        Frames in which it lasted.
    digits : tuple of str
        One digit, or two that meet.
    sd_mm : float
        1-sigma per direction.
    part : str
        bone, tip or pad.
    point_mm : array, shape (3,), optional
        Point that is touched, in the transmitter's frame; None if two digits meet.

    Returns
    -------
    Touch
        The touch in the frames in which all its receivers are valid.

    Raises
    ------
    InputError
        If there is no such frame, or a digit has no fingertip.

    """
    receivers = [tips[digit].receiver for digit in digits]
    columns = [poses.index(name) for name in receivers]
    rows = rows[poses.valid[rows][:, columns].all(1)]
    if not len(rows):
        raise InputError(f"no frame of the touch has a valid pose of {' and '.join(receivers)}")
    held = poses.position_mm[rows][:, columns], poses.quaternion[rows][:, columns]
    return Touch(digits, *held, part, sd_mm, point_mm)


@dataclass(frozen=True)
class _Equation:
    """Equation of a touch: value (3,) = sum over terms of factor (3, 3) @ point of (digit, part).

    sd_mm : 1-sigma error per direction.
    """

    name: str
    terms: tuple[tuple[Array, tuple[str, str]], ...]
    value: Array
    sd_mm: float


def with_touches(tips: Fingertips, touches: Sequence[Touch]) -> Fingertips:
    """Condition a hand and its fingertips on touches (docs/whole-hand.md, section 7).

    Parameters
    ----------
    tips : Fingertips
        The hand before conditioning.
    touches : sequence of Touch
        Touches of points, and contacts of pads.

    Returns
    -------
    Fingertips
        The hand with the conditioned posterior in its `fit`. A touch that disagrees with all other data at
        the level of 1 in 1000 is left out, with a sentence in `refused`.

    Raises
    ------
    InputError
        If a digit has no fingertip, or a part is unknown.

    """
    equations = [_equation(tips, number, touch) for number, touch in enumerate(touches, 1)]
    refused: list[str] = []
    while equations:
        u, covariance, misfits = _condition(tips, equations)
        worst = max(range(len(equations)), key=lambda i: misfits[i][0])
        if misfits[worst][0] <= WORST:
            n_unknowns = len(tips.fit.posterior.x)  # moved_to also updates the mean joint angles
            fit = tips.fit.moved_to(u[:n_unknowns], covariance[:n_unknowns, :n_unknowns])
            offsets_mm = u[n_unknowns:].reshape(tips.offsets_mm.shape)
            return fingertips_of(fit, offsets_mm, covariance, (*tips.refused, *refused))
        squared, apart_mm = misfits[worst]
        refused.append(
            f"{equations.pop(worst).name} is {apart_mm:.1f} mm ({np.sqrt(squared):.1f} sd) from where the "
            "hand and all other touches predict it: left out, as it may be another digit or part or no touch"
        )
    return replace(tips, refused=(*tips.refused, *refused))


def _equation(tips: Fingertips, number: int, touch: Touch) -> _Equation:
    """Write a touch as an equation: the ends of two digits coincide, or one is at the point."""
    if touch.part not in (BONE, TIP, PAD):
        raise InputError(f"part {touch.part!r} of a fingertip is not known; expected bone, tip or pad")
    first, *other = touch.digits
    names = [tips[digit].receiver for digit in touch.digits]
    name = f"contact {number} ({first} and {other[0]})" if other else f"touch {number} ({first}, {names[0]})"
    turns = [matrix(quaternion).mean(0) for quaternion in touch.receiver_quaternion.swapaxes(0, 1)]
    terms = zip((1.0, -1.0), turns, touch.digits, strict=False)
    met = touch.receiver_mm[:, 1] if touch.point_mm is None else touch.point_mm
    return _Equation(
        name,
        tuple((sign * turn, (digit, touch.part)) for sign, turn, digit in terms),
        (met - touch.receiver_mm[:, 0]).mean(0),
        float(np.sqrt(touch.sd_mm**2 + len(touch.digits) * SKIN_SD_MM**2)),
    )


def _condition(
    tips: Fingertips, equations: Sequence[_Equation]
) -> tuple[Array, Array, list[tuple[float, float]]]:
    """Condition on all equations; return unknowns and offsets (G + 6 D,), their covariance, and misfits.

    A misfit is an equation's distance from the prediction of all other data: squared in units of sd, and in
    mm.
    """
    fit, shape = tips.fit, tips.offsets_mm.shape
    start, P = np.concatenate([fit.posterior.x, tips.offsets_mm.ravel()]), tips.covariance
    noise = np.repeat([equation.sd_mm**2 for equation in equations], 3)
    u = start
    off, H = first_off, first_H = _misfit(tips, equations, start, shape)
    for _ in range(_ROUNDS):
        PH = P @ H.T
        gain = np.linalg.solve(H @ PH + np.diag(noise), PH.T).T
        u = start + gain @ (off - H @ (start - u))
        off, H = _misfit(tips, equations, u, shape)
    after = P - gain @ PH.T
    misfits = []
    for i, equation in enumerate(equations):
        rows = slice(3 * i, 3 * i + 3)
        # leave-one-out misfit, from the part of the equation's noise that conditioning did not explain
        left = equation.sd_mm**2 * np.eye(3) - H[rows] @ after @ H[rows].T
        pull = np.linalg.solve(left, off[rows])
        among = float(off[rows] @ pull), float(np.linalg.norm(equation.sd_mm**2 * pull))
        # misfit relative to the fit alone
        spread = first_H[rows] @ P @ first_H[rows].T + equation.sd_mm**2 * np.eye(3)
        apart_mm = first_off[rows]
        alone = float(apart_mm @ np.linalg.solve(spread, apart_mm)), float(np.linalg.norm(apart_mm))
        misfits.append(alone if alone[0] > FAR or among[0] < 0.0 else among)
    return u, (after + after.T) / 2, misfits


def _misfit(
    tips: Fingertips, equations: Sequence[_Equation], u: Array, shape: tuple[int, ...]
) -> tuple[Array, Array]:
    """Return the misfits (3 K,), mm, of K equations at u, and the derivative (3 K, G + 6 D) of their sums."""
    n_unknowns = len(u) - int(np.prod(shape))
    seen = seen_parts(tips.fit, u[:n_unknowns], u[n_unknowns:].reshape(shape))
    off, rows = [], []
    for equation in equations:
        off.append(equation.value - sum(factor @ seen[part][0] for factor, part in equation.terms))
        rows.append(sum(factor @ seen[part][1] for factor, part in equation.terms))
    return np.concatenate(off), np.concatenate(rows)


def find_contacts(tips: Fingertips, poses: Poses) -> list[Touch]:
    """Find frames of a recording in which the thumb's pad probably rests on a finger's pad.

    The finger's pad must be the nearest one, no farther away than the hand's uncertainty explains, and be
    held there. A person pinches in the same way each time, so all contacts of a finger together weigh as much
    as one.

    Parameters
    ----------
    tips : Fingertips
        The hand with its fingertips.
    poses : Poses
        T frames of a recording.

    Returns
    -------
    list of Touch
        One touch for each contact; empty without a thumb.

    """
    fingers = [name for name in tips.digits if name != THUMB]
    if THUMB not in tips.digits or not fingers:
        return []
    pads = tips.in_transmitter(poses, PAD)
    columns = [list(tips.digits).index(name) for name in fingers]
    apart = pads[:, columns] - pads[:, [list(tips.digits).index(THUMB)]]
    distance = np.nan_to_num(np.linalg.norm(apart, axis=-1), nan=np.inf)
    nearest = distance.argmin(1)
    seen = seen_parts(tips.fit, tips.fit.posterior.x, tips.offsets_mm)
    contacts = []
    for i, finger in enumerate(fingers):
        both = [seen[digit, PAD][1] for digit in (THUMB, finger)]
        variance = sum(float(np.trace(rows @ tips.covariance @ rows.T)) / 3 for rows in both)
        apart_sd_mm = float(np.sqrt(variance + CONTACT_SD_MM**2))  # per direction, averaged over directions
        near = (distance[:, i] < NEAR_SD * apart_sd_mm) & (nearest == i)
        episodes = _held(distance[:, i], apart[:, i], near)[:MOST_EACH]
        shared = CONTACT_SD_MM * len(episodes) ** 0.5
        contacts += [touch_in(tips, poses, rows, (THUMB, finger), shared, PAD) for rows in episodes]
    return contacts


def _held(distance_mm: Array, apart_mm: Array, near: npt.NDArray[np.bool_]) -> list[Index]:
    """Return the frames of every episode in which two pads were held together, the stillest episode first."""
    speed, k = np.full(len(apart_mm), np.inf), _SPEED_FRAMES  # mm per frame
    if len(apart_mm) > 2 * k:
        speed[k:-k] = np.linalg.norm(apart_mm[2 * k :] - apart_mm[: -2 * k], axis=-1) / (2 * k)
    speed = np.nan_to_num(speed, nan=np.inf)
    finite = speed[np.isfinite(speed)]
    if not len(finite):
        return []
    slow = SLOW_SHARE * float(np.percentile(finite, 90))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    episodes = []
    for start, stop in edges.reshape(-1, 2):
        run = np.arange(start, stop)
        run = run[speed[run] < slow]
        if len(run):
            rows = run[distance_mm[run] < distance_mm[run].min() + HELD_MM]
            episodes.append((float(np.median(speed[rows])), rows))
    return [rows for _, rows in sorted(episodes, key=lambda episode: episode[0])]
