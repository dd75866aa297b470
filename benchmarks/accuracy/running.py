"""The accuracy benchmark: people by scenarios over processes, tables as they get ready, page, figure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

from benchmarks import peers
from benchmarks.accuracy import accuracy_tables, estimators
from benchmarks.accuracy.accuracy_figure import write_figure
from benchmarks.accuracy.literature import NOISES, RANGES_DEG, ProtocolRow, protocol_row
from benchmarks.accuracy.scenarios import ABLATED, CLEAN, FULL, SIDE_BY_SIDE, STIFF, SWEEPS, Scenario
from benchmarks.accuracy.score import Estimate, HandScore, score
from benchmarks.accuracy.tip_scores import TipError, tip_errors
from benchmarks.accuracy.trials import N_FRAMES, Trial, record
from benchmarks.benchmark_table import TextTable, write_tables

SWEEP_PEOPLE = 5
BASELINE = "blend, fewer hands"
RUNS, PEER_RUNS = 1000, 40
SWEPT = (estimators.PAPER, estimators.ANATOMICAL, estimators.WHOLE)
COMPARED = (*SWEPT, estimators.LENGTHS, estimators.MEASURED)

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


People = Mapping[Scenario, Sequence[Future[PersonResult]]]


def run(
    seeds: Sequence[int],
    *,
    scenarios: Sequence[Scenario] | None = None,
    write: bool = False,
    processes: int = 2,
) -> Iterator[TextTable]:
    """Give the tables over both hands of the people of those seeds.

    scenarios : these side by side, and nothing else. write : page and figure in docs/, too.
    """
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        if scenarios:
            people = _submitted(pool, seeds, dict.fromkeys(scenarios, COMPARED))
            yield from _side_by_side(people, _hands_of(seeds))
            return
        missing = peers.missing_peers()
        people = _submitted(pool, seeds, _everything(missing))
        protocol = [
            pool.submit(protocol_row, noise, range_deg, RUNS, PEER_RUNS)
            for noise in NOISES
            for range_deg in RANGES_DEG
        ]
        shown: list[TextTable] = []
        for table in _tables(people, protocol, seeds, missing):
            shown.append(table)
            yield table
        if write:
            write_figure({one.name: by_estimator(people[one]) for one in people}, _hands_of(seeds))
            command = f"python -m benchmarks accuracy --seeds {min(seeds)}-{max(seeds)} --write"
            write_tables("accuracy.md", shown, command)


def _everything(missing: Mapping[str, str]) -> dict[Scenario, Sequence[str]]:
    """Estimators that are run, by scenario."""
    everyone = (*estimators.OURS, *(name for name in peers.PEERS if name not in missing))
    compared: dict[Scenario, Sequence[str]] = dict.fromkeys(SWEEPS, SWEPT)
    compared |= dict.fromkeys(SIDE_BY_SIDE, COMPARED)
    compared |= dict.fromkeys((FULL, STIFF), everyone)
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


def _tables(
    people: People, protocol: Sequence[Future[ProtocolRow]], seeds: Sequence[int], missing: Mapping[str, str]
) -> Iterator[TextTable]:
    """Every table, as soon as what it needs is there."""
    hands = _hands_of(seeds)
    yield from _side_by_side(people, hands)
    full, stiff = by_estimator(people[FULL]), by_estimator(people[STIFF])
    yield accuracy_tables.estimator_table(FULL.name, full, missing, hands)
    yield accuracy_tables.joint_table(full, hands)
    yield accuracy_tables.estimator_table(STIFF.name, stiff, missing, hands)
    tips = [tip for one in people[FULL] for tip in one.result().tips]
    yield accuracy_tables.tip_table(tips, hands)
    yield accuracy_tables.ablation_table(by_estimator(people[ABLATED]), _hands_of(seeds[:SWEEP_PEOPLE]))
    scores = {scenario.name: by_estimator(results) for scenario, results in people.items()}
    scores[BASELINE] = by_estimator(people[FULL][:SWEEP_PEOPLE])
    order = [BASELINE, *(one.name for one in SWEEPS)]
    yield accuracy_tables.sweep_table(order, scores, f"the same people, the first {SWEEP_PEOPLE}")
    yield accuracy_tables.literature_table([row.result() for row in protocol], RUNS, PEER_RUNS)
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
