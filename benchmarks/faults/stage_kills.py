"""SIGKILL at random moments of every stage, of import and decode."""

from __future__ import annotations

import itertools
import random
import shutil
import statistics
from pathlib import Path

from benchmarks.faults.forked_job import prepare, run_forked
from benchmarks.faults.outcome import Limit, Row, Tries
from benchmarks.faults.small_study import Command, SmallStudy, commands_of, state_of

SLOW, SHARE = 4.0, 4
"""A command that takes so many times the usual is killed in one turn of so many."""


def rows(limit: Limit, seed: int, study: SmallStudy) -> list[Row]:
    """Kill every command in turn, so often together; slow ones less often."""
    prepare()
    chance = random.Random(seed)
    commands = commands_of(study)
    seconds = {command: _undisturbed_s(command, study.folder) for command in commands}
    study = SmallStudy(study.folder, state_of(study.folder))
    usual_s = statistics.median(seconds.values())
    by_name = {command.name: Tries(f"SIGKILL of {command.name}") for command in commands}
    for turn in itertools.count():
        for command in commands:
            if limit.reached(sum(tries.tried for tries in by_name.values())):
                return [tries.row() for tries in by_name.values()]
            if turn % SHARE == 0 or seconds[command] < SLOW * usual_s:
                problem = kill_once(study, command, seconds[command], chance, afresh=chance.random() < 0.5)
                by_name[command.name].add(problem)
    raise AssertionError("endless")


def _undisturbed_s(command: Command, folder: Path) -> float:
    """Run it once for the bytes of what no study made, and once more for its time."""
    ends = [run_forked(command.argv, folder) for _ in range(2)]
    if any(end.code for end in ends):
        raise RuntimeError(f"{command.name} ended with {ends[-1].code}: {ends[-1].said}")
    return ends[-1].seconds


def kill_once(
    study: SmallStudy, command: Command, seconds: float, chance: random.Random, *, afresh: bool
) -> str:
    """Kill a command at a random moment, its outputs absent before or those of an earlier run; run it again.

    Gives what was not as promised. A command that ends before its moment is started again for another.
    """
    removed = command.outputs if afresh else ()
    while True:
        for path in (study.folder / name for name in removed):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        if run_forked(command.argv, study.folder, chance.uniform(0, seconds)).code < 0:
            break
    problem = study.damage(removed)
    again = run_forked(command.argv, study.folder)
    return problem or (f"then exit {again.code}: {again.said[-300:]}" if again.code else study.incomplete())
