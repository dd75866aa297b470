"""Made-up scores, joint errors, receivers and gains of a hand, as the earlier stages write them.

On the first subject's left hand the ring DIP joint failed, and the
receiver of the ring's middle phalanx came loose.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel

Rows = list[dict[str, Any]]

SCORES = ("replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm")
TRUE_SCORES = ("metacarpal_deg", "true_tip_mean_mm")


def score_rows(key: dict[str, str], layout: Layout, models: list[SkeletonModel], *, simulated: bool) -> Rows:
    """Rows of skeleton_scores: in-sample skeletons, with a truth held-out ones too, then references."""
    rows: Rows = []
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
) -> Iterator[dict[str, Any]]:
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


def joint_error_rows(key: dict[str, str], layout: Layout, models: list[SkeletonModel]) -> Rows:
    """Rows of joint_errors: each model made from either task, and prior-only, which states no error."""
    skeletons = [(model.name, tasks) for model in models for tasks in ("opposition", "rom")] + [
        ("prior-only", "")
    ]
    rows: Rows = []
    for name, tasks in skeletons:
        for index, joint in enumerate(seen_joints(layout)):
            row = {**_hand(key), "model": name, "calibrated_on": tasks, "joint": joint, "bone": ""}
            error = (0.12 if name == "whole-hand" else 0.6) * (index + 1)
            if not (spoiled(key) and joint == "ring_dip"):
                row |= {"error_mm": error, "along_mm": 0.8 * error, "across_mm": -0.6 * error}
                row |= {"parent_error_mm": error, "bone": joint, "bone_error_percent": -error}
                row |= {"axis_deg": 2 * error if layout.joints[joint].dof == 1 else None}
                row |= {} if name == "prior-only" else {"within_95": error < 5, "sd_mm": 1.0}
            rows.append(row)
    return rows


def receiver_rows(key: dict[str, str], layout: Layout, model: str) -> Rows:
    """Rows of receivers, one loose on the spoiled hand."""
    rows: Rows = []
    for segment in layout.measured:
        row = {**_hand(key), "model": model, "segment": segment, "status": "ok", "message": ""}
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


def gain_rows(key: dict[str, str], model: str) -> Rows:
    """Rows of gains, best first; the sixth and last must not be told."""
    quantities = (
        "middle_proximal.lateral",
        "ring.touch",
        "ring_middle.along",
        "index_distal",
        "thumb_proximal.height",
        "little_middle.distal",
    )
    rows: Rows = []
    for index, quantity in enumerate(quantities):
        digit = quantity.replace(".", "_").split("_")[0]
        joint = {"joint": f"{digit}_mcp", "joint_sd_before_mm": 1.94, "joint_sd_after_mm": 1.03}
        means = {"mean_sd_before_mm": 1.26, "mean_sd_after_mm": 1.21 + 0.01 * index}
        rows.append({**_hand(key), "model": model, "quantity": quantity, "sd_mm": 0.4, **means, **joint})
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


def _hand(key: dict[str, str]) -> dict[str, str]:
    return {"subject": key["subject"], "hand": key["hand"]}
