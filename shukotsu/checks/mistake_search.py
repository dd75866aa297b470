"""Fit the expected body to poses, and find the mistakes whose correction makes the poses more likely.

The log likelihood is a sum over joints of three terms: (a) the gap between the joint centre as carried by the
parent's and by the child's receiver; (b) the distance of the centre in both receivers' frames from its
expected position, where the unknowns shared by all joints (the hand's size, the placement of its receiver)
are solved together with the centres; (c) the joint's rotation: flexion within its range, abduction and axial
rotation around zero. All terms have long tails, so that one odd joint cannot outvote the others.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Index
from shukotsu.checks.expected_body import FREE_SCALE_SD, SCALE_SD, SHARED, ExpectedBody
from shukotsu.checks.hypotheses import Hypothesis
from shukotsu.hand.sampled_motion import MIRROR, SampledMotion
from shukotsu.study.findings import Values

INDEPENDENT_FRAMES = 8.0
"""Number of independent frames that is assumed for a recording of any length."""
PLACE_TAIL, TURN_TAIL = 12.0, 30.0
"""Degrees of freedom of the t distributions of centres and of angles."""
FLEXION_SD_DEG, SWING_SD_DEG = 12.0, 8.0
"""SD of angles beyond the expected range of flexion, and beyond that of abduction and axial rotation."""
REACH_MM, REACH_LOG_SD = 120.0, 0.9
"""Median distance of a joint's centre from a receiver for a body without known anatomy, and SD of its log."""


@dataclass(frozen=True)
class JointShares:
    """Statistics of P series, each of poses of a joint's two receivers.

    joint : (P,) index of the joint. normal, slope, square : (P, 6, 6), (P, 6) and (P,), coefficients of the
    mean squared gap, a quadratic form c' normal c - 2 slope' c + square of the centres c. turning : (P, F)
    log likelihood of the joint's rotation, for each roll of the receiver on the thumb's metacarpal.
    angles_deg : (P, F, 3, 3) 10th, 50th and 90th percentile (third axis) of flexion, abduction and axial
    rotation (last axis).
    """

    joint: Index
    normal: Array
    slope: Array
    square: Array
    turning: Array
    angles_deg: Array


@dataclass(frozen=True)
class Explanation:
    """Fit of the expected body to the poses under each of H hypotheses.

    closing, placed, turning : (H, J) log likelihoods of gaps, positions and rotations. shared : (H,) log
    likelihood of the shared unknowns. gap_mm : (H, J) rms gap. off_mm : (H, J) distance of the centre from
    its average position, the larger of both receivers. angles_deg : (H, J, 3, 3), see `JointShares`.
    centre_mm : (H, J, 2, 3). scale : (H,) of the hand.
    """

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
        """Log likelihood of each hypothesis, (H,)."""
        return np.asarray((self.closing + self.placed + self.turning).sum(-1) + self.shared)


def joint_shares(body: ExpectedBody, series: Sequence[tuple[Index, SampledMotion]]) -> JointShares:
    """Compute the statistics of joints in motions; series : (indices of joints, motion) pairs."""
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
    turning, angles_deg = _rate_turns(body, joint, turn, weight > 0)
    return JointShares(joint, normal, slope, square, turning, angles_deg)


def _rate_turns(
    body: ExpectedBody, joint: Index, turn: Array, seen: npt.NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return the log likelihood (P, F) of joint rotations, and percentiles (P, F, 3, 3) of angles in deg."""
    facings = body.rest.shape[1]
    angles_deg = np.zeros((len(joint), facings, 3, 3))
    turning = np.zeros((len(joint), facings))
    for facing in range(facings):
        # joints that do not depend on the roll are computed once
        depends = body.faced[joint] | (facing == 0)
        rest = np.swapaxes(body.rest[joint[depends], facing], 1, 2)[:, None]
        turned = rest @ turn[depends]  # decomposed into intrinsic rotations about y, z and x
        radians = np.array(
            [
                np.arctan2(-turned[..., 2, 0], turned[..., 0, 0]),
                np.arctan2(turned[..., 1, 0], np.hypot(turned[..., 0, 0], turned[..., 2, 0])),
                np.arctan2(-turned[..., 1, 2], turned[..., 1, 1]),
            ]
        )
        radians[:, ~seen[depends]] = np.nan
        radians.sort()  # (3, P, K), NaN last
        last = np.maximum(np.isfinite(radians).sum(-1, keepdims=True) - 1, 0)
        at = [(share * last).round().astype(int) for share in (0.1, 0.5, 0.9)]
        chosen = np.nan_to_num(np.degrees(np.take_along_axis(radians, np.concatenate(at, -1), -1)))
        low, middle, high = np.moveaxis(chosen, -1, 0).swapaxes(1, 2)
        angles_deg[depends, facing] = np.stack([low, middle, high], 1)
        turning[depends, facing] = _turning(body, joint[depends], low, middle, high)
    alike = ~body.faced[joint]
    angles_deg[alike], turning[alike] = angles_deg[alike, :1], turning[alike, :1]
    return np.where(body.has_anatomy[joint, None], turning, 0.0), angles_deg


def _turning(body: ExpectedBody, joint: Index, low: Array, middle: Array, high: Array) -> Array:
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
    """Return the log likelihood of a t distribution, relative to its centre."""
    return np.asarray(-(freedom + dimensions) / 2 * np.log1p(squared / freedom))


def explain(body: ExpectedBody, shares: JointShares, choice: Index) -> Explanation:
    """Fit the expected body under each hypothesis.

    Parameters
    ----------
    body : ExpectedBody
        J joints and their expected properties.
    shares : JointShares
        Statistics of P series.
    choice : array, shape (H, J)
        Which of the series each hypothesis uses for each joint.

    Returns
    -------
    Explanation
        Log likelihoods, centres and angles.

    """
    joint = shares.joint
    precision = 1.0 / body.sd_mm.reshape(-1, 6) ** 2
    gain = body.gain.reshape(-1, 6, SHARED)
    expected = body.centre_mm.reshape(-1, 6)
    weight = INDEPENDENT_FRAMES / body.gap_mm[joint] ** 2
    weighed = precision[joint]
    inner = np.linalg.inv(weight[:, None, None] * shares.normal + np.eye(6) * weighed[:, :, None])
    # centre = inner (weight slope + precision (expected + gain u)), with the shared unknowns u
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
    # tolerances scale with the hand, so that no size has an advantage from smaller gaps
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


DECISIVE = 4.0
"""Log posterior odds above which a mistake is reported."""
MOST = 4
"""Largest number of mistakes that are reported."""
OPEN_MM, CLOSER, CLOSED_MM = 5.0, 0.33, 40.0
"""Rms gap of joints without known anatomy: above which mistakes are looked for; largest ratio and largest
value after a correction."""
AWAY_MM, AWAY_LOG_SD = 600.0, 0.8
"""Median distance of receivers from the transmitter, and SD of its logarithm (our estimate)."""
MOVED_MM = 2.0
"""Displacement of a joint's centre above which a correction affects the joint."""
BETTER = 0.95
"""Ratio of median gaps below which joints close better."""
CLOSES, WIDER_MM = 0.8, 0.5
"""Largest ratio of median gaps after and before a correction of axes; largest increase of the median gap of
the joints concerned by any other correction."""


@dataclass(frozen=True)
class Mistake:
    """An accepted hypothesis, values of the evidence for its sentence, and its gain in log likelihood."""

    hypothesis: Hypothesis
    evidence: Values
    gain: float


@dataclass(frozen=True)
class Search:
    """The mistakes found, likeliest first, the motion with all of them undone, and the fit to that motion."""

    mistakes: tuple[Mistake, ...]
    motion: SampledMotion
    explanation: Explanation


def find_mistakes(motion: SampledMotion, body: ExpectedBody, hypotheses: Sequence[Hypothesis]) -> Search:
    """Find the mistakes of a motion, one after another.

    In each round the likeliest hypothesis is accepted and undone if its log odds exceed DECISIVE; at most
    MOST are accepted.

    Parameters
    ----------
    motion : SampledMotion
        Sampled poses.
    body : ExpectedBody
        Expected joints.
    hypotheses : sequence of Hypothesis
        Mistakes to test.

    Returns
    -------
    Search
        Accepted mistakes, and the fit with all of them undone.

    """
    mistakes: list[Mistake] = []
    left = list(hypotheses)
    while True:
        explanation = _explain(motion, body, left)
        gains = (
            explanation.total[1:]
            - explanation.total[0]
            - np.array([hypothesis_left.penalty for hypothesis_left in left])
        )
        gains[_opens(body, explanation, left)] = -np.inf
        if not body.has_anatomy.any():
            gains += _away(motion, left)
            gap = np.sqrt((explanation.gap_mm**2).mean(-1))
            closes = (gap[0] > OPEN_MM) & (gap[1:] < CLOSER * gap[0]) & (gap[1:] < CLOSED_MM)
            unscaled = np.array([hypothesis.kind != "units" for hypothesis in left], bool)
            gains[~closes & unscaled] = -np.inf
        best = int(np.argmax(gains)) if len(gains) else 0
        if len(mistakes) == MOST or not len(gains) or gains[best] < DECISIVE:
            break
        chosen = left[best]
        undone = chosen.undo(motion)
        before, after = Joints.of(motion, explanation), Joints.of(undone, explanation, best + 1)
        mirrors = chosen.kind == "wrong-hand"
        matters = effect(body, before, after, chosen.places, other_hand=mirrors)
        evidence = {**_evidence(body, explanation, best + 1, chosen), **matters}
        mistakes.append(Mistake(chosen, evidence, float(gains[best])))
        motion = undone
        left = [  # drop rivals of the accepted mistake: same kind and same receivers
            other
            for other in left
            if (other.kind, other.places) != (chosen.kind, chosen.places) or chosen.kind == "digits-swapped"
        ]
    return Search(tuple(mistakes), motion, explanation)


def _opens(
    body: ExpectedBody, explanation: Explanation, hypotheses: Sequence[Hypothesis]
) -> npt.NDArray[np.bool_]:
    """Return which hypotheses (H,) widen the gaps of the joints concerned, or do not narrow them as required.

    Hypotheses on units are exempt: they scale all gaps, and are judged by the hand's size.
    """
    by_places = {places: body.concerned(places) for places in {h.places for h in hypotheses}}
    rows = [by_places[h.places] for h in hypotheses]
    concerned = np.array(rows, bool).reshape(len(rows), len(body.names))
    count = concerned.sum(-1, keepdims=True)
    gap_mm = np.array([np.broadcast_to(explanation.gap_mm[0], concerned.shape), explanation.gap_mm[1:]])
    ordered_mm = np.sort(np.where(concerned, gap_mm, np.inf))
    halves = [np.take_along_axis(ordered_mm, at[None], -1) for at in ((count - 1) // 2, count // 2)]
    before_mm, after_mm = np.mean(halves, axis=0)[..., 0]  # medians of the joints concerned
    kinds = np.array([h.kind for h in hypotheses], str)
    most_mm = np.where(kinds == "axes-mirrored", CLOSES * before_mm, before_mm + WIDER_MM)
    return np.asarray((kinds != "units") & (after_mm > most_mm))


def _away(motion: SampledMotion, hypotheses: Sequence[Hypothesis]) -> Array:
    """Return by how much hypotheses raise the log likelihood of the receivers' distance, (H,)."""
    distances_mm = []
    for moved in (motion, *(hypothesis.undo(motion) for hypothesis in hypotheses)):
        distance = np.linalg.norm(moved.position_mm, axis=-1)
        medians = [
            np.median(d[seen]) for d, seen in zip(distance.T, moved.valid.T, strict=True) if seen.any()
        ]
        if not medians or min(medians) <= 0:  # a receiver is at the origin throughout
            return np.zeros(len(hypotheses))
        distances_mm.append(float(np.median(medians)))
    unlikely = 0.5 * (np.log(np.array(distances_mm) / AWAY_MM) / AWAY_LOG_SD) ** 2
    return np.asarray(unlikely[0] - unlikely[1:])


def explain_joints(motion: SampledMotion, body: ExpectedBody) -> Joints:
    """Fit the expected body to a motion without any hypothesis."""
    return Joints.of(motion, _explain(motion, body, []))


def _explain(motion: SampledMotion, body: ExpectedBody, hypotheses: Sequence[Hypothesis]) -> Explanation:
    """Fit the motion as it is (row 0) and with each hypothesis undone; unaffected joints are reused."""
    every: Index = np.arange(len(body.names))
    ends = body.ends.tolist()
    joints_at = {
        places: every if places is None else every[[not places.isdisjoint(pair) for pair in ends]]
        for places in {hypothesis.places for hypothesis in hypotheses}
    }
    series, choice, count = [(every, motion)], [every], len(every)
    for hypothesis in hypotheses:
        row, touched = every.copy(), joints_at[hypothesis.places]
        row[touched] = np.arange(count, count + len(touched))
        count += len(touched)
        series.append((touched, hypothesis.undo(motion)))
        choice.append(row)
    return explain(body, joint_shares(body, series), np.array(choice))


def _evidence(body: ExpectedBody, explained: Explanation, row: int, hypothesis: Hypothesis) -> Values:
    """Return the evidence for a hypothesis: the joint and the measure whose log likelihood gains most."""
    if hypothesis.kind == "units" and hypothesis.variant.startswith("positions"):
        if body.has_anatomy.any():
            return _compare_measure("scale", explained.scale, row)
        return _compare_measure(
            "reach", np.median(np.linalg.norm(explained.centre_mm, axis=-1), axis=(1, 2)), row
        )
    gained = [part[row] - part[0] for part in (explained.closing, explained.placed, explained.turning)]
    closes = explained.gap_mm[row] < 0.8 * explained.gap_mm[0]
    # with an absurd hand size, the likelihood of a gap may improve although the gap stays as wide
    if body.has_anatomy.all():
        gained[0] = np.where(closes, gained[0], -np.inf)
    measure, joint = np.unravel_index(int(np.argmax(gained)), np.shape(gained))
    name = body.names[joint]
    if measure == 0 or not body.has_anatomy[joint]:
        return _compare_measure("gap", explained.gap_mm[:, joint], row) | {"joint": name}
    if measure == 1:
        return _compare_measure("place", explained.off_mm[:, joint], row) | {"joint": name}
    before, after = explained.angles_deg[0, joint], explained.angles_deg[row, joint]
    part = int(np.argmax(np.abs(before - after).max(0)))
    return {
        "seen": "turn",
        "joint": name,
        "angle": ("flexion", "abduction", "axial rotation")[part],
        "least": before[0, part],
        "most": before[2, part],
        "least_after": after[0, part],
        "most_after": after[2, part],
    }


def _compare_measure(what: str, of_rows: Array, row: int) -> dict[str, Any]:
    """Return a measure as declared and with a hypothesis undone, as values of a finding."""
    return {"seen": what, "before": of_rows[0], "after": of_rows[row]}


@dataclass(frozen=True)
class Joints:
    """Fitted joints of a motion. centre_mm : (J, 2, 3) in both receivers' frames. gap_mm : (J,) rms gap."""

    motion: SampledMotion
    centre_mm: Array
    gap_mm: Array
    scale: float

    @classmethod
    def of(cls, motion: SampledMotion, explanation: Explanation, row: int = 0) -> Joints:
        """Take the joints of one hypothesis (row) of an explanation."""
        scale = float(explanation.scale[row])
        return cls(motion, explanation.centre_mm[row], explanation.gap_mm[row], scale)


def effect(
    body: ExpectedBody,
    before: Joints,
    after: Joints,
    places: Collection[int] | None = None,
    *,
    other_hand: bool = False,
) -> Values:
    """Return the effect of undoing a mistake: median gap, number of joints that move, and the hand's scale.

    before, after : joints with and without the mistake. places : receivers whose joints are compared, None
    for all. other_hand : whether undoing the mistake mirrors the world.
    """
    concerned = body.concerned(places)
    gaps = [float(np.median(joints.gap_mm[concerned])) for joints in (before, after)]
    moved = (_apart_mm(body, before, after, mirrored=other_hand)[concerned] > MOVED_MM).sum()
    values: dict[str, float | int | str] = {
        "effect": "closer" if gaps[1] < BETTER * gaps[0] else "no-closer" if moved else "none",
        "gap_before_mm": gaps[0],
        "gap_after_mm": gaps[1],
        "moved": int(moved),
        "joints": int(concerned.sum()),
    }
    if body.has_anatomy.any():
        values |= {"scale_before": before.scale, "scale_after": after.scale}
    return values


def _apart_mm(body: ExpectedBody, before: Joints, after: Joints, *, mirrored: bool) -> Array:
    """Return how far joint centres move in the world's axes, (J,); the larger median of both receivers."""
    signs = MIRROR if mirrored else np.ones(3)
    first, second = (
        np.einsum("kjeab,jeb->kjea", joints.motion.rotation[:, body.ends], joints.centre_mm)
        for joints in (before, after)
    )
    apart = np.linalg.norm(first - signs * second, axis=-1)
    apart[~before.motion.valid[:, body.ends]] = np.nan
    seen = np.isfinite(apart).any(0)
    return np.asarray(np.where(seen, np.nanmedian(np.where(seen, apart, 0.0), axis=0), 0.0).max(-1))
