"""What changes while a study runs: its input, its results, the clock; and two runs at once."""

from __future__ import annotations

import random
import shutil
import subprocess
import time
from pathlib import Path

from benchmarks.faults.outcome import Limit, Row, Tries, not_tried
from benchmarks.faults.small_study import PATIENCE_S, RECORDING, SmallStudy, finish, kill, recording
from benchmarks.faults.study_kills import reset
from stages.simulate.recording import write_recording

MOST_TIMES = 6
BEHIND = "same bytes, or Snakemake says clock skew and the same command completes when that is over"
CLOCK_SKEW = "clock skew"
"""In what Snakemake says where it stops because the clock is behind its files."""


def rows(limit: Limit, seed: int, study: SmallStudy) -> list[Row]:
    """Try each some times; less often where fewer kills of studies are asked for."""
    times, chance = min(MOST_TIMES, max(1, limit.kills // 10)), random.Random(seed)
    start = time.monotonic()
    reset(study)
    finish(study.start())
    seconds = time.monotonic() - start
    deleted = Tries("results deleted while a study runs", "exit other than 0, or made again; then same bytes")
    twice = Tries("two runs of a study at once", "one completes, the other says so and ends with 2")
    stepped = Tries("files a day ahead of the clock, after a kill", BEHIND)
    faked = Tries("the clock a day back, after a kill (faketime)", BEHIND)
    changed = Tries("an input changed while a study runs", "the next run's results are all of the new file")
    program, other = shutil.which("faketime"), _of_other_recording(study)
    for turn in range(times):
        if turn and limit.is_over:
            break
        twice.add(_twice(study, chance))
        deleted.add(_deleted(study, chance, seconds))
        changed.add(_changed(other, chance, seconds))
        stepped.add(_behind(study, chance, seconds))
        if program:
            faked.add(_behind(study, chance, seconds, program))
    last = faked.row() if program else not_tried(faked.fault, "faketime is not installed")
    return [deleted.row(), twice.row(), changed.row(), stepped.row(), last]


def _deleted(study: SmallStudy, chance: random.Random, seconds: float) -> str:
    """Remove one result, or all of the subject, at a random moment."""
    reset(study)
    run, subject = study.start(), study.folder / "results" / "study" / "sub-01"
    end = time.monotonic() + chance.uniform(0.4, 1) * seconds
    while time.monotonic() < end and run.poll() is None:
        time.sleep(0.05)
    files = sorted(path for path in subject.rglob("*.parquet") if not path.name.startswith("."))
    path = subject if not files or chance.random() < 0.3 else chance.choice(files)
    shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
    under_way = not (subject.parent / "report.html").exists()
    said = run.communicate(timeout=PATIENCE_S)[1]
    if under_way and run.returncode == 0 and study.incomplete():
        return f"{path.name}: exit 0 with results missing: {said[-200:]}"
    return _completes(study)


def _completes(study: SmallStudy, *before: str) -> str:
    try:
        finish(study.start(*before))
    except RuntimeError as error:
        return str(error)
    return study.incomplete()


def _twice(study: SmallStudy, chance: random.Random) -> str:
    """Start a second run at most three seconds behind the first."""
    reset(study)
    first = study.start()
    time.sleep(chance.uniform(0, 3))
    second = study.start()
    said = [run.communicate(timeout=PATIENCE_S)[1] for run in (first, second)]
    codes = sorted((first.returncode, second.returncode))
    if codes != [0, 2] or not any("another run of it is under way" in text for text in said):
        return f"exit {codes}: {said[1][-300:]}"
    return study.incomplete()


def _behind(study: SmallStudy, chance: random.Random, seconds: float, faketime: str = "") -> str:
    """Kill a run, and go on a day before its files: they are set ahead, or (faketime) the clock back."""
    reset(study)
    run = study.start()
    time.sleep(chance.uniform(0.3, 1) * seconds)
    kill(run, whole_session=True)
    if not faketime:
        _set_times(study.folder, "tomorrow")
    before = ("env", "FAKETIME_DONT_FAKE_MONOTONIC=1", faketime, "-f", "-1d") if faketime else ()
    problem = _completes(study, *before)
    if CLOCK_SKEW in problem:
        _set_times(study.folder, "now")
        problem = _completes(study)
    return problem


def _set_times(folder: Path, when: str) -> None:
    """Give all files of a study's results a time; that of tomorrow is what a clock set back leaves."""
    find = ["find", str(folder / "results"), "-exec", "touch", "-d", when, "{}", "+"]
    subprocess.run(find, check=False)  # nothing is there yet after an early kill


def _of_other_recording(study: SmallStudy) -> SmallStudy:
    """The same study as it is of another recording."""
    other = study.copied(study.folder.with_name("other"))
    write_recording(other.folder / RECORDING, recording(seed=6))
    reset(other)
    finish(other.start())
    return SmallStudy(other.folder, other.state())


def _changed(study: SmallStudy, chance: random.Random, seconds: float) -> str:
    """Put the study's recording in the place of another while a run of it is under way."""
    file = study.folder / RECORDING
    new = file.read_bytes()
    reset(study)
    write_recording(file, recording())
    run = study.start()
    time.sleep(chance.uniform(0.3, 1) * seconds)
    file.write_bytes(new)
    run.communicate(timeout=PATIENCE_S)
    return _completes(study)
