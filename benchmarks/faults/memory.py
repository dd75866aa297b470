"""Every stage with too little address space: one sentence and exit 2, or whole results."""

from __future__ import annotations

import os
import random
import resource
import subprocess
import sys

from benchmarks.faults.forked_job import Ended
from benchmarks.faults.outcome import REFUSED, Limit, Row, Tries
from benchmarks.faults.small_study import Command, SmallStudy, commands_of, state_of
from benchmarks.processes import ROOT

LEAST_MB, MOST_MB = 50, 900
SIZES = 4
"""Of each command, at random: one in each quarter."""


def rows(limit: Limit, seed: int, study: SmallStudy) -> list[Row]:
    """Run every command under limits of its address space, as a process of its own."""
    chance, commands = random.Random(seed), commands_of(study)
    study = SmallStudy(study.folder, state_of(study.folder))
    tries = Tries(f"too little memory ({LEAST_MB} to {MOST_MB} MB of address space)", REFUSED)
    step = (MOST_MB - LEAST_MB) / SIZES
    chance.shuffle(commands)
    for command in commands:
        if limit.is_over:
            break
        for quarter in range(SIZES):
            size_mb = int(LEAST_MB + step * (quarter + chance.random()))
            ended = run_limited(study, command, size_mb)
            problem = ended.refusal or study.damage()
            tries.add(f"{command.name} at {size_mb} MB: {problem}" if problem else "")
    return [tries.row()]


def run_limited(study: SmallStudy, command: Command, size_mb: int) -> Ended:
    """Run a command as a process of that much address space."""
    size = size_mb << 20
    done = subprocess.run(
        [sys.executable, "-m", "workflow.job", *command.argv],
        cwd=study.folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (size, size)),
    )
    return Ended(done.returncode, done.stderr, 0.0)
