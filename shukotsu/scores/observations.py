"""Observations by which skeleton models are compared: one number, or the reason for its absence, per place.

A place is a digit in a recording, or a joint of a hand.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import pandas as pd

from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.tables.subjects import Hand

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
"""In order of importance; those that judge the skeleton come first (docs/method.md, "The columns")."""

NO_NUMBER = "no such number"
OTHER_KIND = {True: "made from this task too, not held out", False: "made without this task, not in-sample"}
_PLACE = ["subject", "model", "digit", "place"]
_SKELETON = ["subject", "session", "hand", "model", "calibrated_on"]
SCORE_COLUMNS = (*_SKELETON, "task", "trial", "digit", "held_out", "message")
ERROR_COLUMNS = (*_SKELETON, "joint")
RECORDING_COLUMNS = ("subject", "session", "hand", "task", "trial", "role", "status", "message")


@dataclass(frozen=True)
class ScoredStudy:
    """A study's models and scores, from which rows of suspect hands have been removed.

    Attributes
    ----------
    subjects : tuple of str
        In the order of the study's sheet.
    models : mapping
        Name -> model.
    layouts : mapping
        Hand -> layout.
    scores, errors, recordings : DataFrame
        skeleton_scores, joint_errors and recordings: SCORE_COLUMNS, ERROR_COLUMNS and RECORDING_COLUMNS, with
        the columns of METRICS in the first two.

    """

    subjects: tuple[str, ...]
    models: Mapping[str, SkeletonModel]
    layouts: Mapping[Hand, Layout]
    scores: pd.DataFrame
    errors: pd.DataFrame
    recordings: pd.DataFrame

    def taking(self, metric: Metric) -> list[str]:
        """Names of the models to which the metric applies."""
        return [
            name for name, model in self.models.items() if not metric.fitted_only or model.fitting is not None
        ]


class Observation(NamedTuple):
    """Value of one model in one place, or None and the reason."""

    subject: str
    model: str
    digit: str
    place: str
    value: float | None
    reason: str = ""


def observations(
    study: ScoredStudy, metric: Metric, names: Collection[str], *, held_out: bool
) -> pd.DataFrame:
    """Values of models and references in every place, with a reason where there is none.

    References are made from no recording, so they count both as held out and as in-sample. A joint error is
    held out where its skeleton has held-out scores.

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
    """Reasons for missing values: the messages of a place's rows of the right kind, or that there is none."""
    groups = rows.groupby(_PLACE, sort=False)
    rows = rows[groups["value"].transform("count") == 0]
    rows = rows[rows["counts"] | ~rows.groupby(_PLACE)["counts"].transform("any")]
    texts = rows["message"].where(rows["counts"], OTHER_KIND[held_out])
    joined = texts.groupby([rows[name] for name in _PLACE], sort=False)
    return (
        joined.agg(lambda reasons: "; ".join(dict.fromkeys(filter(None, reasons))) or NO_NUMBER)
        .rename("reason")
        .reset_index()
    )


def _score_rows(study: ScoredStudy, metric: Metric) -> pd.DataFrame:
    """Rows of skeleton_scores with place, number and kind (True: held out)."""
    scores = study.scores
    return scores.assign(
        place=_recordings(scores), number=scores[metric.name].astype(float), kind=scores["held_out"]
    )


def _error_rows(study: ScoredStudy, metric: Metric) -> pd.DataFrame:
    """Rows of joint_errors with place, number, kind and digit (the joint's name where it has no digit)."""
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
    """Prefix of a place's name: the session, where there is one."""
    return ("session " + rows["session"] + ", ").where(rows["session"] != "", "")


def _recordings(rows: pd.DataFrame) -> pd.Series[str]:
    """Names of recordings as places."""
    trials = (", trial " + rows["trial"]).where(rows["trial"] != "", "")
    return _sessions(rows) + rows["hand"] + " hand, " + rows["task"] + trials


def _unscored_recordings(study: ScoredStudy, names: Collection[str]) -> Iterator[Observation]:
    """Observations of evaluated recordings without any score, with the recording's status and message."""
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
