"""Compute what one more measurement of a hand would gain, before anyone takes it.

The posterior's covariance after a linear observation does not depend on what is observed, only on how well:
P - P H^T (H P H^T + R)^-1 H P. So every length and place that could be measured, and a touch of every
fingertip, is tried on the covariance alone, all at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shukotsu.anatomy.known_digits import root_of
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fingertips import TIP, TIP_SD_MM, Fingertips, seen_parts, tipped_digits
from shukotsu.stages.fit_hand.fit import HandFit
from shukotsu.stages.fit_hand.measurements import MOUNT_PARTS, Measurement, observations
from shukotsu.stages.fit_hand.posterior import Evidence, centre_by_unknowns, places_of
from shukotsu.stages.fit_hand.posterior_summary import unshown_mm2
from shukotsu.stages.fit_hand.touches import SKIN_SD_MM

MEASURED_SD_MM, TOUCH_SD_MM = 0.4, 0.5
"""Of a calliper between two joints or a joint and a receiver; of a touch, per direction."""

DEEP_SD_MM = 2.0
"""Of a length from a CMC joint or the wrist, which lie deep and show no crease (our choice)."""

TOUCH = "touch"


def gains(tips: Fingertips) -> list[dict[str, Any]]:
    """Give rows of gains: each bone's length, receiver's place and fingertip's touch, best first.

    What starts at a CMC joint or the wrist counts as known to DEEP_SD_MM, what ends at the tip of a bone as
    less certain by the soft tip. Empty for a hand whose anatomy is not known.
    """
    names = list(tips.fit.joints)
    quantities, sds, rows = _candidates(tips)
    if not quantities or not names:
        return []
    before, after = _sd_mm(tips, rows)
    best = (before[:, None] - after).argmax(0)
    all_gains = [
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
    ]
    return sorted(all_gains, key=lambda gain: float(gain["mean_sd_after_mm"]))


def expected_sd_mm(tips: Fingertips) -> tuple[list[str], Array]:
    """Give what could be measured (K), and the joints' stated errors after each (J, K).

    A digit's touch of a known point is `DIGIT.touch`.
    """
    quantities, _, rows = _candidates(tips)
    return quantities, _sd_mm(tips, rows)[1]


def _candidates(tips: Fingertips) -> tuple[list[str], list[float], Array]:
    """List what could be measured, how well, and its rows (K, 3, G + 6 D) in units of its sd."""
    evidence = tips.fit.evidence
    model = evidence.model
    worn = [s for s in model.mount if s in model.receivers]
    quantities = [
        *model.length,
        *(f"{s}.{part}" for s in worn for part in MOUNT_PARTS),
        *(f"{s}.distal" for s in worn if s in model.length),
    ]
    sds = [_realistic_sd_mm(evidence, quantity) for quantity in quantities]
    lengths = [Measurement(quantity, 0.0, sd) for quantity, sd in zip(quantities, sds, strict=True)]
    digits = tipped_digits(evidence)
    rows = np.zeros((len(lengths) + len(digits), 3, len(tips.covariance)))
    rows[: len(lengths), 0, : len(model.unknowns.names)] = observations(model, lengths).rows
    seen = seen_parts(evidence, evidence.posterior.x, tips.offsets_mm)
    for k, digit in enumerate(digits, len(lengths)):
        rows[k] = seen[digit.name, TIP][1] / np.hypot(TOUCH_SD_MM, SKIN_SD_MM)
        quantities.append(f"{digit.name}.{TOUCH}")
        sds.append(TOUCH_SD_MM)
    return quantities, sds, rows


def _realistic_sd_mm(evidence: Evidence, quantity: str) -> float:
    """Return the sd with which a quantity can be measured."""
    segment, _, part = quantity.partition(".")
    first = {digit.segments[0] for digit in evidence.layout.digits.values()}
    last = {digit.tip for digit in evidence.layout.digits.values()}
    if segment == root_of(evidence.layout) or (segment in first and part in ("", "along")):
        return DEEP_SD_MM
    if segment in last and part in ("", "distal"):
        return float(np.hypot(MEASURED_SD_MM, TIP_SD_MM[0]))
    return MEASURED_SD_MM


@dataclass(frozen=True)
class CentreRows:
    """How joint centres hang on the hand's unknowns: by_x (J, 6, G), of both halves; and what skin adds that
    no measurement takes away, skin_mm2 (J, 2).
    """

    by_x: Array
    skin_mm2: Array

    @classmethod
    def of(cls, fit: HandFit, names: Sequence[str]) -> CentreRows:
        """Give those of joints between two receivers, by name."""
        evidence, joints = fit.evidence, [fit.joints[name] for name in names]
        places, known = places_of(evidence.model, evidence.posterior), evidence.layout.joints
        by_x = [centre_by_unknowns(known[joint.name], places, evidence)[1] for joint in joints]
        sides = [((own.parent_segment, own.parent_mm), (own.child_segment, own.child_mm)) for own in joints]
        skin = [[float(np.trace(unshown_mm2(*side, evidence))) for side in both] for both in sides]
        return cls(np.array(by_x), np.array(skin))

    def sd_mm(self, precision: Array) -> Array:
        """Stated errors (J,) of the centres if the unknowns had this precision (G, G)."""
        from scipy.linalg import cho_factor, cho_solve

        flat = self.by_x.reshape(-1, self.by_x.shape[-1])
        solved = cho_solve(cho_factor(precision, check_finite=False), flat.T, check_finite=False)
        variance = (flat.T * solved).sum(0).reshape(-1, 2, 3).sum(-1)
        return np.asarray(np.sqrt(np.maximum(variance + self.skin_mm2, 0.0).max(-1)))


def _sd_mm(tips: Fingertips, rows: Array) -> tuple[Array, Array]:
    """Joint centres' sd (J,) as they are, as `FittedJoint.sd_mm`, and (J, K) after each observation alone."""
    P, of_joints = tips.covariance, CentreRows.of(tips.fit, list(tips.fit.joints))
    centres = np.zeros((*of_joints.by_x.shape[:2], len(P)))
    centres[..., : of_joints.by_x.shape[-1]] = of_joints.by_x
    bent = of_joints.skin_mm2
    flat = centres.reshape(-1, len(P))
    variance = ((flat @ P) * flat).sum(-1).reshape(-1, 2, 3).sum(-1)
    PH = (rows.reshape(-1, len(P)) @ P).reshape(rows.shape)  # P is symmetric
    root = np.linalg.cholesky(np.eye(3) + rows @ PH.swapaxes(-1, -2))
    shown = np.linalg.solve(root, PH @ flat.T)  # (K, 3, 6 J)
    gained = (shown**2).sum(1).reshape(len(rows), -1, 2, 3).sum(-1)
    left = (np.maximum(variance - gained, 0.0) + bent).max(-1)
    return np.sqrt((variance + bent).max(-1)), np.sqrt(left).T
