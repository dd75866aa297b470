"""A study's numbers on one question: every subject's under every model, and the comparisons made of them.

The baseline is the paper's: of the models that reproduce one of its tables uncorrected the last, for the
first of them leaves metacarpals at rest, and everything beats it by centimetres; without any of the paper's
the study's first model. Fitted hands, where only they are asked, are held against anatomy alone. A place is a
digit in a recording, or a joint of a hand.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from schemas.model import the_papers
from stages.report.comparison.comparisons import ALL_DIGITS, Comparison, compare
from stages.report.comparison.questions import PRIOR, Question
from stages.report.study_results import StudyResults, recording_key, row_key
from stages.report.wording import mark, say

if TYPE_CHECKING:
    import pandas as pd


NO_NUMBER = mark("no such number")
OTHER_KIND = {
    True: mark("made from this task too, not held out"),
    False: mark("made without this task, not in-sample"),
}
PLACE = ["subject", "model", "digit", "place"]


class Observation(NamedTuple):
    """One model in one place: its number, or None and the reason."""

    subject: str
    model: str
    digit: str
    place: str
    value: float | None
    reason: str = ""


def observations(
    results: StudyResults, question: Question, models: Collection[str], *, held_out: bool
) -> pd.DataFrame:
    """The models' numbers in every place of a study, a row as an Observation; where there is none, why.

    A reference was made from nothing, so it counts as held out and as in-sample. A joint's error is held out
    where the skeleton has held-out scores. Suspect hands are left out.
    """
    import pandas as pd

    rows = _rows(results, question)
    rows = rows[rows["model"].isin(list(models))]
    counts = rows["kind"].isin([held_out]) | ~rows["model"].isin(list(results.models))
    rows = rows.assign(counts=counts, value=rows["number"].where(counts))
    found = rows.groupby(PLACE, sort=False)["value"].mean().reset_index()
    found = found.merge(_reasons(rows, held_out=held_out), how="left", on=PLACE).fillna({"reason": ""})
    absent = pd.DataFrame(_unscored(results, question, models), columns=Observation._fields)
    return found if absent.empty else pd.concat([found, absent.astype({"value": float})], ignore_index=True)


def _reasons(rows: pd.DataFrame, *, held_out: bool) -> pd.DataFrame:
    """Why a place has no number: the messages of its rows that count, or that none does."""
    groups = rows.groupby(PLACE, sort=False)
    rows = rows[groups["value"].transform("count") == 0]
    rows = rows[rows["counts"] | ~rows.groupby(PLACE)["counts"].transform("any")]
    texts = rows["message"].where(rows["counts"], OTHER_KIND[held_out])
    joined = texts.groupby([rows[name] for name in PLACE], sort=False)
    return (
        joined.agg(lambda own: "; ".join(dict.fromkeys(filter(None, own))) or NO_NUMBER)
        .rename("reason")
        .reset_index()
    )


def _rows(results: StudyResults, question: Question) -> pd.DataFrame:
    """Rows of the question's table: PLACE, number, message and kind (whether it is held out)."""
    import pandas as pd

    of_score = question.table == "skeleton_scores"
    columns = [
        "subject",
        "session",
        "hand",
        "task",
        "trial",
        "model",
        "calibrated_on",
        "digit",
        "held_out",
        "message",
    ]
    scores = pd.DataFrame.from_records(
        results.counted(results.scores), columns=[*columns, *([question.metric] if of_score else [])]
    )
    if of_score:
        place = (
            _in_session(scores)
            + scores["hand"]
            + " hand, "
            + scores["task"]
            + (", trial " + scores["trial"]).where(scores["trial"] != "", "")
        )
        number = scores[question.metric].astype(float)
        return scores.assign(place=place, number=number, kind=scores["held_out"])
    made = ["subject", "session", "hand", "model", "calibrated_on"]
    kinds = scores[[*made, "held_out"]].drop_duplicates().rename(columns={"held_out": "kind"})
    joints = pd.DataFrame.from_records(
        results.counted(results.joint_errors), columns=[*made, "joint", question.metric]
    )
    joints = joints.merge(kinds, how="left", on=made)
    digits = {
        (*hand.who, hand.hand, joint): digit.name
        for hand, layout in results.layouts.items()
        for digit in layout.digits.values()
        for joint in digit.joints
    }
    keys = zip(*(joints[name] for name in ("subject", "session", "hand", "joint")), strict=True)
    return joints.assign(
        digit=[digits.get(key, key[3]) for key in keys],
        place=_in_session(joints) + joints["hand"] + " hand, " + joints["joint"],
        number=joints[question.metric].astype(float),
        message="",
    )


def _in_session(rows: pd.DataFrame) -> pd.Series[str]:
    """How the name of a place begins: with the session, where there is one."""
    return ("session " + rows["session"] + ", ").where(rows["session"] != "", "")


def _unscored(results: StudyResults, question: Question, models: Collection[str]) -> Iterator[Observation]:
    """The evaluated recordings without any score, with what became of them."""
    if question.table == "joint_errors":
        return
    scored = {row_key(row) for row in results.scores}
    for recording in results.recordings:
        subject, session, hand, task, trial = key = recording_key(recording)
        if key in scored or recording.role == "calibration":
            continue
        reason = ": ".join(filter(None, results.status_of(recording)))
        place = (
            (f"session {session}, " if session else "")
            + f"{hand} hand, {task}"
            + (f", trial {trial}" if trial else "")
        )
        for digit in results.layouts[recording.hand].digits:
            for model in models:
                yield Observation(subject, model, digit, place, None, reason)


ByDigit = dict[str, dict[str, dict[str, float]]]
"""Numbers by digit, ALL_DIGITS first, then model, then subject."""


@dataclass(frozen=True)
class Answer:
    """One question with the study's numbers.

    seen : the observations of models and references. names : models, then references. overall, digits : each
    model against the baseline over all digits, and digit by digit; the comparisons of either are corrected
    together.
    """

    question: Question
    held_out: bool
    n_subjects: int
    seen: pd.DataFrame
    names: tuple[str, ...]
    baseline: str
    by_digit: ByDigit
    overall: tuple[Comparison, ...]
    digits: tuple[Comparison, ...]

    @property
    def models(self) -> tuple[str, ...]:
        """The models without the references."""
        return tuple(name for name in self.names if name not in self.question.references)

    @property
    def kind(self) -> str:
        """Which data the skeletons were made from."""
        if self.held_out:
            return say("Held out: skeletons made without the recordings that they are scored on.")
        return say(
            "In-sample: nothing is held out, so a skeleton may have learnt the recording that it is "
            "scored on and not the hand."
        )

    @property
    def judges(self) -> bool:
        """Whether the answer judges a skeleton: by a truth, or by a hand that did not see the recording."""
        return bool(self.question.judged_by) and (self.held_out or not self.question.fitted_only)


def answer(results: StudyResults, question: Question, baseline: str = "") -> Answer | None:
    """Ask the study, of held-out numbers if there are any; None where it has no number of any model.

    baseline : the model that the others are held against; unless given the paper's.
    """
    models = [name for name in results.models if not question.fitted_only or name in results.fitted]
    for held_out in (True, False):
        seen = observations(results, question, [*models, *question.references], held_out=held_out)
        present = set(seen.loc[seen["value"].notna(), "model"])
        if present.intersection(models):
            break
    else:
        return None
    baseline = baseline or the_papers(results.models.values()) or next(iter(results.models))
    if question.fitted_only or len(models) == 1:
        baseline = PRIOR if PRIOR in present else models[0]
    pairs = [(name, baseline) for name in models if name != baseline]
    overall, digits = (
        compare(seen, question, pairs, held_out=held_out, subjects=results.subjects, digits=scopes)
        for scopes in ({ALL_DIGITS}, set(seen["digit"]))
    )
    return Answer(
        question=question,
        held_out=held_out,
        n_subjects=len(results.subjects),
        seen=seen,
        names=(*models, *(name for name in question.references if name in present)),
        baseline=baseline,
        by_digit=_means(results, seen),
        overall=overall,
        digits=digits,
    )


def _means(results: StudyResults, seen: pd.DataFrame) -> ByDigit:
    """Each subject's mean over the places in which a model has a number.

    All digits first, then those with numbers as the layouts name them, then what else has.
    """
    known = seen.dropna(subset="value")
    of_layouts = [digit for layout in results.layouts.values() for digit in layout.digits]
    present = set(known["digit"])
    digits = [d for d in dict.fromkeys([*of_layouts, *sorted(present)]) if d in present]
    means: ByDigit = {}
    for digit in (ALL_DIGITS, *digits):
        own = known if digit == ALL_DIGITS else known[known["digit"] == digit]
        means[digit] = {
            str(model): {str(subject): float(value) for (_, subject), value in of_model.items()}
            for model, of_model in own.groupby(["model", "subject"])["value"].mean().groupby(level=0)
        }
    return means
