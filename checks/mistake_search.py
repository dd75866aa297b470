"""Which mistakes explain a recording: hypotheses against what was declared, the likeliest undone first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from checks.expected_body import ExpectedBody
from checks.explaining import Explanation, explain, joint_shares
from checks.hypotheses import Hypothesis
from checks.sampled_motion import Motion
from skeleton.rotations import Array

DECISIVE = 4.0
"""Log of the odds, the mistake's own rareness taken off, from which on it is named."""
MOST = 4
CLOSER, CLOSED_MM = 0.5, 40.0
"""Of joints that anatomy does not know: how much less their gap must be put right, and how small."""


@dataclass(frozen=True)
class Mistake:
    """A hypothesis that holds. evidence : what is seen of it. gain : in log likelihood, less penalty."""

    hypothesis: Hypothesis
    evidence: str
    gain: float


@dataclass(frozen=True)
class Search:
    """What came of it: the mistakes, likeliest first, and how well the motion is explained without them."""

    mistakes: tuple[Mistake, ...]
    motion: Motion
    explanation: Explanation


def find_mistakes(motion: Motion, body: ExpectedBody, hypotheses: Sequence[Hypothesis]) -> Search:
    """Find the mistakes of a motion, each decisively likelier than none with those before it undone."""
    found: list[Mistake] = []
    left = list(hypotheses)
    while True:
        explanation = _explain(motion, body, left)
        gains = explanation.total[1:] - explanation.total[0] - [one.penalty for one in left]
        if not body.known.any():
            gains[~_closes(explanation, left)] = -np.inf
        best = int(np.argmax(gains)) if len(gains) else 0
        if len(found) == MOST or not len(gains) or gains[best] < DECISIVE:
            break
        chosen = left[best]
        evidence = _evidence(body, explanation, best + 1, chosen)
        found.append(Mistake(chosen, evidence, float(gains[best])))
        motion = chosen.undo(motion)
        left = [one for one in left if not _same_matter(one, chosen)]
    return Search(tuple(found), motion, explanation)


def _closes(explanation: Explanation, hypotheses: Sequence[Hypothesis]) -> npt.NDArray[np.bool_]:
    """Whether joints that anatomy does not know close, and much better than as declared."""
    gap = np.sqrt((explanation.gap_mm**2).mean(-1))
    scaled = np.array([one.kind == "units" for one in hypotheses], bool)
    return np.asarray(scaled | ((gap[1:] < CLOSER * gap[0]) & (gap[1:] < CLOSED_MM)))


def _same_matter(one: Hypothesis, chosen: Hypothesis) -> bool:
    """Whether a hypothesis has nothing to say once the chosen one is undone."""
    return one.kind == chosen.kind and one.places == chosen.places and chosen.kind != "digits-swapped"


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


def _evidence(body: ExpectedBody, explained: Explanation, row: int, hypothesis: Hypothesis) -> str:
    """Say what is seen, by the joint and the measure that gain most."""
    if hypothesis.kind == "units" and hypothesis.what.startswith("the positions"):
        if body.known.any():
            before, after = explained.scale[0], explained.scale[row]
            return f"the hand comes out {before:.2g} times the average size, put right {after:.2g} times"
        before, after = (np.median(np.linalg.norm(explained.centre_mm[i], axis=-1)) for i in (0, row))
        return f"joints come out {before:.2g} mm from the receivers, put right {after:.0f} mm"
    gained = [part[row] - part[0] for part in (explained.closing, explained.placed, explained.turning)]
    closes = explained.gap_mm[row] < 0.8 * explained.gap_mm[0]
    if body.known.all():  # of a hand whose size was absurd a gap may close better and be as wide
        gained[0] = np.where(closes, gained[0], -np.inf)
    measure, joint = np.unravel_index(int(np.argmax(gained)), np.shape(gained))
    name = body.names[joint]
    if measure == 0 or not body.known[joint]:
        before, after = explained.gap_mm[0, joint], explained.gap_mm[row, joint]
        return f"put right, the gap of {name} falls from {before:.1f} to {after:.1f} mm"
    if measure == 1:
        before, after = explained.off_mm[0, joint], explained.off_mm[row, joint]
        return f"{name} is {before:.0f} mm from where an average hand has it, put right {after:.0f} mm"
    before, after = explained.angles_deg[0, joint], explained.angles_deg[row, joint]
    part = int(np.argmax(np.abs(before - after).max(0)))
    word = ("flexion", "abduction", "axial rotation")[part]
    return f"the {word} of {name} is {_range(before[:, part])}, put right {_range(after[:, part])}"


def _range(angles_deg: Array) -> str:
    return f"{angles_deg[0]:.0f} to {angles_deg[2]:.0f} deg"
