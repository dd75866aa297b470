"""The study page's section of compared models: the finding, then an answer to each question."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from shukotsu.sentences.translation import listed, ngettext, tr
from shukotsu.stages.report.comparison.answers import ALL_DIGITS, Answer, Comparison, answer, missing_text
from shukotsu.stages.report.comparison.comparison_text import (
    missing_sentences,
    p_text,
    summary,
    untestable,
)
from shukotsu.stages.report.comparison.questions import JOINT_ERROR, QUESTIONS
from shukotsu.stages.report.models_compared.model_panels import (
    difference_panel,
    digit_title,
    looks_of,
    value_panel,
)
from shukotsu.stages.report.plots.page_pictures import page_picture
from shukotsu.stages.report.plots.rows import FEWEST_FOR_QUARTILES
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import DASH, Block, DataTable, Folded, number
from shukotsu.statistics.paired_statistics import FEWEST_SUBJECTS


@dataclass(frozen=True)
class Pictures:
    """One question's pictures, of values and of differences (None without any), and what is to be seen."""

    caption: str
    values: Markup
    differences: Markup | None
    about_differences: str


def pictures_of(results: StudyResults, answer: Answer) -> Pictures:
    """Draw one question's pictures, all digits first."""
    looks, digits = looks_of(results, answer), list(answer.by_digit)
    places = (
        tr("hands, recordings and joints") if answer.question is JOINT_ERROR else tr("hands and recordings")
    )
    caption = tr("A dot is a subject: the mean over {places}. The mark is the median.", places=places)
    if answer.n_subjects >= FEWEST_FOR_QUARTILES:
        caption += tr(" The bar has the quartiles.")
    differences = difference_panel(answer, looks, digits)
    return Pictures(
        caption,
        page_picture(value_panel(answer, looks, digits)),
        None if differences is None else page_picture(differences),
        _about_differences(answer),
    )


def _about_differences(answer: Answer) -> str:
    text = tr(
        "A dot is a subject: the model's number less that of {baseline}, over the places in "
        "which both have one. The mark is the mean",
        baseline=answer.baseline,
    )
    if all(each.interval is None for each in answer.overall):
        return text + tr(
            "; with fewer than {FEWEST_SUBJECTS} subjects there is no interval.",
            FEWEST_SUBJECTS=FEWEST_SUBJECTS,
        )
    return text + tr(", the bar its 95 % interval, for one comparison at a time.")


@dataclass(frozen=True)
class Section:
    """The answer to one question.

    key : an identifier. kind : which data it is from. sentences : what was own, less what the finding of
    all says already. table, by_digit : None where nothing could be compared.
    """

    key: str
    choice: str
    says: str
    kind: str
    sentences: tuple[str, ...]
    missing: tuple[str, ...]
    pictures: Pictures
    table: DataTable | None
    by_digit: Folded | None
    subjects: Folded


@dataclass(frozen=True)
class ModelsCompared:
    """The study's answer: its headline in a paragraph, and the sections."""

    headline: str
    sections: tuple[Section, ...]


def models_compared(results: StudyResults) -> ModelsCompared:
    """Compare the study's models across its subjects."""
    answers = [own for question in QUESTIONS if (own := answer(results, question)) is not None]
    headline = _headline(results, answers)
    return ModelsCompared(
        headline,
        tuple(_section(results, each, headline) for each in answers),
    )


def _headline(results: StudyResults, answers: Sequence[Answer]) -> str:
    """Compare the study's models by the answer that judges best, or say that it cannot."""
    main = next((each for each in answers if each.judges), None)
    if main is None:
        return tr(
            "The data of this study cannot say which of its models is the better skeleton: there is "
            "no truth and no fitted hand that was held out, and the replay's error says only how "
            "well joints close."
        )
    seen = "" if main.held_out else tr(", on recordings that they were made from, for nothing is held out")
    parts = [
        tr("Models are judged by {judged_by}{seen}.", judged_by=tr(main.question.judged_by), seen=seen),
        untestable(main.overall),
        *_summary(main),
    ]
    others = [name for name in results.models if name not in results.fitted]
    if main.question.fitted_only and len(others) > 1:
        parts.append(
            tr(
                "Between {others} the data of this study cannot decide: there is no truth, and the "
                "replay's error says only how well joints close.",
                others=listed(others),
            )
        )
    return " ".join(filter(None, parts))


def _section(results: StudyResults, own: Answer, headline: str) -> Section:
    overall, by_digit = (_comparison_table(own, comparisons) for comparisons in (own.overall, own.digits))
    summarised = [untestable(own.overall), *_summary(own)]
    return Section(
        key=own.question.metric,
        choice=tr(own.question.choice),
        says=tr(own.question.says),
        kind=own.kind,
        sentences=tuple(text for text in summarised if text and text not in headline),
        missing=tuple(missing_sentences(own)),
        pictures=pictures_of(results, own),
        table=overall,
        by_digit=Folded(tr("The same, digit by digit"), by_digit) if by_digit else None,
        subjects=_subject_table(own),
    )


def _summary(own: Answer) -> list[str]:
    return (
        summary(own.overall)
        if own.overall
        else [tr("There is only {models} to look at.", models=listed(own.models))]
    )


def _held_out(own: Answer) -> str:
    return tr("held out") if own.held_out else tr("in-sample")


def _comparison_table(own: Answer, comparisons: Sequence[Comparison]) -> DataTable | None:
    """A row a model that could be compared with the baseline, a block a digit."""
    unit = own.question.unit
    of_digit: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for each in comparisons:
        of_digit[each.digit].append(_cells(each))
    if not of_digit:
        return None
    measured = (
        tr("Subjects"),
        tr("Model [{unit}]", unit=unit),
        f"{own.baseline} [{unit}]",
        tr("Difference [{unit}]", unit=unit),
        tr("Median [{unit}]", unit=unit),
        tr("95 % interval [{unit}]", unit=unit),
        "p",
        tr("p corrected"),
        tr("Effect size"),
        tr("Better in"),
    )
    blocks = (Block((digit_title(digit), *measured), tuple(rows)) for digit, rows in of_digit.items())
    scope = "" if ALL_DIGITS in of_digit else tr(", digit by digit")
    return DataTable(
        tr(
            "{choice}: every model against {baseline}{scope}, {held_out}.",
            choice=tr(own.question.choice),
            baseline=own.baseline,
            scope=scope,
            held_out=_held_out(own),
        ),
        tuple(blocks),
        (
            tr(
                "Differences are the model's number less that of {baseline}: below 0 the model is "
                "better. A subject counts once, by its mean over the places in which both have a number. "
                "Interval: expanded percentile bootstrap over subjects, from {FEWEST_SUBJECTS} subjects "
                "on, for one comparison. p: sign-flip test; corrected by Holm over {comparisons}. Effect "
                "size: Cohen's d_z with Hedges' correction.",
                baseline=own.baseline,
                FEWEST_SUBJECTS=FEWEST_SUBJECTS,
                comparisons=ngettext("{n} comparison", "{n} comparisons", comparisons[0].n_comparisons),
            ),
        ),
        frozenset({0, 6}),
    )


def _cells(own: Comparison) -> tuple[str, ...]:
    some = tr(" of {n_subjects}", n_subjects=own.n_subjects) if own.n < own.n_subjects else ""
    interval = own.interval
    return (
        own.model,
        f"{own.n}{some}",
        number(own.mean),
        number(own.other_mean),
        number(own.mean_difference),
        number(own.median_difference),
        tr("{interval} to {interval_2}", interval=number(interval[0]), interval_2=number(interval[1]))
        if interval
        else DASH,
        _p_cell(own.p),
        _p_cell(own.p_holm),
        number(own.effect_size),
        tr("{n_better} of {n}", n_better=own.n_better, n=own.n),
    )


def _p_cell(p: float) -> str:
    return p_text(p).removeprefix("p ").removeprefix("= ")


def _subject_table(own: Answer) -> Folded:
    """A row a subject, a column a model, and what is missing."""
    means = own.by_digit[ALL_DIGITS]
    gone = {subject: missing_text(missing) for subject, missing in own.missing.items()}
    last = (tr("Missing"),) if any(gone.values()) else ()
    header = (tr("Subject [{unit}]", unit=own.question.unit), *own.names, *last)
    subjects = sorted({*gone, *(subject for numbers in means.values() for subject in numbers)})
    rows = tuple(
        (
            subject,
            *(number(means.get(name, {}).get(subject)) for name in own.names),
            *((gone.get(subject) or DASH,) if last else ()),
        )
        for subject in subjects
    )
    caption = tr(
        "{choice}, subject by subject: mean over all digits, {held_out}.",
        choice=tr(own.question.choice),
        held_out=_held_out(own),
    )
    text = frozenset({0, len(header) - 1} if last else {0})
    return Folded(tr("Subject by subject"), DataTable(caption, (Block(header, rows),), (), text))
