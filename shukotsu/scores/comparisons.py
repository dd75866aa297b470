"""Comparison of skeleton models over the subjects of a study, metric by metric (docs/statistics.md).

Each subject contributes one difference of two models: the mean over the places (see `observations`) for which
both have a value. A place for which only one model has a value would favour models that fail on difficult
data.

The baseline is the last of the paper's models that reproduce one of its tables without manual corrections.
(The first of them leaves the metacarpals at rest, and every other model is better by centimetres.) If the
study has no model of the paper, the baseline is its first model. Metrics that only fitted hands have are
compared with the anatomical prior.
"""

from __future__ import annotations

import json
import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from shukotsu.arrays import Array
from shukotsu.scores.observations import METRICS, PRIOR, Metric, ScoredStudy, observations, read_scores
from shukotsu.scores.paired_statistics import EQUAL, holm, paired_difference, smallest_p
from shukotsu.study.model import paper_skeleton
from shukotsu.study.results import Results
from shukotsu.study.study import Study
from shukotsu.tables import catalogue
from shukotsu.tables.typed_table import Provenance, columns_from_rows, write_table

if TYPE_CHECKING:
    from shukotsu.tables.rows import ModelDifferencesRow, ModelPairsRow, ModelValuesRow

ALL_DIGITS = ""
NOT_SCORED = "not scored"


@dataclass
class ComparedModels:
    """Rows of the tables model_values, model_pairs and model_differences."""

    values: list[ModelValuesRow] = field(default_factory=list)
    pairs: list[ModelPairsRow] = field(default_factory=list)
    differences: list[ModelDifferencesRow] = field(default_factory=list)


def compare_models(study: ScoredStudy) -> ComparedModels:
    """Compare a study's models by every metric that has values, by held-out values if there are any.

    Parameters
    ----------
    study : ScoredStudy
        Models and scores of a study.

    Returns
    -------
    ComparedModels
        Rows of the three tables of comparisons.

    Raises
    ------
    ValueError
        If a model has two values in one place.

    """
    compared = ComparedModels()
    for metric in METRICS:
        models = study.taking(metric)
        for held_out in (True, False):
            seen = observations(study, metric, [*models, *metric.references], held_out=held_out)
            if seen.loc[seen["model"].isin(models), "value"].notna().any():
                _compare(study, metric, seen, compared, held_out=held_out)
                break
    return compared


def _compare(
    study: ScoredStudy, metric: Metric, seen: pd.DataFrame, compared: ComparedModels, *, held_out: bool
) -> None:
    """Add the rows of one metric to `compared`."""
    models = study.taking(metric)
    present = set(seen.loc[seen["value"].notna(), "model"])
    baseline = paper_skeleton(study.models.values()) or next(iter(study.models))
    others = models
    if metric.fitted_only or len(models) == 1:
        baseline = PRIOR if PRIOR in present else models[0]
        others = [baseline]
    of_metric: Any = {"metric": metric.name, "unit": metric.unit}  # columns of all three tables
    scopes = dict(_scopes(study, seen))
    references = [name for name in metric.references if name in present]
    for digit, places in scopes.items():
        row = of_metric | {"digit": digit, "held_out": held_out}
        expected = list(dict.fromkeys([*models, baseline]))
        for value in _values(places, study.subjects, expected, references):
            compared.values.append(row | {"reference": value["model"] in references} | value)
    of_metric |= {"table": metric.table, "held_out": held_out, "n_subjects": len(study.subjects)}
    for other in others:
        shared_of = {digit: _shared_means(places, models, other) for digit, places in scopes.items()}
        for family in ([ALL_DIGITS], [digit for digit in scopes if digit != ALL_DIGITS]):
            rows: list[ModelDifferencesRow] = []
            for model in models:
                for digit in family if model != other else ():
                    shared = shared_of[digit][model]
                    of_pair = of_metric | {"digit": digit, "model": model, "other": other}
                    compared.pairs += [of_pair | pair for pair in shared]
                    rows.append(of_pair | {"baseline": other == baseline} | _difference(shared))
            n_comparisons = sum(row["p"] is not None for row in rows)
            p_holm, smallest_p_holm = (holm([row[name] for row in rows]) for name in ("p", "smallest_p"))
            for row, *corrected in zip(rows, p_holm, smallest_p_holm, strict=True):
                row["p_holm"], row["smallest_p_holm"] = corrected
                row["n_comparisons"] = n_comparisons
            compared.differences += rows


def _scopes(study: ScoredStudy, seen: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield values and reasons of all models by subject, digit and place: for all digits, then for each.

    Digits are in the order of the layouts, followed by any others that have values. Raise ValueError if a
    model has two values in one place.
    """
    places = seen.pivot(index=["subject", "digit", "place"], columns="model", values=["value", "reason"])
    yield ALL_DIGITS, places
    of_place = places.index.get_level_values("digit")
    of_layouts = [digit for layout in study.layouts.values() for digit in layout.digits]
    for digit in dict.fromkeys([*of_layouts, *sorted(set(of_place))]):
        if digit in of_place:
            yield digit, places[of_place == digit]


def _values(
    places: pd.DataFrame, subjects: Sequence[str], models: Sequence[str], references: Sequence[str]
) -> Iterator[ModelValuesRow]:
    """Yield the value of every subject for each model and reference, with the reasons for missing places.

    A place is missing for a model if any of `models` was observed there but this one has no value.
    """
    names = list(dict.fromkeys([*models, *references]))
    values = places["value"].reindex(columns=names).astype(float)
    reasons = places["reason"].reindex(columns=names).astype(object)
    by_subject = values.groupby(level="subject")
    means, counts = by_subject.mean(), by_subject.count()
    is_seen = reasons[list(models)].notna().any(axis=1)
    missing: dict[tuple[str, str], dict[str, int]] = defaultdict(Counter)
    for model in models:
        absent = reasons.loc[is_seen & values[model].isna(), model]
        for (subject, *_), reason in absent.where(absent.notna(), NOT_SCORED).items():
            missing[subject, model][reason.rstrip(".")] += 1
    for subject in subjects:
        has_mean = subject in means.index
        for name in names:
            n_places = int(counts.at[subject, name]) if has_mean else 0
            if name in references and not n_places:
                continue
            why = missing.get((subject, name), {NOT_SCORED: 1} if not has_mean and name in models else {})
            yield {
                "subject": subject,
                "model": name,
                "value": float(means.at[subject, name]) if n_places else None,
                "n_places": n_places,
                "missing": json.dumps(why, ensure_ascii=False) if why else "",
            }


def _shared_means(places: pd.DataFrame, models: Sequence[str], other: str) -> dict[str, list[ModelPairsRow]]:
    """Return each subject's means of each model and the other one, over places where both have a value."""
    values = places["value"].reindex(columns=[*models, other]).astype(float).to_numpy()
    mine, theirs = values[:, :-1], values[:, -1:]
    shared = np.hstack([np.where(np.isnan(theirs), np.nan, mine), np.where(np.isnan(mine), np.nan, theirs)])
    by_subject = pd.DataFrame(shared, places.index).groupby(level="subject")
    means, counts = by_subject.mean(), by_subject.count()
    pairs: dict[str, list[ModelPairsRow]] = {}
    for at, model in enumerate(models):
        numbers = zip(means.index, means[at], means[len(models) + at], counts[at], strict=True)
        pairs[model] = [
            {"subject": who, "value": a, "other_value": b, "difference": a - b, "n_places": count}
            for who, a, b, count in numbers
            if count
        ]
    return pairs


def _difference(shared: Sequence[ModelPairsRow]) -> ModelDifferencesRow:
    """Test the subjects' differences between two models, without correction for multiple comparisons."""
    n = len(shared)
    row: ModelDifferencesRow = {"n_compared_subjects": n, "p": None, "smallest_p": None}
    if not n:
        return row
    d: Array = np.array([pair["difference"] for pair in shared])
    d = np.where(np.abs(d) <= EQUAL, 0.0, d)
    tested = paired_difference(d)
    low, high = tested.interval or (None, None)
    row |= {
        "mean": sum(pair["value"] for pair in shared) / n,
        "other_mean": sum(pair["other_value"] for pair in shared) / n,
        "mean_difference": math.fsum(d) / n,
        "median_difference": float(np.median(d)),
        "interval_95_low": low,
        "interval_95_high": high,
        "p": tested.p,
        "smallest_p": smallest_p(n),
        "effect_size": tested.effect,
        "n_better": int((d < 0).sum()),
        "n_equal": int((d == 0).sum()),
    }
    return row


def compare_study(study: Study, results: Results) -> None:
    """Compare a study's models and write the tables model_values, model_pairs and model_differences.

    Parameters
    ----------
    study : Study
        The study.
    results : Results
        Paths of its results.

    Raises
    ------
    TableError
        If a table is damaged.

    """
    inputs = (catalogue.SKELETON_SCORES, catalogue.JOINT_ERRORS, catalogue.RECORDINGS, catalogue.PROBLEMS)
    comparison = compare_models(read_scores(study, results))
    paths = [results.study_table(table.name) for table in inputs]
    provenance = Provenance.of([*study.sheets.values(), *paths])
    for table, rows in (
        (catalogue.MODEL_VALUES, comparison.values),
        (catalogue.MODEL_PAIRS, comparison.pairs),
        (catalogue.MODEL_DIFFERENCES, comparison.differences),
    ):
        write_table(results.study_table(table.name), table, columns_from_rows(table, rows), provenance)
