"""Compute how well a body explains poses: one total of log likelihood over all joints, for many hypotheses at
once.

A joint's share is that of (a) how far its centre, solved from both receivers, stays from being one point,
(b) how far from where anatomy has it that centre lies in either receiver's frame, what all joints share
(the hand's size and its receiver's place) being solved with them, and (c) how it turns: flexion within its
range, abduction and axial rotation around none. Every share has long tails, so that one odd joint
cannot outvote the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.checks.expected_body import FREE_SCALE_SD, SCALE_SD, SHARED, ExpectedBody
from shukotsu.hand.rotations import Array
from shukotsu.hand.sampled_motion import Motion

INDEPENDENT_FRAMES = 8.0
"""As many tell something of their own, however many were recorded."""
PLACE_TAIL, TURN_TAIL = 12.0, 30.0
"""Degrees of freedom of the t distributions."""
FLEXION_SD_DEG, SWING_SD_DEG = 12.0, 8.0
REACH_MM, REACH_LOG_SD = 120.0, 0.9
"""Sd of a body that anatomy does not know: how far a joint's centre is from a receiver."""


@dataclass(frozen=True)
class JointShares:
    """What P series of a joint's two receivers say.

    joint : (P,) which. normal : (P, 6, 6), slope : (P, 6), square : (P,) of the mean squared gap, a quadratic
    form of the centres. turning : (P, F) log likelihood of how it turns, by facing of the thumb's metacarpal.
    angles_deg : (P, F, 3, 3), 10th, 50th and 90th percentile of three angles.
    """

    joint: npt.NDArray[np.int64]
    normal: Array
    slope: Array
    square: Array
    turning: Array
    angles_deg: Array


@dataclass(frozen=True)
class Explanation:
    """H hypotheses: log likelihoods (H, J) and (H,), gaps, distances and angles of joints, scale (H,)."""

    closing: Array
    placed: Array
    turning: Array
    shared: Array
    gap_mm: Array
    off_mm: Array
    angles_deg: Array
    centre_mm: Array
    scale: Array

    @property
    def total(self) -> Array:
        """Log likelihood (H,) of each hypothesis."""
        return np.asarray((self.closing + self.placed + self.turning).sum(-1) + self.shared)


def joint_shares(body: ExpectedBody, series: Sequence[tuple[Sequence[int], Motion]]) -> JointShares:
    """Summarise joints' receivers in each motion: (joints, motion) pairs in, shares out."""
    joint = np.concatenate([joints for joints, _ in series])
    parts = []
    for joints, motion in series:
        parent, child = body.ends[joints].T
        above = np.swapaxes(motion.rotation[:, parent], 2, 3)
        apart = motion.position_mm[:, child] - motion.position_mm[:, parent]
        both = (motion.valid[:, parent] & motion.valid[:, child]).astype(float)
        parts.append((above @ motion.rotation[:, child], (above @ apart[..., None])[..., 0], both))
    turn, offset, weight = (np.swapaxes(np.concatenate(part, 1), 0, 1) for part in zip(*parts, strict=True))
    n = len(joint)
    total = weight.sum(1)
    weight = weight / np.maximum(total, 1.0)[:, None]
    # gap = parent - turn @ child - offset
    mean_turn = np.einsum("pk,pkij->pij", weight, turn)
    mean_offset = np.einsum("pk,pki->pi", weight, offset)
    normal = np.zeros((n, 6, 6))
    normal[:, :3, :3] = normal[:, 3:, 3:] = np.eye(3) * (total > 0)[:, None, None]
    normal[:, :3, 3:] = -mean_turn
    normal[:, 3:, :3] = -np.swapaxes(mean_turn, 1, 2)
    turned = np.einsum("pkij,pki->pkj", turn, offset)
    slope = np.concatenate([mean_offset, -np.einsum("pk,pkj->pj", weight, turned)], -1)
    square = np.einsum("pk,pki,pki->p", weight, offset, offset)
    turning, angles_deg = _turned(body, joint, turn, weight > 0)
    return JointShares(joint, normal, slope, square, turning, angles_deg)


def _turned(
    body: ExpectedBody, joint: npt.NDArray[np.int64], turn: Array, seen: npt.NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Log likelihood (P, F) of how the joints turn, and percentiles (P, F, 3, 3) of their angles, deg."""
    facings = body.rest.shape[1]
    angles_deg = np.zeros((len(joint), facings, 3, 3))
    turning = np.zeros((len(joint), facings))
    for facing in range(facings):
        # the others turn alike, whichever way a thumb's receiver faces
        depends = body.faced[joint] | (facing == 0)
        rest = np.swapaxes(body.rest[joint[depends], facing], 1, 2)[:, None]
        turned = rest @ turn[depends]  # turns about y, z and x carried one by the other
        radians = [
            np.arctan2(-turned[..., 2, 0], turned[..., 0, 0]),
            np.arctan2(turned[..., 1, 0], np.hypot(turned[..., 0, 0], turned[..., 2, 0])),
            np.arctan2(-turned[..., 1, 2], turned[..., 1, 1]),
        ]
        ordered = np.sort(np.where(seen[depends], np.degrees(radians), np.nan))  # (3, P, K), NaN last
        last = np.maximum(np.isfinite(ordered).sum(-1, keepdims=True) - 1, 0)
        low, middle, high = (
            np.nan_to_num(np.take_along_axis(ordered, (share * last).round().astype(int), -1)[..., 0].T)
            for share in (0.1, 0.5, 0.9)
        )
        angles_deg[depends, facing] = np.stack([low, middle, high], 1)
        turning[depends, facing] = _turning(body, joint[depends], low, middle, high)
    alike = ~body.faced[joint]
    angles_deg[alike], turning[alike] = angles_deg[alike, :1], turning[alike, :1]
    return np.where(body.has_anatomy[joint, None], turning, 0.0), angles_deg


def _turning(
    body: ExpectedBody, joint: npt.NDArray[np.int64], low: Array, middle: Array, high: Array
) -> Array:
    least, largest = body.flexion_deg[joint].T
    below, above = np.maximum(least - low[:, 0], 0), np.maximum(high[:, 0] - largest, 0)
    swing = np.maximum(high[:, 1:] - low[:, 1:] - body.swing_deg[joint], 0)
    aside = middle[:, 1:] / body.sideways_sd_deg[joint]
    return np.asarray(
        _tail((below / FLEXION_SD_DEG) ** 2)
        + _tail((above / FLEXION_SD_DEG) ** 2)
        + _tail((swing / SWING_SD_DEG) ** 2).sum(-1)
        + _tail(aside**2).sum(-1)
    )


def _tail(squared: Array, freedom: float = TURN_TAIL, dimensions: int = 1) -> Array:
    """Log likelihood of a t distribution, 0 at its middle."""
    return np.asarray(-(freedom + dimensions) / 2 * np.log1p(squared / freedom))


def explain(body: ExpectedBody, shares: JointShares, choice: npt.NDArray[np.int64]) -> Explanation:
    """Explain hypotheses, each of which takes one of the shares for every joint: choice (H, J), indices."""
    joint = shares.joint
    precision = 1.0 / body.sd_mm.reshape(-1, 6) ** 2
    gain = body.gain.reshape(-1, 6, SHARED)
    expected = body.centre_mm.reshape(-1, 6)
    weight = INDEPENDENT_FRAMES / body.gap_mm[joint] ** 2
    weighed = precision[joint]
    inner = np.linalg.inv(weight[:, None, None] * shares.normal + np.eye(6) * weighed[:, :, None])
    # centre = inner (weight slope + own (expected + gain u)), for shared u
    held = np.eye(6) * weighed[:, :, None] - weighed[:, :, None] * inner * weighed[:, None, :]
    pull = weighed * np.einsum("pij,pj->pi", inner, weight[:, None] * shares.slope)
    lean = np.einsum("pij,pj->pi", held, expected[joint])
    gains = gain[joint]
    matrix = np.einsum("pia,pij,pjb->pab", gains, held, gains)
    vector = np.einsum("pia,pi->pa", gains, pull - lean)
    system = matrix[choice].sum(1) + np.eye(SHARED)
    shared = np.linalg.solve(system, vector[choice].sum(1)[..., None])[..., 0]
    joints = np.arange(len(body.names))
    from_shared = expected + np.einsum("jia,ha->hji", gain[joints], shared)
    target = weight[choice][..., None] * shares.slope[choice] + precision * from_shared
    centre = np.einsum("hjik,hjk->hji", inner[choice], target)
    square = (
        np.einsum("hji,hjik,hjk->hj", centre, shares.normal[choice], centre)
        - 2 * np.einsum("hji,hji->hj", centre, shares.slope[choice])
        + shares.square[choice]
    )
    gap = np.sqrt(np.maximum(square, 0))
    scale = np.clip(1.0 + FREE_SCALE_SD * shared[:, 0], 0.01, 100.0)
    off = (centre - from_shared).reshape(*centre.shape[:2], 2, 3)
    centres = centre.reshape(off.shape)
    # of a hand twice as large all is twice as large, so that no size closes better
    distance_mm = np.linalg.norm(centres, axis=-1).reshape(len(centres), -1)
    reach = np.maximum(np.median(distance_mm, axis=-1, keepdims=True), 1e-3) / REACH_MM  # the median joint's
    size = np.where(body.has_anatomy, scale[:, None], reach)
    strange = (off**2 / body.sd_mm**2).sum(-1) / size[..., None] ** 2
    unknown = -0.5 * (np.log(reach) / REACH_LOG_SD) ** 2 / centres.shape[1]
    placed = np.where(body.has_anatomy, _tail(strange, PLACE_TAIL, 3).sum(-1), unknown)
    closing = -1.5 * INDEPENDENT_FRAMES * np.log1p((gap / (size * body.gap_mm)) ** 2)
    facing = np.argmax(shares.turning[choice].sum(1), axis=-1)[:, None]
    return Explanation(
        closing,
        placed,
        shares.turning[choice, facing],
        -0.5 * (shared[:, 1:] ** 2).sum(-1) - 0.5 * (np.log(scale) / SCALE_SD) ** 2,
        gap,
        np.linalg.norm(centres - body.centre_mm, axis=-1).max(-1),
        shares.angles_deg[choice, facing],
        centres,
        scale,
    )
