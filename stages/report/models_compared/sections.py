"""The study page's section of compared models: the finding, then an answer to each question."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from stages.report.comparison.answers import Answer, answer
from stages.report.comparison.comparison_text import (
    missing_of,
    missing_sentences,
    p_text,
    summary,
    untestable,
    with_statistics,
)
from stages.report.comparison.comparisons import ALL_DIGITS, Comparison, missing_text
from stages.report.comparison.questions import QUESTIONS
from stages.report.palette import SOFT, Look, model_looks
from stages.report.pictures.scale import Scale
from stages.report.pictures.subject_dots import (
    FEWEST_FOR_QUARTILES,
    Panel,
    Strip,
    difference_scale,
    draw_panels,
    value_scale,
)
from stages.report.study_results import StudyResults
from stages.report.table_cells import DASH, Block, DataTable, Folded, counted, listed, number, title
from stages.report.wording import mark, say
from subject_statistics.paired_statistics import FEWEST_SUBJECTS, Paired

_SCALES = {"linear": "", "log": mark(", log scale"), "asinh": mark(", even about 0, squeezed outward")}


@dataclass(frozen=True)
class Panels:
    """A picture: a panel a digit with its name, what is to be seen, and what else to know."""

    caption: str
    panels: tuple[tuple[str, Markup], ...]
    remarks: tuple[str, ...]


Looks = Mapping[str, Look]
"""Of models and references, by name."""


def looks_of(results: StudyResults, answer: Answer) -> Looks:
    """Every model's look as in the study's other pictures, and the references' own."""
    return {name: Look(SOFT, "o") for name in answer.names} | model_looks(list(results.models))


def value_panels(answer: Answer, looks: Looks) -> Panels:
    """Every subject's number under each model and each reference."""
    every = np.array(
        [v for of in answer.by_digit.values() for numbers in of.values() for v in numbers.values()]
    )
    scale = value_scale(every)
    shown = say(
        "{choice}, every subject under {names}",
        choice=say(answer.question.choice),
        names=listed(answer.names),
    )
    marks = {name: (name == answer.baseline, name in answer.question.references) for name in answer.names}
    panels = [
        _panel_of(
            digit, shown, [Strip(n, looks[n], of.get(n, {}), None, None, *own) for n, own in marks.items()]
        )
        for digit, of in answer.by_digit.items()
    ]
    places = (
        say("hands, recordings and joints")
        if answer.question.table == "joint_errors"
        else say("hands and recordings")
    )
    caption = say("A dot is a subject: the mean over {places}.", places=places)
    if answer.n_subjects >= FEWEST_FOR_QUARTILES:
        caption += say(" The line is the median, the box the quartiles.")
    if answer.overall:
        caption += say(" In bold what the others are compared with: {baseline}.", baseline=answer.baseline)
    low = scale.below(every)
    below = say(
        "{numbers} below {low:.2g} {unit} at the left edge.",
        numbers=counted(low, "number"),
        low=scale.low,
        unit=answer.question.unit,
    )
    return _panels(answer, caption, panels, scale, (below,) if low else ())


def difference_panels(answer: Answer, looks: Looks) -> Panels | None:
    """Every subject's difference from the baseline, with means and intervals; None without any."""
    of_digit: dict[str, list[Strip]] = {digit: [] for digit in answer.by_digit}
    for each in (*answer.overall, *answer.digits):
        if each.statistics is not None:
            differences = {p.subject: p.difference for p in each.compared if p.difference is not None}
            own = each.statistics
            strip = Strip(each.model, looks[each.model], differences, own.mean, own.interval)
            of_digit[each.digit].append(strip)
    strips = [strip for of in of_digit.values() for strip in of]
    if not strips:
        return None
    scale = difference_scale(np.array([value for strip in strips for value in strip.numbers.values()]))
    shown = say(
        "{choice}, each subject's difference from {baseline}",
        choice=say(answer.question.choice),
        baseline=answer.baseline,
    )
    panels = [_panel_of(digit, shown, of) for digit, of in of_digit.items() if of]
    caption = say(
        (
            "A dot is a subject: the model's number less that of {baseline}, over the places in "
            "which both have one. The line is the mean"
        ),
        baseline=answer.baseline,
    )
    if all(strip.interval is None for strip in strips):
        caption += say(
            "; with fewer than {FEWEST_SUBJECTS} subjects there is no interval.",
            FEWEST_SUBJECTS=FEWEST_SUBJECTS,
        )
    else:
        caption += say(", the bar its 95 % interval, for one comparison at a time.")
    return _panels(answer, caption, panels, scale)


def digit_title(digit: str) -> str:
    """The digit in words."""
    return say("All digits") if digit == ALL_DIGITS else title(digit)


def _panel_of(digit: str, shown: str, strips: Sequence[Strip]) -> Panel:
    return Panel(digit_title(digit), f"{digit_title(digit)}: {shown}.", strips)


def _panels(
    answer: Answer, caption: str, panels: Sequence[Panel], scale: Scale, remarks: tuple[str, ...] = ()
) -> Panels:
    drawn = draw_panels(panels, scale, f"{answer.question.unit}{say(_SCALES[scale.kind])}", answer.n_subjects)
    if drawn.overlapping:
        remarks += (
            say(
                "{dots} of much the same number lie partly on others.", dots=counted(drawn.overlapping, "dot")
            ),
        )
    names = (panel.name for panel in panels)
    return Panels(caption, tuple(zip(names, drawn.pictures, strict=True)), remarks)


@dataclass(frozen=True)
class Section:
    """The answer to one question.

    key : an identifier. kind : which data it is from. sentences : what was own, less what the finding of
    all says already. differences, table, by_digit : None where nothing could be compared.
    """

    key: str
    choice: str
    says: str
    kind: str
    sentences: tuple[str, ...]
    missing: tuple[str, ...]
    values: Panels
    differences: Panels | None
    table: DataTable | None
    by_digit: Folded | None
    subjects: Folded


@dataclass(frozen=True)
class ModelsCompared:
    """The study's answer: its headline in a paragraph, the sections, and all comparisons that were made."""

    headline: str
    sections: tuple[Section, ...]
    comparisons: tuple[Comparison, ...]


def models_compared(results: StudyResults) -> ModelsCompared:
    """Compare the study's models across its subjects."""
    answers = [own for question in QUESTIONS if (own := answer(results, question)) is not None]
    headline = _headline(results, answers)
    return ModelsCompared(
        headline,
        tuple(_section(each, headline, looks_of(results, each)) for each in answers),
        tuple(comparison for each in answers for comparison in (*each.overall, *each.digits)),
    )


def _headline(results: StudyResults, answers: Sequence[Answer]) -> str:
    """What the study shows of its models by the answer that judges best; where it cannot, that it cannot."""
    main = next((each for each in answers if each.judges), None)
    if main is None:
        return say(
            "The data of this study cannot say which of its models is the better skeleton: there is "
            "no truth and no fitted hand that was held out, and the replay's error says only how "
            "well joints close."
        )
    seen = "" if main.held_out else say(", on recordings that they were made from, for nothing is held out")
    parts = [
        say("Models are judged by {judged_by}{seen}.", judged_by=say(main.question.judged_by), seen=seen),
        untestable(main.overall),
        *_summary(main),
    ]
    others = [name for name in results.models if name not in results.fitted]
    if main.question.fitted_only and len(others) > 1:
        parts.append(
            say(
                (
                    "Between {others} the data of this study cannot decide: there is no truth, and the "
                    "replay's error says only how well joints close."
                ),
                others=listed(others),
            )
        )
    return " ".join(filter(None, parts))


def _section(own: Answer, headline: str, looks: Looks) -> Section:
    overall, by_digit = (_comparison_table(own, comparisons) for comparisons in (own.overall, own.digits))
    summarised = [untestable(own.overall), *_summary(own)]
    return Section(
        key=own.question.metric,
        choice=say(own.question.choice),
        says=say(own.question.says),
        kind=own.kind,
        sentences=tuple(text for text in summarised if text and text not in headline),
        missing=tuple(missing_sentences(own.overall)),
        values=value_panels(own, looks),
        differences=difference_panels(own, looks),
        table=overall,
        by_digit=Folded(say("The same, digit by digit"), by_digit) if by_digit else None,
        subjects=_subject_table(own),
    )


def _summary(own: Answer) -> list[str]:
    return (
        summary(own.overall)
        if own.overall
        else [say("There is only {models} to look at.", models=listed(own.models))]
    )


def _held_out(own: Answer) -> str:
    return say("held out") if own.held_out else say("in-sample")


def _comparison_table(own: Answer, comparisons: Sequence[Comparison]) -> DataTable | None:
    """A row a model that could be compared with the baseline, a block a digit."""
    unit = own.question.unit
    of_digit: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for each, statistics in with_statistics(comparisons):
        of_digit[each.digit].append(_cells(each, statistics))
    if not of_digit:
        return None
    measured = (
        say("Subjects"),
        say("Model [{unit}]", unit=unit),
        f"{own.baseline} [{unit}]",
        say("Difference [{unit}]", unit=unit),
        say("Median [{unit}]", unit=unit),
        say("95 % interval [{unit}]", unit=unit),
        "p",
        say("p corrected"),
        say("Effect size"),
        say("Better in"),
    )
    blocks = (Block((digit_title(digit), *measured), tuple(rows)) for digit, rows in of_digit.items())
    scope = "" if ALL_DIGITS in of_digit else say(", digit by digit")
    return DataTable(
        say(
            "{choice}: every model against {baseline}{scope}, {held_out}.",
            choice=say(own.question.choice),
            baseline=own.baseline,
            scope=scope,
            held_out=_held_out(own),
        ),
        tuple(blocks),
        (
            say(
                (
                    "Differences are the model's number less that of {baseline}: below 0 the model is "
                    "better. A subject counts once, by its mean over the places in which both have a number. "
                    "Interval: expanded percentile bootstrap over subjects, from {FEWEST_SUBJECTS} subjects "
                    "on, for one comparison. p: sign-flip test; corrected by Holm over {comparisons}. Effect "
                    "size: Cohen's d_z with Hedges' correction."
                ),
                baseline=own.baseline,
                FEWEST_SUBJECTS=FEWEST_SUBJECTS,
                comparisons=counted(comparisons[0].n_compared, "comparison"),
            ),
        ),
        frozenset({0, 6}),
    )


def _cells(comparison: Comparison, statistics: Paired) -> tuple[str, ...]:
    compared = comparison.compared
    some = (
        say(" of {n_subjects}", n_subjects=len(comparison.subjects))
        if len(compared) < len(comparison.subjects)
        else ""
    )
    interval = statistics.interval
    return (
        comparison.model,
        f"{len(compared)}{some}",
        *(
            number(sum(value or 0.0 for value in values) / statistics.n)
            for values in ([pair.value for pair in compared], [pair.other for pair in compared])
        ),
        number(statistics.mean),
        number(statistics.median),
        say("{interval} to {interval_2}", interval=number(interval[0]), interval_2=number(interval[1]))
        if interval
        else DASH,
        _p_cell(statistics.p),
        _p_cell(comparison.p_holm),
        number(statistics.effect),
        say("{n_better} of {n}", n_better=statistics.n_better, n=statistics.n),
    )


def _p_cell(p: float | None) -> str:
    return DASH if p is None else p_text(p).removeprefix("p ").removeprefix("= ")


def _subject_table(own: Answer) -> Folded:
    """A row a subject, a column a model, and what is missing."""
    means = own.by_digit[ALL_DIGITS]
    gone = {subject: missing_text(missing) for subject, missing in missing_of(own.overall).items()}
    last = (say("Missing"),) if any(gone.values()) else ()
    header = (say("Subject [{unit}]", unit=own.question.unit), *own.names, *last)
    subjects = sorted({*gone, *(subject for numbers in means.values() for subject in numbers)})
    rows = tuple(
        (
            subject,
            *(number(means.get(name, {}).get(subject)) for name in own.names),
            *((gone.get(subject) or DASH,) if last else ()),
        )
        for subject in subjects
    )
    caption = say(
        "{choice}, subject by subject: mean over all digits, {held_out}.",
        choice=say(own.question.choice),
        held_out=_held_out(own),
    )
    text = frozenset({0, len(header) - 1} if last else {0})
    return Folded(say("Subject by subject"), DataTable(caption, (Block(header, rows),), (), text))
