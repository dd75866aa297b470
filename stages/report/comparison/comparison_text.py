"""Put comparisons with one baseline into words, together and one by one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from shukotsu.sentences.translation import listed, ngettext, tr
from shukotsu.stages.report.comparison.answers import Answer, Comparison, missing_text
from shukotsu.stages.report.table_cells import number
from shukotsu.statistics.multiple_comparisons import LEVEL
from shukotsu.statistics.paired_statistics import FEWEST_SUBJECTS

MOST_NAMED = 3
_MOST = 2 / 3
"""The share of subjects from which the text says that they contradict the mean."""


def summary(comparisons: Sequence[Comparison]) -> list[str]:
    """Sentences: who does better than the baseline, who worse, of whom nothing is shown, who does the same.

    `comparisons` are of several models with one baseline, over all digits, made together. Where there are
    too few subjects for a test the numbers are those of these subjects; `untestable` says so.
    """
    if not comparisons:
        return [tr("There is nothing to compare: no subject has the numbers of two models.")]
    differ = [each for each in comparisons if not each.equal]
    tested = [each for each in differ if each.testable]
    equal = [each for each in comparisons if each.equal]
    return _shown(tested) + _seen([each for each in differ if not each.testable]) + _equal(equal)


def untestable(comparisons: Sequence[Comparison]) -> str:
    """Say that so few subjects can show no difference, whatever their numbers are; empty where a test can."""
    if not comparisons or any(each.testable for each in comparisons):
        return ""
    most = max(each.n for each in comparisons)
    who = tr(
        "{subjects} cannot show a difference between models, whatever the numbers are: ",
        subjects=ngettext("{n} subject", "{n} subjects", most),
    )
    if most < FEWEST_SUBJECTS:
        least = min(each.smallest_p for each in comparisons)
        return tr(
            "{who}the smallest p that a test can give is {least:.2g}. It takes {FEWEST_SUBJECTS} or more.",
            who=who,
            least=least,
            FEWEST_SUBJECTS=FEWEST_SUBJECTS,
        )
    least = min(each.smallest_p_holm for each in comparisons)
    over = ngettext("{n} comparison", "{n} comparisons", comparisons[0].n_comparisons)
    return tr(
        "{who}the smallest p that a test can give, Holm-corrected over {over}, is {least:.2g}.",
        who=who,
        over=over,
        least=least,
    )


def missing_sentences(own: Answer) -> list[str]:
    """Name the subjects without a number of some model, those with the same reasons together."""
    subjects: dict[str, list[str]] = defaultdict(list)
    for subject, missing in own.missing.items():
        subjects[missing_text(missing)].append(subject)
    return [f"{_some(names)}: {reasons}." for reasons, names in subjects.items()]


def p_text(p: float) -> str:
    """The test's p with two digits, or as many as it takes to stay on its side of LEVEL."""
    if p < 0.0001:
        return "p < 0.0001"
    texts = (f"{p:.{digits}g}" for digits in range(2, 17))
    return tr("p = {next}", next=next(text for text in texts if (float(text) <= LEVEL) == (p <= LEVEL)))


def _some(names: Sequence[str]) -> str:
    """The first few by name."""
    if len(names) <= MOST_NAMED + 1:
        return listed(names)
    return listed([*names[:MOST_NAMED], tr("{n_names} more", n_names=len(names) - MOST_NAMED)])


def _shown(tested: Sequence[Comparison]) -> list[str]:
    """Whose difference is shown, best first, then of whom none is."""
    if not tested:
        return []
    other = tested[0].other
    shown = sorted((each for each in tested if each.significant), key=_mean)
    better = [_with_amount(each) for each in shown if each.mean_difference < 0]
    worse = [_with_amount(each) for each in shown if each.mean_difference > 0]
    unclear = [f"{each.model}{_despite(each)}" for each in tested if not each.significant]
    parts = []
    if better:
        parts.append(
            ngettext(
                "better than {other} is {models}",
                "better than {other} are {models}",
                len(better),
                other=other,
                models=listed(better),
            )
        )
    if worse and parts:
        parts.append(ngettext("worse is {models}", "worse are {models}", len(worse), models=listed(worse)))
    elif worse:
        parts.append(
            ngettext(
                "worse than {other} is {models}",
                "worse than {other} are {models}",
                len(worse),
                other=other,
                models=listed(worse),
            )
        )
    if unclear and parts:
        parts.append(tr("no difference is shown for {models}", models=listed(unclear)))
    elif unclear:
        parts.append(
            tr("no difference from {other} is shown for {models}", other=other, models=listed(unclear))
        )
    counts = sorted({each.n for each in tested})
    who = (
        ngettext("{n} subject", "{n} subjects", counts[0])
        if len(counts) == 1
        else tr("{counts} to {counts_2} subjects", counts=counts[0], counts_2=counts[-1])
    )
    return [tr("Over {who}, {parts}.", who=who, parts="; ".join(parts))]


def _with_amount(own: Comparison) -> str:
    amount = tr("by {mean} {unit} in the mean", mean=number(abs(own.mean_difference)), unit=own.question.unit)
    return f"{own.model} ({amount}){_despite(own)}"


def _despite(own: Comparison) -> str:
    """Say that most subjects show the opposite of the mean, which a few gross failures carry."""
    n, n_better = own.n, own.n_better
    n_worse = n - n_better - own.n_equal
    if own.mean_difference > 0 and n_better >= _MOST * n:
        return tr(" (the mean is worse, though it is better in {n_better} of {n})", n_better=n_better, n=n)
    if own.mean_difference < 0 and n_worse >= _MOST * n:
        return tr(" (the mean is better, though it is worse in {n_worse} of {n})", n_worse=n_worse, n=n)
    return ""


def _mean(own: Comparison) -> float:
    return own.mean_difference


def _seen(untested: Sequence[Comparison]) -> list[str]:
    """The differences of those who took part, without a test, best first."""
    if not untested:
        return []
    first = untested[0]
    parts = [
        tr(
            "{mean} {unit} {part} with {model} ({n_better} of {n} better)",
            mean=number(abs(own.mean_difference)),
            unit=own.question.unit,
            part=tr("more") if own.mean_difference > 0 else tr("less"),
            model=own.model,
            n_better=own.n_better,
            n=own.n,
        )
        for own in sorted(untested, key=_mean)
    ]
    who = tr("this subject") if all(own.n == 1 for own in untested) else tr("these subjects")
    return [
        tr(
            "In {who}, compared with {other}, {amount} {parts}.",
            who=who,
            other=first.other,
            amount=tr(first.question.amount),
            parts=listed(parts),
        )
    ]


def _equal(equal: Sequence[Comparison]) -> list[str]:
    if not equal:
        return []
    return [
        ngettext(
            "{models} has exactly the same numbers as {other}.",
            "{models} have exactly the same numbers as {other}.",
            len(equal),
            models=listed(each.model for each in equal),
            other=equal[0].other,
        )
    ]
