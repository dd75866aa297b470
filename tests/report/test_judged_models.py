"""Which model to use: judged by the truth or by left-out receivers, with its p value, or not at all."""

from dataclasses import replace

import numpy as np
import pytest
from report_samples.made_study import compared

from shukotsu.report.judged_models import judged_models, model_to_take
from shukotsu.report.study_results import StudyResults
from shukotsu.report.table_cells import p_text

OURS, PAPER = "whole-hand", "paper-fig4"


@pytest.fixture(scope="module")
def fingers(twelve: StudyResults) -> StudyResults:
    """The twelve subjects' index fingers alone, which are compared in a third of the time."""
    scores = [row for row in twelve.rows.skeleton_scores if row["digit"] == "index"]
    errors = [row for row in twelve.rows.joint_errors if row["joint"].startswith("index")]
    return compared(twelve.with_rows(skeleton_scores=scores, joint_errors=errors))


def without_truth(results: StudyResults, *, held_out: bool = True) -> StudyResults:
    """Return the results as those of recorded hands, without a known truth."""
    blind = dict.fromkeys(("metacarpal_deg", "true_tip_mean_mm", "true_tip_p95_mm"))
    scores = [
        {**row, **blind}
        for row in results.rows.skeleton_scores
        if row["reference"] or row["held_out"] == held_out
    ]
    return compared(replace(results.with_rows(skeleton_scores=scores, joint_errors=[]), simulated=False))


def means(results: StudyResults, metric: str) -> dict[str, float]:
    (judged,) = (each for each in judged_models(results) if each.metric == metric)
    return {model: float(np.mean(list(values.values()))) for model, values in judged.values.items()}


def test_the_truth_decides_if_it_is_known(twelve: StudyResults) -> None:
    mean = means(twelve, "error_mm")
    assert model_to_take(twelve) == (
        f"Use the model whole-hand: its joints are {mean[OURS]:.1f} mm from the true ones on average; "
        f"{mean[PAPER]:.1f} mm with the model paper-fig4 (12 subjects; p = 0.00049 after Holm's correction)."
    )


def test_the_model_shown_to_be_better_is_recommended(fingers: StudyResults) -> None:
    """It is recommended even if pages show another model first."""
    swapped = [{**row, "model": {OURS: PAPER, PAPER: OURS}.get(row["model"], row["model"])}
               for row in fingers.rows.joint_errors]  # fmt: skip
    taken = model_to_take(compared(fingers.with_rows(joint_errors=swapped)))
    assert taken.startswith("Use the model paper-fig4: ")


def test_too_few_subjects_are_reported_and_not_tested(fingers: StudyResults) -> None:
    rows = {
        name: [row for row in getattr(fingers.rows, name) if row["subject"] in fingers.subjects[:2]]
        for name in ("skeleton_scores", "joint_errors")
    }
    two = compared(replace(fingers.with_rows(**rows), recordings=fingers.recordings[:8]))
    assert model_to_take(two).endswith("(2 subjects, too few to test the difference).")


def test_an_insignificant_difference_is_reported_with_its_p(fingers: StudyResults) -> None:
    mean = means(fingers, "error_mm")
    noise = np.random.default_rng(1).normal(1.0, 0.3, 12)
    factor = dict(zip(fingers.subjects, noise, strict=True))
    alike = [
        {**row, "error_mm": row["error_mm"] and factor[row["subject"]] * mean[PAPER]}
        if row["model"] == OURS
        else {**row, "error_mm": row["error_mm"] and mean[PAPER]}
        for row in fingers.rows.joint_errors
    ]
    assert "no significant difference, p = " in model_to_take(compared(fingers.with_rows(joint_errors=alike)))


def test_without_a_truth_left_out_receivers_judge_fitted_hands(fingers: StudyResults) -> None:
    real = without_truth(fingers)
    mean = means(real, "left_out_mean_mm")
    assert model_to_take(real).startswith(
        "Use the model whole-hand: its mean error at fingertip receivers left out of the fit is "
        f"{mean[OURS]:.2f} mm; {mean['prior-only']:.2f} mm with anatomy alone, without data (12 subjects; "
    )


def test_without_a_deciding_number_no_model_is_recommended(fingers: StudyResults) -> None:
    """Cases: no held-out recording, no whole-hand model, and findings in every hand."""
    seen = without_truth(fingers, held_out=False)
    assert model_to_take(seen).endswith("no recording was held out to test it.")
    models = {name: model for name, model in fingers.models.items() if name != OURS}
    assert model_to_take(replace(without_truth(fingers), models=models)).startswith(
        "No model can be recommended"
    )
    findings = [vars(hand) | {"severity": "suspect"} for hand in fingers.hands]
    assert model_to_take(fingers.with_rows(problems=findings)).startswith("Resolve the findings first")


def test_p_is_never_rounded_across_the_significance_level() -> None:
    """It has two significant digits, or more if two would contradict the stated result."""
    texts = {0.0123: "p = 0.012", 0.05: "p = 0.05", 0.0502: "p = 0.0502", 0.0498: "p = 0.05", 1.0: "p = 1"}
    assert {p: p_text(p) for p in texts} == texts
    assert p_text(0.00005) == "p < 0.0001"
