"""A study small enough to be run a thousand times, its undisturbed results, and the commands of its jobs."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.processes import ROOT, run_python
from benchmarks.study_runs import Study
from schemas.files import file_sha256
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import Simulated, simulate

FRAMES = 200
PATIENCE_S = 900.0
"""How long a run of the study may take."""
RECORDING = "rom.csv"
ALL_STAGES = ("rigid", "whole-hand")
"""Models with which every stage has something to do."""


@dataclass(frozen=True)
class Command:
    """A job's own command: arguments behind `python -m workflow.job`, and files relative to the study."""

    name: str
    argv: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class SmallStudy:
    """A study's folder, and the SHA-256 of its files after an undisturbed run."""

    folder: Path
    expected: Mapping[str, str]

    def copied(self, folder: Path) -> SmallStudy:
        """The same study elsewhere, as deep in the file system."""
        shutil.copytree(self.folder, folder, symlinks=True)
        return SmallStudy(folder, self.expected)

    def state(self) -> dict[str, str]:
        """SHA-256 of the files as they are now."""
        return state_of(self.folder)

    def start(self, *before: str, cores: int = 2) -> subprocess.Popen[str]:
        """Start the study's one command in a session of its own; before : a command that runs it."""
        return subprocess.Popen(
            [*before, *snakemake(self.folder, cores)],
            cwd=self.folder,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def damage(self, removed: Sequence[str] = ()) -> str:
        """Say what is half written, and what is lost besides what was removed before; empty for nothing."""
        state = self.state()
        strange = [path for path, digest in state.items() if self.expected.get(path) != digest]
        lost = [
            path
            for path in self.expected
            if path not in state and not any(path == out or path.startswith(f"{out}/") for out in removed)
        ]
        return (f"half written: {strange[:3]} " if strange else "") + (f"lost: {lost[:3]}" if lost else "")

    def incomplete(self) -> str:
        """Say where the files differ from the undisturbed run's, and which temporary ones are left."""
        left = [path.name for path in (self.folder / "results").rglob(".*.tmp")]
        return self.damage() + (f"left: {left[:3]}" if left else "")


def state_of(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a study by its path there; logs, and hidden files, are none of its results."""
    files = {}
    for path in folder.rglob("*"):
        name = path.relative_to(folder)
        if (
            path.is_file()
            and "logs" not in name.parts
            and not any(part.startswith(".") for part in name.parts)
        ):
            files[name.as_posix()] = file_sha256(path)
    return files


def snakemake(folder: Path, cores: int) -> list[str]:
    """The command that runs the study of a folder."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    return [*command, "--configfile", str(folder / "study.yaml"), "--cores", str(cores)]


def make_study(folder: Path, models: Sequence[str] = ALL_STAGES, exports: str = "bvh, bids") -> SmallStudy:
    """Write a study of one short recording and run it undisturbed."""
    folder.mkdir(parents=True)
    write_recording(folder / RECORDING, recording())
    (folder / "recordings.tsv").write_text(
        f"subject\thand\ttask\trole\tfile\n01\tright\trom\tboth\t{RECORDING}\n", "utf-8"
    )
    head = "study: study\nrecordings: recordings.tsv\nlayout: liberty16\n"
    (folder / "study.yaml").write_text(
        f"{head}models: [{', '.join(models)}]\nexports: [{exports}]\n", "utf-8"
    )
    study = SmallStudy(folder, {})
    finish(study.start())
    return SmallStudy(folder, state_of(folder))


def recording(seed: int = 5) -> Simulated:
    """A recording of one hand; another seed moves otherwise."""
    return simulate("01", "right", "rom", seed, Realism.full(), FRAMES)


def finish(process: subprocess.Popen[str], timeout_s: float = PATIENCE_S) -> str:
    """Wait for a run that is to end with 0; give what it said. RuntimeError where it does not."""
    try:
        said = process.communicate(timeout=timeout_s)[1]
    except subprocess.TimeoutExpired:
        kill(process, whole_session=True)
        raise RuntimeError(f"still running after {timeout_s:.0f} s") from None
    if process.returncode:
        raise RuntimeError(f"ended with {process.returncode}: {said[-10_000:]}")
    return said


def kill(process: subprocess.Popen[str], *, whole_session: bool) -> bool:
    """Kill a run's main process, or its session; whether it was still running."""
    running = process.poll() is None
    if whole_session:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            running = False
    elif running:
        process.kill()
    process.wait()
    if process.stderr is not None:
        process.stderr.close()
    return running


def commands_of(study: SmallStudy) -> list[Command]:
    """The commands of a study's jobs, and of simulating and decoding, their files made."""
    commands = []
    for job in Study(study.folder).jobs():
        words = shlex.split(job.command.split(" -m workflow.job ", 1)[1])
        words = words[: next((at for at, word in enumerate(words) if word in (">", "2>")), len(words))]
        inputs = tuple(name for name in job.inputs if name and not name.startswith(".."))
        commands.append(Command(job.rule, tuple(words), inputs, tuple(job.outputs)))
    who = ("--subject", "01", "--hand", "right", "--task", "rom")
    simulated, streamed, decoded = "sim/rom.parquet", "sim/rom.arrows", "sim/records.parquet"
    made = ("stages.simulate", *who, "--seed", "1", "--frames", str(FRAMES), "--out", simulated)
    stream = ("stages.capture", "emulate", "--recording", simulated, "--layout", "liberty16")
    decode = ("stages.capture", "decode", "--in", streamed, "--out", decoded)
    for argv in (made, (*stream, "--archive", streamed), decode):
        run_python("-m", *argv, folder=study.folder)
    truths = tuple(path.relative_to(study.folder).as_posix() for path in study.folder.glob("sim/*_truth/*"))
    commands.append(Command("simulate", made, (), (simulated, *truths)))
    commands.append(Command("decode", decode, (streamed,), (decoded,)))
    return commands
