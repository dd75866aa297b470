"""Two models over the subjects of a study.

The unit is the subject: hands, tasks, trials and digits of one person are not independent. Each subject gives
one difference, the mean over the places in which both models have a number: a place that only one of them has
would favour the model that failed where it was hard.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stages.report.comparison.questions import Question
from stages.report.table_cells import listed
from stages.report.wording import mark, say, told
from subject_statistics.multiple_comparisons import LEVEL, holm
from subject_statistics.paired_statistics import Paired, paired

if TYPE_CHECKING:
    import pandas as pd

Pair = tuple[str, str]

ALL_DIGITS = ""
NO_ROW = mark("not scored")


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
class Comparison:
    """Two models over the subjects, in one digit or over ALL_DIGITS; differences are model - other.

    statistics : None where no subject has both. p_holm : corrected for the n_compared comparisons made
    together. smallest_p_holm : what that can be at best with so many subjects.
    """

    question: Question
    held_out: bool
    digit: str
    model: str
    other: str
    subjects: tuple[SubjectPair, ...]
    statistics: Paired | None
    p_holm: float | None = None
    smallest_p_holm: float | None = None
    n_compared: int = 0

    @property
    def compared(self) -> tuple[SubjectPair, ...]:
        """The subjects that have both."""
        return tuple(pair for pair in self.subjects if pair.difference is not None)

    @property
    def significant(self) -> bool:
        """Whether a difference is shown at LEVEL, corrected for all comparisons."""
        return self.p_holm is not None and self.p_holm <= LEVEL

    @property
    def testable(self) -> bool:
        """Whether so many subjects can show a difference at all."""
        return self.smallest_p_holm is not None and self.smallest_p_holm <= LEVEL

    @property
    def equal(self) -> bool:
        """Whether the models have the same number in every subject."""
        return self.statistics is not None and self.statistics.n_equal == self.statistics.n


def compare(
    seen: pd.DataFrame,
    question: Question,
    pairs: Sequence[Pair],
    *,
    held_out: bool = True,
    subjects: Iterable[str] = (),
    digits: Collection[str] | None = None,
) -> tuple[Comparison, ...]:
    """Compare the models of every pair over all digits, then digit by digit.

    seen : as `observations` gives them. All of one call is corrected together. subjects : to be listed though
    nothing was observed of them. digits : which to compare, ALL_DIGITS among them where wanted; unless given
    all. Raises ValueError where a model was observed twice in a place.
    """
    scopes = [d for d in dict.fromkeys([ALL_DIGITS, *seen["digit"]]) if digits is None or d in digits]
    places = seen.pivot(index=["subject", "digit", "place"], columns="model", values=["value", "reason"])
    names = sorted({*subjects, *seen["subject"]})
    compared = []
    for pair in pairs:
        for digit in scopes:
            of_digit = (
                places if digit == ALL_DIGITS else places[places.index.get_level_values("digit") == digit]
            )
            own = _subject_pairs(of_digit, names, pair)
            both = [each.difference for each in own if each.difference is not None]
            compared.append(
                Comparison(question, held_out, digit, *pair, own, paired(np.array(both)) if both else None)
            )
    corrected = holm([each.statistics.p if each.statistics else None for each in compared])
    smallest = holm([each.statistics.smallest_p if each.statistics else None for each in compared])
    n_compared = sum(each.statistics is not None for each in compared)
    return tuple(
        replace(each, p_holm=p, smallest_p_holm=least, n_compared=n_compared)
        for each, p, least in zip(compared, corrected, smallest, strict=True)
    )


def missing_text(missing: Iterable[Missing]) -> str:
    """Each reason once, with its models and the number of places; empty where nothing is missing."""
    models_of: dict[tuple[str, int], list[str]] = defaultdict(list)
    for (model, reason), count in Counter((each.model, each.reason.rstrip(".")) for each in missing).items():
        models_of[reason, count].append(model)
    return "; ".join(
        f"{listed(models)}: {told(reason)}" + (say(", {count} places", count=count) if count > 1 else "")
        for (reason, count), models in models_of.items()
    )


def _subject_pairs(places: pd.DataFrame, names: Sequence[str], pair: Pair) -> tuple[SubjectPair, ...]:
    """Places : value and reason of every model by subject, digit and place."""
    values = places["value"].reindex(columns=list(pair)).astype(float)
    reasons = places["reason"].reindex(columns=list(pair))
    there = reasons.notna().any(axis=1)
    values, reasons = values[there], reasons[there].astype(object)
    reasons = reasons.where(reasons.notna(), NO_ROW)
    by_subject = values.groupby(level="subject")
    shared = values.dropna().groupby(level="subject")
    alone, together, n_places, n_shared = by_subject.mean(), shared.mean(), by_subject.size(), shared.size()
    missing: dict[str, list[Missing]] = defaultdict(list)
    for model in pair:
        for (subject, digit, place), reason in reasons[model][values[model].isna()].items():
            missing[subject].append(Missing(model, digit, place, reason))
    pairs = []
    for name in names:
        if name not in n_places.index:
            lacking = tuple(Missing(model, "", "", NO_ROW) for model in pair)
            pairs.append(SubjectPair(name, None, None, None, 0, 0, lacking))
            continue
        both = name in together.index
        value, other = (_known((together if both else alone).at[name, model]) for model in pair)
        difference = value - other if both and value is not None and other is not None else None
        count = int(n_shared.get(name, 0))
        pairs.append(
            SubjectPair(name, value, other, difference, count, int(n_places[name]), tuple(missing[name]))
        )
    return tuple(pairs)


def _known(value: float) -> float | None:
    return None if value != value else float(value)
