"""Find mistakes that explain a recording: hypotheses against what was declared, the likeliest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.checks.expected_body import ExpectedBody
from shukotsu.checks.explanation import Explanation, explain, joint_shares
from shukotsu.checks.hypotheses import Hypothesis
from shukotsu.checks.mistake_effect import Joints, effect
from shukotsu.checks.sampled_motion import Motion
from shukotsu.sentences.finding_sentences import Values
from shukotsu.skeleton.rotations import Array

DECISIVE = 4.0
"""Log of the odds, the mistake's own rareness taken off, from which on it is named."""
MOST = 4
OPEN_MM, CLOSER, CLOSED_MM = 5.0, 0.33, 40.0
"""Of joints that anatomy does not know: from which gap on a mistake is looked for, how much less it must be
put right, and how small."""
AWAY_MM, AWAY_LOG_SD = 600.0, 0.8
"""From a tracker's transmitter to what is worn (ours)."""


@dataclass(frozen=True)
class Mistake:
    """A hypothesis that holds. evidence : values of what is seen of it and how much it matters, see
    `finding_sentences`. gain : in log likelihood, less penalty.
    """

    hypothesis: Hypothesis
    evidence: Values
    gain: float


@dataclass(frozen=True)
class Search:
    """Hold the mistakes found, likeliest first, and how well the motion is explained without them."""

    mistakes: tuple[Mistake, ...]
    motion: Motion
    explanation: Explanation


def find_mistakes(motion: Motion, body: ExpectedBody, hypotheses: Sequence[Hypothesis]) -> Search:
    """Find the mistakes of a motion, each decisively likelier than none with those before it undone."""
    found: list[Mistake] = []
    left = list(hypotheses)
    while True:
        explanation = _explain(motion, body, left)
        gains = explanation.total[1:] - explanation.total[0] - np.array([one.penalty for one in left])
        if not body.known.any():
            gains += _away(motion, left)
            gains[~_closes(explanation, left)] = -np.inf
        best = int(np.argmax(gains)) if len(gains) else 0
        if len(found) == MOST or not len(gains) or gains[best] < DECISIVE:
            break
        chosen = left[best]
        undone = chosen.undo(motion)
        before, after = Joints.of(motion, explanation), Joints.of(undone, explanation, best + 1)
        mirrors = chosen.kind == "wrong-hand"
        matters = effect(body, before, after, chosen.places, other_hand=mirrors)
        evidence = {**_evidence(body, explanation, best + 1, chosen), **matters}
        found.append(Mistake(chosen, evidence, float(gains[best])))
        motion = undone
        left = [one for one in left if not _same_matter(one, chosen)]
    return Search(tuple(found), motion, explanation)


def _closes(explanation: Explanation, hypotheses: Sequence[Hypothesis]) -> npt.NDArray[np.bool_]:
    """Say whether joints that anatomy does not know close, and much better than as declared."""
    gap = np.sqrt((explanation.gap_mm**2).mean(-1))
    scaled = np.array([one.kind == "units" for one in hypotheses], bool)
    return np.asarray(scaled | ((gap[0] > OPEN_MM) & (gap[1:] < CLOSER * gap[0]) & (gap[1:] < CLOSED_MM)))


def _away(motion: Motion, hypotheses: Sequence[Hypothesis]) -> Array:
    """Compute how much likelier (H,) each hypothesis makes the receivers' distance from the transmitter.

    Where a segment is at the origin all along the others are counted from it, and nothing is known.
    """
    distances_mm = [_distance_mm(own) for own in (motion, *(one.undo(motion) for one in hypotheses))]
    if not all(distances_mm):
        return np.zeros(len(hypotheses))
    unlikely = 0.5 * (np.log(np.array(distances_mm) / AWAY_MM) / AWAY_LOG_SD) ** 2
    return np.asarray(unlikely[0] - unlikely[1:])


def _distance_mm(motion: Motion) -> float:
    """The median over receivers that are seen; 0 where one of them is at the origin all along."""
    distance = np.linalg.norm(motion.position_mm, axis=-1)
    own = [np.median(d[seen]) for d, seen in zip(distance.T, motion.valid.T, strict=True) if seen.any()]
    return float(np.median(own)) if own and min(own) > 0 else 0.0


def _same_matter(one: Hypothesis, chosen: Hypothesis) -> bool:
    """Say whether a hypothesis has nothing to say once the chosen one is undone."""
    return one.kind == chosen.kind and one.places == chosen.places and chosen.kind != "digits-swapped"


def explained(motion: Motion, body: ExpectedBody) -> Joints:
    """Give the joints of a motion as it is."""
    return Joints.of(motion, _explain(motion, body, []))


def _explain(motion: Motion, body: ExpectedBody, hypotheses: Sequence[Hypothesis]) -> Explanation:
    """Explain the motion as it is (first) and with each hypothesis undone; what it leaves alone is shared."""
    joints = range(len(body.names))
    series = [(joint, motion) for joint in joints]
    choice = [list(joints)]
    for hypothesis in hypotheses:
        undone, row = hypothesis.undo(motion), list(joints)
        for joint in joints:
            if hypothesis.places is None or hypothesis.places & set(body.ends[joint].tolist()):
                row[joint] = len(series)
                series.append((joint, undone))
        choice.append(row)
    return explain(body, joint_shares(body, series), np.array(choice))


def _evidence(body: ExpectedBody, explained: Explanation, row: int, hypothesis: Hypothesis) -> Values:
    """Return the evidence of the joint and the measure that gain most."""
    if hypothesis.kind == "units" and hypothesis.variant.startswith("positions"):
        if body.known.any():
            return _seen("scale", explained.scale, row)
        return _seen("reach", np.median(np.linalg.norm(explained.centre_mm, axis=-1), axis=(1, 2)), row)
    gained = [part[row] - part[0] for part in (explained.closing, explained.placed, explained.turning)]
    closes = explained.gap_mm[row] < 0.8 * explained.gap_mm[0]
    if body.known.all():  # of a hand whose size was absurd a gap may close better and be as wide
        gained[0] = np.where(closes, gained[0], -np.inf)
    measure, joint = np.unravel_index(int(np.argmax(gained)), np.shape(gained))
    name = body.names[joint]
    if measure == 0 or not body.known[joint]:
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
