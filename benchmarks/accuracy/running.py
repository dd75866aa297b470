"""Run the accuracy benchmark: people by scenarios over processes, tables as they get ready, page, figure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context

from benchmarks.accuracy import estimators, peers, tables
from benchmarks.accuracy.errors import HandScore
from benchmarks.accuracy.figure import write_figure
from benchmarks.accuracy.literature import NOISES, RANGES_DEG, ProtocolRow, protocol_row
from benchmarks.accuracy.people import PersonResult, person_result
from benchmarks.accuracy.scenarios import (
    ABLATED,
    ARTEFACTS,
    FOREIGN_ARTEFACTS,
    FULL,
    STIFF,
    SWEEPS,
    Scenario,
)
from benchmarks.page import write_tables
from benchmarks.text_table import TextTable

SWEEP_PEOPLE = 5
BASELINE = "full range of motion, fewer hands"
RUNS, PEER_RUNS = 1000, 40
SWEPT = (estimators.PAPER, estimators.ANATOMICAL, estimators.WHOLE)


def run(seeds: Sequence[int], *, write: bool = False, processes: int = 2) -> Iterator[TextTable]:
    """Give the tables over both hands of the people of those seeds; write : page and figure in docs/, too."""
    missing = peers.missing()
    everyone = (*estimators.OURS, *(name for name in peers.PEERS if name not in missing))
    skin = [ARTEFACTS[0], ARTEFACTS[1], FULL, ARTEFACTS[2], *FOREIGN_ARTEFACTS]
    plan = {FULL: everyone, STIFF: everyone} | {one: SWEPT for one in (*skin, *SWEEPS) if one != FULL}
    plan[ABLATED] = (estimators.WHOLE, *estimators.ABLATIONS)
    made: list[TextTable] = []
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        people = {
            scenario: [
                pool.submit(person_result, seed, scenario, wanted)
                for seed in (seeds[:SWEEP_PEOPLE] if scenario in (*SWEEPS, ABLATED) else seeds)
            ]
            for scenario, wanted in plan.items()
        }
        protocol = [
            pool.submit(protocol_row, noise, range_deg, RUNS, PEER_RUNS)
            for noise in NOISES
            for range_deg in RANGES_DEG
        ]
        for table in _tables(people, protocol, seeds, skin, missing):
            made.append(table)
            yield table
        if write:
            scores = {one.name: by_estimator(people[one]) for one in people}
            write_figure(scores, [one.name for one in skin], _whose(seeds))
            command = f"python -m benchmarks accuracy --seeds {min(seeds)}-{max(seeds)} --write"
            write_tables("accuracy.md", made, [f"As printed by `{command}`:"])


def _tables(
    people: dict[Scenario, list[Future[PersonResult]]],
    protocol: list[Future[ProtocolRow]],
    seeds: Sequence[int],
    skin: Sequence[Scenario],
    missing: dict[str, str],
) -> Iterator[TextTable]:
    """Every table, as soon as what it needs is there."""
    whose = _whose(seeds)
    full, stiff = by_estimator(people[FULL]), by_estimator(people[STIFF])
    yield tables.estimator_table(FULL.name, full, missing, whose)
    yield tables.joint_table(full, whose)
    yield tables.estimator_table(STIFF.name, stiff, missing, whose)
    tips = [tip for one in people[FULL] for tip in one.result().tips]
    yield tables.tip_table(tips, whose)
    yield tables.ablation_table(by_estimator(people[ABLATED]), _whose(seeds[:SWEEP_PEOPLE]))
    scores = {scenario.name: by_estimator(found) for scenario, found in people.items()}
    scores[BASELINE] = by_estimator(people[FULL][:SWEEP_PEOPLE])
    order = [*(one.name for one in skin), STIFF.name, BASELINE, *(one.name for one in SWEEPS)]
    yield tables.sweep_table(
        order, scores, f"the same people, the first {SWEEP_PEOPLE} where hands are fewer"
    )
    yield tables.literature_table([row.result() for row in protocol], RUNS, PEER_RUNS)
    aims = [*tables.targets(scores, [one.name for one in skin]), *tables.tip_targets(tips)]
    yield tables.target_table(aims, whose)


def by_estimator(people: Sequence[Future[PersonResult]]) -> dict[str, list[HandScore]]:
    """The scores of all people by estimator."""
    found: dict[str, list[HandScore]] = {}
    for person in people:
        for one in person.result().scores:
            found.setdefault(one.estimator, []).append(one)
    return found


def _whose(seeds: Sequence[int]) -> str:
    return f"{2 * len(seeds)} simulated hands (seeds {min(seeds)} to {max(seeds)}, right and left)"
