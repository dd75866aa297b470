"""A made-up study with its results, written as the stages before the report write theirs.

Two subjects, one with a hostile name; two hands; one task. The second subject's left recording failed. On
the first subject's left hand the little DIP joint is weak and 300 mm off, the ring DIP joint failed. A
simulated study has a second task, rom, that calibrates only, and a truth.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from simulated_poses import write_poses

from shukotsu.paper.hand import is_whole
from shukotsu.report.study_results import StudyResults
from shukotsu.scores.comparisons import ComparedModels, compare_models, compare_study
from shukotsu.scores.observations import ScoredStudy
from shukotsu.study.layout import Layout, read_layout
from shukotsu.study.model import SkeletonModel, read_model
from shukotsu.study.results import MODEL_COMPARISONS, STUDY_TABLES, Results
from shukotsu.study.study import read_study
from shukotsu.study.verdict import AXIS_IN_PLANE, judged_bone, judged_joint, noted
from shukotsu.tables.catalogue import (
    BONE_TIP,
    DISTAL_RECEIVER,
    JOINT_ERRORS,
    RECORDINGS,
    SKELETON_SCORES,
    TABLES,
)
from shukotsu.tables.poses import Poses
from shukotsu.tables.subjects import path_token
from shukotsu.tables.typed_table import Provenance, Table, columns_from_rows, read_table, write_table

HOSTILE = 'A & <b>"x"'
FITTED_MODELS = ("paper-fig4", "whole-hand")
MODELS = ("paper-fig3-rest", "paper-fig3", "paper-fig4", "paper-fig4-corrected", "rigid")
UNSEEN = slice(100, 160)
"""Frames in which the index finger's distal receiver is not valid."""
NO_SOURCE = Provenance((("recording.csv", "0" * 64),), {})

# Joints of a right hand, mm from the wrist centre: right (towards the thumb), distal, dorsal.
POINTS = {
    "thumb": [(26.5, 25.0, -10.5), (43.0, 54.2, -23.2), (57.0, 80.1, -33.3), (67, 100, -41)],
    "index": [(22.2, 80.9, 11.0), (29.7, 122.2, 18.3), (33.0, 147.1, 19.5), (35.0, 165, 19.5)],
    "middle": [(4.7, 80.6, 11.5), (6.4, 124.8, 17.7), (7.7, 153.8, 19.7), (9.7, 173, 18.7)],
    "ring": [(-9.9, 79.3, 5.7), (-13.4, 119.5, 7.0), (-15.7, 144.3, 7.6), (-16.7, 162, 8.6)],
    "little": [(-19.5, 71.2, -3.4), (-24.8, 106.7, -6.3), (-27.7, 127.4, -8.5), (-28.7, 144, -11.5)],
}


Row = dict[str, Any]
Rows = defaultdict[str, list[Row]]
"""Rows of the study-wide tables, by the tables' names."""


def make_study(
    folder: Path,
    *,
    n_frames: int = 300,
    models: tuple[str, ...] = MODELS,
    subjects: tuple[str, ...] = (),
    simulated: bool = False,
    compared: bool = False,
) -> tuple[Path, Path]:
    """Write a study file, its sheet and its results; return the study file and the results folder.

    compared : whether its models are compared, which takes most of the time; else these tables are empty.
    """
    subjects = subjects or ("S01", HOSTILE)
    rng = np.random.default_rng(7)
    study, results = folder / "study.yaml", folder / "results" / "made"
    sheet = ["subject\thand\ttask\trole\tfile"]
    rows: Rows = defaultdict(list)
    read = [read_model(name) for name in models]
    for subject in subjects:
        for hand in ("right", "left"):
            file = f"{path_token(subject)}-{hand}.csv"
            sheet.append(f"{subject}\t{hand}\topposition\tboth\t{file}")
            key = {"subject": subject, "hand": hand, "task": "opposition", "trial": ""}
            if subject == subjects[-1] and hand == "left" and len(subjects) > 1:
                _add_failed(rows, key, file)
                continue
            _add_hand(rows, results, key, file, n_frames, read, rng)
            _add_judgement(rows, key, read, simulated=simulated)
            if simulated:
                sheet.append(f"{subject}\t{hand}\trom\tcalibration\trom-{file}")
                rows["recordings"].append({**rows["recordings"][-1], "task": "rom", "role": "calibration"})
    study.write_text(
        f"study: made\nrecordings: sheet.tsv\nlayout: liberty16\nmodels: [{', '.join(models)}]\n"
        "exports: [bvh]\n" + ("simulation: {folder: ., seed: 1}\n" if simulated else ""),
        "utf-8",
    )
    (folder / "sheet.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    write_rows(results, rows)
    if compared:
        compare_study(read_study(study), Results(results))
    for name in () if compared else MODEL_COMPARISONS:
        write(results / f"{name}.parquet", TABLES[name], [])
    return study, results


def write_rows(results: Path, rows: Mapping[str, list[Row]]) -> None:
    """Write the study-wide tables, and beside them the tips."""
    for name in (*STUDY_TABLES, "tips"):
        write(results / f"{name}.parquet", TABLES[name], rows.get(name, []))


def write(path: Path, table: Table, rows: list[Row]) -> None:
    empty = lacking_text(table)
    write_table(path, table, columns_from_rows(table, [empty | row for row in rows]), NO_SOURCE)


def lacking_text(table: Table) -> dict[str, str]:
    """Empty text for every text column."""
    return {column.name: "" for column in table.columns if column.type == pa.string()}


def _add_failed(rows: Rows, key: dict[str, str], file: str) -> None:
    message = f"{file}: row 7, column x_mm: 'n/a' is not a number"
    row = key | {"role": "both", "file": file, "status": "failed", "message": message}
    rows["recordings"].append(row | {"n_frames": 0, "n_receivers": 0})
    where = {**_who(key), "task": key["task"], "stage": "capture"}
    rows["problems"].append(where | {"severity": "refused", "message": message})


def _add_hand(
    rows: Rows,
    results: Path,
    key: dict[str, str],
    file: str,
    n_frames: int,
    models: list[SkeletonModel],
    rng: np.random.Generator,
) -> None:
    layout = read_layout("liberty16")
    centres, receivers = hand_points(key["hand"])
    row = key | {"role": "both", "file": file, "status": "used", "message": "", "n_frames": n_frames}
    rows["recordings"].append(row | {"duration_s": n_frames / 240, "valid_percent": 99.5, "n_receivers": 16})
    poses = results / f"sub-{path_token(key['subject'])}" / key["hand"] / key["task"] / "poses.parquet"
    resting = _resting_poses(layout, receivers, n_frames, rng)
    write_poses(poses, resting, key["hand"], key["task"], key["subject"])
    for model in models:
        joints = _joint_rows(layout, model, key, centres, receivers)
        rows["joint_centres"] += joints
        rows["bone_lengths"] += _bone_rows(layout, model, key, centres, joints)
        for digit in layout.digits:
            _add_digit(rows, key, model, digit, n_frames, rng)


def _add_judgement(rows: Rows, key: dict[str, str], models: list[SkeletonModel], *, simulated: bool) -> None:
    layout = read_layout("liberty16")
    rows["skeleton_scores"] += score_rows(key, layout, models, simulated=simulated)
    rows["joint_errors"] += joint_error_rows(key, layout, models) if simulated else []
    for model in (model for model in models if model.fitting is not None):
        rows["receivers"] += receiver_rows(key, layout, model.name)
        rows["gains"] += gain_rows(key, model.name)


def hand_points(hand: str) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Joint centres and receiver places of a hand, mm in the hand receiver's frame (x distal, z dorsal)."""
    mirror = 1.0 if hand == "right" else -1.0
    places = {
        digit: np.array([(y, mirror * x, z) for x, y, z in points], float) - (35.0, 0.0, 14.0)
        for digit, points in POINTS.items()
    }
    centres = {"wrist": np.array([-35.0, 0.0, -14.0])}
    receivers = {"hand": np.zeros(3)}
    bones = {
        digit: ("metacarpal", "proximal", "distal") if digit == "thumb" else ("proximal", "middle", "distal")
        for digit in places
    }
    for digit, points in places.items():
        joints = ("cmc", "mcp", "ip") if digit == "thumb" else ("mcp", "pip", "dip")
        for index, (joint, bone) in enumerate(zip(joints, bones[digit], strict=True)):
            centres[f"{digit}_{joint}"] = points[index]
            receivers[f"{digit}_{bone}"] = (points[index] + points[index + 1]) / 2 + (0, 0, 7.0)
    return centres, receivers


def _resting_poses(
    layout: Layout, receivers: dict[str, np.ndarray], n_frames: int, rng: np.random.Generator
) -> Poses:
    """Return the hand at rest, slowly moving in x; every receiver parallel to the hand's."""
    segments, frame = tuple(s for s in layout.measured if s in receivers), np.arange(n_frames)
    position_mm = rng.normal((200.0, 30.0, 40.0), 0.05, (n_frames, len(segments), 3))
    position_mm += [receivers[segment] for segment in segments]
    position_mm[..., 0] += 0.1 * frame[:, None]
    valid = np.ones((n_frames, len(segments)), bool)
    valid[UNSEEN, segments.index("index_distal")] = False
    upright = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*valid.shape, 4))
    return Poses(segments, frame, frame / 240, position_mm, upright, valid)


def _joint_rows(
    layout: Layout,
    model: SkeletonModel,
    key: dict[str, str],
    centres: dict[str, np.ndarray],
    receivers: dict[str, np.ndarray],
) -> list[Row]:
    rows = []
    bases = {name: 0.2 * centres[name.replace("cmc", "mcp")] for name in model.own_cmc if name not in centres}
    for name, centre in (centres | bases).items():
        joint = layout.joints[name]
        failed, weak = spoiled(key) and name == "ring_dip", spoiled(key) and name == "little_dip"
        status = "failed" if failed else "weak" if weak else "ok"
        message = "too few frames (3)" if failed else ""
        moved = centre + (np.array([40.0, -300.0, 60.0]) if weak and not model.planes.corrections else 0.0)
        row = _who(key) | {"model": model.name, "joint": name, "dof": joint.dof, "n_frames": 300}
        doubts = {AXIS_IN_PLANE: {"axis_plane_deg": 4.0, "slide_mm": 59.0}} if weak else {}
        row |= {"source": "fit", "status": status, "message": message, "child_segment": joint.child}
        row |= noted(doubts)
        row |= {"parent_segment": "" if name == "wrist" else joint.parent_receiver}
        if not failed and joint.child in receivers:
            child = moved - receivers[joint.child]
            row |= {f"child_{axis}_mm": value for axis, value in zip("xyz", child, strict=True)}
            row |= {"range_deg": 41.23, "gap_rms_mm": 0.715, "axis_plane_deg": 4.0 if weak else 78.9}
            row["sd_mm"] = 9.876 if weak else 1.234
        if not failed and name != "wrist":
            parent = moved - receivers[joint.parent_receiver]
            row |= {f"parent_{axis}_mm": value for axis, value in zip("xyz", parent, strict=True)}
        rows.append(judged_joint(row, layout.wanted_mm))
    return rows


def _bone_rows(
    layout: Layout,
    model: SkeletonModel,
    key: dict[str, str],
    centres: dict[str, np.ndarray],
    joints: list[Row],
) -> list[Row]:
    rows, by_name = [], {row["joint"]: row for row in joints}
    for digit in layout.digits.values():
        for index, bone in enumerate(digit.segments):
            length = float(np.linalg.norm(centres[digit.joints[-1]])) / (1 + index)
            row = _who(key) | {"model": model.name, "digit": digit.name, "bone": bone, "driven_by": bone}
            ends = (*digit.joints, DISTAL_RECEIVER if model.fitting is None else BONE_TIP)
            row |= {"starts_at": ends[index], "ends_at": ends[index + 1]}
            varies = 0.8 if bone.endswith("metacarpal") else None
            numbers = {"length_mm": length, "sd_mm": 0.456, "sd_over_frames_mm": varies}
            rows.append(
                judged_bone(
                    row | numbers | {"message": ""}, by_name, layout.wanted_mm, is_whole=is_whole(row, layout)
                )
            )
    return rows


def _add_digit(
    rows: Rows, key: dict[str, str], model: SkeletonModel, digit: str, n_frames: int, rng: np.random.Generator
) -> None:
    """Tip errors of one digit: smooth, a few mm, gross where the little DIP joint is off."""
    who = {**key, "model": model.name, "digit": digit}
    of_binding = who | {"n_frames_total": n_frames, "held_out": False, "message": ""}
    if spoiled(key) and digit == "ring":
        failed = of_binding | {"n_frames": 0, "message": "joint ring_dip failed"}
        rows["tip_errors"] += [failed | {"binding": binding} for binding in ("first-frame", "least-squares")]
        return
    level = {"thumb": 3.0, "index": 5.0, "middle": 6.5, "ring": 6.8, "little": 9.0}[digit]
    level *= 15.0 if spoiled(key) and digit == "little" and not model.planes.corrections else 1.0
    level *= 20.0 if model.metacarpals.unmeasured == "rest" and digit != "thumb" else 1.0
    time_s = np.arange(n_frames) / 240
    noise = rng.normal(0, 0.03, n_frames)
    error = level * np.abs(1 + 0.4 * np.sin(time_s * 1.7 + len(digit)) + 0.1 * np.sin(time_s * 9) + noise)
    if digit == "index":
        error[UNSEEN] = np.nan
    first = np.abs(error - error[0])
    rows["tips"] += [
        {**who, "frame": k, "time_s": time_s[k], "error_mm": error[k], "error_first_frame_mm": first[k]}
        for k in range(n_frames)
    ]
    for binding, values in (("first-frame", first), ("least-squares", error)):
        finite = values[np.isfinite(values)]
        row = of_binding | {"binding": binding, "n_frames": len(finite), "median_mm": np.median(finite)}
        row |= {f"{name}_mm": getattr(finite, name)() for name in ("max", "min", "mean")}
        rows["tip_errors"].append(row | {"sd_mm": finite.std(), "p95_mm": np.quantile(finite, 0.95)})


def _who(key: dict[str, str]) -> dict[str, str]:
    return {"subject": key["subject"], "hand": key["hand"]}


SCORES = ("replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm")
TRUE_SCORES = ("metacarpal_deg", "true_tip_mean_mm")


def score_rows(
    key: dict[str, str], layout: Layout, models: list[SkeletonModel], *, simulated: bool
) -> list[Row]:
    """Rows of skeleton_scores: in-sample skeletons, with a truth held-out ones too, then references."""
    rows: list[Row] = []
    for rank, model in enumerate(models):
        fitted = model.fitting is not None
        means = [0.7 + 0.1 * rank, 0.3 if fitted else None, 0.5 if fitted else 0.7 + 0.1 * rank, 0.9]
        truth = [2.0 if fitted else 9.0, 1.5 if fitted else 10.0]
        rows += _of_digits(key, layout, (model.name, "opposition", False, False), means, truth, simulated)
        if simulated:
            worse = [None if value is None else value + 0.25 for value in means]
            rows += _of_digits(key, layout, (model.name, "rom", True, False), worse, truth, simulated)
    prior: list[float | None] = [None, 3.2, 5.6, 1.0]
    rows += _of_digits(key, layout, ("prior-only", "", True, True), prior, [8.7, 3.9], simulated)
    nothing: list[float | None] = [0.0, None, None, None]
    rows += _of_digits(key, layout, ("distal-receiver", "", True, True), nothing, [None, 10.3], simulated)
    if simulated:
        true: list[float | None] = [1.17, None, 1.17, 0.9]
        rows += _of_digits(key, layout, ("true-skeleton", "", True, True), true, [0.0, 0.4], simulated)
    return rows


def _of_digits(
    key: dict[str, str],
    layout: Layout,
    who: tuple[str, str, bool, bool],
    means: list[float | None],
    truth: list[float | None],
    simulated: bool,
) -> Iterator[Row]:
    names = (*SCORES, *TRUE_SCORES) if simulated else SCORES
    for index, digit in enumerate(layout.digits):
        row = {**key, "digit": digit, "n_frames": 300, "message": ""}
        row |= dict(zip(("model", "calibrated_on", "held_out", "reference"), who, strict=True))
        if spoiled(key) and digit == "ring" and not who[3]:
            yield row | {"n_frames": 0, "message": "joint ring_dip failed"}
            continue
        for name, value in zip(names, [*means, *truth], strict=False):
            row[name] = None if value is None else value * (1 + 0.1 * index)
        for mean in ("replay", "left_out", "true_tip"):
            value = row.get(f"{mean}_mean_mm")
            row[f"{mean}_p95_mm"] = None if value is None else 2 * value
        yield row


def joint_error_rows(key: dict[str, str], layout: Layout, models: list[SkeletonModel]) -> list[Row]:
    """Rows of joint_errors: each model made from either task, and prior-only, which states no error."""
    skeletons = [(model.name, tasks) for model in models for tasks in ("opposition", "rom")] + [
        ("prior-only", "")
    ]
    rows: list[Row] = []
    for name, tasks in skeletons:
        for index, joint in enumerate(seen_joints(layout)):
            row = {**_who(key), "model": name, "calibrated_on": tasks, "joint": joint, "bone": ""}
            error = (0.12 if name == "whole-hand" else 0.6) * (index + 1)
            if not (spoiled(key) and joint == "ring_dip"):
                row |= {"error_mm": error, "along_mm": 0.8 * error, "across_mm": -0.6 * error}
                row |= {"parent_error_mm": error, "bone": joint, "bone_error_percent": -error}
                row |= {"axis_deg": 2 * error if layout.joints[joint].dof == 1 else None}
                row |= {} if name == "prior-only" else {"within_95": error < 5, "sd_mm": 1.0}
            rows.append(row)
    return rows


def receiver_rows(key: dict[str, str], layout: Layout, model: str) -> list[Row]:
    """Rows of receivers, one loose on the spoiled hand."""
    rows: list[Row] = []
    for segment in layout.measured:
        row = {**_who(key), "model": model, "segment": segment, "status": "ok", "message": ""}
        row |= {f"{name}_mm": 12.34 for name in ("along", "lateral", "height")}
        row |= {f"{name}_sd_mm": 0.56 for name in ("along", "lateral", "height")}
        row |= {"residual_mm": 0.3, "residual_deg": 0.4, "loose_task": "", "loose_kind": ""}
        if segment.endswith("_distal"):
            row["soft_tip_sd_mm"] = 2.57
        if spoiled(key) and segment == "ring_middle":
            row |= {"loose_from_frame": 123, "loose_task": "opposition", "loose_shift_mm": 3.21}
            row |= {
                "loose_kind": "step",
                "loose_turn_deg": 4.32,
                "status": "weak",
                "message": "it came loose",
            }
        rows.append(row)
    return rows


def gain_rows(key: dict[str, str], model: str) -> list[Row]:
    """Rows of gains, best first; the sixth and last must not be told."""
    quantities = (
        "middle_proximal.lateral",
        "ring.touch",
        "ring_middle.along",
        "index_distal",
        "thumb_proximal.height",
        "little_middle.distal",
    )
    rows: list[Row] = []
    for index, quantity in enumerate(quantities):
        digit = quantity.replace(".", "_").split("_")[0]
        joint = {"joint": f"{digit}_mcp", "joint_sd_before_mm": 1.94, "joint_sd_after_mm": 1.03}
        means = {"mean_sd_before_mm": 1.26, "mean_sd_after_mm": 1.21 + 0.01 * index}
        rows.append({**_who(key), "model": model, "quantity": quantity, "sd_mm": 0.4, **means, **joint})
    return rows


def seen_joints(layout: Layout) -> list[str]:
    """Joints between two receivers that are always worn."""
    return [
        joint.name
        for joint in layout.solvable
        if not layout.segments[joint.parent_receiver].optional and not layout.segments[joint.child].optional
    ]


def spoiled(key: dict[str, str]) -> bool:
    """Whether it is the hand on which things went wrong."""
    return key["subject"] == "S01" and key["hand"] == "left"


FIRST = "S001"
SCALED = ("skeleton_scores", "joint_errors", "bone_lengths")


def many_subjects(
    folder: Path, n_subjects: int, models: tuple[str, ...] = FITTED_MODELS, *, simulated: bool = True
) -> tuple[Path, Path]:
    """Write a study file, its sheet and its results; return the study file and the results folder."""
    study, results = make_study(folder, n_frames=20, models=models, subjects=(FIRST,), simulated=simulated)
    rng = np.random.default_rng(3)
    names = [f"S{index + 1:03}" for index in range(n_subjects)]
    header, *lines = (folder / "sheet.tsv").read_text("utf-8").splitlines()
    sheet = [header, *(line.replace(FIRST, name) for name in names for line in lines)]
    (folder / "sheet.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    factors = {(name, model): rng.lognormal(0.0, 0.2) for name in names for model in models}
    for table in STUDY_TABLES:
        path = results / f"{table}.parquet"
        rows = read_table(path, TABLES[table]).to_pylist()
        scaled = [
            column.name
            for column in TABLES[table].columns
            if table in SCALED and column.name.endswith("_mm") and pa.types.is_floating(column.type)
        ]
        repeated = []
        for name in names:
            for row in rows:
                factor = factors.get((name, row.get("model", "")), 1.0)
                numbers = {column: factor * row[column] for column in scaled if row[column] is not None}
                repeated.append(row | {"subject": name} | numbers)
        write(path, TABLES[table], repeated)
    compare_study(read_study(study), Results(results))
    return study, results


def scored_study(results: StudyResults) -> ScoredStudy:
    """What the stage reads of these results."""
    return ScoredStudy(
        subjects=tuple(results.subjects),
        models=results.models,
        layouts=results.layouts,
        scores=_frame(SKELETON_SCORES, results.counted(results.scores)),
        errors=_frame(JOINT_ERRORS, results.counted(results.joint_errors)),
        recordings=_frame(RECORDINGS, results.recording_rows),
    )


def compared(results: StudyResults) -> StudyResults:
    return with_comparisons(results, compare_models(scored_study(results)))


def with_comparisons(results: StudyResults, models: ComparedModels) -> StudyResults:
    """The results with these comparisons, every column as the tables have it."""
    empty = dict.fromkeys(("interval_95_low", "interval_95_high", "effect_size", "p"))
    differences = [empty | row for row in models.differences]
    return replace(results, model_values=models.values, model_differences=differences)


def _frame(table: Table, rows: list[Row]) -> pd.DataFrame:
    return pd.DataFrame.from_records(rows, columns=[column.name for column in table.columns])
