"""Simulated hands: how far every skeleton's joints, axes and bones are from the true ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from shukotsu.schemas.study import SubjectSession
from shukotsu.sentences.translation import N_, tr
from shukotsu.stages.report.score_tables import tasks_text
from shukotsu.stages.report.study_results import Row, StudyResults, hand_of
from shukotsu.stages.report.table_cells import (
    DASH,
    Block,
    Column,
    DataTable,
    Folded,
    number,
    table_of_blocks,
    title,
)

FAR_MM = 5.0
"""A joint farther off than this is of no use: it is half the breadth of a finger's bone or more."""

Made = tuple[str, str]
"""A model or a reference, and what it was made from as the table names it."""


def truth_table(results: StudyResults, who: SubjectSession) -> DataTable | None:
    """The joints of both of a subject's hands against the truth, a row a skeleton; None without a truth."""
    made = _by_skeleton(results, [row for row in results.joint_errors if hand_of(row).who == who])
    if not made:
        return None
    columns = (
        Column(tr("Skeleton"), lambda own: own[0][0], is_text=True),
        Column(tr("Made from"), lambda own: made_from(results, own[0]), is_text=True),
        Column(tr("Joints"), _joint_count),
        _quantile_column(N_("Median [mm]"), 0.5),
        _quantile_column(N_("p90 [mm]"), 0.9),
        _quantile_column(N_("Worst [mm]"), 1.0),
        Column(
            tr("Over {FAR_MM:.0f} mm [%]", FAR_MM=FAR_MM),
            lambda own: _percent([error > FAR_MM for error in known(own[1], "error_mm")]),
        ),
        _quantile_column(N_("Along [mm]"), 0.5, "along_mm"),
        _quantile_column(N_("Across [mm]"), 0.5, "across_mm"),
        _quantile_column(N_("Axis [deg]"), 0.5, "axis_deg"),
        _quantile_column(N_("Bone length [%]"), 0.5, "bone_error_percent"),
        Column(
            tr("In the stated 95 % [%]"),
            lambda own: _percent([row["within_95"] for row in own[1] if row["within_95"] is not None]),
        ),
    )
    blocks = {
        kind: [own for own in made.items() if (own[0][0] in results.models) == is_model]
        for kind, is_model in ((tr("Skeleton"), True), (tr("Reference"), False))
    }
    return table_of_blocks(
        tr(
            "Distance of the joints from the true ones, both hands: {who}. Along and across the "
            "axis, axis and bone length: medians.",
            who=who,
        ),
        columns,
        blocks,
    )


def truth_summary(results: StudyResults, who: SubjectSession, model: str) -> str:
    """Say how far a model's joints are from the true ones, best first; empty without a truth."""
    of_subject = [r for r in results.joint_errors if (hand_of(r).who, r["model"]) == (who, model)]
    made = _by_skeleton(results, of_subject)
    parts = [
        tr(
            "made from {made_from} {errors} mm in the median, {n_far} of {n_errors} more than "
            "{FAR_MM:.0f} mm off",
            made_from=made_from(results, key),
            errors=number(float(np.median(errors)), 1),
            n_far=sum(error > FAR_MM for error in errors),
            n_errors=len(errors),
            FAR_MM=FAR_MM,
        )
        for key, rows in made.items()
        if (errors := known(rows, "error_mm"))
    ]
    return f"{model}, {'; '.join(parts)}" if parts else ""


def joint_error_tables(results: StudyResults, who: SubjectSession) -> list[Folded]:
    """The error of every joint, mm: a folded table a hand, a column a skeleton."""
    folded = []
    for hand in results.hands_of(*who):
        rows = [row for row in results.joint_errors if hand_of(row) == hand]
        if not rows:
            continue
        made = _by_skeleton(results, rows)
        errors = {key: {row["joint"]: row["error_mm"] for row in of_key} for key, of_key in made.items()}
        joints = dict.fromkeys(row["joint"] for row in rows)
        block = Block(
            (tr("Joint [mm]"), *(_title(results, key) for key in made)),
            tuple((joint, *(number(errors[key].get(joint)) for key in made)) for joint in joints),
        )
        caption = tr("Distance of each joint from the true one, in mm: {hand}.", hand=hand)
        folded.append(
            Folded(tr("{hand} hand, joint by joint", hand=title(hand.hand)), DataTable(caption, (block,)))
        )
    return folded


def made_from(results: StudyResults, skeleton: Made) -> str:
    """The tasks that a model was made from; a dash for a reference."""
    model, calibrated_on = skeleton
    return tasks_text(calibrated_on) if model in results.models else DASH


def _title(results: StudyResults, skeleton: Made) -> str:
    model = skeleton[0]
    return (
        tr("{model}, from {made_from}", model=model, made_from=made_from(results, skeleton))
        if model in results.models
        else model
    )


def _by_skeleton(results: StudyResults, rows: Iterable[Row]) -> dict[Made, list[Row]]:
    """Rows by model and what it was made from, models in the study's order, references last."""
    groups: dict[Made, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["model"], row["calibrated_on"]].append(row)
    names = list(results.models)
    ordered = sorted(groups, key=lambda made: names.index(made[0]) if made[0] in names else len(names))
    return {made: groups[made] for made in ordered}


def _joint_count(own: tuple[Made, list[Row]]) -> str:
    found, every = len(known(own[1], "error_mm")), len(own[1])
    return str(every) if found == every else tr("{found} of {every}", found=found, every=every)


def _quantile_column(heading: str, share: float, name: str = "error_mm") -> Column:
    def cell(own: tuple[Made, list[Row]]) -> str:
        values = known(own[1], name)
        return number(float(np.quantile(values, share)) if values else None)

    return Column(heading, cell)


def _percent(answers: Sequence[bool]) -> str:
    return number(100.0 * sum(answers) / len(answers) if answers else None, 0)


def known(rows: Iterable[Row], name: str) -> list[float]:
    """Sizes of a column's numbers, those that are there."""
    return [abs(row[name]) for row in rows if row[name] is not None]
