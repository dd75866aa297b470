"""Models compared over a study: what is said of how many subjects, what is drawn, and that all of it is."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browser import WatchedPage
from report_samples.many_subjects import NOT_FITTED, SEVEN, many_subjects
from report_samples.read_page import read_page, rows_where
from report_samples.small_page import small_page

from schemas.model import read_model
from schemas.study import read_study
from stages.report.comparison.answers import Observation, answer
from stages.report.comparison.comparison_text import missing_sentences, summary, untestable
from stages.report.comparison.comparisons import ALL_DIGITS, Comparison, compare
from stages.report.comparison.questions import JOINT_ERROR, QUESTIONS, TRUE_TIP
from stages.report.models_compared import sections
from stages.report.models_compared.sections import ModelsCompared, models_compared
from stages.report.pictures.subject_dots import Drawn
from stages.report.study_results import StudyResults, read_results

FOUR = ("paper-fig3-rest", "paper-fig4", "anatomical", "whole-hand")
DIGITS = ["All digits", "Thumb", "Index", "Middle", "Ring", "Little"]
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
    monkeypatch.setattr(sections, "draw_panels", lambda drawn, *_: Drawn(("",) * len(drawn), 0))


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


def made(values: dict[str, list[float | None]], base: str = BASE) -> tuple[Comparison, ...]:
    """Comparisons over all digits of the models with the base, a number a subject."""
    told = [
        Observation(f"S{k:02}", model, "index", "right hand, rom", value, "" if value is not None else "why")
        for model, numbers in values.items()
        for k, value in enumerate(numbers)
    ]
    pairs = [(model, base) for model in values if model != base]
    return compare(pd.DataFrame(told), JOINT_ERROR, pairs, digits={ALL_DIGITS})


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
        assert section.differences is not None
        assert "with fewer than 6 subjects there is no interval" in section.differences.caption
    assert compared.sections[0].sentences == ()  # the finding said it
    assert all(len(section.sentences) == 1 for section in compared.sections[1:])


def test_a_study_of_many_says_who_is_better(twelve_compared: ModelsCompared) -> None:
    """By the joints, for they are known: names and amounts first, every test below."""
    compared = twelve_compared
    overall = [each for each in compared.comparisons if each.question.metric == "error_mm" and not each.digit]
    mean = {each.model: each.statistics.mean for each in overall if each.statistics}
    assert compared.headline.startswith(
        "Models are judged by how far the joint centres are from the true ones. Over 12 subjects, better "
        f"than paper-fig4 are whole-hand (by {-mean['whole-hand']:.2f} mm in the mean) and anatomical (by "
        f"{-mean['anatomical']:.2f} mm in the mean); worse is paper-fig3-rest (by "
        f"{mean['paper-fig3-rest']:.2f} mm in the mean)."
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
        "Between paper-fig3-rest, paper-fig4 and anatomical the data of this study cannot decide: there is "
        "no truth, and the replay's error says only how well joints close."
    )
    unfitted = {name: model for name, model in real.models.items() if name != "whole-hand"}
    compared = models_compared(replace(real, models=unfitted))
    assert [section.key for section in compared.sections] == ["replay_mean_mm"]
    assert compared.headline.startswith("The data of this study cannot say which of its models is the better")
    assert compared.sections[0].says.startswith(
        "The paper's number. It says how well the joints close and not"
    )


@pytest.mark.usefixtures("undrawn")
def test_nothing_held_out_judges_no_fitted_hand(real: StudyResults) -> None:
    """A fitted hand that saw the recording is shown as such, and the finding does not rest on it."""
    seen = [row for row in real.scores if not row["held_out"] or row["reference"]]
    compared = models_compared(replace(real, scores=seen))
    assert compared.headline.startswith("The data of this study cannot say which of its models is the better")
    assert {section.kind.split(":")[0] for section in compared.sections} == {"In-sample"}


def test_who_is_missing_and_why(twelve_compared: ModelsCompared) -> None:
    """Once below, and in the table of subjects; the others have a dash there."""
    section = twelve_compared.sections[1]
    assert section.missing == (f"S003: whole-hand: {NOT_FITTED}, 5 places.",)
    rows = {row[0]: row for row in section.subjects.table.blocks[0].rows}
    assert rows["S003"][-1] == f"whole-hand: {NOT_FITTED}, 5 places"
    assert rows["S004"][-1] == "–"
    assert len(rows) == 12


def test_the_paper_is_the_baseline(twelve: StudyResults) -> None:
    """Its last uncorrected model; the study's first without any of the paper's; or the one that is named."""

    def baseline(results: StudyResults, named: str = "") -> str:
        own = answer(results, TRUE_TIP, named)
        assert own is not None
        return own.baseline

    assert baseline(twelve) == "paper-fig4"
    by_hand = read_model("paper-fig4-corrected")
    assert baseline(replace(twelve, models={**twelve.models, by_hand.name: by_hand})) == "paper-fig4"
    others = {name: twelve.models[name] for name in ("anatomical", "whole-hand")}
    assert baseline(replace(twelve, models=others)) == "anatomical"
    assert baseline(twelve, "whole-hand") == "whole-hand"


@pytest.mark.usefixtures("undrawn")
def test_one_model_is_held_against_anatomy(twelve: StudyResults) -> None:
    """A study of one model still has a question: what its data improved."""
    alone = {"whole-hand": twelve.models["whole-hand"]}
    first = models_compared(replace(twelve, models=alone)).sections[0]
    assert first.table is not None
    assert first.table.caption == (
        "Joint centres against the truth: every model against prior-only, held out."
    )


def test_summary_words() -> None:
    """Better, worse, not shown and the same in turn; a single name is, more are."""
    base = [2.0 + 0.1 * k for k in range(9)]
    told = summary(
        made(
            {
                BASE: list(base),
                LATER: [v - 1 for v in base],
                "rigid": [v + (-1) ** k * 0.1 for k, v in enumerate(base)],
                "paper-fig3": list(base),
                "anatomical": [v + 0.5 for v in base],
            }
        )
    )
    assert told == [
        "Over 9 subjects, better than paper-fig4 is whole-hand (by 1.00 mm in the mean); worse is anatomical "
        "(by 0.50 mm in the mean); no difference is shown for rigid.",
        "paper-fig3 has exactly the same numbers as paper-fig4.",
    ]
    failing = {BASE: [2.0] * 10, LATER: [1.0] * 9 + [60.0], "rigid": [2.1] * 9 + [0.0]}
    assert summary(made(failing)) == [
        "Over 10 subjects, no difference from paper-fig4 is shown for whole-hand (the mean is worse, though "
        "it is better in 9 of 10) and rigid (the mean is better, though it is worse in 9 of 10)."
    ]
    assert summary(made({BASE: [None], LATER: [1.0]})) == [
        "There is nothing to compare: no subject has the numbers of two models."
    ]


@pytest.mark.parametrize(
    ("n", "words"),
    [
        (
            1,
            "1 subject cannot show a difference between models, whatever the numbers are: the smallest p "
            "that a test can give is 1. It takes 6 or more.",
        ),
        (
            6,
            "6 subjects cannot show a difference between models, whatever the numbers are: the smallest p "
            "that a test can give, Holm-corrected over 2 comparisons, is 0.062.",
        ),
        (7, ""),
    ],
)
def test_too_few_for_a_test(n: int, words: str) -> None:
    """By themselves, or for so many comparisons."""
    found = made(
        {BASE: [2.0] * n, LATER: [1.0 + 0.01 * k for k in range(n)], "rigid": [3.0 + k for k in range(n)]}
    )
    assert untestable(found) == words
    in_this = "In this subject" if n == 1 else "In these subjects" if words else "Over 7 subjects"
    assert summary(found)[0].startswith(in_this)


def test_reasons_are_gathered() -> None:
    """Subjects with the same reasons stand together, the first few by name."""
    found = made({BASE: [2.0] * 9, LATER: [1.0, *[None] * 8], "rigid": [3.0] * 8 + [None]})
    assert missing_sentences(found) == [
        "S01, S02, S03 and 4 more: whole-hand: why.",
        "S08: whole-hand and rigid: why.",
    ]


# ---- numbers ----


def test_dots_are_the_subjects_means(twelve: StudyResults) -> None:
    """Over hands, and over digits where all are taken together; each digit by itself."""
    found = answer(twelve, TRUE_TIP)
    assert found is not None
    assert found.held_out
    assert list(found.by_digit) == [ALL_DIGITS, "thumb", "index", "middle", "ring", "little"]
    assert found.names == (*FOUR, "prior-only", "distal-receiver", "true-skeleton")
    for digit in found.by_digit:
        rows = [
            row["true_tip_mean_mm"]
            for row in rows_where(twelve.scores, subject="S003", model="whole-hand", held_out=True)
            if row["true_tip_mean_mm"] is not None and digit in (ALL_DIGITS, row["digit"])
        ]
        assert len(rows) == (5 if digit == ALL_DIGITS else 1)  # one hand: the other was not fitted
        assert found.by_digit[digit]["whole-hand"]["S003"] == pytest.approx(np.mean(rows))


def test_table_is_laid_out_for_one_baseline(twelve_compared: ModelsCompared) -> None:
    """A row a model with the comparison's own numbers; folded a block a digit."""
    compared = twelve_compared
    section = compared.sections[0]
    assert section.table is not None
    assert section.by_digit is not None
    (block,) = section.table.blocks
    assert block.header[:4] == ("All digits", "Subjects", "Model [mm]", "paper-fig4 [mm]")
    made_here = [each for each in compared.comparisons if each.question.metric == "error_mm"]
    for row, each in zip(block.rows, made_here, strict=False):
        assert each.statistics is not None
        assert each.statistics.interval is not None
        assert row[0] == each.model
        assert row[4] == f"{each.statistics.mean:.2f}"
        assert row[6] == "{:.2f} to {:.2f}".format(*each.statistics.interval)
    (note,) = section.table.notes
    assert note.startswith(
        "Differences are the model's number less that of paper-fig4: below 0 the model is better. A "
        "subject counts "
    )
    assert note.endswith("Effect size: Cohen's d_z with Hedges' correction.")
    digits = section.by_digit.table.blocks
    assert [each.header[0] for each in digits] == DIGITS[1:]
    assert all([row[0] for row in each.rows] == [row[0] for row in block.rows] for each in digits)
    thumb = {each.model: each for each in made_here if each.digit == "thumb"}
    for row in digits[0].rows:
        found = thumb[row[0]].statistics
        assert found is not None
        assert row[4] == f"{found.mean:.2f}"
    assert {each.n_compared for each in made_here} == {3, 15}


def test_a_picture_of_differences_has_means_and_intervals(twelve_compared: ModelsCompared) -> None:
    """A bar where there is an interval, in every panel, rows of one model at one height."""
    section = twelve_compared.sections[0]
    assert section.differences is not None
    assert [name for name, _ in section.differences.panels] == DIGITS
    assert [name for name, _ in section.values.panels] == DIGITS
    assert "the bar its 95 % interval" in section.differences.caption
    for _, picture in section.differences.panels:
        assert ">better ←<" in picture
        assert picture.count("stroke-width:2.5") == 3, "a stroke a mean"
    for group in (section.values, section.differences):
        assert len({tuple(re.findall(r'class="model"><title>[^<]*</title><text[^>]* y="([\d.]+)"', p))
                    for _, p in group.panels}) == 1  # fmt: skip


@pytest.mark.slow
def test_a_hundred_subjects_stay_small(tmp_path: Path) -> None:
    """Seven models, five digits: every dot, in less than 200 kB a question."""
    results = study(tmp_path, 100, SEVEN)
    compared = models_compared(results)
    for section in compared.sections:
        assert section.differences is not None
        panels = [picture for group in (section.values, section.differences) for _, picture in group.panels]
        assert sum(map(len, panels)) < 200_000
        shown = section.values.panels[0][1]
        models = 1 if section.key == "left_out_mean_mm" else 7
        references = {"true_tip_mean_mm": 3, "left_out_mean_mm": 2}.get(section.key, 1)
        assert shown.count("h0") == 100 * (models + references)
    assert len(page_of(compared).encode()) < 1_000_000


@pytest.mark.slow
def test_one_question_is_shown_at_a_time(
    watched_page: WatchedPage, two: StudyResults, tmp_path: Path
) -> None:
    """As the reader chooses, on paper too; a link into another one shows that."""
    file = tmp_path / "page.html"
    file.write_text(page_of(models_compared(two)), "utf-8")
    watched_page.open(file)
    page = watched_page.page
    sections, choice = page.locator("section.compared"), page.get_by_label("Compare by")
    visible = lambda: [section.is_visible() for section in sections.all()]  # noqa: E731
    assert visible() == [True, False, False, False, False]
    choice.select_option(label="Tip error of the replay")
    assert visible() == [False, False, False, False, True]
    watched_page.value("location.hash = 'compared-left_out_mean_mm'")
    watched_page.wait("!document.getElementById('compared-left_out_mean_mm').hidden")
    assert choice.input_value() == "compared-left_out_mean_mm"
    on_screen = visible()
    page.emulate_media(media="print")
    assert visible() == on_screen
    assert not choice.is_visible()
    assert watched_page.value("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.slow
def test_a_subject_is_named_where_the_pointer_is(
    watched_page: WatchedPage, two: StudyResults, tmp_path: Path
) -> None:
    """The dots are lines of no length, and still feel the pointer."""
    file = tmp_path / "page.html"
    file.write_text(page_of(models_compared(two)), "utf-8")
    watched_page.open(file)
    watched_page.page.locator(".strips").first.scroll_into_view_if_needed()
    told = watched_page.value(
        """() => [...document.querySelector(".strips").querySelectorAll(".dots > path")].map((path) => {
          const start = path.getPointAtLength(0).matrixTransform(path.getScreenCTM());
          const felt = document.elementFromPoint(start.x, start.y) === path;
          return [path.parentNode.querySelector("title").textContent, felt];
        })"""
    )
    assert {name for name, _ in told} == {"S001", "S002"}
    assert any(felt for _, felt in told)
