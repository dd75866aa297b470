"""Predict how much one more measurement of a hand would reduce the errors of its joint centres.

The posterior covariance after a linear observation, P - P H^T (H P H^T + R)^-1 H P, does not depend on the
observed value, only on its error. So every length and receiver position that could be measured, and a touch
of every fingertip, is tested on the covariance alone, all at once.

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shukotsu.fit.fingertips import TIP, TIP_SD_MM, Fingertips, seen_parts, tipped_digits
from shukotsu.fit.measurements import MOUNT_PARTS, Measurement, observations
from shukotsu.fit.posterior import SolvedFit, centre_by_unknowns, places_of
from shukotsu.fit.posterior_summary import unmodelled_mm2, unshown_mm2
from shukotsu.fit.touches import SKIN_SD_MM
from shukotsu.hand.known_digits import root_of
from shukotsu.hand.measured import measured_in
from shukotsu.hand.rotations import Array

if TYPE_CHECKING:
    from shukotsu.tables.rows import GainsRow

MEASURED_SD_MM, TOUCH_SD_MM = 0.4, 0.5
"""Sd of a calliper reading between two joints or a joint and a receiver, and of a touch, per direction."""

DEEP_SD_MM = 2.0
"""Sd of a length from a CMC joint or the wrist, which are deep and have no crease (our choice)."""

TOUCH = "touch"


def gains(tips: Fingertips) -> list[GainsRow]:
    """Compute the joint centres' errors before and after every possible measurement (section 11).

    Parameters
    ----------
    tips : Fingertips
        The hand, with the covariance of its unknowns and soft parts.

    Returns
    -------
    list of GainsRow
        Rows of table gains for lengths of bones, positions of receivers and touches of fingertips, best
        first. Quantities and joints that no receiver measures are left out.

    """
    fit = tips.fit
    seen = np.asarray(fit.problem.frames.valid.any(0))[None]
    measured = measured_in(fit.layout, fit.model.receivers, seen)
    shown = {**measured.bones, **measured.tips}
    kept = np.array([bool(measured.joints[joint][0]) for joint in tips.fit.joints], bool)
    names = [joint for joint, is_kept in zip(tips.fit.joints, kept, strict=True) if is_kept]
    quantities, sds, rows = _candidates(tips)
    if not quantities or not names:
        return []
    before, after = (of_joints[kept] for of_joints in _sd_mm(tips, rows))
    best = (before[:, None] - after).argmax(0)
    all_gains: list[GainsRow] = [
        {
            "quantity": quantity,
            "sd_mm": sd,
            "mean_sd_before_mm": float(before.mean()),
            "mean_sd_after_mm": float(after[:, k].mean()),
            "joint": names[best[k]],
            "joint_sd_before_mm": float(before[best[k]]),
            "joint_sd_after_mm": float(after[best[k], k]),
        }
        for k, (quantity, sd) in enumerate(zip(quantities, sds, strict=True))
        if (seen_in := shown.get(quantity.partition(".")[0])) is None or seen_in[0]
    ]
    return sorted(all_gains, key=lambda gain: gain["mean_sd_after_mm"])


def _candidates(tips: Fingertips) -> tuple[list[str], list[float], Array]:
    """List possible measurements, their sd, and their rows (K, 3, G + 6 D) in units of that sd."""
    fit = tips.fit
    model = fit.model
    worn = [s for s in model.mount if s in model.receivers]
    quantities = [
        *model.length,
        *(f"{s}.{part}" for s in worn for part in MOUNT_PARTS),
        *(f"{s}.distal" for s in worn if s in model.length),
    ]
    sds = [_realistic_sd_mm(fit, quantity) for quantity in quantities]
    lengths = [Measurement(quantity, 0.0, sd) for quantity, sd in zip(quantities, sds, strict=True)]
    digits = tipped_digits(fit)
    rows = np.zeros((len(lengths) + len(digits), 3, len(tips.covariance)))
    rows[: len(lengths), 0, : len(model.unknowns.names)] = observations(model, lengths).rows
    seen = seen_parts(fit, fit.posterior.x, tips.offsets_mm)
    for k, digit in enumerate(digits, len(lengths)):
        rows[k] = seen[digit.name, TIP][1] / np.hypot(TOUCH_SD_MM, SKIN_SD_MM)
        quantities.append(f"{digit.name}.{TOUCH}")
        sds.append(TOUCH_SD_MM)
    return quantities, sds, rows


def _realistic_sd_mm(fit: SolvedFit, quantity: str) -> float:
    """Return the sd with which a quantity can realistically be measured."""
    segment, _, part = quantity.partition(".")
    first = {digit.segments[0] for digit in fit.layout.digits.values()}
    last = {digit.tip for digit in fit.layout.digits.values()}
    if segment == root_of(fit.layout) or (segment in first and part in ("", "along")):
        return DEEP_SD_MM
    if segment in last and part in ("", "distal"):
        return float(np.hypot(MEASURED_SD_MM, TIP_SD_MM[0]))
    return MEASURED_SD_MM


def _sd_mm(tips: Fingertips, rows: Array) -> tuple[Array, Array]:
    """Return joint centres' sd now (J,), as `FittedJoint.sd_mm`, and after each observation alone (J, K)."""
    fit, joints, P = tips.fit, tips.fit.joints.values(), tips.covariance
    places = places_of(fit.model, fit.posterior)
    by_x = np.array([centre_by_unknowns(fit.layout.joints[j.name], places, fit)[1] for j in joints])
    centres = np.zeros((*by_x.shape[:2], len(P)))
    centres[..., : by_x.shape[-1]] = by_x
    halves = [((j.parent_segment, j.parent_mm), (j.child_segment, j.child_mm)) for j in joints]
    bent = np.array([[float(np.trace(unshown_mm2(*half, fit))) for half in both] for both in halves])
    bent += [[3.0 * unmodelled_mm2(j.name, fit)] for j in joints]
    flat = centres.reshape(-1, len(P))
    variance = ((flat @ P) * flat).sum(-1).reshape(-1, 2, 3).sum(-1)
    PH = (rows.reshape(-1, len(P)) @ P).reshape(rows.shape)  # P is symmetric
    root = np.linalg.cholesky(np.eye(3) + rows @ PH.swapaxes(-1, -2))
    shown = np.linalg.solve(root, PH @ flat.T)  # (K, 3, 6 J)
    gained = (shown**2).sum(1).reshape(len(rows), -1, 2, 3).sum(-1)
    left = (np.maximum(variance - gained, 0.0) + bent).max(-1)
    return np.sqrt((variance + bent).max(-1)), np.sqrt(left).T
