"""Draw the pictures of one question: every subject's number under each model, and the differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shukotsu.sentences.translation import N_, listed, tr
from shukotsu.stages.report.comparison.answers import ALL_DIGITS, Answer
from shukotsu.stages.report.palette import SOFT, Look, model_looks
from shukotsu.stages.report.plots.panels import Panel
from shukotsu.stages.report.plots.rows import Group, Row, Scale, difference_scale, rows_panel, value_scale
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import title

SCALES = {"linear": "", "log": N_(", log scale"), "asinh": N_(", asinh scale")}
SIDES = (N_("better ←"), N_("→ worse"))


def digit_title(digit: str) -> str:
    """Give the digit in words."""
    return tr("All digits") if digit == ALL_DIGITS else title(digit)


def looks_of(results: StudyResults, answer: Answer) -> Mapping[str, Look]:
    """Give every model's look as in the study's other pictures, and the references' own."""
    return {name: Look(SOFT, "o") for name in answer.names} | model_looks(list(results.models))


def value_panel(answer: Answer, looks: Mapping[str, Look], digits: Sequence[str]) -> Panel:
    """Draw every subject's number under each model and reference, digit by digit."""
    groups = tuple(
        Group(
            digit_title(digit),
            tuple(
                Row(name, looks[name], own)
                for name in answer.names
                if (own := answer.by_digit[digit].get(name, {}))
            ),
        )
        for digit in digits
    )
    shown = tr(
        "{choice}, every subject under {names}",
        choice=tr(answer.question.choice),
        names=listed(answer.names),
    )
    scale = value_scale([value for group in groups for row in group.rows for value in row.values()])
    return rows_panel("", f"{shown}.", _axis(answer, scale), scale, groups, of_all=answer.n_subjects)


def difference_panel(answer: Answer, looks: Mapping[str, Look], digits: Sequence[str]) -> Panel | None:
    """Draw every subject's difference from the baseline, with means and intervals; None without any."""
    rows: dict[str, list[Row]] = {digit: [] for digit in digits}
    for each in (*answer.overall, *answer.digits):
        if each.digit in rows:
            own, mean = each.differences, each.mean_difference
            rows[each.digit].append(
                Row(each.model, looks[each.model], own, mean=mean, interval=each.interval)
            )
    several = len(digits) > 1
    groups = tuple(
        Group(digit_title(digit) if several else "", tuple(of)) for digit, of in rows.items() if of
    )
    if not groups:
        return None
    scale = difference_scale([value for group in groups for row in group.rows for value in row.values()])
    shown = tr(
        "{choice}, each subject's difference from {baseline}",
        choice=tr(answer.question.choice),
        baseline=answer.baseline,
    )
    axis = tr("{axis}, less that of", axis=tr(answer.question.axis))
    axis = f"{axis}\n{answer.baseline}{tr(SCALES[scale.kind])}"
    sides = (tr(SIDES[0]), tr(SIDES[1]))
    return rows_panel("", f"{shown}.", axis, scale, groups, sides, answer.n_subjects)


def _axis(answer: Answer, scale: Scale) -> str:
    return f"{tr(answer.question.axis)}{tr(SCALES[scale.kind])}"
