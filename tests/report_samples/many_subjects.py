"""A made-up study of many subjects: the study-wide tables that compare models, written straight.

Every subject has two hands and one evaluated task. Of every model there is a skeleton made without the task
and one made with it. The numbers are random: subjects differ more than models do, the model that fits the
whole hand is better, and a few hands fail grossly. One subject's left hand was not fitted at all.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import product
from pathlib import Path

import numpy as np

from report_samples.made_scores import seen_joints
from report_samples.made_study import Rows, write_rows
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.model import read_model
from shukotsu.schemas.results import Results
from shukotsu.schemas.study import read_study
from shukotsu.stages.compare_models.study_comparison import compare_study

SIX = (
    "paper-fig3-rest",
    "paper-fig3",
    "paper-fig4",
    "paper-fig4-corrected",
    "rigid",
    "whole-hand",
)
REFERENCES = {"prior-only": 3.0, "distal-receiver": 4.0, "true-skeleton": 0.3}
LEVEL = {"paper-fig3-rest": 30.0, "paper-fig3": 2.2, "paper-fig4": 2.0, "paper-fig4-corrected": 1.2}
LEVEL |= {"rigid": 2.0, "whole-hand": 0.9}
FAIL = ("paper-fig3", "rigid")
"""The models that fail grossly with one hand in thirty."""
ERRORS = ("max_mm", "min_mm", "mean_mm", "sd_mm", "median_mm", "p95_mm")
NOT_FITTED = "no hand was fitted: too few frames"


def many_subjects(
    folder: Path, n_subjects: int, models: tuple[str, ...] = SIX, *, simulated: bool = True
) -> tuple[Path, Path]:
    """Write a study file, its sheet and its results; give the study file and the results folder."""
    names = [f"S{index + 1:03}" for index in range(n_subjects)]
    rng = np.random.default_rng(3)
    rows: Rows = defaultdict(list)
    sheet = ["subject\thand\ttask\trole\tfile"]
    for name in names:
        person = float(np.exp(rng.normal(0, 0.35)))
        for hand in ("right", "left"):
            key = {"subject": name, "hand": hand, "task": "opposition", "trial": ""}
            sheet += [f"{name}\t{hand}\topposition\tevaluation\t{name}-{hand}.csv"]
            sheet += [f"{name}\t{hand}\trom\tcalibration\t{name}-{hand}-rom.csv"]
            row = key | {"role": "evaluation", "file": f"{name}-{hand}.csv", "status": "used"}
            rows["recordings"].append(row | {"n_frames": 900, "n_receivers": 16, "message": ""})
            _add_hand(
                rows, key, models, person, rng, simulated=simulated, lost=(name, hand) == ("S003", "left")
            )
    study = folder / "study.yaml"
    study.write_text(
        f"study: many\nrecordings: sheet.tsv\nlayout: liberty16\nmodels: [{', '.join(models)}]\n"
        + ("simulation: {folder: ., seed: 1}\n" if simulated else ""),
        "utf-8",
    )
    (folder / "sheet.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    write_rows(folder / "results", rows)
    compare_study(read_study(study), Results(folder / "results"))
    return study, folder / "results"


def _add_hand(
    rows: Rows,
    key: dict[str, str],
    models: tuple[str, ...],
    person: float,
    rng: np.random.Generator,
    *,
    simulated: bool,
    lost: bool,
) -> None:
    layout = read_layout("liberty16")
    made = [(name, *kind) for name in models for kind in (("rom", True, False), ("opposition", False, False))]
    made += [(name, "", True, True) for name in REFERENCES if simulated or name != "true-skeleton"]
    for model, tasks, held_out, reference in made:
        fitted = model == "prior-only" or (not reference and read_model(model).fitting is not None)
        gone = lost and model == "whole-hand"
        gross = 12.0 if model in FAIL and rng.random() < 0.03 else 1.0
        level = (LEVEL | REFERENCES)[model] * person * gross
        who = {**key, "model": model, "calibrated_on": tasks, "held_out": held_out, "reference": reference}
        for digit in layout.digits:
            row = who | {"digit": digit, "n_frames": 900, "message": ""}
            scores = _scores(level, np.exp(rng.normal(0, 0.2, 9)), fitted=fitted, simulated=simulated)
            row |= {"n_frames": 0, "message": NOT_FITTED} if gone else scores
            rows["skeleton_scores"].append(row)
        if simulated and model != "distal-receiver" and model != "true-skeleton":
            of_hand = {name: who[name] for name in ("subject", "hand", "model", "calibrated_on")}
            for joint in seen_joints(layout):
                error = level * float(np.exp(rng.normal(0, 0.3)))
                parts = {"along_mm": error * rng.random(), "axis_deg": 3 * error * rng.random()}
                row = {**of_hand, "joint": joint, "bone": "", "error_mm": error, **parts}
                rows["joint_errors"].append({**of_hand, "joint": joint, "bone": ""} if gone else row)
        if not held_out:
            for digit, binding in product(layout.digits, ("first-frame", "least-squares")):
                values = (0.3 * level * np.exp(rng.normal(0, 0.2, len(ERRORS)))).tolist()
                row = key | {"model": model, "digit": digit, "binding": binding, "held_out": False}
                row |= {"message": "", "n_frames": 900, "n_frames_total": 900}
                rows["tip_errors"].append(row | dict(zip(ERRORS, values, strict=True)))


def _scores(level: float, noise: np.ndarray, *, fitted: bool, simulated: bool) -> dict[str, float]:
    replay = 0.3 * level * noise[0]
    left_out = 0.8 * level * noise[1] if fitted else replay
    found = {"replay_mean_mm": replay, "replay_p95_mm": 2 * replay * noise[2], "left_out_mean_mm": left_out}
    found |= {"left_out_p95_mm": 2 * left_out * noise[3], "wrist_mcp_sd_mm": 0.4 * noise[4]}
    found |= {"posed_mean_mm": 0.2 * level * noise[5]} if fitted else {}
    if simulated:
        tip = (level if fitted else 9.0 + level) * noise[6]
        found |= {"true_tip_mean_mm": tip, "true_tip_p95_mm": 2 * tip * noise[8]}
        found |= {"metacarpal_deg": 2 * level * noise[7]}
    return {name: float(value) for name, value in found.items()}
