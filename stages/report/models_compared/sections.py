"""The study page's section of compared models: the finding, then an answer to each question."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from stages.report.comparison import ALL_DIGITS, Comparison, missing_in_words
from stages.report.comparison_words import comparison_table
from stages.report.data_table import DASH, Block, DataTable, Folded, listed, number
from stages.report.models_compared.answers import Answer, answer, baseline_of
from stages.report.models_compared.pictures import Panels, difference_panels, title_of, value_panels
from stages.report.models_compared.questions import QUESTIONS
from stages.report.models_compared.words import (
    bullets,
    missing_in_sentences,
    missing_of,
    summary,
    untestable,
)
from stages.report.study_results import StudyResults


@dataclass(frozen=True)
class Section:
    """The answer to one question.

    key : an identifier. kind : which data it is from. sentences : what was found, less what the finding of
    all says already; bullets : comparison by comparison, where any can be tested. differences, table,
    by_digit : None where nothing could be compared.
    """

    key: str
    choice: str
    says: str
    kind: str
    sentences: tuple[str, ...]
    bullets: tuple[str, ...]
    missing: tuple[str, ...]
    values: Panels
    differences: Panels | None
    table: DataTable | None
    by_digit: Folded | None
    subjects: Folded


@dataclass(frozen=True)
class ModelsCompared:
    """The study's answer: its finding in a paragraph, the sections, and all comparisons that were made."""

    finding: str
    sections: tuple[Section, ...]
    comparisons: tuple[Comparison, ...]


def models_compared(results: StudyResults, baseline: str | None = None) -> ModelsCompared:
    """Compare the study's models across its subjects.

    baseline : the model that the others are held against; unless given the paper's, see `answers`.
    """
    base = baseline_of(results) if baseline is None else baseline
    answers = [found for question in QUESTIONS if (found := answer(results, question, base)) is not None]
    finding = _finding(results, answers)
    return ModelsCompared(
        finding,
        tuple(_section(each, finding) for each in answers),
        tuple(comparison for each in answers for comparison in (*each.overall, *each.digits)),
    )


def _finding(results: StudyResults, answers: Sequence[Answer]) -> str:
    """What the study shows of its models by the answer that judges best; where it cannot, that it cannot."""
    judging = [each for each in answers if each.judges]
    if not judging:
        return (
            "The data of this study cannot say which of its models is the better skeleton: there is no truth "
            "and no fitted hand that was held out, and the replay's error says only how well joints close."
        )
    main = judging[0]
    seen = "" if main.held_out else ", on recordings that they were made from, for nothing is held out"
    told = [f"Models are judged by {main.question.judged_by}{seen}.", untestable(main.overall), *_told(main)]
    others = [name for name in results.models if name not in results.fitted]
    if main.question.fitted_only and len(others) > 1:
        told.append(
            f"Between {listed(others)} the data of this study cannot decide: there is no truth, and the "
            "replay's error says only how well joints close."
        )
    return " ".join(filter(None, told))


def _section(found: Answer, finding: str) -> Section:
    table, by_digit = _tables(found)
    told = [untestable(found.overall), *_told(found)]
    return Section(
        key=found.question.metric,
        choice=found.question.choice,
        says=found.question.says,
        kind=_kind(found),
        sentences=tuple(sentence for sentence in told if sentence and sentence not in finding),
        bullets=tuple(bullets(found.overall)),
        missing=tuple(missing_in_sentences(found.overall)),
        values=value_panels(found),
        differences=difference_panels(found),
        table=table,
        by_digit=by_digit,
        subjects=_subject_table(found),
    )


def _told(found: Answer) -> list[str]:
    return summary(found.overall) if found.overall else [f"There is only {listed(found.models)} to look at."]


def _held_out(found: Answer) -> str:
    return "held out" if found.held_out else "in-sample"


def _kind(found: Answer) -> str:
    if found.held_out:
        return "Held out: skeletons made without the recordings that they are scored on."
    return (
        "In-sample: nothing is held out, so a skeleton may have learnt the recording that it is scored on "
        "and not the hand."
    )


def _tables(found: Answer) -> tuple[DataTable | None, Folded | None]:
    """The comparisons over all digits, a row a model, and folded the same with a block a digit."""
    overall, digits = (_table(found, made) for made in (found.overall, found.digits))
    return overall, Folded("The same, digit by digit", digits) if digits else None


def _table(found: Answer, comparisons: Sequence[Comparison]) -> DataTable | None:
    """The numbers of `comparison_table`, laid out for one baseline.

    Of its notes only how to read it: what the numbers do not say the section says.
    """
    made = [each for each in comparisons if each.found is not None]
    table = comparison_table(made)
    if table is None:
        return None
    unit, measured = found.metric.unit, table.blocks[0].header[4:]
    of_digit: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for each, row in zip(made, (row for block in table.blocks for row in block.rows), strict=True):
        of_digit[each.digit].append((each.model, *row[1:]))
    blocks = tuple(
        Block(
            (title_of(digit), "Subjects", f"Model [{unit}]", f"{found.baseline} [{unit}]", *measured),
            tuple(rows),
        )
        for digit, rows in of_digit.items()
    )
    scope = "" if ALL_DIGITS in of_digit else ", digit by digit"
    caption = f"{found.question.choice}: every model against {found.baseline}{scope}, {_held_out(found)}."
    _, _, how = table.notes[0].partition(". ")
    what = f"Differences are the model's number less that of {found.baseline}: below 0 the model is better."
    return DataTable(caption, blocks, (f"{what} {how}",))


def _subject_table(found: Answer) -> Folded:
    """A row a subject, a column a model, and what is missing."""
    means = found.by_digit[ALL_DIGITS]
    gone = {subject: missing_in_words(missing) for subject, missing in missing_of(found.overall).items()}
    told = ("Missing",) if any(gone.values()) else ()
    header = (f"Subject [{found.metric.unit}]", *found.names, *told)
    subjects = sorted({*gone, *(subject for numbers in means.values() for subject in numbers)})
    rows = tuple(
        (
            subject,
            *(number(means.get(name, {}).get(subject)) for name in found.names),
            *((gone.get(subject) or DASH,) if told else ()),
        )
        for subject in subjects
    )
    caption = f"{found.question.choice}, subject by subject: mean over all digits, {_held_out(found)}."
    text = frozenset({0, len(header) - 1} if told else {0})
    return Folded("Subject by subject", DataTable(caption, (Block(header, rows),), (), text))
