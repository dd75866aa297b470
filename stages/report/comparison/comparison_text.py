"""What comparisons with one baseline say together and one by one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from stages.report.comparison.comparisons import Comparison, Missing, missing_text
from stages.report.table_cells import counted, listed, number
from subject_statistics.multiple_comparisons import LEVEL
from subject_statistics.paired_statistics import FEWEST_SUBJECTS, Paired

MOST_NAMED = 3
_MOST = 2 / 3
"""The share of subjects from which the text says that they contradict the mean."""

Tested = tuple[Comparison, Paired]


def summary(comparisons: Sequence[Comparison]) -> list[str]:
    """Sentences: who does better than the baseline, who worse, of whom nothing is shown, who does the same.

    `comparisons` are of several models with one baseline, over all digits, made together. Where there are
    too few subjects for a test the numbers are those of these subjects; `untestable` says so.
    """
    known = with_statistics(comparisons)
    if not known:
        return ["There is nothing to compare: no subject has the numbers of two models."]
    differ = [each for each in known if not each[0].equal]
    tested = [each for each in differ if each[0].testable]
    equal = [each for each, _ in known if each.equal]
    return _shown(tested) + _seen([each for each in differ if not each[0].testable]) + _equal(equal)


def with_statistics(comparisons: Sequence[Comparison]) -> list[Tested]:
    """Those that some subject has the numbers of both models for."""
    return [(each, each.statistics) for each in comparisons if each.statistics is not None]


def untestable(comparisons: Sequence[Comparison]) -> str:
    """That so few subjects can show no difference, whatever their numbers are; empty where a test can."""
    known = [statistics for _, statistics in with_statistics(comparisons)]
    if not known or any(each.testable for each in comparisons):
        return ""
    most = max(each.n for each in known)
    who = f"{counted(most, 'subject')} cannot show a difference between models, whatever the numbers are: "
    if most < FEWEST_SUBJECTS:
        least = min(each.smallest_p for each in known)
        return f"{who}the smallest p that a test can give is {least:.2g}. It takes {FEWEST_SUBJECTS} or more."
    least = min(each.smallest_p_holm or 1.0 for each in comparisons)
    over = counted(comparisons[0].n_compared, "comparison")
    return f"{who}the smallest p that a test can give, Holm-corrected over {over}, is {least:.2g}."


def missing_of(comparisons: Sequence[Comparison]) -> dict[str, list[Missing]]:
    """By subject in which places a model has no number, each once, however many comparisons it is in."""
    of_subject: dict[str, dict[Missing, None]] = defaultdict(dict)
    for each in comparisons:
        for pair in each.subjects:
            of_subject[pair.subject].update(dict.fromkeys(pair.missing))
    return {subject: list(missing) for subject, missing in of_subject.items()}


def missing_sentences(comparisons: Sequence[Comparison]) -> list[str]:
    """The subjects without a number of some model, those with the same reasons together."""
    subjects: dict[str, list[str]] = defaultdict(list)
    for subject, missing in missing_of(comparisons).items():
        if missing:
            subjects[missing_text(missing)].append(subject)
    return [f"{_some(names)}: {reasons}." for reasons, names in subjects.items()]


def p_text(p: float) -> str:
    """The test's p with two digits, or as many as it takes to stay on its side of LEVEL."""
    if p < 0.0001:
        return "p < 0.0001"
    texts = (f"{p:.{digits}g}" for digits in range(2, 17))
    return f"p = {next(text for text in texts if (float(text) <= LEVEL) == (p <= LEVEL))}"


def _some(names: Sequence[str]) -> str:
    """The first few by name."""
    if len(names) <= MOST_NAMED + 1:
        return listed(names)
    return listed([*names[:MOST_NAMED], f"{len(names) - MOST_NAMED} more"])


def _shown(tested: Sequence[Tested]) -> list[str]:
    """Whose difference is shown, best first, then of whom none is."""
    if not tested:
        return []
    other = tested[0][0].other
    shown = sorted((each for each in tested if each[0].significant), key=_mean)
    better = [_with_amount(*each) for each in shown if _mean(each) < 0]
    worse = [_with_amount(*each) for each in shown if _mean(each) > 0]
    unclear = [f"{each.model}{_despite(own)}" for each, own in tested if not each.significant]
    parts = [f"better than {other} {_are(better)} {listed(better)}"] if better else []
    parts += [f"worse {'' if better else f'than {other} '}{_are(worse)} {listed(worse)}"] if worse else []
    against = "" if parts else f"from {other} "
    parts += [f"no difference {against}is shown for {listed(unclear)}"] if unclear else []
    counts = sorted({own.n for _, own in tested})
    who = counted(counts[0], "subject") if len(counts) == 1 else f"{counts[0]} to {counts[-1]} subjects"
    return [f"Over {who}, {'; '.join(parts)}."]


def _with_amount(comparison: Comparison, statistics: Paired) -> str:
    amount = f"by {number(abs(statistics.mean))} {comparison.question.unit} in the mean"
    return f"{comparison.model} ({amount}){_despite(statistics)}"


def _despite(statistics: Paired) -> str:
    """That most subjects say the opposite of the mean, which a few gross failures carry."""
    n, n_better = statistics.n, statistics.n_better
    n_worse = n - n_better - statistics.n_equal
    if statistics.mean > 0 and n_better >= _MOST * n:
        return f" (the mean is worse, though it is better in {n_better} of {n})"
    if statistics.mean < 0 and n_worse >= _MOST * n:
        return f" (the mean is better, though it is worse in {n_worse} of {n})"
    return ""


def _are(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"


def _mean(tested: Tested) -> float:
    return tested[1].mean


def _seen(untested: Sequence[Tested]) -> list[str]:
    """The differences of those who took part, without a test, best first."""
    if not untested:
        return []
    first = untested[0][0]
    parts = [
        f"{number(abs(own.mean))} {each.question.unit} {'more' if own.mean > 0 else 'less'} with "
        f"{each.model} "
        f"({own.n_better} of {own.n} better)"
        for each, own in sorted(untested, key=_mean)
    ]
    who = "this subject" if all(own.n == 1 for _, own in untested) else "these subjects"
    return [f"In {who}, compared with {first.other}, {first.question.amount} {listed(parts)}."]


def _equal(equal: Sequence[Comparison]) -> list[str]:
    if not equal:
        return []
    verb = "has" if len(equal) == 1 else "have"
    return [f"{listed(each.model for each in equal)} {verb} exactly the same numbers as {equal[0].other}."]
