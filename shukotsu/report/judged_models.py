"""The study's models held against each other: every subject's numbers, and which model to take."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from shukotsu.report.study_results import Row, StudyResults
from shukotsu.report.table_cells import p_text, shown
from shukotsu.scores.paired_statistics import LEVEL
from shukotsu.study.model import the_papers
from shukotsu.translation import ngettext, tr

ALL_DIGITS = ""
PRIOR = "prior-only"
TRUTH, LEFT_OUT, REPLAY = "error_mm", "left_out_mean_mm", "replay_mean_mm"
METRICS = (TRUTH, "true_tip_mean_mm", LEFT_OUT, REPLAY)
"""What model_values holds of models, what judges a skeleton best first; a replay's error judges none."""


@dataclass(frozen=True)
class JudgedModels:
    """One number of the study's models, over all digits.

    values : by model, then by subject. references : of those models that are none of the study's. differences
    : rows of model_differences.
    """

    metric: str
    held_out: bool
    values: dict[str, dict[str, float]]
    references: frozenset[str]
    differences: list[Row]

    @property
    def judges(self) -> bool:
        """Whether the number judges a skeleton: by a truth, or by a recording that it has not seen."""
        return self.metric not in (LEFT_OUT, REPLAY) or (self.metric == LEFT_OUT and self.held_out)


def judged_models(results: StudyResults) -> list[JudgedModels]:
    """Return the numbers that there are, METRICS in turn."""
    found = []
    for metric in METRICS:
        rows = [row for row in results.model_values if (row["metric"], row["digit"]) == (metric, ALL_DIGITS)]
        values: dict[str, dict[str, float]] = defaultdict(dict)
        for row in rows:
            if row["value"] is not None:
                values[row["model"]][row["subject"]] = row["value"]
        if not any(model in values for model in results.models):
            continue
        references = frozenset(row["model"] for row in rows if row["reference"])
        differences = [
            row
            for row in results.model_differences
            if (row["metric"], row["digit"]) == (metric, ALL_DIGITS) and row["n_compared_subjects"]
        ]
        found.append(JudgedModels(metric, rows[0]["held_out"], dict(values), references, differences))
    return found


def model_to_take(results: StudyResults) -> str:
    """Return the sentence which says which model to take and why."""
    leading = results.leading
    if results.hands and results.suspect >= {*results.hands}:
        return tr("Settle the findings first: every hand has one, so that nothing judges a model.")
    judged = next((each for each in judged_models(results) if each.judges), None)
    if judged is None or leading not in judged.values:
        if results.fitted:
            return tr(
                "Take {model}, which fits the whole hand; no recording was held out that could judge it.",
                model=leading,
            )
        return tr(
            "No model can be chosen here: nothing but a fit of the whole hand or a known truth judges a "
            "skeleton; add whole-hand to the study's models."
        )
    ours = [row for row in judged.differences if row["model"] == leading]
    if not ours:
        own = judged.values[leading].values()
        sentence = _amount(judged, leading, sum(own) / len(own))
        return tr(
            "{claim} ({test}).",
            claim=sentence,
            test=ngettext("{n} subject", "{n} subjects", len(own)),
        )
    paper = the_papers(results.models.values())
    row = min(ours, key=lambda row: (round(row["other_mean"], 6), row["other"] != paper))
    if row["mean_difference"] > 0 and row["p_holm"] <= LEVEL:
        leading = row["other"]
        row = next(
            own for own in judged.differences if (own["model"], own["other"]) == (leading, row["model"])
        )
    sentence = _amount(judged, leading, row["mean"])
    values = {"other": row["other"], "amount": shown(judged.metric, row["other_mean"])}
    if row["other"] == PRIOR:
        sentence += tr("; anatomy alone, without data, by {amount} mm", **values)
    else:
        sentence += tr("; those of the model {other} are {amount} mm off", **values)
    return tr("{claim} ({test}).", claim=sentence, test=_test(row))


def _amount(judged: JudgedModels, model: str, mean: float) -> str:
    values = {"model": model, "mean": shown(judged.metric, mean)}
    if judged.metric == TRUTH:
        return tr("Take the model {model}: its joints are {mean} mm from the true ones on average", **values)
    if judged.metric == LEFT_OUT:
        return tr(
            "Take the model {model}: it misses fingertip receivers that are hidden from it by {mean} mm",
            **values,
        )
    return tr("Take the model {model}: its fingertips are {mean} mm from the true ones on average", **values)


def _test(row: Row) -> str:
    """How far a difference can be relied on."""
    subjects = ngettext("{n} subject", "{n} subjects", row["n_compared_subjects"])
    if row["smallest_p_holm"] > LEVEL:
        return tr("{subjects}, too few to test the difference", subjects=subjects)
    if row["p_holm"] > LEVEL:
        return tr("{subjects}; no difference is shown, {p}", subjects=subjects, p=p_text(row["p_holm"]))
    return tr("{subjects}; {p}, corrected by Holm", subjects=subjects, p=p_text(row["p_holm"]))
