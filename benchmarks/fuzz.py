"""Damaged input for every reader, decoder and configuration file: what raises, hangs or grows too large.

Coverage guides it where atheris is installed (`make fuzz`), else the damage is random; the table says which.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.benchmark_table import Cell, TextTable, write_tables
from benchmarks.processes import ROOT

PAGE, MARKS = "reliability.md", "fuzzing"
COLUMNS = ("target", "inputs:d", "edges:d", "failed:d", "crashed:d", "hung:d", "memory MB:.0f")


@dataclass(frozen=True)
class Outcome:
    """What came of a target's inputs.

    edges : of the program's Python code that were reached, 0 where nobody counted. failed : inputs at which
    something else than InputError of one sentence came out, or more memory was taken than is allowed.
    memory_mb : the most beyond what the process held at its start.
    """

    inputs: int
    edges: int
    failed: int
    crashed: int
    hung: int
    memory_mb: float

    @property
    def sound(self) -> bool:
        """Whether every input was taken as it must be."""
        return not (self.failed or self.crashed or self.hung)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--inputs", type=int, default=20_000, help="of all targets together (20000)")
    parser.add_argument("--seed", type=int, default=1, help="of the damage (1)")
    parser.add_argument("--minutes", type=float, help="by the clock, at most; targets keep their shares")
    parser.add_argument("--targets", nargs="*", help="these alone")
    parser.add_argument("--folder", type=Path, default=Path("failed-inputs"), help="for inputs that failed")
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{PAGE}")


def run(
    inputs: int = 20_000,
    seed: int = 1,
    minutes: float | None = None,
    targets: Sequence[str] | None = None,
    folder: Path = Path("failed-inputs"),
    write: bool = False,
) -> Iterator[TextTable]:
    """Give the table. SystemExit where an input failed, once all have been tried; their files are printed."""
    options = [f"--inputs={inputs}", f"--seed={seed}", f"--folder={folder.resolve()}"]
    options += [] if minutes is None else [f"--minutes={minutes}"]
    options += ["--targets", *targets] if targets else []
    paths = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    said = subprocess.run(
        [sys.executable, "-m", "fuzzing.worker", *options],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        check=True,
    )
    *failed, last = said.stdout.decode().splitlines()
    if failed:
        print(*failed, sep="\n", flush=True)
    found = json.loads(last)
    outcomes = {name: _outcome(counts) for name, counts in found["outcomes"].items()}
    table = _table(outcomes, guided=found["guided"])
    yield table
    if write:
        given = [f"--inputs {inputs} --seed {seed}", *([] if minutes is None else [f"--minutes {minutes:g}"])]
        write_tables(PAGE, [table], f"python -m benchmarks fuzz {' '.join(given)} --write", MARKS)
    if not all(outcome.sound for outcome in outcomes.values()):
        raise SystemExit(f"inputs failed; they are in {folder}")


def _outcome(counts: Mapping[str, int]) -> Outcome:
    done, edges, failed, crashed, hung = (
        counts[name] for name in ("done", "edges", "failures", "crashed", "hangs")
    )
    memory_mb = max(0, counts["memory_kb"] - counts["start_kb"]) * 1024 / 1e6
    return Outcome(done, edges, failed, crashed, hung, memory_mb)


def _table(outcomes: Mapping[str, Outcome], *, guided: bool) -> TextTable:
    rows: list[tuple[Cell, ...]] = [
        (name, own.inputs, own.edges or None, own.failed, own.crashed, own.hung, own.memory_mb)
        for name, own in outcomes.items()
    ]
    every = outcomes.values()
    sums = (sum(getattr(own, key) for own in every) for key in ("failed", "crashed", "hung"))
    largest = max(own.memory_mb for own in every)
    rows.append(("all", sum(own.inputs for own in every), None, *sums, largest))
    how = "guided by coverage (atheris)" if guided else "random damage, not guided by coverage"
    return TextTable(
        f"Damaged input, {how}",
        COLUMNS,
        rows,
        "Edges: places of the Python code that the inputs reached. Failed: anything but a result or one "
        "sentence of at most 400 letters came out, a warning among it, or one input took more than 300 MB "
        "and four times its size. Crashed: the process died. Hung: more than 10 s of a processor. Memory: "
        "the most that was held beyond what was there at the start, the fuzzer's own among it.",
    )
