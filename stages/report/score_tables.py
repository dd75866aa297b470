"""Tabulate the skeletons' scores: every model and every reference in one evaluated task.

A skeleton is a model made from certain tasks: a model has a row for each set of tasks that it was made from.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import N_, ngettext, tr, translated
from shukotsu.stages.report.study_results import HANDS, Row, StudyResults, Trial, hand_of
from shukotsu.stages.report.table_cells import (
    DASH,
    Column,
    DataTable,
    Folded,
    number,
    table_of,
    table_of_blocks,
    title,
)

IN_SAMPLE = N_("○ no")


class Skeleton(NamedTuple):
    """A model with the tasks that it was made from, or a reference."""

    model: str
    calibrated_on: str
    held_out: bool
    reference: bool

    @property
    def made_from(self) -> str:
        """The tasks that it was made from; a dash for a reference, which was made from none."""
        return DASH if self.reference else tasks_text(self.calibrated_on)

    @property
    def seen(self) -> str:
        """Tell whether it was made without the task that it is scored on."""
        return DASH if self.reference else tr("yes") if self.held_out else tr(IN_SAMPLE)

    @property
    def kind(self) -> str:
        """Return its heading in the terminal."""
        return tr("Reference") if self.reference else tr("Held out") if self.held_out else tr("In-sample")

    @property
    def title(self) -> str:
        """The model and what it was made from."""
        return (
            self.model
            if self.reference
            else tr("{model} (from {made_from})", model=self.model, made_from=self.made_from)
        )


Scored = tuple[Skeleton, list[Row]]
"""A skeleton with its rows of skeleton_scores."""

_SKELETON = (
    Column(N_("Skeleton"), lambda scored: scored[0].model, is_text=True),
    Column(N_("Made from"), lambda scored: scored[0].made_from, is_text=True),
    Column(N_("Held out"), lambda scored: scored[0].seen, is_text=True),
)
_FRAMES = Column(N_("Frames"), lambda scored: number(scored[1][0]["n_frames"], 0))
_MESSAGE = Column(N_("Message"), lambda scored: translated(scored[1][0]["message"]), is_text=True)


class Score(NamedTuple):
    """A column of the scores: its name in the table, its heading on the page and in the terminal."""

    name: str
    heading: str
    short: str = ""


MEANS = (
    Score("replay_mean_mm", N_("Tip error of the replay [mm]"), "replay"),
    Score("posed_mean_mm", N_("Posed with all receivers [mm]"), "posed"),
    Score("left_out_mean_mm", N_("Distal positions left out [mm]"), N_("left out")),
    Score("wrist_mcp_sd_mm", N_("SD of wrist to MCP [mm]"), "wr-MCP"),
    Score("metacarpal_deg", N_("Metacarpal direction [deg]"), "metac."),
    Score("true_tip_mean_mm", N_("True fingertip [mm]"), N_("true tip")),
)
OF_A_DIGIT = (
    *MEANS[:1],
    Score("replay_p95_mm", N_("p95 [mm]")),
    *MEANS[1:3],
    Score("left_out_p95_mm", N_("p95 [mm]")),
    *MEANS[3:],
    Score("true_tip_p95_mm", N_("p95 [mm]")),
)
LEFT_OUT = ("left_out_mean_mm", "left_out_p95_mm")
"""A replay never uses the distal receivers' positions: without a posed hand these are the replay's, and stand
in its column alone.
"""


def tasks_text(calibrated_on: str) -> str:
    """The tasks of a column calibrated_on."""
    return ", ".join(calibrated_on.split(";")) or tr("unknown")


def score_table(results: StudyResults, trial: Trial, *, compact: bool = False) -> DataTable | None:
    """The scores of one subject's task, means over digits and hands; None where it has none.

    Held-out skeletons, or in-sample ones where none is, and references apart. Columns without a number are
    left out: those of a truth that the study does not have, for instance. compact : for the terminal, all
    skeletons, and what they were made from in notes.
    """
    found = _in_order(results, results.scores_in(trial))
    if not found:
        return None
    scores = _with_numbers(MEANS, results.scores_in(trial))
    notes = _shortfalls(results, trial, dict(found), scores)
    whose = tr("Mean over digits and hands: {who}, {title}.", who=trial.who, title=trial.title)
    if not compact:
        fresh = any(own.held_out and not own.reference for own, _ in found)
        shown = [each for each in found if each[0].held_out or each[0].reference or not fresh]
        return table_of_blocks(whose, (*_SKELETON, *_columns(scores)), _blocks(shown), notes)
    by_kind = {
        kind: [own for own in found if own[0].kind == kind]
        for kind in (tr("Held out"), tr("In-sample"), tr("Reference"))
    }
    legend = "; ".join(f"{score.short}: {score.heading}" for score in scores)
    remark = tr("{legend}. The replay does not judge a skeleton (docs/evaluation.md).", legend=legend)
    columns = (_SKELETON[0], *_columns(scores, short=True))
    notes = (remark, *_made_from(dict(found)), *notes)
    return table_of_blocks(f"Skeletons, m{whose[1:]}", columns, by_kind, notes)


def in_sample_table(results: StudyResults, trial: Trial) -> DataTable | None:
    """Scores of skeletons that were made with the task, where others were made without; None without any."""
    found = _in_order(results, results.scores_in(trial))
    seen = [each for each in found if not each[0].held_out and not each[0].reference]
    if not seen or not any(own.held_out and not own.reference for own, _ in found):
        return None
    scores = _with_numbers(MEANS, (row for _, rows in seen for row in rows))
    caption = tr("In-sample, mean over digits and hands: {who}, {title}.", who=trial.who, title=trial.title)
    return table_of_blocks(caption, (*_SKELETON, *_columns(scores)), _blocks(seen))


def _blocks(found: list[Scored]) -> dict[str, list[Scored]]:
    return {
        kind: [own for own in found if own[0].reference == is_reference]
        for kind, is_reference in ((tr("Skeleton"), False), (tr("Reference"), True))
    }


def digit_tables(results: StudyResults, trial: Trial) -> list[Folded]:
    """The same digit by digit, with 95th percentiles: a folded table a hand, a block a digit."""
    folded = []
    for hand in HANDS:
        rows = [row for row in results.scores_in(trial) if row["hand"] == hand]
        if not rows:
            continue
        columns = [*_SKELETON, *_columns(_with_numbers(OF_A_DIGIT, rows)), _FRAMES]
        columns += [_MESSAGE] if any(row["message"] for row in rows) else []
        found = _in_order(results, rows)
        blocks = {
            title(digit): [(own, [row]) for own, its in found for row in its if row["digit"] == digit]
            for digit in dict.fromkeys(row["digit"] for row in rows)
        }
        whose = tr("{who}, {hand} hand, {title}", who=trial.who, hand=hand, title=trial.title)
        table = table_of_blocks(
            tr("Digit by digit: {whose}; p95: 95th percentile.", whose=whose), columns, blocks
        )
        folded.append(Folded(tr("{hand} hand, digit by digit", hand=title(hand)), table))
    return folded


def _in_order(results: StudyResults, rows: Iterable[Row]) -> list[Scored]:
    """Rows by skeleton: held-out ones, in-sample ones, references; within each as the study names them."""
    groups: dict[Skeleton, list[Row]] = defaultdict(list)
    for row in rows:
        key = Skeleton(row["model"], row["calibrated_on"], row["held_out"], row["reference"])
        groups[key].append(row)
    names = list(results.models)
    ordered = sorted(
        groups,
        key=lambda s: (s.reference, not s.held_out, names.index(s.model) if s.model in names else len(names)),
    )
    return [(skeleton, groups[skeleton]) for skeleton in ordered]


def _with_numbers(scores: Sequence[Score], rows: Iterable[Row]) -> list[Score]:
    rows = list(rows)
    return [score for score in scores if any(_is_known(score, row) for row in rows)]


def _columns(scores: Iterable[Score], *, short: bool = False) -> list[Column]:
    return [Column(score.short if short else score.heading, partial(_cell, score)) for score in scores]


def _cell(score: Score, scored: Scored) -> str:
    """The mean over rows of one skeleton."""
    return number(mean(row[score.name] for row in scored[1] if _is_known(score, row)))


def _is_known(score: Score, row: Row) -> bool:
    return row[score.name] is not None and (score.name not in LEFT_OUT or row["posed_mean_mm"] is not None)


def mean(values: Iterable[float | None]) -> float | None:
    """The mean of what is there; None where nothing is."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _shortfalls(
    results: StudyResults, trial: Trial, found: dict[Skeleton, list[Row]], scores: list[Score]
) -> tuple[str, ...]:
    """Tell which skeletons' means are over fewer digits than the task has, and why; the same reason once."""
    total = sum(len(results.layouts[r.hand].digits) for r in trial.recordings.values())
    titles_of: dict[str, list[str]] = defaultdict(list)
    for skeleton, rows in found.items():
        counts = [sum(row[score.name] is not None for row in rows) for score in scores]
        fewest = min((count for count in counts if count), default=0)
        reasons = dict.fromkeys(translated(row["message"]).rstrip(".。") for row in rows if row["message"])
        words = (
            [tr("{fewest} of {digits}", fewest=fewest, digits=ngettext("{n} digit", "{n} digits", total))]
            if fewest < total
            else []
        )
        if words or reasons:
            titles_of["; ".join([*words, *reasons])].append(skeleton.title)
    models = [skeleton.title for skeleton in found if not skeleton.reference]
    groups = {tuple(skeleton.title for skeleton in found): tr("All rows"), tuple(models): tr("All models")}
    return tuple(
        f"{groups.get(tuple(names), '; '.join(names))}: {text}." for text, names in titles_of.items()
    )


def _made_from(found: dict[Skeleton, list[Row]]) -> list[str]:
    groups: dict[tuple[str, str], list[str]] = defaultdict(list)
    for skeleton in found:
        if not skeleton.reference:
            groups[skeleton.kind, skeleton.made_from].append(skeleton.model)
    return [
        tr("{kind}, made from {tasks}: {models}.", kind=kind, tasks=tasks, models=", ".join(models))
        for (kind, tasks), models in groups.items()
    ]


def held_out_table(results: StudyResults) -> DataTable | None:
    """A row for every model, what it was made from and what it was scored on; None where nothing was."""
    hands: dict[tuple[Skeleton, str], set[Hand]] = defaultdict(set)
    for skeleton, rows in _in_order(results, [row for row in results.scores if not row["reference"]]):
        for row in rows:
            hands[skeleton, row["task"]].add(hand_of(row))
    order = list(results.models)
    made = sorted(
        hands.items(),
        key=lambda each: (
            order.index(each[0][0].model), not each[0][0].held_out, each[0][0].calibrated_on, each[0][1]
        ),
    )  # fmt: skip
    table = table_of(tr("What skeletons were made from, and what they were scored on."), _HELD_OUT, made)
    return replace(table, notes=(tr(_HELD_OUT_NOTE),)) if made else None


_HELD_OUT = (
    Column(N_("Model"), lambda made: made[0][0].model, is_text=True),
    Column(N_("Made from"), lambda made: made[0][0].made_from, is_text=True),
    Column(N_("Scored on"), lambda made: made[0][1], is_text=True),
    Column(
        N_("The score is"),
        lambda made: tr("held out") if made[0][0].held_out else tr("○ in-sample"),
        is_text=True,
    ),
    Column(
        N_("Hands"),
        lambda made: tr(
            "{hands} of {subjects}",
            hands=ngettext("{n} hand", "{n} hands", len(made[1])),
            subjects=ngettext("{n} subject", "{n} subjects", len({hand.subject for hand in made[1]})),
        ),
        is_text=True,
    ),
)
_HELD_OUT_NOTE = N_(
    "A held-out score judges a skeleton by recordings that it has not seen. An in-sample one "
    "tells how well it describes what it was made from."
)
