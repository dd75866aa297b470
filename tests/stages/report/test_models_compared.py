"""Models compared over a study: what is said of how many subjects, what is drawn, and that all of it is."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from report_samples.compared import compared as compared_anew
from report_samples.compared import scored_study, with_comparisons
from report_samples.many_subjects import many_subjects
from report_samples.read_page import read_page
from report_samples.small_page import small_page

from shukotsu.schemas.model import read_model
from shukotsu.schemas.study import read_study
from shukotsu.stages.compare_models import comparisons
from shukotsu.stages.compare_models.comparisons import compare_models
from shukotsu.stages.compare_models.observations import METRICS, Observation
from shukotsu.stages.report.comparison.answers import Answer, answer
from shukotsu.stages.report.comparison.comparison_text import (
    p_text,
    summary,
)
from shukotsu.stages.report.comparison.questions import JOINT_ERROR, QUESTIONS, TRUE_TIP
from shukotsu.stages.report.models_compared import sections
from shukotsu.stages.report.models_compared.sections import ModelsCompared, models_compared
from shukotsu.stages.report.study_results import StudyResults, read_results

FOUR = ("paper-fig3-rest", "paper-fig4", "paper-fig4-corrected", "whole-hand")
BODY = """{% from "models_compared/models_compared.html.j2" import models_compared %}
{{ models_compared(compared) }}"""

LATER, BASE = "whole-hand", "paper-fig4"


def study(
    folder: Path, n_subjects: int, models: tuple[str, ...] = FOUR, *, simulated: bool = True
) -> StudyResults:
    made, results = many_subjects(folder, n_subjects, models, simulated=simulated)
    return read_results(read_study(made), results)


@pytest.fixture(scope="module")
def twelve(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """Twelve simulated subjects, of whom the third has a hand that was not fitted."""
    return study(tmp_path_factory.mktemp("twelve"), 12)


@pytest.fixture(scope="module")
def twelve_compared(twelve: StudyResults) -> ModelsCompared:
    """What their page says of them."""
    return models_compared(twelve)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of words: no picture is drawn."""
    monkeypatch.setattr(sections, "page_picture", lambda *_: "")


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """Two simulated subjects."""
    return study(tmp_path_factory.mktemp("two"), 2)


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    """Eight subjects without a truth."""
    return study(tmp_path_factory.mktemp("real"), 8, simulated=False)


def page_of(compared: ModelsCompared) -> str:
    return small_page(BODY, compared=compared)


def made(
    values: dict[str, list[float | None]], monkeypatch: pytest.MonkeyPatch, twelve: StudyResults
) -> Answer:
    """The answer of made-up numbers, one a subject and model, with BASE as the baseline."""
    seen = [
        Observation(f"S{k:02}", model, "index", "right hand, rom", value, "" if value is not None else "why")
        for model, numbers in values.items()
        for k, value in enumerate(numbers)
    ]
    monkeypatch.setattr(comparisons, "METRICS", METRICS[:1])
    monkeypatch.setattr(comparisons, "observations", lambda *_, **__: pd.DataFrame(seen))
    subjects = sorted({each.subject for each in seen})
    study = replace(
        scored_study(twelve), subjects=subjects, models={name: read_model(name) for name in values}
    )
    found = answer(with_comparisons(twelve, compare_models(study)), JOINT_ERROR, BASE)
    assert found is not None
    return found


# ---- what is said ----


@pytest.mark.usefixtures("undrawn")
def test_a_study_of_two_says_once_that_it_can_show_nothing(two: StudyResults) -> None:
    """What was seen in them is told, without test and without interval; the demo is such a study."""
    compared = models_compared(two)
    page = page_of(compared)
    text = " ".join(read_page(re.sub("<script>.*?</script>", "", page, flags=re.DOTALL)).text)
    assert text.count("cannot show a difference") == 1
    assert "2 subjects cannot show a difference between models" in compared.headline
    assert "the smallest p that a test can give is 0.5" in compared.headline
    assert "In these subjects, compared with paper-fig4, the joint centre is off by " in compared.headline
    assert "p = " not in text
    for section in compared.sections:
        assert "with fewer than 6 subjects there is no interval" in section.pictures.about_differences
    assert compared.sections[0].sentences == ()  # the finding said it
    assert all(len(section.sentences) == 1 for section in compared.sections[1:])


def test_a_study_of_many_says_who_is_better(twelve: StudyResults, twelve_compared: ModelsCompared) -> None:
    """By the joints, for they are known: names and amounts first, every test below."""
    compared = twelve_compared
    found = answer(twelve, JOINT_ERROR)
    assert found is not None
    mean = {each.model: each.mean_difference for each in found.overall}
    assert compared.headline.startswith(
        "Models are judged by how far the joint centres are from the true ones. Over 12 subjects, better "
        f"than paper-fig4 are whole-hand (by {-mean['whole-hand']:.2f} mm in the mean) and "
        f"paper-fig4-corrected (by {-mean['paper-fig4-corrected']:.2f} mm in the mean); worse is "
        f"paper-fig3-rest (by {mean['paper-fig3-rest']:.2f} mm in the mean)."
    )
    first = compared.sections[0]
    assert first.table is not None
    assert [row[8] for row in first.table.blocks[0].rows] == ["0.0015"] * 3
    assert [section.key for section in compared.sections] == [question.metric for question in QUESTIONS]


@pytest.mark.usefixtures("undrawn")
def test_what_cannot_be_decided_is_said(real: StudyResults) -> None:
    """Without a truth fitted hands alone are judged; without those nothing is."""
    compared = models_compared(real)
    assert [section.key for section in compared.sections] == ["left_out_mean_mm", "replay_mean_mm"]
    assert compared.headline.startswith("Models are judged by how far distal receivers are missed when")
    assert "better than prior-only is whole-hand" in compared.headline
    assert compared.headline.endswith(
        "Between paper-fig3-rest, paper-fig4 and paper-fig4-corrected the data of this study cannot decide: "
        "there is no truth, and the replay's error says only how well joints close."
    )
    unfitted = {name: model for name, model in real.models.items() if name != "whole-hand"}
    compared = models_compared(compared_anew(replace(real, models=unfitted)))
    assert [section.key for section in compared.sections] == ["replay_mean_mm"]
    assert compared.headline.startswith("The data of this study cannot say which of its models is the better")
    assert compared.sections[0].says.startswith(
        "The paper's number. It says how well the joints close and not"
    )


@pytest.mark.usefixtures("undrawn")
def test_nothing_held_out_judges_no_fitted_hand(real: StudyResults) -> None:
    """A fitted hand that saw the recording is shown as such, and the finding does not rest on it."""
    seen = [row for row in real.scores if not row["held_out"] or row["reference"]]
    compared = models_compared(compared_anew(replace(real, scores=seen)))
    assert compared.headline.startswith("The data of this study cannot say which of its models is the better")
    assert {section.kind.split(":")[0] for section in compared.sections} == {"In-sample"}


def test_the_baseline_can_be_named(twelve: StudyResults) -> None:
    """Unless it is, or where it was compared with none, it is the tables' own."""
    for named, baseline in (("", BASE), (LATER, LATER), ("nobody", BASE)):
        own = answer(twelve, TRUE_TIP, named)
        assert own is not None
        assert own.baseline == baseline
        assert {each.other for each in own.overall} == {baseline}


def test_summary_words(monkeypatch: pytest.MonkeyPatch, twelve: StudyResults) -> None:
    """Better, worse, not shown and the same in turn; a single name is, more are."""

    def summary_of(values: dict[str, list[float | None]]) -> list[str]:
        return summary(made(values, monkeypatch, twelve).overall)

    base = [2.0 + 0.1 * k for k in range(9)]
    told = summary_of(
        {
            BASE: list(base),
            LATER: [v - 1 for v in base],
            "rigid": [v + (-1) ** k * 0.1 for k, v in enumerate(base)],
            "paper-fig3": list(base),
            "paper-fig4-corrected": [v + 0.5 for v in base],
        }
    )
    assert told == [
        "Over 9 subjects, better than paper-fig4 is whole-hand (by 1.00 mm in the mean); worse is "
        "paper-fig4-corrected (by 0.50 mm in the mean); no difference is shown for rigid.",
        "paper-fig3 has exactly the same numbers as paper-fig4.",
    ]
    failing = {BASE: [2.0] * 10, LATER: [1.0] * 9 + [60.0], "rigid": [2.1] * 9 + [0.0]}
    assert summary_of(failing) == [
        "Over 10 subjects, no difference from paper-fig4 is shown for whole-hand (the mean is worse, though "
        "it is better in 9 of 10) and rigid (the mean is better, though it is worse in 9 of 10)."
    ]
    assert summary_of({BASE: [None], LATER: [1.0]}) == [
        "There is nothing to compare: no subject has the numbers of two models."
    ]


def test_p_never_rounds_over_the_level() -> None:
    """Two digits, unless they would say the opposite of what the sentence says."""
    texts = {0.0123: "p = 0.012", 0.05: "p = 0.05", 0.0502: "p = 0.0502", 0.0498: "p = 0.05", 1.0: "p = 1"}
    assert {p: p_text(p) for p in texts} == texts
    assert p_text(0.00005) == "p < 0.0001"


# ---- numbers ----
