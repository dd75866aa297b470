"""Skeleton models over the subjects of a study: their numbers, subject by subject, and what they say.

Each subject gives one difference of two models, the mean over the places in which both have a number: a place
that only one of them has would favour the model that failed where it was hard.

The baseline is the paper's: of the models that reproduce one of its tables uncorrected the last, for the
first of them leaves metacarpals at rest, and everything beats it by centimetres; without any of the paper's
the study's first model. Fitted hands, where only they are asked, are compared with anatomy alone.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.schemas.model import the_papers
from shukotsu.stages.compare_models.observations import METRICS, PRIOR, Metric, ScoredStudy, observations
from shukotsu.statistics.multiple_comparisons import holm
from shukotsu.statistics.paired_statistics import Paired, paired

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]

ALL_DIGITS = ""
NOT_SCORED = "not scored"


@dataclass
class ComparedModels:
    """Rows of the tables model_values, model_pairs and model_differences."""

    values: list[Row] = field(default_factory=list)
    pairs: list[Row] = field(default_factory=list)
    differences: list[Row] = field(default_factory=list)


def compare_models(study: ScoredStudy) -> ComparedModels:
    """Compare a study's models by every metric that any has a number of, held out if there are any."""
    compared = ComparedModels()
    for metric in METRICS:
        models = study.taking(metric)
        for held_out in (True, False):
            seen = observations(study, metric, [*models, *metric.references], held_out=held_out)
            present = set(seen.loc[seen["value"].notna(), "model"])
            if present.intersection(models):
                _compare(study, metric, seen, present, compared, held_out=held_out)
                break
    return compared


def _compare(
    study: ScoredStudy,
    metric: Metric,
    seen: pd.DataFrame,
    present: Collection[str],
    compared: ComparedModels,
    *,
    held_out: bool,
) -> None:
    """Add the rows of one metric."""
    models = study.taking(metric)
    baseline = the_papers(study.models.values()) or next(iter(study.models))
    others = models
    if metric.fitted_only or len(models) == 1:
        baseline = PRIOR if PRIOR in present else models[0]
        others = [baseline]
    of_metric = {"metric": metric.name, "unit": metric.unit}
    scopes = dict(_scopes(study, seen))
    references = [name for name in metric.references if name in present]
    for digit, places in scopes.items():
        row = of_metric | {"digit": digit, "held_out": held_out}
        expected = list(dict.fromkeys([*models, baseline]))
        for value in _values(places, study.subjects, expected, references):
            compared.values.append(row | {"reference": value["model"] in references} | value)
    kind = {"table": metric.table, "held_out": held_out, "n_subjects": len(study.subjects)}
    for other in others:
        for family in ([ALL_DIGITS], [digit for digit in scopes if digit != ALL_DIGITS]):
            pairs = {
                (model, digit): _shared(scopes[digit], model, other)
                for model in models
                if model != other
                for digit in family
            }
            for (model, digit), own in pairs.items():
                of_pair = of_metric | {"digit": digit, "model": model, "other": other}
                compared.pairs += [of_pair | row for row in own]
            for (model, digit), row in zip(pairs, _differences(list(pairs.values())), strict=True):
                of_pair = of_metric | {"digit": digit, "model": model, "other": other}
                compared.differences.append(of_pair | kind | {"baseline": other == baseline} | row)


def _scopes(study: ScoredStudy, seen: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Give value and reason of every model by subject, digit and place: of all digits, then of each.

    Digits stand as the layouts name them, then what else has numbers. Raises ValueError where a model was
    observed twice in a place.
    """
    places = seen.pivot(index=["subject", "digit", "place"], columns="model", values=["value", "reason"])
    yield ALL_DIGITS, places
    present = set(seen["digit"])
    of_layouts = [digit for layout in study.layouts.values() for digit in layout.digits]
    of_place = places.index.get_level_values("digit")
    for digit in dict.fromkeys([*of_layouts, *sorted(present)]):
        if digit in present:
            yield digit, places[of_place == digit]


def _values(
    places: pd.DataFrame, subjects: Sequence[str], models: Sequence[str], references: Sequence[str]
) -> Iterator[Row]:
    """Give every subject's number under each model, with what is missing of it, and each reference."""
    names = list(dict.fromkeys([*models, *references]))
    values = places["value"].reindex(columns=names).astype(float)
    of_subject = values.groupby(level="subject")
    means, counts = of_subject.mean(), of_subject.count()
    missing = {model: _missing(places, model, models) for model in models}
    for subject in subjects:
        for name in names:
            known = subject in means.index
            if name in references and not (known and counts.at[subject, name]):
                continue
            absent = {} if known else {NOT_SCORED: 1}
            reasons = missing.get(name, {}).get(subject, absent if name in models else {})
            yield {
                "subject": subject,
                "model": name,
                "value": _known(means.at[subject, name]) if known else None,
                "n_places": int(counts.at[subject, name]) if known else 0,
                "missing": json.dumps(reasons, ensure_ascii=False) if reasons else "",
            }


def _missing(places: pd.DataFrame, model: str, models: Sequence[str]) -> Mapping[str, dict[str, int]]:
    """Count by subject and reason the places, of those that any of `models` was seen in, without a number."""
    reasons = places["reason"].reindex(columns=list(models)).astype(object)
    values = places["value"].reindex(columns=list(models)).astype(float)
    absent = reasons[model][reasons.notna().any(axis=1) & values[model].isna()]
    absent = absent.where(absent.notna(), NOT_SCORED)
    found: dict[str, dict[str, int]] = {}
    for (subject, *_), reason in absent.items():
        own = found.setdefault(subject, {})
        own[reason.rstrip(".")] = own.get(reason.rstrip("."), 0) + 1
    return found


def _shared(places: pd.DataFrame, model: str, other: str) -> list[Row]:
    """Give each subject's means of two models over the places in which both have a number."""
    values = places["value"].reindex(columns=[model, other]).astype(float).dropna().groupby(level="subject")
    counts = values.size()
    return [
        {
            "subject": subject,
            "value": float(value),
            "other_value": float(other_value),
            "difference": float(value - other_value),
            "n_places": int(counts[subject]),
        }
        for subject, value, other_value in values.mean().itertuples(name=None)
    ]


def _differences(pairs: Sequence[Sequence[Row]]) -> Iterator[Row]:
    """Test the subjects' differences between two models each, corrected for all of them together."""
    found = [paired(np.array([row["difference"] for row in own])) if own else None for own in pairs]
    corrected = holm([each.p if each else None for each in found])
    smallest = holm([each.smallest_p if each else None for each in found])
    n_comparisons = sum(each is not None for each in found)
    for own, each, p_holm, smallest_p_holm in zip(pairs, found, corrected, smallest, strict=True):
        means = {
            name: float(sum(row[column] for row in own)) / len(own) if own else None
            for name, column in (("mean", "value"), ("other_mean", "other_value"))
        }
        yield {
            "n_compared_subjects": len(own),
            **means,
            **(_statistics(each) if each else {}),
            "p_holm": p_holm,
            "smallest_p_holm": smallest_p_holm,
            "n_comparisons": n_comparisons,
        }


def _statistics(found: Paired) -> Row:
    low, high = found.interval or (None, None)
    return {
        "mean_difference": found.mean,
        "median_difference": found.median,
        "lowest_difference": found.lowest,
        "highest_difference": found.highest,
        "interval_95_low": low,
        "interval_95_high": high,
        "p": found.p,
        "smallest_p": found.smallest_p,
        "effect_size": found.effect,
        "n_better": found.n_better,
        "n_equal": found.n_equal,
    }


def _known(value: float) -> float | None:
    return None if value != value else float(value)
