"""Twelve pianists, two groups, three sessions: is a known effect found, and do sem and stated sd hold?"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.benchmark_table import Cell, TextTable, write_tables
from benchmarks.processes import ROOT, run_process
from schemas.results import Results
from schemas.tables import read_table
from stages.compare_movement.level_differences import difference_rows
from stages.compare_movement.movement_values import QUANTITIES, Recorded
from stages.compare_movement.repeatability import reliability_rows
from stages.simulate.random_hand import FLEXION, JOINTS, hand_of
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import Simulated, simulate
from stages.simulate.task_motion import Motion, move

if TYPE_CHECKING:
    import pandas as pd

PAGE = "pianists.md"
SEED = 7300
PIANISTS = tuple(f"P{number:02}" for number in range(1, 13))
SESSIONS = ("1", "2", "3")
HAND, TASK = "right", "opposition"
FRAMES = {"rom": 3600, TASK: 2400}
MODELS = ("rigid", "whole-hand")
JOINT, GAIN = "index_pip", 1.3
"""Group A moves this joint so many times as far as the same hands would in group B."""

SUBJECT_SD_DEG, RETEST_SD_DEG, EFFECTS_DEG = 6.0, 1.5, (0.0, 12.0, 18.0)
"""Of drawn studies: between subjects, of a session, and what group A moves more."""
DRAWN_ANGLES = ("index_mcp flexion", f"{JOINT} flexion", "thumb_ip flexion")


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--drawn", type=int, default=500, help="studies of drawn numbers (500)")
    parser.add_argument("--simulated", type=int, default=1, help="studies that are simulated and run (1)")
    parser.add_argument("--write", action="store_true", help=f"put the tables into docs/{PAGE}")


def run(drawn: int = 500, simulated: int = 1, write: bool = False) -> Iterator[TextTable]:
    """Give the tables: drawn numbers through the statistics, simulated recordings through the pipeline."""
    tables = [drawn_studies(drawn)]
    yield tables[0]
    if simulated:
        tables += simulated_studies(simulated)
        yield from tables[1:]
    if write:
        command = f"python -m benchmarks pianists --drawn {drawn} --simulated {simulated} --write"
        write_tables(PAGE, tables, command)


def group_of(subject: str) -> str:
    """A or B, in turn."""
    return "AB"[PIANISTS.index(subject) % 2]


# --- drawn numbers ------------------------------------------------------------------------------------------


def drawn_studies(studies: int) -> TextTable:
    """The statistics alone on numbers whose effect and spread are known."""
    rows: list[tuple[Cell, ...]] = []
    for effect_deg in EFFECTS_DEG:
        rng = np.random.default_rng(SEED)
        results = [_drawn_study(rng, effect_deg) for _ in range(studies)]
        shares = (100.0 * float(np.mean(column)) for column in zip(*results, strict=True))
        rows.append((effect_deg, *shares))
    return TextTable(
        f"Drawn studies: {len(PIANISTS)} pianists, {len(SESSIONS)} sessions, {studies} studies a row",
        (
            "effect, deg:.0f",
            "found, %:.1f",
            "in its interval, %:.1f",
            "another joint called different, %:.1f",
            "sem in its interval, %:.1f",
            "stated sd holds, %:.1f",
        ),
        rows,
        f"Group A moves {JOINT} so much more. Subjects differ by {SUBJECT_SD_DEG:g} deg (1 sigma), sessions "
        f"by {RETEST_SD_DEG:g} deg, which is also what is stated. Found: p below 5 %, corrected over "
        f"{len(DRAWN_ANGLES)} angles.",
    )


def _drawn_study(rng: np.random.Generator, effect_deg: float) -> tuple[float, ...]:
    import pandas as pd

    recordings = pd.DataFrame(product(PIANISTS, SESSIONS), columns=["subject", "session"])
    recordings = recordings.assign(hand=HAND, task=TASK, trial="", left_out="")
    recordings["group"] = recordings["subject"].map(group_of)
    parts = []
    for of in DRAWN_ANGLES:
        own = np.repeat(rng.normal(60.0, SUBJECT_SD_DEG, len(PIANISTS)), len(SESSIONS))
        effect = effect_deg * (of == DRAWN_ANGLES[1]) * (recordings["group"] == "A")
        value = own + effect + rng.normal(0.0, RETEST_SD_DEG, len(recordings))
        parts.append(recordings.assign(model="drawn", of=of, value=value, sd=RETEST_SD_DEG))
    numbers, everything = pd.concat(parts), Recorded(recordings, ("group",))
    differences = {row["of"]: row for row in difference_rows(QUANTITIES[0], numbers, everything)}
    moved = differences[DRAWN_ANGLES[1]]
    repeated = list(reliability_rows(QUANTITIES[0], numbers, everything))
    return (
        moved["p_max_t"] <= 0.05,
        moved["low"] <= effect_deg <= moved["high"],
        any(row["p_max_t"] <= 0.05 for of, row in differences.items() if of != DRAWN_ANGLES[1]),
        float(np.mean([row["sem_low"] <= RETEST_SD_DEG <= row["sem_high"] for row in repeated])),
        float(np.mean([row["held_percent"] for row in repeated])) / 100.0,
    )


# --- simulated recordings -----------------------------------------------------------------------------------


def simulated_studies(studies: int) -> Iterator[TextTable]:
    """Whole studies: recordings of hands that put the receivers on three times, through the workflow."""
    effects: list[tuple[Cell, ...]] = []
    repeated: list[tuple[Cell, ...]] = []
    for number in range(studies):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            true_deg = write_study(folder, SEED + number)
            tables = run_study(folder)
            effects += _effect_rows(number, tables["movement_differences"], true_deg)
            repeated += _repeated_rows(number, tables["movement_reliability"])
    yield TextTable(
        f"Simulated studies: group A moves {JOINT} {GAIN:g} times as far",
        ("study:d", "model", "true difference, deg:.1f", "measured:.1f", "low:.1f", "high:.1f", "p:.3f",
         "others called different:d"),
        effects,
        "Flexion's range of motion in opposition, mean of three sessions a subject. True: of the same "
        "subjects' simulated angles.",
    )  # fmt: skip
    yield TextTable(
        f"Simulated studies: the same movement, receivers put on {len(SESSIONS)} times",
        (
            "study:d",
            "model",
            "number",
            "angles:d",
            "sem, deg, median:.2f",
            "largest:.2f",
            "held by stated sd, %:.1f",
        ),
        repeated,
        "Over all joint angles with a number. Held: differences between two sessions of a subject within "
        "1.96 of their stated sd.",
    )


def write_study(folder: Path, seed: int) -> Mapping[str, float]:
    """Simulate the recordings and write the study; give each subject's true range of JOINT, in deg."""
    true_deg, lines = {}, ["subject\tsession\thand\ttask\trole\tfile"]
    for subject in PIANISTS:
        for session, task in product(SESSIONS, FRAMES):
            file = f"recordings/{subject}_{session}_{task}.parquet"
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            write_recording(folder / file, _recording(subject, session, task, seed))
            role = "evaluation" if task == TASK else "calibration"
            lines.append("\t".join([subject, session, HAND, task, role, file]))
        angle = np.degrees(_motion(subject, TASK, seed).angles_rad[:, JOINTS.index(JOINT), FLEXION])
        true_deg[subject] = float(np.subtract(*np.percentile(angle, [97.5, 2.5])))
    (folder / "recordings.tsv").write_text("\n".join(lines) + "\n", "utf-8")
    people = ["subject\tgroup", *(f"{subject}\t{group_of(subject)}" for subject in PIANISTS)]
    (folder / "participants.tsv").write_text("\n".join(people) + "\n", "utf-8")
    (folder / "study.yaml").write_text(
        "study: pianists\nrecordings: recordings.tsv\nparticipants: participants.tsv\nlayout: liberty16\n"
        f"models: [{', '.join(MODELS)}]\nfactors: [group, session]\n",
        "utf-8",
    )
    return true_deg


def _motion(subject: str, task: str, seed: int) -> Motion:
    """What the subject does, the same in every session; group A goes further in JOINT than the task asks."""
    realism = Realism.full()
    motion = move(subject, HAND, task, seed, hand_of(subject, HAND, seed, realism), realism, FRAMES[task])
    if task != TASK or group_of(subject) != "A":
        return motion
    angles = motion.angles_rad.copy()
    angles[:, JOINTS.index(JOINT), FLEXION] *= GAIN
    return replace(motion, angles_rad=angles)


def _recording(subject: str, session: str, task: str, seed: int) -> Simulated:
    return simulate(
        subject, HAND, task, seed, Realism.full(), FRAMES[task],
        session=session, change=lambda _: _motion(subject, task, seed),
    )  # fmt: skip


def run_study(folder: Path) -> Mapping[str, pd.DataFrame]:
    """Run the workflow up to the comparisons; give the tables."""
    from schemas.movement_tables import MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY

    results = Results(folder / "results" / "pianists")
    tables = (MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY)
    command = ["snakemake", "--snakefile", str(ROOT / "Snakefile"), "--directory", str(folder)]
    command += ["--configfile", str(folder / "study.yaml"), "--cores", "2", "--quiet"]
    targets = [str(results.study_table(table.name).relative_to(folder)) for table in tables]
    run_process([sys.executable, "-m", *command, "--", *targets], folder)
    return {table.name: read_table(results.study_table(table.name), table).to_pandas() for table in tables}


def _effect_rows(number: int, table: pd.DataFrame, true_deg: Mapping[str, float]) -> list[tuple[Cell, ...]]:
    """How the groups' difference compares with the true one, under every model."""
    means = {group: np.mean([v for s, v in true_deg.items() if group_of(s) == group]) for group in "AB"}
    own = table.query("factor == 'group' and quantity == 'range_deg'")
    rows: list[tuple[Cell, ...]] = []
    for model, of_model in own.groupby("model", sort=False):
        moved = of_model[of_model["of"] == f"{JOINT} flexion"].iloc[0]
        others = int((of_model.loc[of_model["of"] != moved["of"], "p_max_t"] <= 0.05).sum())
        values = (moved["difference"], moved["low"], moved["high"], moved["p_max_t"])
        rows.append((number, str(model), float(means["A"] - means["B"]), *map(float, values), others))
    return rows


def _repeated_rows(number: int, table: pd.DataFrame) -> list[tuple[Cell, ...]]:
    """Sem over all angles, and how often the stated sd holds."""
    rows: list[tuple[Cell, ...]] = []
    own: Any = table.query("across == 'session' and quantity in ('range_deg', 'median_deg')")
    for (model, quantity), angles in own.groupby(["model", "quantity"], sort=False):
        held = angles["held_percent"].dropna()
        sem = angles["sem"]
        share = float(held.mean()) if len(held) else None
        rows.append((number, model, quantity, len(angles), float(sem.median()), float(sem.max()), share))
    return rows
