"""The accuracy benchmark: people by scenarios over processes, tables as they get ready, page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace

from benchmarks.accuracy import accuracy_tables, estimators
from benchmarks.accuracy.scenarios import ABLATED, CLEAN, FULL, SIDE_BY_SIDE, STIFF, SWEEPS, Scenario
from benchmarks.accuracy.score import Estimate, HandScore, score
from benchmarks.accuracy.tip_scores import TipError, tip_errors
from benchmarks.accuracy.trials import N_FRAMES, Trial, record
from benchmarks.benchmark_table import TextTable, workers

SWEEP_PEOPLE = 5
BASELINE = "blend, fewer hands"
SWEPT = (estimators.PAPER, estimators.ANATOMICAL, estimators.WHOLE)
COMPARED = (*SWEPT, estimators.LENGTHS, estimators.MEASURED)

HANDS = ("right", "left")


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


def _counted(one: HandScore, ending: str) -> HandScore:
    """The score with those joints alone whose names end so."""
    return replace(one, joints=tuple(joint for joint in one.joints if joint.joint.endswith(ending)))


People = Mapping[Scenario, Sequence[Future[PersonResult]]]


def run(seeds: Sequence[int], *, scenarios: Sequence[Scenario] | None = None) -> Iterator[TextTable]:
    """Give the tables over both hands of the people of those seeds.

    scenarios : these side by side, and nothing else.
    """
    with workers() as pool:
        if scenarios:
            people = _submitted(pool, seeds, dict.fromkeys(scenarios, COMPARED))
            yield from _side_by_side(people, _hands_of(seeds))
        else:
            yield from _tables(_submitted(pool, seeds, _everything()), seeds)


def _everything() -> dict[Scenario, Sequence[str]]:
    """Estimators that are run, by scenario."""
    compared: dict[Scenario, Sequence[str]] = dict.fromkeys(SWEEPS, SWEPT)
    compared |= dict.fromkeys(SIDE_BY_SIDE, COMPARED)
    compared |= dict.fromkeys((FULL, STIFF), estimators.OURS)
    return compared | {ABLATED: (estimators.WHOLE, *estimators.ABLATIONS)}


def _submitted(
    pool: ProcessPoolExecutor, seeds: Sequence[int], compared: Mapping[Scenario, Sequence[str]]
) -> People:
    """Every person in every scenario, on its way; fewer people where there are many scenarios."""
    return {
        scenario: [
            pool.submit(person_result, seed, scenario, names)
            for seed in (seeds[:SWEEP_PEOPLE] if scenario in (*SWEEPS, ABLATED) else seeds)
        ]
        for scenario, names in compared.items()
    }


def _side_by_side(people: People, hands: str) -> Iterator[TextTable]:
    """The scenarios that are there beside each other, and what is lost without noise and skin."""
    scores = {one.name: by_estimator(people[one]) for one in SIDE_BY_SIDE if one in people}
    yield accuracy_tables.scenario_table(scores, COMPARED, hands)
    yield accuracy_tables.length_table(scores, SWEPT, hands)
    if CLEAN.name in scores:
        yield accuracy_tables.direction_table(scores[CLEAN.name], SWEPT, hands)


def _tables(people: People, seeds: Sequence[int]) -> Iterator[TextTable]:
    """Every table, as soon as what it needs is there."""
    hands = _hands_of(seeds)
    yield from _side_by_side(people, hands)
    full, stiff = by_estimator(people[FULL]), by_estimator(people[STIFF])
    yield accuracy_tables.estimator_table(FULL.name, full, hands)
    yield accuracy_tables.joint_table(full, hands)
    yield accuracy_tables.estimator_table(STIFF.name, stiff, hands)
    tips = [tip for one in people[FULL] for tip in one.result().tips]
    yield accuracy_tables.tip_table(tips, hands)
    yield accuracy_tables.ablation_table(by_estimator(people[ABLATED]), _hands_of(seeds[:SWEEP_PEOPLE]))
    scores = {scenario.name: by_estimator(results) for scenario, results in people.items()}
    scores[BASELINE] = by_estimator(people[FULL][:SWEEP_PEOPLE])
    order = [BASELINE, *(one.name for one in SWEEPS)]
    yield accuracy_tables.sweep_table(order, scores, f"the same people, the first {SWEEP_PEOPLE}")
    yield accuracy_tables.target_table(
        [*accuracy_tables.targets(scores), *accuracy_tables.tip_targets(tips)], hands
    )


def by_estimator(people: Sequence[Future[PersonResult]]) -> dict[str, list[HandScore]]:
    """The scores of all people by estimator."""
    scores: dict[str, list[HandScore]] = {}
    for person in people:
        for one in person.result().scores:
            scores.setdefault(one.estimator, []).append(one)
    return scores


def _hands_of(seeds: Sequence[int]) -> str:
    return f"{2 * len(seeds)} simulated hands (seeds {min(seeds)} to {max(seeds)}, right and left)"
