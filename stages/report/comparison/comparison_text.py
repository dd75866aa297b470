"""What comparisons with one baseline say together and one by one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from stages.report.comparison.comparisons import Comparison, Missing, missing_text
from stages.report.table_cells import counted, listed, number
from stages.report.wording import say
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
        return [say("There is nothing to compare: no subject has the numbers of two models.")]
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
    who = say(
        "{subjects} cannot show a difference between models, whatever the numbers are: ",
        subjects=counted(most, "subject"),
    )
    if most < FEWEST_SUBJECTS:
        least = min(each.smallest_p for each in known)
        return say(
            ("{who}the smallest p that a test can give is {least:.2g}. It takes {FEWEST_SUBJECTS} or more."),
            who=who,
            least=least,
            FEWEST_SUBJECTS=FEWEST_SUBJECTS,
        )
    least = min(each.smallest_p_holm or 1.0 for each in comparisons)
    over = counted(comparisons[0].n_compared, "comparison")
    return say(
        "{who}the smallest p that a test can give, Holm-corrected over {over}, is {least:.2g}.",
        who=who,
        over=over,
        least=least,
    )


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
    return say("p = {next}", next=next(text for text in texts if (float(text) <= LEVEL) == (p <= LEVEL)))


def _some(names: Sequence[str]) -> str:
    """The first few by name."""
    if len(names) <= MOST_NAMED + 1:
        return listed(names)
    return listed([*names[:MOST_NAMED], say("{n_names} more", n_names=len(names) - MOST_NAMED)])


def _shown(tested: Sequence[Tested]) -> list[str]:
    """Whose difference is shown, best first, then of whom none is."""
    if not tested:
        return []
    other = tested[0][0].other
    shown = sorted((each for each in tested if each[0].significant), key=_mean)
    better = [_with_amount(*each) for each in shown if _mean(each) < 0]
    worse = [_with_amount(*each) for each in shown if _mean(each) > 0]
    unclear = [f"{each.model}{_despite(own)}" for each, own in tested if not each.significant]
    parts = (
        [say("better than {other} {are} {better}", other=other, are=_are(better), better=listed(better))]
        if better
        else []
    )
    parts += (
        [
            say(
                "worse {part}{are} {worse}",
                part="" if better else say("than {other} ", other=other),
                are=_are(worse),
                worse=listed(worse),
            )
        ]
        if worse
        else []
    )
    against = "" if parts else say("from {other} ", other=other)
    parts += (
        [say("no difference {against}is shown for {unclear}", against=against, unclear=listed(unclear))]
        if unclear
        else []
    )
    counts = sorted({own.n for _, own in tested})
    who = (
        counted(counts[0], "subject")
        if len(counts) == 1
        else say("{counts} to {counts_2} subjects", counts=counts[0], counts_2=counts[-1])
    )
    return [say("Over {who}, {parts}.", who=who, parts="; ".join(parts))]


def _with_amount(comparison: Comparison, statistics: Paired) -> str:
    amount = say(
        "by {mean} {unit} in the mean", mean=number(abs(statistics.mean)), unit=comparison.question.unit
    )
    return f"{comparison.model} ({amount}){_despite(statistics)}"


def _despite(statistics: Paired) -> str:
    """That most subjects say the opposite of the mean, which a few gross failures carry."""
    n, n_better = statistics.n, statistics.n_better
    n_worse = n - n_better - statistics.n_equal
    if statistics.mean > 0 and n_better >= _MOST * n:
        return say(" (the mean is worse, though it is better in {n_better} of {n})", n_better=n_better, n=n)
    if statistics.mean < 0 and n_worse >= _MOST * n:
        return say(" (the mean is better, though it is worse in {n_worse} of {n})", n_worse=n_worse, n=n)
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
        say(
            "{mean} {unit} {part} with {model} ({n_better} of {n} better)",
            mean=number(abs(own.mean)),
            unit=each.question.unit,
            part=say("more") if own.mean > 0 else say("less"),
            model=each.model,
            n_better=own.n_better,
            n=own.n,
        )
        for each, own in sorted(untested, key=_mean)
    ]
    who = say("this subject") if all(own.n == 1 for _, own in untested) else say("these subjects")
    return [
        say(
            "In {who}, compared with {other}, {amount} {parts}.",
            who=who,
            other=first.other,
            amount=say(first.question.amount),
            parts=listed(parts),
        )
    ]


def _equal(equal: Sequence[Comparison]) -> list[str]:
    if not equal:
        return []
    verb = "has" if len(equal) == 1 else "have"
    return [
        say(
            "{value} {verb} exactly the same numbers as {other}.",
            value=listed(each.model for each in equal),
            verb=verb,
            other=equal[0].other,
        )
    ]
