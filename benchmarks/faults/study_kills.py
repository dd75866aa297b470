"""SIGKILL at random moments of whole studies: of all its processes, or of Snakemake's own alone."""

from __future__ import annotations

import random
import shutil
import time

from benchmarks.faults.outcome import Limit, Row, Tries
from benchmarks.faults.small_study import RECORDING, SmallStudy, finish, kill

IN_A_ROW = 2
"""Runs that are killed, one going on after the other, before one may end."""


def rows(limit: Limit, seed: int, study: SmallStudy) -> list[Row]:
    """Kill runs of the study, so many together."""
    chance, seconds = random.Random(seed), _undisturbed_s(study)
    every, alone = (
        Tries("SIGKILL of a study, all its processes"),
        Tries("SIGKILL of a study, Snakemake alone"),
    )
    while not limit.reached(every.tried + alone.tried):
        tries = (every, alone)[every.tried > alone.tried]
        kill_in_a_row(study, seconds, chance, tries, whole_session=tries is every)
    return [every.row(), alone.row()]


def _undisturbed_s(study: SmallStudy) -> float:
    reset(study)
    start = time.monotonic()
    finish(study.start())
    return time.monotonic() - start


def reset(study: SmallStudy) -> None:
    """Take everything away that runs have made."""
    for name in ("results", ".snakemake"):
        shutil.rmtree(study.folder / name, ignore_errors=True)


def kill_in_a_row(
    study: SmallStudy, seconds: float, chance: random.Random, tries: Tries, *, whole_session: bool
) -> None:
    """Kill a fresh run and the one that goes on, and let the next one end."""
    reset(study)
    killed, problem = 0, ""
    for _ in range(IN_A_ROW):
        run = study.start()
        time.sleep(chance.uniform(0, seconds))
        killed += kill(run, whole_session=whole_session)
        problem = problem or _half_written(study)
    try:
        finish(study.start())
    except RuntimeError as error:
        problem = problem or str(error)
    problem = problem or study.incomplete()
    for _ in range(killed):
        tries.add(problem)


def _half_written(study: SmallStudy) -> str:
    results = [path for path in study.expected if path.startswith("results/")]
    return study.damage(results) + ("" if (study.folder / RECORDING).is_file() else " the recording is gone")
