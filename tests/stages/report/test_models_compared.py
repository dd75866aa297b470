"""Models compared over a study: what is said of how many subjects, what is drawn, and that all of it is."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import WatchedPage
from hypothesis import given
from hypothesis import strategies as st
from report_samples.many_subjects import NOT_FITTED, SEVEN, many_subjects
from report_samples.read_page import read_page
from report_samples.small_page import small_page

from schemas.model import read_model
from schemas.study import read_study
from stages.report.comparison import ALL_DIGITS, METRICS, Comparison, Observation, compare
from stages.report.models_compared.answers import answer, baseline_of
from stages.report.models_compared.axis import difference_axis, value_axis
from stages.report.models_compared.charts import MOST_NAMED, Panel, Strip, draw
from stages.report.models_compared.questions import QUESTIONS
from stages.report.models_compared.sections import ModelsCompared, models_compared
from stages.report.models_compared.swarm import dots, swarm
from stages.report.models_compared.words import bullets, missing_in_sentences, summary, untestable
from stages.report.study_results import StudyResults, read_results

FOUR = ("paper-fig3-rest", "paper-fig4", "anatomical", "whole-hand")
DIGITS = ["All digits", "Thumb", "Index", "Middle", "Ring", "Little"]
BODY = """{% from "models_compared/models_compared.html.j2" import models_compared %}
{{ models_compared(compared) }}"""

NUMBERS = st.lists(st.floats(-500.0, 500.0).map(lambda value: round(value, 3)), min_size=1, max_size=40)
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
    return compare(told, METRICS["error_mm"], pairs, digits={ALL_DIGITS}, fitted={LATER})


# ---- what is said ----


def test_a_study_of_two_says_once_that_it_can_show_nothing(two: StudyResults) -> None:
    """What was seen in them is told, without test and without interval; the demo is such a study."""
    compared = models_compared(two)
    page = page_of(compared)
    text = " ".join(read_page(re.sub("<script>.*?</script>", "", page, flags=re.DOTALL)).text)
    assert text.count("cannot show a difference") == 1
    assert "2 subjects cannot show a difference between models" in compared.finding
    assert "the smallest p that a test can give is 0.5" in compared.finding
    assert "In these subjects, compared with paper-fig4, the joint centre is off by " in compared.finding
    assert "p = " not in text
    for section in compared.sections:
        assert section.bullets == ()
        assert section.differences is not None
        assert "with fewer than 6 subjects there is no interval" in section.differences.caption
    assert compared.sections[0].sentences == ()  # the finding said it
    assert all(len(section.sentences) == 1 for section in compared.sections[1:])


def test_a_study_of_many_says_who_is_better(twelve: StudyResults) -> None:
    """By the joints, for they are known: names and amounts first, every test below."""
    compared = models_compared(twelve)
    overall = [each for each in compared.comparisons if each.metric.name == "error_mm" and not each.digit]
    mean = {each.model: each.found.mean for each in overall if each.found}
    assert compared.finding.startswith(
        "Models are judged by how far the joint centres are from the true ones. Over 12 subjects, better "
        f"than paper-fig4 are whole-hand (by {-mean['whole-hand']:.2f} mm in the mean) and anatomical (by "
        f"{-mean['anatomical']:.2f} mm in the mean); worse is paper-fig3-rest (by "
        f"{mean['paper-fig3-rest']:.2f} mm in the mean)."
    )
    first = compared.sections[0]
    assert [bullet[:40] for bullet in first.bullets][2].startswith("With whole-hand the joint centre is off")
    assert len(first.bullets) == 3
    assert "p = 0.0015, Holm-corrected over 3" in first.bullets[2]
    assert [section.key for section in compared.sections] == [question.metric for question in QUESTIONS]


def test_what_cannot_be_decided_is_said(real: StudyResults) -> None:
    """Without a truth fitted hands alone are judged; without those nothing is."""
    compared = models_compared(real)
    assert [section.key for section in compared.sections] == ["left_out_mean_mm", "replay_mean_mm"]
    assert compared.finding.startswith("Models are judged by how far distal receivers are missed when")
    assert "better than prior-only is whole-hand" in compared.finding
    assert compared.finding.endswith(
        "Between paper-fig3-rest, paper-fig4 and anatomical the data of this study cannot decide: there is "
        "no truth, and the replay's error says only how well joints close."
    )
    unfitted = {name: model for name, model in real.models.items() if name != "whole-hand"}
    compared = models_compared(replace(real, models=unfitted))
    assert [section.key for section in compared.sections] == ["replay_mean_mm"]
    assert compared.finding.startswith("The data of this study cannot say which of its models is the better")
    assert compared.sections[0].says.startswith(
        "The paper's number. It says how well the joints close and not"
    )


def test_nothing_held_out_judges_no_fitted_hand(real: StudyResults) -> None:
    """A fitted hand that saw the recording is shown as such, and the finding does not rest on it."""
    seen = [row for row in real.scores if not row["held_out"] or row["reference"]]
    compared = models_compared(replace(real, scores=seen))
    assert compared.finding.startswith("The data of this study cannot say which of its models is the better")
    assert {section.kind.split(":")[0] for section in compared.sections} == {"In-sample"}


def test_who_is_missing_and_why(twelve: StudyResults) -> None:
    """Once below, and in the table of subjects; the others have a dash there."""
    section = models_compared(twelve).sections[1]
    assert section.missing == (f"S003: whole-hand: {NOT_FITTED}, 5 places.",)
    rows = {row[0]: row for row in section.subjects.table.blocks[0].rows}
    assert rows["S003"][-1] == f"whole-hand: {NOT_FITTED}, 5 places"
    assert rows["S004"][-1] == "–"
    assert len(rows) == 12


def test_the_paper_is_the_baseline(twelve: StudyResults) -> None:
    """Its last uncorrected model; the study's first without any of the paper's; or one that is asked for."""
    assert baseline_of(twelve) == "paper-fig4"
    by_hand = read_model("paper-fig4-corrected")
    assert baseline_of(replace(twelve, models={**twelve.models, by_hand.name: by_hand})) == "paper-fig4"
    others = {name: twelve.models[name] for name in ("anatomical", "whole-hand")}
    assert baseline_of(replace(twelve, models=others)) == "anatomical"
    asked = models_compared(twelve, "whole-hand").sections[0]
    assert asked.table is not None
    assert asked.table.blocks[0].header[3] == "whole-hand [mm]"
    assert [row[0] for row in asked.table.blocks[0].rows] == list(FOUR[:3])


def test_one_model_is_held_against_anatomy(twelve: StudyResults) -> None:
    """A study of one model still has a question: what its data improved."""
    alone = {"whole-hand": twelve.models["whole-hand"]}
    first = models_compared(replace(twelve, models=alone)).sections[0]
    assert first.bullets[0].startswith("With whole-hand the joint centre is off by ")
    assert "than with prior-only" in first.bullets[0]


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
    assert bool(bullets(found)) == (not words)
    in_this = "In this subject" if n == 1 else "In these subjects" if words else "Over 7 subjects"
    assert summary(found)[0].startswith(in_this)


def test_reasons_are_gathered() -> None:
    """Subjects with the same reasons stand together, the first few by name."""
    found = made({BASE: [2.0] * 9, LATER: [1.0, *[None] * 8], "rigid": [3.0] * 8 + [None]})
    assert missing_in_sentences(found) == [
        "S01, S02, S03 and 4 more: whole-hand: why.",
        "S08: whole-hand and rigid: why.",
    ]


# ---- numbers ----


def test_dots_are_the_subjects_means(twelve: StudyResults) -> None:
    """Over hands, and over digits where all are taken together; each digit by itself."""
    found = answer(twelve, QUESTIONS[2], "paper-fig4")
    assert found is not None
    assert found.held_out
    assert list(found.by_digit) == [ALL_DIGITS, "thumb", "index", "middle", "ring", "little"]
    assert found.names == (*FOUR, "prior-only", "distal-receiver", "true-skeleton")
    for digit in found.by_digit:
        rows = [
            row["true_tip_mean_mm"]
            for row in twelve.scores
            if (row["subject"], row["model"]) == ("S003", "whole-hand")
            and row["held_out"]
            and row["true_tip_mean_mm"] is not None
            and digit in (ALL_DIGITS, row["digit"])
        ]
        assert len(rows) == (5 if digit == ALL_DIGITS else 1)  # one hand: the other was not fitted
        assert found.by_digit[digit]["whole-hand"]["S003"] == pytest.approx(np.mean(rows))


def test_table_is_laid_out_for_one_baseline(twelve: StudyResults) -> None:
    """A row a model with the comparison's own numbers; folded a block a digit."""
    compared = models_compared(twelve)
    section = compared.sections[0]
    assert section.table is not None
    assert section.by_digit is not None
    (block,) = section.table.blocks
    assert block.header[:4] == ("All digits", "Subjects", "Model [mm]", "paper-fig4 [mm]")
    made_here = [each for each in compared.comparisons if each.metric.name == "error_mm"]
    for row, each in zip(block.rows, made_here, strict=False):
        assert each.found is not None
        assert each.found.interval is not None
        assert row[0] == each.model
        assert row[4] == f"{each.found.mean:.2f}"
        assert row[6] == "{:.2f} to {:.2f}".format(*each.found.interval)
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
        found = thumb[row[0]].found
        assert found is not None
        assert row[4] == f"{found.mean:.2f}"
    assert {each.n_compared for each in made_here} == {3, 15}


def test_same_results_same_page(two: StudyResults) -> None:
    """Nothing that is random, dated or in no order."""
    assert page_of(models_compared(two)) == page_of(models_compared(two))


# ---- pictures ----


def places(path: str) -> np.ndarray:
    """Where the dots of a path are, (n, 2)."""
    steps = re.findall(r"m(-?[\d.]+?)[ ]?(-?[\d.]+)h0", path.replace("m-", "m -").replace("m ", "m"))
    return np.cumsum(np.array(steps, float).reshape(-1, 2), axis=0)


@given(st.lists(st.floats(0, 250), max_size=60), st.sampled_from([2.8, 6.0]), st.sampled_from([3, 19]))
def test_no_dot_hides_another_uncounted(values: list[float], diameter: float, most: int) -> None:
    """Dots are apart or counted as overlapping, within as many lanes as are told."""
    x = np.array(values)
    y, n_lanes, overlapping = swarm(x, diameter, most)
    assert n_lanes <= most
    assert np.abs(y).max(initial=0.0) <= (n_lanes - 1) / 2 * diameter + 1e-9
    apart = np.hypot(x[:, None] - x, y[:, None] - y) + np.eye(len(x)) * 1e9
    hidden = int((apart.min(axis=1, initial=1e9) < diameter - 1e-9).sum())
    assert (hidden > 0) == (overlapping > 0)
    again = swarm(x, diameter, most)
    assert (again[0] == y).all()


@given(st.lists(st.tuples(st.floats(0, 400), st.floats(0, 400)), max_size=30))
def test_a_path_holds_every_dot(points: list[tuple[float, float]]) -> None:
    """To a tenth of a pixel, a line of no length each."""
    x, y = np.array(points).reshape(-1, 2).T
    found = places(dots(x, y))
    wanted = np.stack([x, y], -1)[np.lexsort((y, x))]
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max(initial=0.0) <= 0.05 + 1e-9


@given(NUMBERS)
def test_axes_hold_every_number(values: list[float]) -> None:
    """Differences all, errors all but those that are counted; ticks are on the axis, apart and in order."""
    numbers = np.array(values)
    for axis, shown in ((difference_axis(numbers), numbers), (value_axis(np.abs(numbers)), np.abs(numbers))):
        outside = (shown < axis.low) | (shown > axis.high)
        assert outside.sum() == axis.below(shown)
        order = np.argsort(shown)
        assert (np.diff(axis.place(shown[order])) >= -1e-12).all()
        ticks = axis.ticks(0.15)
        assert ticks
        at = axis.place(np.array(ticks))
        assert ((at >= -1e-3) & (at <= 1 + 1e-3)).all()
        assert (np.diff(at) >= 0.1).all()
    assert difference_axis(numbers).low < 0 < difference_axis(numbers).high


def test_gross_failures_flatten_nothing() -> None:
    """The usual numbers keep a good part of the axis beside one of centimetres; else the axis is even."""
    usual = np.linspace(1.0, 3.0, 30)
    assert value_axis(usual).kind == difference_axis(usual - 2).kind == "linear"
    with_gross = np.append(usual, 150.0)
    axis = value_axis(with_gross)
    assert axis.kind == "log"
    assert np.ptp(axis.place(usual)) > 0.15
    assert np.ptp(value_axis(usual).place(usual)) > 0.6
    signed = np.append(usual - 2, -90.0)
    axis = difference_axis(signed)
    assert axis.kind == "asinh"
    assert np.ptp(axis.place(usual - 2)) > 0.2
    assert axis.ticks(0.12)[0] < 0
    assert 0.0 in axis.ticks(0.12)


def test_an_axis_of_nothing() -> None:
    """Only zeros, which a model may well have against itself."""
    assert value_axis(np.zeros(3)).place(np.zeros(3)).tolist() == [0.0] * 3
    assert difference_axis(np.zeros(3)).place(np.zeros(3)).tolist() == [0.5] * 3
    assert value_axis(np.array([0.0, 0.0, 3.0])).below(np.array([0.0, 0.0, 3.0])) == 2


@pytest.mark.parametrize("n", [3, MOST_NAMED + 1])
def test_every_subject_is_drawn(n: int) -> None:
    """A dot a number, over its value; subjects are named while they are few."""
    axis = value_axis(np.arange(1.0, n + 1))
    strips = [
        Strip("a & b", {f"S{k}": k + 1.0 for k in range(n)}),
        Strip("c", {"S0": 1.0}),
        Strip("none", {}),
    ]
    drawn = draw([Panel("Thumb", "Thumb <1>", "digit0", strips)], axis, "mm", n)
    picture = str(drawn.pictures[0])
    paths = re.findall(r'class="digit0" d="([^"]*)"', picture)
    found = np.concatenate([places(path) for path in paths])
    assert len(found) == n + 1
    assert len(paths) == (n if n <= MOST_NAMED else 2)
    assert picture.count("<title>S") == (n if n <= MOST_NAMED else 0)
    row = np.sort(found[found[:, 1] < found[:, 1].max() - 8][:, 0])
    shares = axis.place(np.arange(1.0, n + 1))
    assert np.polyfit(shares, row, 1, full=True)[1] < 1.0
    assert f">1 of {n}<" in picture
    assert f">0 of {n}<" in picture
    assert "a &amp; b" in picture
    assert "Thumb &lt;1&gt;" in picture


def test_dots_stand_over_their_numbers() -> None:
    """Where the grid has its line for the number, and the number is written below that."""
    axis = value_axis(np.array([0.0, 10.0]))
    strips = [Strip("one", {"S0": 4.0})]
    (picture,) = draw([Panel("Thumb", "Thumb", "digit0", strips)], axis, "mm", 1).pictures
    (dot,) = places(re.findall(r'class="digit0" d="([^"]*)"', picture)[0])
    grid = re.findall(r"M([\d.]+) ", re.findall(r'class="grid" d="([^"]*)"', picture)[0])
    written = dict(re.findall(r'<text x="([\d.]+)" y="[\d.]+" class="tick middle">([\d.]+)<', picture))
    at = next(float(x) for x, tick in written.items() if tick == "4")
    assert dot[0] == pytest.approx(at, abs=0.11)
    assert any(abs(float(x) - at) < 0.11 for x in grid)


def test_rows_have_room_for_the_most_crowded_panel() -> None:
    """Rows are as high in every panel, and no dot leaves its own."""
    axis = value_axis(np.array([1.0, 100.0]))
    same = {f"S{k}": 5.0 for k in range(9)}
    apart = {name: 10.0 * k for k, name in enumerate(same)}
    panels = [
        Panel("Thumb", "Thumb", "digit0", [Strip("one", crowded), Strip("two", apart)])
        for crowded in (same, apart)
    ]
    first, second = draw(panels, axis, "mm", 9).pictures
    rows = [
        [float(y) for y in re.findall(r'y="([\d.]+)" class="model"', picture)] for picture in (first, second)
    ]
    assert rows[0] == rows[1]
    dots_of = np.concatenate([places(path) for path in re.findall(r'class="digit0" d="([^"]*)"', first)])
    border = dots_of[:, 1][dots_of[:, 1] > rows[0][1] - 10].min()
    assert (dots_of[:, 1] < border).sum() == (dots_of[:, 1] >= border).sum() == 9


def test_a_picture_of_differences_has_means_and_intervals(twelve: StudyResults) -> None:
    """A bar where there is an interval, in every panel, rows of one model at one height."""
    section = models_compared(twelve).sections[0]
    assert section.differences is not None
    assert [name for name, _ in section.differences.panels] == DIGITS
    assert [name for name, _ in section.values.panels] == DIGITS
    assert "the bar its 95 % interval" in section.differences.caption
    for _, picture in section.differences.panels:
        assert picture.count('class="bar"') == picture.count('class="mark"') == 3
        assert 'class="axis zero"' in picture
    for group in (section.values, section.differences):
        heights = {tuple(re.findall(r'y="([\d.]+)" class="(?:model|baseline)"', p)) for _, p in group.panels}
        assert len(heights) == 1


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
    """As the reader chooses; a link into another one shows that; on paper and without scripting all are."""
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
    page.emulate_media(media="print")
    assert visible() == [True] * 5
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
          return [path.querySelector("title").textContent, felt];
        })"""
    )
    assert {name for name, _ in told} == {"S001", "S002"}
    assert any(felt for _, felt in told)
