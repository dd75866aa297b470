"""What comparisons of models say: a sentence each, and tables of the numbers and of every subject."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from stages.report.comparison import (
    ALL_DIGITS,
    FEWEST_SUBJECTS,
    LEVEL,
    METRICS,
    Comparison,
    Metric,
    Paired,
    missing_in_words,
)
from stages.report.data_table import DASH, Block, DataTable, counted, listed, number

LEFT_OUT = ("left_out_mean_mm", "left_out_p95_mm")
TRUE_TIP = ("true_tip_mean_mm", "true_tip_p95_mm")
MOST_NAMED = 3


def sentence(comparison: Comparison) -> str:
    """What one comparison found, with the number of subjects; that nothing was, or could be, shown."""
    where = "" if comparison.digit == ALL_DIGITS else f"{_digit(comparison.digit)}: "
    text = where + _finding(comparison)
    text = text[0].upper() + text[1:]
    return " ".join(filter(None, [text, _not_compared(comparison), caution(comparison)]))


def caution(comparison: Comparison) -> str:
    """What the difference does not say of the two skeletons; empty where it says what it seems to."""
    metric, pair = comparison.metric, (comparison.model, comparison.other)
    replayed = [model for model in pair if model not in comparison.fitted]
    if metric.name in LEFT_OUT and len(replayed) == 1:
        return f"Not one test for both: {replayed[0]} replays its receivers, the other poses a fitted hand."
    if metric.name in LEFT_OUT and replayed:
        return f"Both replay their receivers. {METRICS['replay_mean_mm'].caution}"
    blind = [model for model in replayed if model != "true-skeleton"]
    if metric.name in TRUE_TIP and blind:
        verb = "knows" if len(blind) == 1 else "know"
        return f"{listed(blind)} {verb} no fingertip but the distal receiver's origin."
    return metric.caution


def comparison_table(comparisons: Sequence[Comparison]) -> DataTable | None:
    """The comparisons that were made together, a block a pair; None without any."""
    if not comparisons:
        return None
    metric, unit = comparisons[0].metric, comparisons[0].metric.unit
    blocks = tuple(
        Block(
            (
                f"{model} against {other}",
                "Subjects",
                f"{model} [{unit}]",
                f"{other} [{unit}]",
                f"Difference [{unit}]",
                f"Median [{unit}]",
                f"95 % interval [{unit}]",
                "p",
                "p corrected",
                "Effect size",
                "Better in",
            ),
            tuple(_cells(each) for each in of_pair),
        )
        for (model, other), of_pair in _by_pair(comparisons).items()
    )
    return DataTable(
        f"Models compared across subjects, {_heading(metric)}, {_kind(comparisons[0])}.",
        blocks,
        _notes(comparisons),
        frozenset({0, 6}),
    )


def p_in_words(p: float) -> str:
    """The test's p with two digits, or as many as it takes to stay on its side of LEVEL."""
    if p < 0.0001:
        return "p < 0.0001"
    texts = (f"{p:.{digits}g}" for digits in range(2, 17))
    return f"p = {next(text for text in texts if (float(text) <= LEVEL) == (p <= LEVEL))}"


def _finding(comparison: Comparison) -> str:
    found, model, other = comparison.found, comparison.model, comparison.other
    if found is None:
        return f"nothing to compare {model} and {other} by: no subject has a number of both."
    if found.n_equal == found.n:
        who = counted(found.n, "subject")
        return f"no difference at all between {model} and {other} in {who}: {comparison.metric.what} as much."
    if not _testable(comparison):
        return f"{_untestable(comparison, found)} {_capital(_difference(comparison, found))}."
    if comparison.significant:
        return f"with {model} {_difference(comparison, found, versus=f' than with {other}')}."
    return f"no difference shown between {model} and {other}: {_difference(comparison, found)}."


def _testable(comparison: Comparison) -> bool:
    return comparison.smallest_p_holm is not None and comparison.smallest_p_holm <= LEVEL


def _untestable(comparison: Comparison, found: Paired) -> str:
    """That so few subjects can show no difference, whatever their numbers are."""
    alone = found.smallest_p > LEVEL
    least = found.smallest_p if alone else comparison.smallest_p_holm
    corrected = "" if alone else f", Holm-corrected over {comparison.n_compared},"
    return (
        f"{counted(found.n, 'subject')} cannot show a difference between {comparison.model} and "
        f"{comparison.other}: the smallest p that the test can give{corrected} is {least:.2g}."
    )


def _difference(comparison: Comparison, found: Paired, versus: str = "") -> str:
    """The amount and, in brackets, how sure it is; amounts in the direction that the words name."""
    sign = 1.0 if found.mean > 0 else -1.0
    word, unit = ("more" if found.mean > 0 else "less"), comparison.metric.unit
    with_model = versus or f" with {comparison.model}"
    low, high = sorted(sign * end for end in (found.interval or (found.lowest, found.highest)))
    span = "95 % interval" if found.interval else "subjects from"
    parts = [f"{span} {number(low)} to {number(high)} {unit}"] if found.n > 1 else []
    parts.append(f"{counted(found.n, 'subject')}, {found.n_better} of {found.n} better")
    if found.n_equal:
        parts[-1] += f", {found.n_equal} the same"
    if _testable(comparison) and comparison.p_holm is not None:
        over = f", Holm-corrected over {comparison.n_compared}" if comparison.n_compared > 1 else ""
        parts.append(p_in_words(comparison.p_holm) + over)
    amount = f"{number(abs(found.mean))} {unit} {word}{with_model}"
    return f"{comparison.metric.what} {amount} ({'; '.join(parts)})"


def _not_compared(comparison: Comparison) -> str:
    """The subjects and places that are not in the number; empty where all are."""
    gone = [pair for pair in comparison.subjects if pair.difference is None]
    told = [f"{pair.subject} ({missing_in_words(pair.missing)})" for pair in gone[:MOST_NAMED]]
    more = [f"{len(gone) - MOST_NAMED} more"] if len(gone) > MOST_NAMED else []
    subjects = f"Not compared: {listed([*told, *more])}." if gone else ""
    n_shared, n_places = (
        sum(getattr(pair, name) for pair in comparison.compared) for name in ("n_shared", "n_places")
    )
    places = (
        f"Compared in {n_shared} of {n_places} places, where both have a number."
        if n_shared < n_places
        else ""
    )
    return " ".join(filter(None, [subjects, places]))


def _cells(comparison: Comparison) -> tuple[str, ...]:
    found, compared = comparison.found, comparison.compared
    name = _digit(comparison.digit)
    subjects = f"{len(compared)}"
    if len(compared) < len(comparison.subjects):
        subjects += f" of {len(comparison.subjects)}"
    if found is None:
        return (name, subjects, *[DASH] * 9)
    means = (
        number(sum(value for value in values if value is not None) / found.n)
        for values in ([pair.value for pair in compared], [pair.other for pair in compared])
    )
    return (
        name,
        subjects,
        *means,
        number(found.mean),
        number(found.median),
        f"{number(found.interval[0])} to {number(found.interval[1])}" if found.interval else DASH,
        _p_cell(found.p),
        _p_cell(comparison.p_holm),
        number(found.effect),
        f"{found.n_better} of {found.n}",
    )


def _p_cell(p: float | None) -> str:
    return DASH if p is None else p_in_words(p).removeprefix("p ").removeprefix("= ")


def _notes(comparisons: Sequence[Comparison]) -> tuple[str, ...]:
    """How to read the table, then what its numbers do not say."""
    n_compared = counted(comparisons[0].n_compared, "comparison")
    read = (
        "Differences are the first model's number less the second's: below 0 the first is better. A subject "
        "counts once, by its mean over the places in which both have a number. Interval: expanded "
        f"percentile bootstrap over subjects, from {FEWEST_SUBJECTS} subjects on, for one comparison. "
        f"p: sign-flip test; corrected by Holm over {n_compared}. "
        "Effect size: Cohen's d_z with Hedges' correction."
    )
    cautions: dict[str, list[str]] = defaultdict(list)
    for (model, other), of_pair in _by_pair(comparisons).items():
        if caution(of_pair[0]):
            cautions[caution(of_pair[0])].append(f"{model} against {other}")
    many = len(_by_pair(comparisons)) > 1
    return (
        read,
        *(f"{'; '.join(pairs)}: {text}" if many else text for text, pairs in cautions.items()),
    )


def _by_pair(comparisons: Iterable[Comparison]) -> dict[tuple[str, str], list[Comparison]]:
    groups: dict[tuple[str, str], list[Comparison]] = defaultdict(list)
    for each in comparisons:
        groups[each.model, each.other].append(each)
    return dict(groups)


def _heading(metric: Metric) -> str:
    return f"{metric.name} of {metric.table}"


def _kind(comparison: Comparison) -> str:
    return "held out" if comparison.held_out else "in-sample"


def _digit(name: str) -> str:
    return _capital(name.replace("_", " ")) if name != ALL_DIGITS else "All digits"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
