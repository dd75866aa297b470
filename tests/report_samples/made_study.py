"""A made-up study with its results, written as the stages before the report write theirs.

Two subjects, one with a hostile name; two hands; one task. The second subject's left recording failed. On
the first subject's left hand the little DIP joint is weak and 300 mm off, the ring DIP joint failed. A
simulated study has a second task, rom, that calibrates only, and a truth.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from report_samples.made_scores import (
    advice_rows,
    gain_rows,
    joint_error_rows,
    receiver_rows,
    score_rows,
    spoiled,
)
from schemas.catalogue import (
    BONE_LENGTHS,
    CALIBRATION_ADVICE,
    GAINS,
    JOINT_CENTRES,
    JOINT_ERRORS,
    POSES,
    PROBLEMS,
    RECEIVERS,
    RECORDINGS,
    SKELETON_SCORES,
    TIP_ERRORS,
    TIPS,
)
from schemas.layout import Layout, read_layout
from schemas.model import SkeletonModel, read_model
from schemas.study import path_token
from schemas.tables import Provenance, Table, columns_from_rows, write_table

HOSTILE = 'A & <b>"x"'
FITTED_MODELS = ("paper-fig4", "whole-hand")
MODELS = ("paper-fig3-rest", "paper-fig3", "paper-fig4", "paper-fig4-corrected", "rigid")
NO_SOURCE = Provenance((("recording.csv", "0" * 64),), {})

# Joints of a right hand, mm from the wrist centre: right (towards the thumb), distal, dorsal.
POINTS = {
    "thumb": [(26.5, 25.0, -10.5), (43.0, 54.2, -23.2), (57.0, 80.1, -33.3), (67, 100, -41)],
    "index": [(22.2, 80.9, 11.0), (29.7, 122.2, 18.3), (33.0, 147.1, 19.5), (35.0, 165, 19.5)],
    "middle": [(4.7, 80.6, 11.5), (6.4, 124.8, 17.7), (7.7, 153.8, 19.7), (9.7, 173, 18.7)],
    "ring": [(-9.9, 79.3, 5.7), (-13.4, 119.5, 7.0), (-15.7, 144.3, 7.6), (-16.7, 162, 8.6)],
    "little": [(-19.5, 71.2, -3.4), (-24.8, 106.7, -6.3), (-27.7, 127.4, -8.5), (-28.7, 144, -11.5)],
}


@dataclass
class MadeRows:
    """Rows of the study-wide tables, gathered hand by hand."""

    recordings: list[dict[str, Any]] = field(default_factory=list)
    joints: list[dict[str, Any]] = field(default_factory=list)
    tips: list[dict[str, Any]] = field(default_factory=list)
    tip_errors: list[dict[str, Any]] = field(default_factory=list)
    bones: list[dict[str, Any]] = field(default_factory=list)
    problems: list[dict[str, Any]] = field(default_factory=list)
    scores: list[dict[str, Any]] = field(default_factory=list)
    joint_errors: list[dict[str, Any]] = field(default_factory=list)
    advice: list[dict[str, Any]] = field(default_factory=list)
    receivers: list[dict[str, Any]] = field(default_factory=list)
    gains: list[dict[str, Any]] = field(default_factory=list)


def make_study(
    folder: Path,
    *,
    n_frames: int = 300,
    models: tuple[str, ...] = MODELS,
    subjects: tuple[str, ...] = (),
    simulated: bool = False,
) -> tuple[Path, Path]:
    """Write a study file, its sheet and its results; give the study file and the results folder."""
    subjects = subjects or ("S01", HOSTILE)
    rng = np.random.default_rng(7)
    study, results = folder / "study.yaml", folder / "results" / "made"
    sheet = ["subject\thand\ttask\trole\tfile"]
    rows = MadeRows()
    for subject in subjects:
        for hand in ("right", "left"):
            file = f"{path_token(subject)}-{hand}.csv"
            sheet.append(f"{subject}\t{hand}\topposition\tboth\t{file}")
            key = {"subject": subject, "hand": hand, "task": "opposition", "trial": ""}
            if subject == subjects[-1] and hand == "left" and len(subjects) > 1:
                _add_failed(rows, key, file)
                continue
            _add_hand(rows, results, key, file, n_frames, models, rng)
            _add_judgement(rows, key, models, simulated=simulated)
            if simulated:
                sheet.append(f"{subject}\t{hand}\trom\tcalibration\trom-{file}")
                rows.recordings.append({**rows.recordings[-1], "task": "rom", "role": "calibration"})
    study.write_text(
        f"study: made\nrecordings: sheet.tsv\nlayout: liberty16\nmodels: [{', '.join(models)}]\n"
        "exports: [bvh]\n" + ("simulation: {folder: ., seed: 1}\n" if simulated else ""),
        "utf-8",
    )
    (folder / "sheet.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    write_rows(results, rows)
    return study, results


def write_rows(results: Path, rows: MadeRows) -> None:
    """Write the study-wide tables."""
    for table, own in (
        (RECORDINGS, rows.recordings),
        (JOINT_CENTRES, rows.joints),
        (TIPS, rows.tips),
        (TIP_ERRORS, rows.tip_errors),
        (BONE_LENGTHS, rows.bones),
        (PROBLEMS, rows.problems),
        (SKELETON_SCORES, rows.scores),
        (JOINT_ERRORS, rows.joint_errors),
        (CALIBRATION_ADVICE, rows.advice),
        (RECEIVERS, rows.receivers),
        (GAINS, rows.gains),
    ):
        write(results / f"{table.name}.parquet", table, own)


def write(path: Path, table: Table, rows: list[dict[str, Any]]) -> None:
    """Write rows as one table of the contract."""
    write_table(path, table, columns_from_rows(table, rows), NO_SOURCE)


def _add_failed(rows: MadeRows, key: dict[str, str], file: str) -> None:
    message = f"{file}: row 7, column x_mm: 'n/a' is not a number"
    rows.recordings.append(
        {**key, "role": "both", "file": file, "status": "failed", "n_frames": 0, "message": message}
    )
    rows.problems.append({"where": file, "stage": "capture", "message": message})


def _add_hand(
    rows: MadeRows,
    results: Path,
    key: dict[str, str],
    file: str,
    n_frames: int,
    models: tuple[str, ...],
    rng: np.random.Generator,
) -> None:
    layout = read_layout("liberty16")
    centres, receivers = hand_points(key["hand"])
    rows.recordings.append(
        {
            **key,
            "role": "both",
            "file": file,
            "status": "used",
            "n_frames": n_frames,
            "duration_s": n_frames / 240,
            "valid_percent": 99.5,
            "message": "",
        }
    )
    poses = results / f"sub-{path_token(key['subject'])}" / key["hand"] / key["task"] / "poses.parquet"
    pose_columns = columns_from_rows(POSES, _pose_rows(layout, receivers, n_frames, rng))
    write_table(poses, POSES, pose_columns, NO_SOURCE, row_group_rows=n_frames)
    for name in models:
        model = read_model(name)
        rows.joints += _joint_rows(layout, model, key, centres, receivers)
        rows.bones += _bone_rows(layout, model, key, centres)
        for digit in layout.digits:
            _add_digit(rows, key, model, digit, n_frames, rng)


def _add_judgement(rows: MadeRows, key: dict[str, str], models: tuple[str, ...], *, simulated: bool) -> None:
    """What the stages that judge and advise say of a hand."""
    layout, read = read_layout("liberty16"), [read_model(name) for name in models]
    rows.scores += score_rows(key, layout, read, simulated=simulated)
    rows.joint_errors += joint_error_rows(key, layout, read) if simulated else []
    rows.advice += advice_rows(key, layout)
    for model in read:
        if model.fitting is not None:
            rows.receivers += receiver_rows(key, layout, model.name)
            rows.gains += gain_rows(key, model.name)


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


def _pose_rows(
    layout: Layout, receivers: dict[str, np.ndarray], n_frames: int, rng: np.random.Generator
) -> list[dict[str, Any]]:
    """The hand at rest in a slowly moving place; every receiver parallel to the hand's."""
    rows = []
    for segment in (s for s in layout.measured if s in receivers):
        for frame in range(n_frames):
            x, y, z = receivers[segment] + (200 + 0.1 * frame, 30, 40) + rng.normal(0, 0.05, 3)
            rows.append(
                {
                    "segment": segment,
                    "frame": frame,
                    "time_s": frame / 240,
                    "x_mm": x,
                    "y_mm": y,
                    "z_mm": z,
                    "qw": 1.0,
                    "qx": 0.0,
                    "qy": 0.0,
                    "qz": 0.0,
                    "valid": not (segment == "index_distal" and 100 <= frame < 160),
                    "flags": "",
                }
            )
    return rows


def _joint_rows(
    layout: Layout,
    model: SkeletonModel,
    key: dict[str, str],
    centres: dict[str, np.ndarray],
    receivers: dict[str, np.ndarray],
) -> list[dict[str, Any]]:
    rows = []
    bases = {name: 0.2 * centres[name.replace("cmc", "mcp")] for name in model.own_cmc if name not in centres}
    for name, centre in (centres | bases).items():
        joint = layout.joints[name]
        failed, weak = spoiled(key) and name == "ring_dip", spoiled(key) and name == "little_dip"
        status = "failed" if failed else "weak" if weak else "ok"
        message = "axis is 4 deg from the plane" if weak else "too few frames (3)" if failed else ""
        moved = centre + (np.array([40.0, -300.0, 60.0]) if weak and not model.corrections else 0.0)
        row = {
            **_who(key),
            "model": model.name,
            "joint": name,
            "parent_segment": "" if name == "wrist" else joint.parent_receiver,
            "child_segment": joint.child,
            "dof": joint.dof,
            "n_frames": 300,
            "source": "fit",
            "status": status,
            "message": message,
        }
        if not failed and joint.child in receivers:
            child = moved - receivers[joint.child]
            row |= {f"child_{axis}_mm": value for axis, value in zip("xyz", child, strict=True)}
            row |= {"range_deg": 41.23, "gap_rms_mm": 0.715, "sd_mm": 1.234, "axis_plane_deg": 78.9}
        if not failed and name != "wrist":
            parent = moved - receivers[joint.parent_receiver]
            row |= {f"parent_{axis}_mm": value for axis, value in zip("xyz", parent, strict=True)}
        rows.append(row)
    return rows


def _bone_rows(
    layout: Layout, model: SkeletonModel, key: dict[str, str], centres: dict[str, np.ndarray]
) -> list[dict[str, Any]]:
    rows = []
    for digit in layout.digits.values():
        for bone in digit.segments:
            metacarpal = bone.endswith("metacarpal")
            length = float(np.linalg.norm(centres[digit.joints[-1]])) / (1 + digit.segments.index(bone))
            rows.append(
                {
                    **_who(key),
                    "model": model.name,
                    "digit": digit.name,
                    "bone": bone,
                    "length_mm": length,
                    "driven_by": bone,
                    "sd_mm": 0.456,
                    "sd_over_frames_mm": 0.8 if metacarpal else None,
                    "message": "",
                }
            )
    return rows


def _add_digit(
    rows: MadeRows,
    key: dict[str, str],
    model: SkeletonModel,
    digit: str,
    n_frames: int,
    rng: np.random.Generator,
) -> None:
    """Tip errors of one digit: smooth, a few mm, gross where the little DIP joint is off."""
    who = {**key, "model": model.name, "digit": digit}
    if spoiled(key) and digit == "ring":
        for binding in ("first-frame", "least-squares"):
            rows.tip_errors.append(
                {
                    **who,
                    "binding": binding,
                    "n_frames": 0,
                    "n_frames_total": n_frames,
                    "held_out": False,
                    "message": "joint ring_dip failed",
                }
            )
        return
    level = {"thumb": 3.0, "index": 5.0, "middle": 6.5, "ring": 6.8, "little": 9.0}[digit]
    level *= 15.0 if spoiled(key) and digit == "little" and not model.corrections else 1.0
    level *= 20.0 if model.unmeasured == "rest" and digit != "thumb" else 1.0
    time_s = np.arange(n_frames) / 240
    noise = rng.normal(0, 0.03, n_frames)
    error = level * np.abs(1 + 0.4 * np.sin(time_s * 1.7 + len(digit)) + 0.1 * np.sin(time_s * 9) + noise)
    if digit == "index":
        error[100:160] = np.nan
    first = np.abs(error - error[0])
    rows.tips += [
        {**who, "frame": k, "time_s": time_s[k], "error_mm": error[k], "error_first_frame_mm": first[k]}
        for k in range(n_frames)
    ]
    for binding, values in (("first-frame", first), ("least-squares", error)):
        known = values[np.isfinite(values)]
        rows.tip_errors.append(
            {
                **who,
                "binding": binding,
                "max_mm": known.max(),
                "min_mm": known.min(),
                "mean_mm": known.mean(),
                "sd_mm": known.std(),
                "median_mm": np.median(known),
                "p95_mm": np.quantile(known, 0.95),
                "n_frames": len(known),
                "n_frames_total": n_frames,
                "held_out": False,
                "message": "",
            }
        )


def _who(key: dict[str, str]) -> dict[str, str]:
    return {"subject": key["subject"], "hand": key["hand"]}
