"""Whether one skeleton model does better than another across the subjects of a study.

The unit is the subject: hands, tasks, trials and digits of one person are not independent. Each subject gives
one difference, the mean over the places (a digit in a recording, a joint of a hand) in which both models have
a number: a place that only one of them has would favour the model that failed where it was hard.

Interval: percentile bootstrap over subjects, its tails widened as Student's are (expanded percentile
interval: T. Hesterberg, What Teachers Should Know About the Bootstrap, Am. Stat. 69, 2015). Of 8 and of 12
normal differences it holds the true mean in 94 % of studies, the plain percentile and BCa intervals in 89 and
91 %; of strongly skewed (exponential) ones in 90 %. It is not corrected for many comparisons.

Test: the signs of the differences are flipped, in all ways or at random, which is exact where a difference is
as likely to lie above 0 as so far below (R. A. Fisher, The Design of Experiments, 1935). Of random flips the
data themselves count as one (B. Phipson, G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 9, 2010). S. Holm (Scand.
J. Stat. 6, 1979) corrects for all comparisons made together. Effect size: mean over standard deviation of the
differences, Cohen's d_z, with the exact correction for few subjects (L. V. Hedges, J. Educ. Stat. 6, 1981).
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from stages.report.data_table import listed
from stages.report.study_results import LEAST_SQUARES, Row, StudyResults, recording_key

Array = npt.NDArray[np.float64]
Pair = tuple[str, str]

ALL_DIGITS = ""
LEVEL = 0.05
N_RESAMPLES = 10_000
N_FLIPS = 20_000
MOST_ENUMERATED = 14
FEWEST_SUBJECTS = 6
"""With fewer the smallest p, 2 / 2^n, is over LEVEL. No bootstrap interval holds the mean in 95 % of studies
then, either: none leaves the range of the data, and in 2 / 2^n of studies all lie on one side of the median.
"""
EQUAL = 1e-9
"""Differences up to this, in mm or deg, are rounding: the models do the same."""

NO_NUMBER, NO_ROW = "no such number", "not scored"
UNFIT = {True: "made from this task too, not held out", False: "made without this task, not in-sample"}


@dataclass(frozen=True)
class Metric:
    """What models are compared by; the smaller, the better.

    name : the column of `table`. what : the words before the amount in a sentence. caution : what it does not
    say of a skeleton.
    """

    name: str
    table: str
    what: str
    unit: str = "mm"
    caution: str = ""


class Observation(NamedTuple):
    """One model in one place: its number, or None and the reason."""

    subject: str
    model: str
    digit: str
    place: str
    value: float | None
    reason: str = ""


class Missing(NamedTuple):
    """A place in which a model has no number; digit and place are empty where it has none anywhere."""

    model: str
    digit: str
    place: str
    reason: str


@dataclass(frozen=True)
class SubjectPair:
    """One subject with both models.

    value, other : means over the `n_shared` of `n_places` places in which both have a number; without such a
    place over those that each has, None without any. difference : value - other over shared places, or None.
    """

    subject: str
    value: float | None
    other: float | None
    difference: float | None
    n_shared: int
    n_places: int
    missing: tuple[Missing, ...]


@dataclass(frozen=True)
class Paired:
    """What n differences say, in the metric's unit.

    interval : 95 %; None with fewer than FEWEST_SUBJECTS. p : not corrected. smallest_p : what the test can
    give at best with so many. effect : d_z, corrected; None with fewer than 3 or with equal differences.
    n_better, n_equal : subjects with whom the first model does better, and the same.
    """

    n: int
    mean: float
    median: float
    lowest: float
    highest: float
    interval: tuple[float, float] | None
    p: float
    smallest_p: float
    effect: float | None
    n_better: int
    n_equal: int


@dataclass(frozen=True)
class Comparison:
    """Two models over the subjects, in one digit or over ALL_DIGITS; differences are model - other.

    found : None where no subject has both. p_holm : corrected for the n_compared comparisons made together.
    smallest_p_holm : what that can be at best with so many subjects. fitted : those of the two models that
    pose a fitted hand.
    """

    metric: Metric
    held_out: bool
    digit: str
    model: str
    other: str
    subjects: tuple[SubjectPair, ...]
    found: Paired | None
    p_holm: float | None
    smallest_p_holm: float | None
    n_compared: int
    fitted: frozenset[str]

    @property
    def compared(self) -> tuple[SubjectPair, ...]:
        """The subjects that have both."""
        return tuple(pair for pair in self.subjects if pair.difference is not None)

    @property
    def significant(self) -> bool:
        """Whether a difference is shown at LEVEL, corrected for all comparisons."""
        return self.p_holm is not None and self.p_holm <= LEVEL


_CLOSES = "It says how well the joints close, not where they are."
METRICS = {
    metric.name: metric
    for metric in (
        Metric("true_tip_mean_mm", "skeleton_scores", "the fingertip is missed by"),
        Metric("true_tip_p95_mm", "skeleton_scores", "the 95th percentile of the fingertip's error is"),
        Metric("metacarpal_deg", "skeleton_scores", "the metacarpal's direction is off by", "deg"),
        Metric("left_out_mean_mm", "skeleton_scores", "the distal receiver, left out, is missed by"),
        Metric("left_out_p95_mm", "skeleton_scores", "the 95th percentile of the left-out error is"),
        Metric(
            "posed_mean_mm",
            "skeleton_scores",
            "the posed hand misses its distal receiver by",
            caution="It was told where that is.",
        ),
        Metric("replay_mean_mm", "skeleton_scores", "the replay misses its receiver by", caution=_CLOSES),
        Metric(
            "replay_p95_mm",
            "skeleton_scores",
            "the 95th percentile of the replay's error is",
            caution=_CLOSES,
        ),
        Metric(
            "wrist_mcp_sd_mm",
            "skeleton_scores",
            "the distance from wrist to MCP joint varies by",
            caution="Where the palm moves a true skeleton's varies as well.",
        ),
        Metric("mean_mm", "tip_errors", "the replay misses its receiver by", caution=_CLOSES),
        Metric("median_mm", "tip_errors", "the median of the replay's error is", caution=_CLOSES),
        Metric("p95_mm", "tip_errors", "the 95th percentile of the replay's error is", caution=_CLOSES),
        Metric("max_mm", "tip_errors", "the largest of the replay's errors is", caution=_CLOSES),
        Metric("error_mm", "joint_errors", "the joint centre is off by"),
        Metric("axis_deg", "joint_errors", "the hinge's axis is off by", "deg"),
    )
}
"""By name; of tip_errors with the least-squares binding."""


def study_comparisons(
    results: StudyResults,
    metric: Metric,
    *,
    held_out: bool = True,
    pairs: Sequence[Pair] | None = None,
    digits: Collection[str] | None = None,
) -> tuple[Comparison, ...]:
    """Compare models of a study across its subjects, see `compare`.

    held_out : by skeletons made without the task that they are scored on; else by those made with it.
    pairs : models or references; unless given every two models, the one that the study names later first.
    """
    models = list(results.models)
    pairs = [(later, earlier) for earlier, later in combinations(models, 2)] if pairs is None else pairs
    names = dict.fromkeys(name for pair in pairs for name in pair)
    return compare(
        observed(results, metric, names, held_out=held_out),
        metric,
        pairs,
        held_out=held_out,
        subjects=results.subjects,
        digits=digits,
        fitted={*results.fitted, "prior-only"},
    )


def compare(
    observations: Iterable[Observation],
    metric: Metric,
    pairs: Sequence[Pair],
    *,
    held_out: bool = True,
    subjects: Iterable[str] = (),
    digits: Collection[str] | None = None,
    fitted: Collection[str] = (),
) -> tuple[Comparison, ...]:
    """Compare the models of every pair over all digits, then digit by digit.

    All of one call is corrected together. subjects : to be listed though nothing was observed of them.
    digits : which to compare, ALL_DIGITS among them where wanted; unless given all. fitted : models that pose
    a fitted hand. Raises ValueError where a model was observed twice in a place.
    """
    observations = list(observations)
    seen = dict.fromkeys([ALL_DIGITS, *(each.digit for each in observations)])
    scopes = list(seen) if digits is None else [digit for digit in seen if digit in digits]
    cells = _cells(observations)
    names = sorted({*subjects, *cells})
    made = [
        _comparison(cells, names, metric, held_out, digit, pair, frozenset(fitted) & frozenset(pair))
        for pair in pairs
        for digit in scopes
    ]
    corrected = holm([each.found.p if each.found else None for each in made])
    smallest = holm([each.found.smallest_p if each.found else None for each in made])
    n_compared = sum(each.found is not None for each in made)
    return tuple(
        replace(each, p_holm=p, smallest_p_holm=least, n_compared=n_compared)
        for each, p, least in zip(made, corrected, smallest, strict=True)
    )


def observed(
    results: StudyResults, metric: Metric, models: Collection[str], *, held_out: bool
) -> list[Observation]:
    """The models' numbers in every place of a study; where there is none, why.

    A reference was made from nothing, so it counts as held out and as in-sample. A joint's error is held out
    where the skeleton has held-out scores.
    """
    groups: dict[tuple[str, str, str, str], list[Row]] = defaultdict(list)
    for row, digit, place in _placed(results, metric):
        if row["model"] in models:
            groups[row["subject"], row["model"], digit, place].append(row)
    of_kind = _scored_so(results, held_out)
    found = []
    for who, rows in groups.items():
        fit = [row for row in rows if _is_fit(row, metric, results, of_kind, held_out)]
        if len(fit) == 1 and fit[0][metric.name] is not None:  # as it nearly always is
            found.append(Observation(*who, fit[0][metric.name]))
            continue
        values = [row[metric.name] for row in fit if row[metric.name] is not None]
        told = "; ".join(dict.fromkeys(row["message"] for row in fit if row.get("message")))
        reason = (told or NO_NUMBER) if fit else UNFIT[held_out]
        found.append(Observation(*who, _mean(values), "" if values else reason))
    return [*found, *_unscored(results, metric, models)]


def paired(differences: Array) -> Paired:
    """What differences (n,), n at least 1, say of their mean; negative ones are better.

    What is random depends on n alone, so the same data give the same numbers, and the comparisons of a
    study, which are of the same subjects, share it: drawn once, it takes milliseconds a comparison.
    """
    d = np.where(np.abs(differences) <= EQUAL, 0.0, differences)
    n = len(d)
    return Paired(
        n=n,
        mean=math.fsum(d) / n,
        median=float(np.median(d)),
        lowest=float(d.min()),
        highest=float(d.max()),
        interval=interval_95(d) if n >= FEWEST_SUBJECTS else None,
        p=sign_flip_p(d),
        smallest_p=smallest_p(n),
        effect=effect_size(d),
        n_better=int((d < 0).sum()),
        n_equal=int((d == 0).sum()),
    )


def interval_95(differences: Array) -> tuple[float, float]:
    """95 % expanded percentile bootstrap interval of the mean of differences (n,), n at least 2."""
    n = len(differences)
    low, high = np.quantile(_shares(n) @ differences, [bootstrap_tail(n), 1.0 - bootstrap_tail(n)])
    return float(low), float(high)


@lru_cache(maxsize=64)
def bootstrap_tail(n: int) -> float:
    """The share of resampled means to leave out at either end: 0.025, less the fewer subjects there are.

    The resampled means of n scatter sqrt((n - 1) / n) too little, and a normal quantile stands for Student's.
    """
    from scipy.special import ndtr, stdtrit

    return float(ndtr(stdtrit(n - 1, LEVEL / 2) * math.sqrt(n / (n - 1))))


def sign_flip_p(differences: Array) -> float:
    """Two-sided p of the mean of differences (n,): exact up to MOST_ENUMERATED, else by N_FLIPS."""
    n, rounding = len(differences), EQUAL * float(np.abs(differences).sum())
    reached = abs(float(differences.sum())) - rounding
    if n > MOST_ENUMERATED:
        return (1 + int((np.abs(_flips(n) @ differences) >= reached).sum())) / (1 + N_FLIPS)
    flips = np.arange(2 ** (n - 1))[:, None] >> np.arange(n) & 1  # the last sign stays: the rest mirrors
    sums = (1.0 - 2.0 * flips) @ differences
    return float((np.abs(sums) >= reached).mean())


def smallest_p(n: int) -> float:
    """The smallest p that `sign_flip_p` can give of n differences."""
    return 2.0 / 2.0**n if n <= MOST_ENUMERATED else 1.0 / (1 + N_FLIPS)


def effect_size(differences: Array) -> float | None:
    """Cohen's d_z of differences (n,) with Hedges' correction for n - 1 degrees of freedom."""
    freedom = len(differences) - 1
    if freedom < 2 or np.ptp(differences) <= EQUAL:
        return None
    log_ratio = math.lgamma(freedom / 2) - math.lgamma((freedom - 1) / 2)
    correction = math.exp(log_ratio) / math.sqrt(freedom / 2)
    return float(correction * differences.mean() / differences.std(ddof=1))


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Holm's corrected p-values, in the same order; None is no test and stays so."""
    known = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    corrected: list[float | None] = [None] * len(p_values)
    highest = 0.0
    for rank, (p, place) in enumerate(known):
        highest = max(highest, min(1.0, p * (len(known) - rank)))
        corrected[place] = highest
    return corrected


def missing_in_words(missing: Iterable[Missing]) -> str:
    """Each reason once, with its models and the number of places; empty where nothing is missing."""
    models_of: dict[tuple[str, int], list[str]] = defaultdict(list)
    for (model, reason), count in Counter((each.model, each.reason.rstrip(".")) for each in missing).items():
        models_of[reason, count].append(model)
    return "; ".join(
        f"{listed(models)}: {reason}" + (f", {count} places" if count > 1 else "")
        for (reason, count), models in models_of.items()
    )


_Places = Mapping[tuple[str, str], Observation]
_OfModel = Mapping[str, Mapping[str, _Places]]
_Cells = Mapping[str, _OfModel]


def _cells(observations: Iterable[Observation]) -> _Cells:
    """Observations by subject, model, digit (and ALL_DIGITS), and digit with place."""
    cells: dict[str, dict[str, dict[str, dict[tuple[str, str], Observation]]]] = defaultdict(
        lambda: defaultdict(lambda: defaultdict(dict))
    )
    for each in observations:
        of_digit, key = cells[each.subject][each.model], (each.digit, each.place)
        if key in of_digit[each.digit]:
            raise ValueError(
                f"two observations of {each.model} in {each.digit}, {each.place}: {each.subject}"
            )
        of_digit[each.digit][key] = of_digit[ALL_DIGITS][key] = each
    return cells


def _comparison(
    cells: _Cells,
    names: Sequence[str],
    metric: Metric,
    held_out: bool,
    digit: str,
    pair: Pair,
    fitted: frozenset[str],
) -> Comparison:
    """One comparison, not yet corrected for the others."""
    subjects = tuple(_subject_pair(name, cells.get(name, {}), digit, pair) for name in names)
    both = [each.difference for each in subjects if each.difference is not None]
    found = paired(np.array(both)) if both else None
    return Comparison(metric, held_out, digit, *pair, subjects, found, None, None, 0, fitted)


def _subject_pair(subject: str, of_model: _OfModel, digit: str, pair: Pair) -> SubjectPair:
    own = [of_model.get(model, {}).get(digit, {}) for model in pair]
    places = sorted({*own[0], *own[1]})
    values = [{k: each.value for k, each in mine.items() if each.value is not None} for mine in own]
    shared = [key for key in places if key in values[0] and key in values[1]]
    missing = tuple(
        Missing(model, *key, mine[key].reason if key in mine else NO_ROW)
        for model, mine, having in zip(pair, own, values, strict=True)
        for key in places
        if key not in having
    )
    if not places:
        missing = tuple(Missing(model, "", "", NO_ROW) for model in pair)
    value, other = (_mean([having[key] for key in shared or having]) for having in values)
    difference = value - other if shared and value is not None and other is not None else None
    return SubjectPair(subject, value, other, difference, len(shared), len(places), missing)


def _mean(values: Sequence[float]) -> float | None:
    """The mean, which the order does not change by a bit; None of nothing."""
    return math.fsum(values) / len(values) if values else None


@lru_cache(maxsize=4)
def _shares(n: int) -> Array:
    """What each of n differences counts in every resampled mean, (N_RESAMPLES, n)."""
    drawn = np.random.default_rng((n, 1)).integers(0, n, (N_RESAMPLES, n))
    drawn += n * np.arange(N_RESAMPLES)[:, None]
    counts = np.bincount(drawn.ravel(), minlength=N_RESAMPLES * n).reshape(N_RESAMPLES, n)
    return np.asarray(counts / n)


@lru_cache(maxsize=4)
def _flips(n: int) -> Array:
    """Random signs of n differences, (N_FLIPS, n)."""
    return np.asarray(1.0 - 2.0 * np.random.default_rng((n, 2)).integers(0, 2, (N_FLIPS, n)))


def _placed(results: StudyResults, metric: Metric) -> Iterator[tuple[Row, str, str]]:
    """The rows of the metric's table, each with its digit and its place in words."""
    if metric.table == "joint_errors":
        digit_of = {
            (hand.subject, hand.hand, joint): digit.name
            for hand, layout in results.layouts.items()
            for digit in layout.digits.values()
            for joint in digit.joints
        }
        for row in results.joint_errors:
            key = (row["subject"], row["hand"], row["joint"])
            yield (
                row,
                digit_of[key] if key in digit_of else row["joint"],
                f"{row['hand']} hand, {row['joint']}",
            )
        return
    replays = (row for row in results.tip_errors if row["binding"] == LEAST_SQUARES)
    for row in results.scores if metric.table == "skeleton_scores" else replays:
        yield row, row["digit"], _place(row["hand"], row["task"], row["trial"])


def _place(hand: str, task: str, trial: str) -> str:
    return f"{hand} hand, {task}" + (f", trial {trial}" if trial else "")


_Made = tuple[str, str, str, str]


def _made(row: Row) -> _Made:
    return row["subject"], row["hand"], row["model"], row["calibrated_on"]


def _scored_so(results: StudyResults, held_out: bool) -> set[_Made]:
    """The skeletons that have scores of the kind."""
    return {_made(row) for row in results.scores if row["held_out"] == held_out}


def _is_fit(
    row: Row, metric: Metric, results: StudyResults, of_kind: Collection[_Made], held_out: bool
) -> bool:
    """Whether the row is of the kind that is compared."""
    if row["model"] not in results.models:
        return True
    return _made(row) in of_kind if metric.table == "joint_errors" else row["held_out"] == held_out


def _unscored(results: StudyResults, metric: Metric, models: Collection[str]) -> Iterator[Observation]:
    """The evaluated recordings without any row, with what became of them."""
    if metric.table == "joint_errors":
        return
    rows = results.scores if metric.table == "skeleton_scores" else results.tip_errors
    scored = {(row["subject"], row["hand"], row["task"], row["trial"]) for row in rows}
    for recording in results.study.recordings:
        subject, hand, task, trial = key = recording_key(recording)
        if key in scored or recording.role == "calibration":
            continue
        reason = ": ".join(filter(None, results.status_of(recording)))
        for digit in results.layouts[recording.hand].digits:
            for model in models:
                yield Observation(subject, model, digit, _place(hand, task, trial), None, reason)
