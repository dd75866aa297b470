"""Scores of a study, and the observations by which its skeleton models are compared.

An observation is one value, or the reason why it is missing, per place. A place is a digit in a recording,
or a joint of a hand.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import pandas as pd

from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel, read_model
from shukotsu.study.results import Results
from shukotsu.study.study import Study
from shukotsu.tables.catalogue import JOINT_ERRORS, PROBLEMS, RECORDINGS, SKELETON_SCORES
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Table, read_table

PRIOR, NAIL, TRUE = "prior-only", "distal-receiver", "true-skeleton"


@dataclass(frozen=True)
class Metric:
    """Metric by which skeletons are compared; smaller is better.

    Attributes
    ----------
    name : str
        Column of `table`.
    references : tuple of str
        References shown beside the models.
    fitted_only : bool
        Whether the metric applies only to models that fit the whole hand.
    table : str
        Table that has the column.
    unit : str
        Unit of the column.

    """

    name: str
    references: tuple[str, ...]
    fitted_only: bool = False
    table: str = "skeleton_scores"
    unit: str = "mm"


METRICS = (
    Metric("error_mm", (PRIOR,), table="joint_errors"),
    Metric("metacarpal_deg", (PRIOR,), unit="deg"),
    Metric("true_tip_mean_mm", (PRIOR, NAIL, TRUE)),
    Metric("left_out_mean_mm", (PRIOR, TRUE), fitted_only=True),
    Metric("replay_mean_mm", (TRUE,)),
)
"""Metrics in order of importance; those that judge the skeleton are first (docs/method.md, "The columns")."""

NO_NUMBER = "no value"
OTHER_KIND = {True: "made from this task too: not held out", False: "made without this task: not in-sample"}
_PLACE = ["subject", "model", "digit", "place"]
_HAND = ["subject", "session", "hand"]
_SKELETON = [*_HAND, "model", "calibrated_on"]
_SCORES = [metric.name for metric in METRICS if metric.table == "skeleton_scores"]
_ERRORS = [metric.name for metric in METRICS if metric.table == "joint_errors"]
_SCORE_COLUMNS = (*_SKELETON, "task", "trial", "digit", "held_out", "message", *_SCORES)
_ERROR_COLUMNS = (*_SKELETON, "joint", *_ERRORS)
_RECORDING_COLUMNS = ("subject", "session", "hand", "task", "trial", "role", "status", "message")


@dataclass(frozen=True)
class ScoredStudy:
    """A study's models and scores, from which rows of suspect hands have been removed.

    Attributes
    ----------
    subjects : tuple of str
        Subjects in the order of the study's sheet.
    models : mapping
        Name -> model.
    layouts : mapping
        Hand -> layout.
    scores, errors, recordings : DataFrame
        Tables skeleton_scores, joint_errors and recordings, as far as they are compared.

    """

    subjects: tuple[str, ...]
    models: Mapping[str, SkeletonModel]
    layouts: Mapping[Hand, Layout]
    scores: pd.DataFrame
    errors: pd.DataFrame
    recordings: pd.DataFrame

    def taking(self, metric: Metric) -> list[str]:
        """List the names of the models to which the metric applies."""
        return [
            name for name, model in self.models.items() if not metric.fitted_only or model.fitting is not None
        ]


def read_scores(study: Study, results: Results) -> ScoredStudy:
    """Read the models, scores, joint errors and recordings of a study, leaving out suspect hands.

    Parameters
    ----------
    study : Study
        The study.
    results : Results
        Paths of its results.

    Returns
    -------
    ScoredStudy
        Models and scores to compare.

    Raises
    ------
    TableError
        If a table does not exist or is damaged.

    """
    problems = study_frame(results, PROBLEMS, [*_HAND, "severity"])
    suspect = problems.loc[problems["severity"] == "suspect", _HAND].drop_duplicates()
    return ScoredStudy(
        subjects=tuple(dict.fromkeys(recording.hand.subject for recording in study.recordings)),
        models={name: read_model(path.absolute()) for name, path in study.models.items()},
        layouts={hand: study.judged_layout(hand) for hand in study.hands},
        scores=_without(study_frame(results, SKELETON_SCORES, _SCORE_COLUMNS), suspect),
        errors=_without(study_frame(results, JOINT_ERRORS, _ERROR_COLUMNS), suspect),
        recordings=study_frame(results, RECORDINGS, _RECORDING_COLUMNS),
    )


def study_frame(results: Results, table: Table, columns: Sequence[str]) -> pd.DataFrame:
    """Read columns of a study table as a data frame."""
    frame: pd.DataFrame = read_table(results.study_table(table.name), table, list(columns)).to_pandas()
    return frame


def _without(rows: pd.DataFrame, suspect: pd.DataFrame) -> pd.DataFrame:
    """Drop the rows of suspect hands."""
    of_suspect = rows.merge(suspect, how="left", on=_HAND, indicator=True)["_merge"] == "both"
    return rows[~of_suspect.to_numpy()]


class Observation(NamedTuple):
    """Value of one model in one place, or None and the reason why it is missing."""

    subject: str
    model: str
    digit: str
    place: str
    value: float | None
    reason: str = ""


def observations(
    study: ScoredStudy, metric: Metric, names: Collection[str], *, held_out: bool
) -> pd.DataFrame:
    """Collect the values of models and references in every place, with reasons for missing values.

    References are not made from recordings, so that they are used both with held-out and with in-sample
    values. A joint error is held out if its skeleton has held-out scores.

    Parameters
    ----------
    study : ScoredStudy
        Models and scores.
    metric : Metric
        The metric.
    names : collection of str
        Models and references to include.
    held_out : bool
        Whether to take the held-out values or the in-sample ones.

    Returns
    -------
    DataFrame
        One row per model and place, with the fields of `Observation`.

    """
    rows = _error_rows(study, metric) if metric.table == "joint_errors" else _score_rows(study, metric)
    rows = rows[rows["model"].isin(list(names))]
    counts = rows["kind"].isin([held_out]) | ~rows["model"].isin(list(study.models))
    rows = rows.assign(counts=counts, value=rows["number"].where(counts))
    means = rows.groupby(_PLACE, sort=False)["value"].mean().reset_index()
    means = means.merge(_reasons(rows, held_out=held_out), how="left", on=_PLACE).fillna({"reason": ""})
    absent = [] if metric.table == "joint_errors" else list(_unscored_recordings(study, names))
    if not absent:
        return means
    others = pd.DataFrame(absent, columns=Observation._fields).astype({"value": float})
    return pd.concat([means, others], ignore_index=True)


def _reasons(rows: pd.DataFrame, *, held_out: bool) -> pd.DataFrame:
    """Return the reason for each missing value: messages of the place's rows of the right kind, if any."""
    groups = rows.groupby(_PLACE, sort=False)
    rows = rows[groups["value"].transform("count") == 0]
    rows = rows[rows["counts"] | ~rows.groupby(_PLACE)["counts"].transform("any")]
    texts = rows["message"].where(rows["counts"], OTHER_KIND[held_out])
    joined = texts.groupby([rows[name] for name in _PLACE], sort=False)
    reasons = joined.agg(lambda each: "; ".join(dict.fromkeys(filter(None, each))) or NO_NUMBER)
    return reasons.rename("reason").reset_index()


def _score_rows(study: ScoredStudy, metric: Metric) -> pd.DataFrame:
    """Return the rows of skeleton_scores with place, number and kind (True: held out)."""
    scores = study.scores
    return scores.assign(
        place=_recordings(scores), number=scores[metric.name].astype(float), kind=scores["held_out"]
    )


def _error_rows(study: ScoredStudy, metric: Metric) -> pd.DataFrame:
    """Return rows of joint_errors with place, number, kind and digit (the joint's name if it has none)."""
    kinds = study.scores[[*_SKELETON, "held_out"]].drop_duplicates().rename(columns={"held_out": "kind"})
    joints = study.errors.merge(kinds, how="left", on=_SKELETON)
    digits = {
        (*hand.who, hand.hand, joint): digit.name
        for hand, layout in study.layouts.items()
        for digit in layout.digits.values()
        for joint in digit.joints
    }
    keys = zip(*(joints[name] for name in ("subject", "session", "hand", "joint")), strict=True)
    return joints.assign(
        digit=[digits.get(key, key[3]) for key in keys],
        place=_sessions(joints) + joints["hand"] + " hand, " + joints["joint"],
        number=joints[metric.name].astype(float),
        message="",
    )


def _sessions(rows: pd.DataFrame) -> pd.Series[str]:
    """Return the prefix of a place's name: the session, if there is one."""
    return ("session " + rows["session"] + ", ").where(rows["session"] != "", "")


def _recordings(rows: pd.DataFrame) -> pd.Series[str]:
    """Return the names of recordings as places."""
    trials = (", trial " + rows["trial"]).where(rows["trial"] != "", "")
    return _sessions(rows) + rows["hand"] + " hand, " + rows["task"] + trials


def _unscored_recordings(study: ScoredStudy, names: Collection[str]) -> Iterator[Observation]:
    """Yield observations of evaluated recordings without scores, with the recording's status and message."""
    key = ["subject", "session", "hand", "task", "trial"]
    scored = set(study.scores[key].itertuples(index=False, name=None))
    rows = study.recordings[study.recordings["role"] != "calibration"]
    for row, recording in zip(rows.itertuples(), _recordings(rows), strict=True):
        if (row.subject, row.session, row.hand, row.task, row.trial) in scored:
            continue
        reason = ": ".join(filter(None, (row.status, row.message)))
        for digit in study.layouts[Hand(row.subject, row.hand, row.session)].digits:
            for name in names:
                yield Observation(row.subject, name, digit, recording, None, reason)
