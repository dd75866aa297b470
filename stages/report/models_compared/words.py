"""What comparisons with one baseline say together, so that nothing is said as often as there are models."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from stages.report.comparison import (
    FEWEST_SUBJECTS,
    LEVEL,
    Comparison,
    Missing,
    missing_in_words,
)
from stages.report.comparison_words import MOST_NAMED, caution, sentence
from stages.report.data_table import counted, listed, number

_MOST = 2 / 3
"""The share of subjects from which it is told that they contradict the mean."""


def summary(comparisons: Sequence[Comparison]) -> list[str]:
    """Sentences: who does better than the baseline, who worse, of whom nothing is shown, who does the same.

    `comparisons` are of several models with one baseline, over all digits, made together. Where there are
    too few subjects for a test the numbers are those of these subjects; `untestable` says so.
    """
    found = [each for each in comparisons if each.found is not None]
    if not found:
        return ["There is nothing to compare: no subject has the numbers of two models."]
    same = [each for each in found if each.found and each.found.n_equal == each.found.n]
    differ = [each for each in found if each not in same]
    tested = [each for each in differ if _testable(each)]
    return _shown(tested) + _seen([each for each in differ if each not in tested]) + _same(same)


def untestable(comparisons: Sequence[Comparison]) -> str:
    """That so few subjects can show no difference, whatever their numbers are; empty where a test can."""
    found = [each.found for each in comparisons if each.found is not None]
    if not found or any(_testable(each) for each in comparisons):
        return ""
    most = max(each.n for each in found)
    who = f"{counted(most, 'subject')} cannot show a difference between models, whatever the numbers are: "
    if most < FEWEST_SUBJECTS:
        least = min(each.smallest_p for each in found)
        return f"{who}the smallest p that a test can give is {least:.2g}. It takes {FEWEST_SUBJECTS} or more."
    least = min(each.smallest_p_holm or 1.0 for each in comparisons)
    over = counted(comparisons[0].n_compared, "comparison")
    return f"{who}the smallest p that a test can give, Holm-corrected over {over}, is {least:.2g}."


def bullets(comparisons: Sequence[Comparison]) -> list[str]:
    """A sentence for each comparison; none where none can be tested.

    Without who is missing and what a difference does not say: that stands once for all of them.
    """
    if not any(_testable(each) for each in comparisons):
        return []
    alone = [(each, replace(each, subjects=each.compared)) for each in comparisons if each.found is not None]
    return [sentence(bare).removesuffix(caution(each)).rstrip() for each, bare in alone]


def missing_of(comparisons: Sequence[Comparison]) -> dict[str, list[Missing]]:
    """By subject in which places a model has no number, each once, however many comparisons it is in."""
    of_subject: dict[str, dict[Missing, None]] = defaultdict(dict)
    for each in comparisons:
        for pair in each.subjects:
            of_subject[pair.subject].update(dict.fromkeys(pair.missing))
    return {subject: list(missing) for subject, missing in of_subject.items()}


def missing_in_sentences(comparisons: Sequence[Comparison]) -> list[str]:
    """The subjects without a number of some model, those with the same reasons together."""
    subjects: dict[str, list[str]] = defaultdict(list)
    for subject, missing in missing_of(comparisons).items():
        if missing:
            subjects[missing_in_words(missing)].append(subject)
    return [f"{_some(names)}: {reasons}." for reasons, names in subjects.items()]


def _some(names: Sequence[str]) -> str:
    """The first few by name."""
    if len(names) <= MOST_NAMED + 1:
        return listed(names)
    return listed([*names[:MOST_NAMED], f"{len(names) - MOST_NAMED} more"])


def _testable(comparison: Comparison) -> bool:
    return comparison.smallest_p_holm is not None and comparison.smallest_p_holm <= LEVEL


def _shown(tested: Sequence[Comparison]) -> list[str]:
    """Whose difference is shown, best first, then of whom none is."""
    if not tested:
        return []
    other = tested[0].other
    shown = sorted((each for each in tested if each.significant), key=_mean)
    better = [_with_amount(each) for each in shown if _mean(each) < 0]
    worse = [_with_amount(each) for each in shown if _mean(each) > 0]
    open_ = [f"{each.model}{_despite(each)}" for each in tested if not each.significant]
    told = [f"better than {other} {_are(better)} {listed(better)}"] if better else []
    told += [f"worse {'' if better else f'than {other} '}{_are(worse)} {listed(worse)}"] if worse else []
    told += [f"no difference {'' if told else f'from {other} '}is shown for {listed(open_)}"] if open_ else []
    return [f"Over {_subjects(tested)}, {'; '.join(told)}."]


def _with_amount(comparison: Comparison) -> str:
    amount = f"by {number(abs(_mean(comparison)))} {comparison.metric.unit} in the mean"
    return f"{comparison.model} ({amount}){_despite(comparison)}"


def _despite(comparison: Comparison) -> str:
    """That most subjects say the opposite of the mean, which a few gross failures carry."""
    found = comparison.found
    assert found is not None
    n_worse = found.n - found.n_better - found.n_equal
    if found.mean > 0 and found.n_better >= _MOST * found.n:
        return f" (the mean is worse, though it is better in {found.n_better} of {found.n})"
    if found.mean < 0 and n_worse >= _MOST * found.n:
        return f" (the mean is better, though it is worse in {n_worse} of {found.n})"
    return ""


def _are(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"


def _mean(comparison: Comparison) -> float:
    return comparison.found.mean if comparison.found else 0.0


def _subjects(comparisons: Sequence[Comparison]) -> str:
    counts = sorted({each.found.n for each in comparisons if each.found})
    return counted(counts[0], "subject") if len(counts) == 1 else f"{counts[0]} to {counts[-1]} subjects"


def _seen(few: Sequence[Comparison]) -> list[str]:
    """The differences of those who took part, without a test, best first."""
    if not few:
        return []
    told = [_difference(each) for each in sorted(few, key=_mean)]
    alone = all(each.found is not None and each.found.n == 1 for each in few)
    who = "this subject" if alone else "these subjects"
    return [f"In {who}, compared with {few[0].other}, {few[0].metric.what} {listed(told)}."]


def _difference(comparison: Comparison) -> str:
    found = comparison.found
    assert found is not None
    amount = f"{number(abs(found.mean))} {comparison.metric.unit} {'more' if found.mean > 0 else 'less'}"
    return f"{amount} with {comparison.model} ({found.n_better} of {found.n} better)"


def _same(same: Sequence[Comparison]) -> list[str]:
    if not same:
        return []
    verb = "has" if len(same) == 1 else "have"
    return [f"{listed(each.model for each in same)} {verb} exactly the same numbers as {same[0].other}."]
