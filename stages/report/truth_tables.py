"""Simulated hands: how far every skeleton's joints, axes and bones are from the true ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from shukotsu.schemas.study import SubjectSession
from shukotsu.sentences.translation import N_, tr
from shukotsu.stages.report.score_tables import tasks_text
from shukotsu.stages.report.study_results import Row, StudyResults, hand_of
from shukotsu.stages.report.table_cells import DASH, Column, DataTable, number, table_of_blocks

FAR_MM = 5.0
"""A joint farther off than this is of no use: it is half the breadth of a finger's bone or more."""

Made = tuple[tuple[str, str], list[Row]]
"""A model or a reference and what it was made from, as the table names it, with its rows."""


def truth_table(results: StudyResults, who: SubjectSession) -> DataTable | None:
    """The joints of both of a subject's hands against the truth, a row a skeleton; None without a truth."""
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in results.joint_errors:
        if hand_of(row).who == who:
            groups[row["model"], row["calibrated_on"]].append(row)
    if not groups:
        return None
    order = {name: place for place, name in enumerate(results.models)}
    made = sorted(groups.items(), key=lambda own: order.get(own[0][0], len(order)))
    columns = (
        Column(tr("Skeleton"), lambda own: own[0][0], is_text=True),
        Column(
            tr("Made from"), lambda own: tasks_text(own[0][1]) if own[0][0] in order else DASH, is_text=True
        ),
        Column(tr("Joints"), _joint_count),
        _quantile_column(N_("Median [mm]"), 0.5),
        _quantile_column(N_("p90 [mm]"), 0.9),
        _quantile_column(N_("Worst [mm]"), 1.0),
        Column(
            tr("Over {FAR_MM:.0f} mm [%]", FAR_MM=FAR_MM),
            lambda own: _percent([error > FAR_MM for error in known(own[1], "error_mm")]),
        ),
        _quantile_column(N_("Axis [deg]"), 0.5, "axis_deg"),
        _quantile_column(N_("Bone length [%]"), 0.5, "bone_error_percent"),
        Column(
            tr("In the stated 95 % [%]"),
            lambda own: _percent([row["within_95"] for row in own[1] if row["within_95"] is not None]),
        ),
    )
    blocks = {
        kind: [own for own in made if (own[0][0] in order) == is_model]
        for kind, is_model in ((tr("Skeleton"), True), (tr("Reference"), False))
    }
    caption = tr(
        "Distance of the joints from the true ones, both hands: {who}. Axis and bone length: medians.",
        who=who,
    )
    return table_of_blocks(caption, columns, blocks)


def _joint_count(own: Made) -> str:
    found, every = len(known(own[1], "error_mm")), len(own[1])
    return str(every) if found == every else tr("{found} of {every}", found=found, every=every)


def _quantile_column(heading: str, share: float, name: str = "error_mm") -> Column:
    def cell(own: Made) -> str:
        values = known(own[1], name)
        return number(float(np.quantile(values, share)) if values else None)

    return Column(tr(heading), cell)


def _percent(answers: Sequence[bool]) -> str:
    return number(100.0 * sum(answers) / len(answers) if answers else None, 0)


def known(rows: Iterable[Row], name: str) -> list[float]:
    """Sizes of a column's numbers, those that are there."""
    return [abs(row[name]) for row in rows if row[name] is not None]
