"""Simulated hands against their truth: how far every estimator is off, and whether its sd says so."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

from benchmarks.accuracy import accuracy_tables, estimators
from benchmarks.accuracy.score import Estimate, HandScore, score
from benchmarks.accuracy.tip_scores import TipError, tip_errors
from benchmarks.accuracy.trials import BY_KEY, FULL, N_FRAMES, SIDE_BY_SIDE, STIFF, Scenario, Trial, record
from benchmarks.benchmark_table import TextTable, add_people, workers

N_HANDS, FIRST_SEED = 20, 5200
"""Of the documented run; seeds below are for development."""

SHOWN = (estimators.PAPER, estimators.WHOLE)
COMPARED = (*SHOWN, estimators.LENGTHS, estimators.MEASURED)

HANDS = ("right", "left")
WRITTEN_TO = "accuracy.md", "tables"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    add_people(parser, N_HANDS, FIRST_SEED)
    parser.add_argument(
        "--scenarios",
        type=_scenarios,
        help=f"run these alone, side by side, e.g. ct,blend: {', '.join(BY_KEY)}",
    )


def _scenarios(text: str) -> list[Scenario]:
    unknown = [key for key in text.split(",") if key not in BY_KEY]
    if unknown:
        raise argparse.ArgumentTypeError(f"{unknown[0]!r} is no scenario; expected of {', '.join(BY_KEY)}")
    return [BY_KEY[key] for key in text.split(",")]


@dataclass(frozen=True)
class PersonResult:
    """All errors on both hands of one person in one scenario."""

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
    return PersonResult(tuple(scores), tuple(tips))


def _one_hand(trial: Trial, names: Sequence[str]) -> Iterator[tuple[str, Estimate]]:
    """Estimators that look at one hand alone, and joint by joint."""
    for name in names:
        if name in (estimators.PAPER, estimators.SCORE, estimators.SARA):
            yield name, estimators.joint_by_joint(trial, name)


def run(
    n_hands: int = N_HANDS, seed: int = FIRST_SEED, *, scenarios: Sequence[Scenario] | None = None
) -> Iterator[TextTable]:
    """Give the tables over so many hands, right and left of each person.

    scenarios : these side by side, and nothing else.
    """
    seeds = range(seed, seed + max(1, n_hands // 2))
    hands = f"{2 * len(seeds)} simulated hands (seeds {min(seeds)} to {max(seeds)}, right and left)"
    with workers() as pool:
        people = {
            one: [
                pool.submit(person_result, own, one, _compared(one, alone=bool(scenarios))) for own in seeds
            ]
            for one in scenarios or SIDE_BY_SIDE
        }
        if not scenarios:
            full = by_estimator(people[FULL])
            yield accuracy_tables.estimator_table(FULL.name, full, hands)
            yield accuracy_tables.joint_table(full, hands)
            yield accuracy_tables.tip_table([tip for one in people[FULL] for tip in one.result().tips], hands)
            yield accuracy_tables.estimator_table(STIFF.name, by_estimator(people[STIFF]), hands)
        scores = {scenario.name: by_estimator(own) for scenario, own in people.items()}
        yield accuracy_tables.scenario_table(scores, COMPARED, hands)
        yield accuracy_tables.length_table(scores, SHOWN, hands)


def _compared(scenario: Scenario, *, alone: bool) -> Sequence[str]:
    return COMPARED if alone or scenario not in (FULL, STIFF) else estimators.OURS


def by_estimator(people: Sequence[Future[PersonResult]]) -> dict[str, list[HandScore]]:
    """The scores of all people by estimator."""
    scores: dict[str, list[HandScore]] = {}
    for person in people:
        for one in person.result().scores:
            scores.setdefault(one.estimator, []).append(one)
    return scores
