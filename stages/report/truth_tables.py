"""Simulated hands: how far every skeleton's joints, axes and bones are from the true ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from stages.report.score_tables import tasks_text
from stages.report.study_results import Row, StudyResults
from stages.report.table_cells import DASH, Block, DataTable, Folded, number

FAR_MM = 5.0
"""A joint farther off than this is of no use: it is half the breadth of a finger's bone or more."""

Made = tuple[str, str]

_HEADER = (
    "Made from",
    "Joints",
    "Median [mm]",
    "p90 [mm]",
    "Worst [mm]",
    f"Over {FAR_MM:.0f} mm [%]",
    "Along [mm]",
    "Across [mm]",
    "Axis [deg]",
    "Bone length [%]",
    "In the stated 95 % [%]",
)


def truth_table(results: StudyResults, subject: str) -> DataTable | None:
    """The joints of both of a subject's hands against the truth, a row a skeleton; None without a truth."""
    made = _by_skeleton(results, [row for row in results.joint_errors if row["subject"] == subject])
    kinds: tuple[tuple[str, Callable[[str], bool]], ...] = (
        ("Skeleton", lambda model: model in results.models),
        ("Reference", lambda model: model not in results.models),
    )
    blocks = (
        Block(
            (kind, *_HEADER),
            tuple((key[0], made_from(results, key), *_cells(made[key])) for key in made if wanted(key[0])),
        )
        for kind, wanted in kinds
    )
    if not made:
        return None
    return DataTable(
        f"Distance of the joints from the true ones, both hands: subject {subject}. Along and across the "
        "axis, axis and bone length: medians.",
        tuple(block for block in blocks if block.rows),
        (),
        frozenset({0, 1}),
    )


def joint_error_tables(results: StudyResults, subject: str) -> list[Folded]:
    """The error of every joint, mm: a folded table a hand, a column a skeleton."""
    folded = []
    for hand in results.hands_of(subject):
        rows = [r for r in results.joint_errors if (r["subject"], r["hand"]) == (hand.subject, hand.hand)]
        if not rows:
            continue
        made = _by_skeleton(results, rows)
        errors = {key: {row["joint"]: row["error_mm"] for row in of_key} for key, of_key in made.items()}
        joints = dict.fromkeys(row["joint"] for row in rows)
        block = Block(
            ("Joint [mm]", *(_title(results, key) for key in made)),
            tuple((joint, *(number(errors[key].get(joint)) for key in made)) for joint in joints),
        )
        caption = f"Distance of each joint from the true one, in mm: subject {subject}, {hand.hand} hand."
        folded.append(Folded(f"{hand.hand.capitalize()} hand, joint by joint", DataTable(caption, (block,))))
    return folded


def made_from(results: StudyResults, skeleton: Made) -> str:
    """The tasks that a model was made from; a dash for a reference."""
    model, calibrated_on = skeleton
    return tasks_text(calibrated_on) if model in results.models else DASH


def _title(results: StudyResults, skeleton: Made) -> str:
    model = skeleton[0]
    return f"{model}, from {made_from(results, skeleton)}" if model in results.models else model


def _by_skeleton(results: StudyResults, rows: Iterable[Row]) -> dict[Made, list[Row]]:
    """Rows by model and what it was made from, models in the study's order, references last."""
    groups: dict[Made, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["model"], row["calibrated_on"]].append(row)
    names = list(results.models)
    ordered = sorted(groups, key=lambda made: names.index(made[0]) if made[0] in names else len(names))
    return {made: groups[made] for made in ordered}


def _cells(rows: list[Row]) -> tuple[str, ...]:
    errors = known(rows, "error_mm")
    joints = str(len(rows)) if len(errors) == len(rows) else f"{len(errors)} of {len(rows)}"
    within = [row["within_95"] for row in rows if row["within_95"] is not None]
    return (
        joints,
        number(_quantile(errors, 0.5)),
        number(_quantile(errors, 0.9)),
        number(_quantile(errors, 1.0)),
        number(_percent([error > FAR_MM for error in errors]), 0),
        *(
            number(_quantile(known(rows, name), 0.5))
            for name in ("along_mm", "across_mm", "axis_deg", "bone_error_percent")
        ),
        number(_percent(within), 0),
    )


def known(rows: Iterable[Row], name: str) -> list[float]:
    """Sizes of a column's numbers, those that are there."""
    return [abs(row[name]) for row in rows if row[name] is not None]


def _quantile(values: Sequence[float], share: float) -> float | None:
    return float(np.quantile(values, share)) if values else None


def _percent(answers: Sequence[bool]) -> float | None:
    return 100.0 * sum(answers) / len(answers) if answers else None
