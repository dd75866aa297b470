"""One simulated person, both hands, by every estimator that is compared: the work of one process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from benchmarks import peers
from benchmarks.accuracy import estimators
from benchmarks.accuracy.scenarios import FULL, STIFF, Scenario
from benchmarks.accuracy.score import Estimate, HandScore, score
from benchmarks.accuracy.tip_scores import TipError, tip_errors
from benchmarks.accuracy.trials import N_FRAMES, Trial, record

HANDS = ("right", "left")
PEER_STEP = 4
"""Published software gets one frame in four, since it takes up to a second a joint for all of them. Skin
wanders for half a second, so 60 Hz tell it what 240 Hz do: all frames move its centres by 0.2 mm and their
errors by 0.1 mm (medians of 16 joints, seeds 3 and 41)."""


@dataclass(frozen=True)
class PersonResult:
    """All errors on both hands of one person in one scenario."""

    scenario: str
    scores: tuple[HandScore, ...]
    tips: tuple[TipError, ...]


def person_result(
    seed: int, scenario: Scenario, names: Sequence[str], n_frames: int = N_FRAMES
) -> PersonResult:
    """Record both hands of a person and score every estimator; in FULL the fingertips of another task too."""
    trials = [record(seed, hand, scenario, n_frames) for hand in HANDS]
    scores = [score(name, trial, estimate) for trial in trials for name, estimate in _one_hand(trial, names)]
    fits = estimators.whole_hands(trials, names)
    for name, fitted in fits.items():
        for trial, (fit, seconds) in zip(trials, fitted, strict=True):
            scores.append(score(name, trial, estimators.of_fit(name, trial, fit, seconds)))
    tips: list[TipError] = []
    if scenario == FULL:
        for i, hand in enumerate(HANDS):
            held_out = record(seed, hand, STIFF, n_frames)
            tips += tip_errors(trials[i], held_out, {name: fitted[i][0] for name, fitted in fits.items()})
    counted = tuple(_counted(one, scenario.counted) for one in scores)
    return PersonResult(scenario.name, counted, tuple(tips))


def _one_hand(trial: Trial, names: Sequence[str]) -> Iterator[tuple[str, Estimate]]:
    """Estimators that look at one hand alone, and joint by joint."""
    for name in names:
        if name in (estimators.PAPER, estimators.SCORE, estimators.SARA):
            yield name, estimators.joint_by_joint(trial, name)
        elif name == estimators.ANATOMICAL:
            yield name, estimators.anatomical(trial)
        elif name in peers.PEERS:
            yield name, estimators.published(trial, name, PEER_STEP)


def _counted(one: HandScore, ending: str) -> HandScore:
    """The score with those joints alone whose names end so."""
    return replace(one, joints=tuple(joint for joint in one.joints if joint.joint.endswith(ending)))
