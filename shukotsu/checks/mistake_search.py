"""Find mistakes that explain a recording, the likeliest first, and how much each matters to its joints."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shukotsu.checks.expected_body import ExpectedBody
from shukotsu.checks.explanation import Explanation, explain, joint_shares
from shukotsu.checks.hypotheses import Hypothesis
from shukotsu.hand.rotations import Array
from shukotsu.hand.sampled_motion import MIRROR, Motion
from shukotsu.study.findings import Values

DECISIVE = 4.0
"""Log of the odds, the mistake's own rareness taken off, from which on it is named."""
MOST = 4
OPEN_MM, CLOSER, CLOSED_MM = 5.0, 0.33, 40.0
"""Gaps of joints without known anatomy: from which on a mistake is looked for, how much less it must be put
right, and how small."""
AWAY_MM, AWAY_LOG_SD = 600.0, 0.8
"""Distance from a tracker's transmitter to what is worn (ours)."""
MOVED_MM = 2.0
"""A joint whose centre moves farther on its bones is another joint."""
BETTER = 0.95
"""Share of the median gap below which joints close better."""


@dataclass(frozen=True)
class Mistake:
    """A hypothesis that holds, values of what is seen of it (`finding_sentences`), gain in log likelihood."""

    hypothesis: Hypothesis
    evidence: Values
    gain: float


@dataclass(frozen=True)
class Search:
    """The mistakes found, likeliest first, and how well the motion is explained without them."""

    mistakes: tuple[Mistake, ...]
    motion: Motion
    explanation: Explanation


def find_mistakes(motion: Motion, body: ExpectedBody, hypotheses: Sequence[Hypothesis]) -> Search:
    """Find the mistakes of a motion, each decisively likelier than none with those before it undone."""
    mistakes: list[Mistake] = []
    left = list(hypotheses)
    while True:
        explanation = _explain(motion, body, left)
        gains = (
            explanation.total[1:]
            - explanation.total[0]
            - np.array([hypothesis_left.penalty for hypothesis_left in left])
        )
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
        left = [  # what has something to say once the chosen one is undone
            other
            for other in left
            if (other.kind, other.places) != (chosen.kind, chosen.places) or chosen.kind == "digits-swapped"
        ]
    return Search(tuple(mistakes), motion, explanation)


def _away(motion: Motion, hypotheses: Sequence[Hypothesis]) -> Array:
    """Return how much likelier (H,) hypotheses make the receivers' distance from the transmitter."""
    distances_mm = []
    for moved in (motion, *(hypothesis.undo(motion) for hypothesis in hypotheses)):
        distance = np.linalg.norm(moved.position_mm, axis=-1)
        medians = [
            np.median(d[seen]) for d, seen in zip(distance.T, moved.valid.T, strict=True) if seen.any()
        ]
        if not medians or min(medians) <= 0:  # one is at the origin all along
            return np.zeros(len(hypotheses))
        distances_mm.append(float(np.median(medians)))
    unlikely = 0.5 * (np.log(np.array(distances_mm) / AWAY_MM) / AWAY_LOG_SD) ** 2
    return np.asarray(unlikely[0] - unlikely[1:])


def explained(motion: Motion, body: ExpectedBody) -> Joints:
    """The joints of a motion as it is."""
    return Joints.of(motion, _explain(motion, body, []))


def _explain(motion: Motion, body: ExpectedBody, hypotheses: Sequence[Hypothesis]) -> Explanation:
    """Explain the motion as it is (first) and with each hypothesis undone; what it leaves alone is shared."""
    every, ends = np.arange(len(body.names)), body.ends.tolist()
    series, choice, count = [(every, motion)], [every], len(every)
    for hypothesis in hypotheses:
        places, row = hypothesis.places, every.copy()
        touched = every if places is None else every[[not places.isdisjoint(pair) for pair in ends]]
        row[touched] = np.arange(count, count + len(touched))
        count += len(touched)
        series.append((touched, hypothesis.undo(motion)))
        choice.append(row)
    return explain(body, joint_shares(body, series), np.array(choice))


def _evidence(body: ExpectedBody, explained: Explanation, row: int, hypothesis: Hypothesis) -> Values:
    """The evidence of the joint and the measure that gain most."""
    if hypothesis.kind == "units" and hypothesis.variant.startswith("positions"):
        if body.has_anatomy.any():
            return _seen("scale", explained.scale, row)
        return _seen("reach", np.median(np.linalg.norm(explained.centre_mm, axis=-1), axis=(1, 2)), row)
    gained = [part[row] - part[0] for part in (explained.closing, explained.placed, explained.turning)]
    closes = explained.gap_mm[row] < 0.8 * explained.gap_mm[0]
    if body.has_anatomy.all():  # of a hand whose size was absurd a gap may close better and be as wide
        gained[0] = np.where(closes, gained[0], -np.inf)
    measure, joint = np.unravel_index(int(np.argmax(gained)), np.shape(gained))
    name = body.names[joint]
    if measure == 0 or not body.has_anatomy[joint]:
        return _seen("gap", explained.gap_mm[:, joint], row) | {"joint": name}
    if measure == 1:
        return _seen("place", explained.off_mm[:, joint], row) | {"joint": name}
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


def _seen(what: str, of_rows: Array, row: int) -> dict[str, Any]:
    """A measure as declared and with a hypothesis undone."""
    return {"seen": what, "before": of_rows[0], "after": of_rows[row]}


@dataclass(frozen=True)
class Joints:
    """A motion's J joints as they are explained. centre_mm : (J, 2, 3) in both receivers. gap_mm : (J,)."""

    motion: Motion
    centre_mm: Array
    gap_mm: Array
    scale: float

    @classmethod
    def of(cls, motion: Motion, explanation: Explanation, row: int = 0) -> Joints:
        """Those of one hypothesis of an explanation."""
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
    """Compare joints without a mistake: the joints' median gap, how many of them move, the hand's scale.

    places : receivers whose joints count; None: all. other_hand : whether undoing it mirrors the world.
    """
    concerned = np.isin(body.ends, list(places)).any(1) if places else np.ones(len(body.names), bool)
    concerned = concerned if concerned.any() else ~concerned
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
    """Return how far (J,) joints move from the receiver that sees more of it, in the world's axes."""
    signs = MIRROR if mirrored else np.ones(3)
    first, second = (
        np.einsum("kjeab,jeb->kjea", joints.motion.rotation[:, body.ends], joints.centre_mm)
        for joints in (before, after)
    )
    apart = np.linalg.norm(first - signs * second, axis=-1)
    apart[~before.motion.valid[:, body.ends]] = np.nan
    seen = np.isfinite(apart).any(0)
    return np.asarray(np.where(seen, np.nanmedian(np.where(seen, apart, 0.0), axis=0), 0.0).max(-1))
