"""The paper's stages on simulated hands: how far joints and tips are off, and whether the sd says so."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.accuracy.score import JOINT_TYPES
from benchmarks.benchmark_table import Cell, TextTable
from shukotsu.schemas.catalogue import JOINT_CENTRES, TIP_ERRORS
from shukotsu.schemas.layout import FINGER_MM
from shukotsu.schemas.parts import Part, parts_writer
from shukotsu.schemas.tables import Provenance, read_table, rows_of
from shukotsu.schemas.verdict import RADIUS_SD, VERDICTS, judged_joint
from shukotsu.stages.evaluate_skeletons.truth_errors import centre_errors
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.recording import write_recording
from shukotsu.stages.simulate.simulation import LAYOUT, Simulated, simulate
from shukotsu.stages.simulate.written_truth import write_truth

if TYPE_CHECKING:
    import pandas as pd

TASKS = ("opposition", "rom")
MODEL = "paper-fig4"
CONFIG = {"layout": LAYOUT, "model": MODEL}
ESTIMATED, TRUE = "estimated", "true"
COMPOUND = "MCP 4-5"
ALL = "all"
BINDINGS = ("first-frame", "least-squares")

SPREAD = ("median mm:.1f", "p90 mm:.1f", "> 5 mm %:.0f", "worst mm:.1f")

NO_CRIME = (
    "Simulator and estimator share no model of the skin: the paper's method has none, and the simulated skin "
    "saturates, lags and wanders."
)

Row = dict[str, Any]


def run(seeds: int = 20, n_frames: int | None = None, processes: int = 2) -> Iterator[TextTable]:
    """Give the tables over that many seeds, right and left hand of each."""
    import pandas as pd

    people = [(seed, hand, n_frames) for seed in range(seeds) for hand in ("right", "left")]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        hands = list(pool.map(paper_hand, *zip(*people, strict=True)))
    joints, tips = (pd.DataFrame([row for hand in hands for row in hand[i]]) for i in (0, 1))
    of = f"{len(hands)} simulated hands ({seeds} seeds, right and left), full realism, {MODEL}"
    for task in TASKS:
        yield centre_table(joints[joints["calibration"] == task], f"{task}, {of}")
    yield verdict_table(joints, of)
    yield tip_table(tips, of)


def paper_hand(seed: int, hand: str, n_frames: int | None = None) -> tuple[list[Row], list[Row]]:
    """Simulate a hand doing every task, solve it from each, replay all of them with each.

    Gives a row a joint and calibration: its error in mm, without numbers where it failed; and a row a digit,
    calibration, skeleton, binding and replayed recording: its mean tip error in mm.
    """
    simulated = {task: simulate("01", hand, task, seed, Realism.full(), n_frames) for task in TASKS}
    joints: list[Row] = []
    tips: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        poses = {task: _captured(folder / task, recording) for task, recording in simulated.items()}
        for task in TASKS:
            folders = {skeleton: folder / f"{task}-{skeleton}" for skeleton in (ESTIMATED, TRUE)}
            _solve_joints(folders[ESTIMATED], poses[task])
            true = _write_true_centres(folders[TRUE], simulated[task])
            for skeleton, place in folders.items():
                _replay(place, poses[task], list(poses.values()))
                rows = rows_of(read_table(place / "tip_errors.parquet", TIP_ERRORS))
                tips += [{**row, "calibration": task, "skeleton": skeleton} for row in rows]
            for row in rows_of(read_table(folders[ESTIMATED] / "projected_joints.parquet", JOINT_CENTRES)):
                off = {} if row["status"] == "failed" else centre_errors(row, true[row["joint"]])
                verdict = judged_joint(row, FINGER_MM)["verdict"]
                own = {"joint": row["joint"], "status": row["status"], "verdict": verdict}
                joints.append({"calibration": task, **own, **off})
    return joints, tips


def _stage(name: str, *argv: str, **options: object) -> None:
    """Run a stage in this process; RuntimeError where it fails."""
    argv = (*argv, *(f"--{option.replace('_', '-')}={value}" for option, value in options.items()))
    if status := import_module(f"shukotsu.stages.{name}.__main__").main(list(argv)):
        raise RuntimeError(f"stages.{name} {' '.join(argv)} ended with {status}")


def _captured(folder: Path, simulated: Simulated) -> Path:
    """Write a recording and capture it; give its poses."""
    recording, poses = folder / "recording.parquet", folder / "poses.parquet"
    write_recording(recording, simulated)
    keys = {"subject": simulated.subject, "hand": simulated.hand, "task": simulated.task}
    _stage("capture", "import", **{"in": recording}, out=poses, layout=LAYOUT, **keys)
    return poses


def _solve_joints(folder: Path, poses: Path) -> None:
    """Write the folder's projected_joints."""
    solutions = folder / "joint_solutions.parquet"
    _stage("solve_joints", **CONFIG, poses=poses, out=solutions)
    _stage("project_planes", **CONFIG, joints=solutions, out=folder / "projected_joints.parquet")


def _write_true_centres(folder: Path, simulated: Simulated) -> dict[str, Row]:
    """Write the true centres as if the model had solved them: the folder's projected_joints; give them."""
    write_truth(folder / "truth", simulated, Provenance())
    rows = list(rows_of(read_table(folder / "truth" / "joint_centres.parquet", JOINT_CENTRES)))
    with parts_writer(folder / "projected_joints.parquet", JOINT_CENTRES, Provenance()) as table:
        part = Part(simulated.hand, MODEL, subject=simulated.subject)
        table.rows(part, [{**row, "model": MODEL} for row in rows])
    return {row["joint"]: row for row in rows}


def _replay(folder: Path, calibration: Path, evaluated: Sequence[Path]) -> None:
    """Build a skeleton from the folder's projected_joints and write its tip_errors."""

    def files(**tables: str) -> dict[str, Path]:
        return {option: folder / f"{table}.parquet" for option, table in tables.items()}

    poses, config = ("--poses", *map(str, evaluated)), {**CONFIG, "calibration": calibration}
    made = files(out_joints="joint_centres", out_bones="bone_lengths", out="metacarpals")
    built = files(joints="joint_centres", bones="bone_lengths", metacarpals="metacarpals")
    _stage("estimate_metacarpals", *poses, **config, **files(joints="projected_joints"), **made)
    _stage("evaluate_tips", *poses, **config, **built, **files(out="tips", out_errors="tip_errors"))


def centre_table(joints: pd.DataFrame, of: str) -> TextTable:
    """Errors of the joint centres by joint type."""
    rows = [_centre_row(kind, joints[joints["joint"].isin(own)]) for kind, own in JOINT_TYPES.items()]
    sizes = [f"{name} mm:.1f" for name in ("median", "p90", "along axis", "across axis")]
    shares = ("> 5 mm %:.0f", "> 50 mm %:.1f", "worse half mm:.1f", "sd mm:.1f", "within 95 % radius %:.0f")
    return TextTable(
        f"paper_accuracy: joint centres solved from {of}",
        ("joints", "n:d", "failed:d", *sizes, *shares),
        [*rows, _centre_row(ALL, joints)],
        "Distance to the true centre in the child's receiver frame, its parts along and across the true axis "
        "(medians), and shares of it; then the worse of both halves (median) beside the sd stated for it "
        f"(median), and how often it is within {RADIUS_SD} sd: 95 % if the sd held everything. {NO_CRIME}",
    )


def _centre_row(kind: str, joints: pd.DataFrame) -> tuple[Cell, ...]:
    solved = joints[joints["status"] != "failed"]
    counts = (kind, len(joints), len(joints) - len(solved))
    if solved.empty:
        return (*counts, *[None] * 9)
    child, median = solved["error_mm"], solved.median(numeric_only=True)
    numbers = (child.quantile(0.5), child.quantile(0.9), median["along_mm"], median["across_mm"])
    shares = (100 * (child > 5).mean(), 100 * (child > 50).mean())
    worse = solved[["error_mm", "parent_error_mm"]].max(axis=1)
    covered = 100 * (worse <= RADIUS_SD * solved["sd_mm"]).mean()
    return (*counts, *map(float, (*numbers, *shares, worse.median(), median["sd_mm"], covered)))


def verdict_table(joints: pd.DataFrame, of: str) -> TextTable:
    """Errors of the joint centres by the verdict on them, compound joints apart."""
    compound = joints["joint"].isin(JOINT_TYPES[COMPOUND])
    rows: list[tuple[Cell, ...]] = []
    for task in TASKS:
        for kind, apart in ((f"all but {COMPOUND}", ~compound), (COMPOUND, compound)):
            for verdict in VERDICTS:
                some = joints[(joints["calibration"] == task) & apart & (joints["verdict"] == verdict)]
                child = some["error_mm"]
                numbers = (child.quantile(0.5), child.quantile(0.9), 100 * (child > 5).mean(), child.max())
                known: list[Cell] = [float(number) for number in numbers] if len(child) else [None] * 4
                rows.append((task, kind, verdict, len(child), *known))
    return TextTable(
        f"paper_accuracy: what the verdict on a joint is worth, {of}",
        ("solved from", "joints", "verdict", "n:d", *SPREAD),
        rows,
        "Distance to the true centre in the child's receiver frame. The verdict goes by the stated error: "
        f"{COMPOUND}, seen from the hand, have a palm that moves between, which residuals hardly show.",
    )


def tip_table(tips: pd.DataFrame, of: str) -> TextTable:
    """Tip errors of estimated and true skeletons, in the recording they were solved from and the other."""
    by = tips.groupby(["calibration", "skeleton", "held_out", "binding"])["mean_mm"]
    quantiles = by.quantile([0.5, 0.9]).unstack([-2, -1])
    rows: list[tuple[Cell, ...]] = []
    for task in TASKS:
        for held_out in (False, True):
            replayed = TASKS[1 - TASKS.index(task)] if held_out else task
            for skeleton in (ESTIMATED, TRUE):
                row = quantiles.loc[task, skeleton, held_out]
                numbers = [float(row[binding, share]) for binding in BINDINGS for share in (0.5, 0.9)]
                rows.append((task, replayed, "yes" if held_out else "no", skeleton, *numbers))
    heads = [f"{binding} {what}:.1f" for binding in BINDINGS for what in ("median mm", "p90 mm")]
    return TextTable(
        f"paper_accuracy: tip error, {of}",
        ("solved from", "replayed in", "held out", "skeleton", *heads),
        rows,
        "Mean distance over a recording of the replayed tip to the distal receiver, median and p90 over "
        "digits and hands; the true skeleton has the truth's centres and is replayed alike. The tip error is "
        "a sum of fit residuals: where the truth does no better than centres that are millimetres off, it "
        f"does not measure the skeleton. {NO_CRIME}",
    )
