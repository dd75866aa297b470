"""Tables of scores of the skeletons in an evaluated task, of errors against the truth of simulated hands, and
the paper's Tables 1 to 4, as printed and for the study, in the same layout.

A row of scores belongs to a reference, or to a model that was made from a certain set of tasks.
Saito, Mitobe, Suzuki, Yoshimura, "Modeling of Hand Skeletal Structure from Magnetic Motion Capture Data",
section 6.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from shukotsu.report import table_cells
from shukotsu.report.study_results import FIRST_FRAME, HANDS, LEAST_SQUARES, StudyResults, Trial, hand_of
from shukotsu.report.table_cells import DASH, DataTable, PageColumn, RowBlock, number, title
from shukotsu.study.model import SkeletonModel
from shukotsu.study.study import Recording
from shukotsu.tables.subjects import SubjectSession
from shukotsu.tables.typed_table import key_of
from shukotsu.translation import N_, listed, ngettext, tr, translated, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import TipErrorsRow

MEANS = (
    "replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm", "metacarpal_deg",
    "true_tip_mean_mm",
)  # fmt: skip
LEFT_OUT = "left_out_mean_mm"
"""Error at fingertip receivers that were left out.

A replay never uses the distal receivers' positions, so for skeletons that are not fitted this equals the
replay's error and is shown only in that column.
"""


FAR_MM = 5.0
"""Error beyond which a joint is useless, half the breadth of a finger's bone."""

HALVES_WITHIN_95 = ("within_95", "parent_within_95")


class Scored(NamedTuple):
    """Rows of a model made from certain tasks, or of a reference, which is not made from any."""

    model: str
    calibrated_on: str
    held_out: bool
    reference: bool
    rows: list[Mapping[str, Any]]


_OF_TRIAL = ("subject", "session", "task", "trial")


def score_table(results: StudyResults, trial: Trial) -> DataTable | None:
    """Return a table of scores in one subject's task, means over digits and hands, or None without scores.

    Held-out skeletons come first, then in-sample ones, then references. Empty columns are left out.
    """
    wanted = (*trial.who, trial.task, trial.trial)
    rows = [row for row in results.rows.skeleton_scores if key_of(row, _OF_TRIAL) == wanted]
    scored = _scored(results, sorted(rows, key=lambda row: bool(row["hand"] != "right")))
    if not scored:
        return None
    names = [name for name in MEANS if any(_is_known(name, row) for each in scored for row in each.rows)]
    columns = (
        PageColumn(tr("Skeleton"), lambda each: each.model, is_text=True),
        PageColumn(tr("Calibrated on"), _made_from, is_text=True),
        PageColumn(
            tr("Held out"),
            lambda each: DASH if each.reference else tr("yes") if each.held_out else tr("○ no"),
            is_text=True,
        ),
        *(PageColumn(table_cells.heading(name), partial(_mean_text, name)) for name in names),
    )
    caption = tr("Mean over digits and hands: {who}, {title}.", who=trial.who, title=trial.title)
    notes = _shortfalls(results, trial, scored, names)
    return table_cells.table_of(caption, columns, _blocks(scored), notes=notes, source="skeleton_scores")


def _scored(results: StudyResults, rows: Iterable[Mapping[str, Any]]) -> list[Scored]:
    """Group rows by skeleton: held-out ones, then in-sample ones, then references, in the study's order."""
    order = {name: index for index, name in enumerate(results.models)}
    groups: dict[tuple[str, str, bool, bool], list[Mapping[str, Any]]] = defaultdict(list)
    for row in rows:
        model = row["model"]
        reference = row.get("reference", model not in order)
        groups[model, row["calibrated_on"], row.get("held_out", False), reference].append(row)
    return sorted(
        (Scored(*skeleton, rows) for skeleton, rows in groups.items()),
        key=lambda each: (each.reference, not each.held_out, order.get(each.model, len(order))),
    )


def _blocks(scored: Sequence[Scored]) -> dict[str, list[Scored]]:
    return {
        heading: [each for each in scored if each.reference == is_reference]
        for heading, is_reference in ((tr("Skeleton"), False), (tr("Reference"), True))
    }


def _made_from(scored: Scored) -> str:
    tasks = "" if scored.reference else scored.calibrated_on.replace(";", ", ")
    return tasks or DASH


def _mean_text(name: str, scored: Scored) -> str:
    return table_cells.format_value(name, mean(row[name] for row in scored.rows if _is_known(name, row)))


def _is_known(name: str, row: Mapping[str, Any]) -> bool:
    return row[name] is not None and (name != LEFT_OUT or row["posed_mean_mm"] is not None)


def mean(values: Iterable[float | None]) -> float | None:
    """Return the mean of the values that are not None, or None if there are none."""
    numbers = [value for value in values if value is not None]
    return sum(numbers) / len(numbers) if numbers else None


def _shortfalls(
    results: StudyResults, trial: Trial, scored: Sequence[Scored], names: Sequence[str]
) -> list[str]:
    """Return notes on skeletons whose means include fewer digits than the task has, with the reasons."""
    total = sum(len(results.layouts[r.hand].digits) for r in trial.recordings.values())
    models_of: dict[str, dict[str, None]] = defaultdict(dict)
    for skeleton in scored:
        counts = [sum(row[name] is not None for row in skeleton.rows) for name in names]
        fewest = min((count for count in counts if count), default=0)
        messages = filter(None, (row["message"] for row in skeleton.rows))
        parts = dict.fromkeys(translated(message).rstrip(".。") for message in messages)
        digits = ngettext("{n} digit", "{n} digits", total)
        short = [tr("{n} of {total}", n=fewest, total=digits)] if fewest < total else []
        if short or parts:
            models_of["; ".join([*short, *parts])][skeleton.model] = None
    return [f"{', '.join(models)}: {text}." for text, models in models_of.items()]


def truth_table(results: StudyResults, who: SubjectSession) -> DataTable | None:
    """Return a table of errors of a subject's joints by skeleton, or None if the truth is unknown."""
    scored = _scored(results, (row for row in results.rows.joint_errors if hand_of(row).who == who))
    if not scored:
        return None

    def quantile(title: str, share: float, name: str = "error_mm") -> PageColumn:
        def cell(each: Scored) -> str:
            values = _sizes(each, name)
            return number(float(np.quantile(values, share)) if values else None)

        return PageColumn(title, cell)

    columns = (
        PageColumn(tr("Skeleton"), lambda each: each.model, is_text=True),
        PageColumn(tr("Calibrated on"), _made_from, is_text=True),
        PageColumn(tr("Joints"), lambda each: f"{len(_sizes(each, 'error_mm'))}/{len(each.rows)}"),
        quantile(table_cells.heading("median_mm"), 0.5),
        quantile(tr("90th percentile [mm]"), 0.9),
        quantile(table_cells.heading("max_mm"), 1.0),
        PageColumn(
            f"> {FAR_MM:.0f} mm [%]", lambda each: _percent([e > FAR_MM for e in _sizes(each, "error_mm")])
        ),
        quantile(tr("Axis [deg]"), 0.5, "axis_deg"),
        quantile(table_cells.heading("bone_error_percent"), 0.5, "bone_error_percent"),
        PageColumn(tr("Within the stated 95 % region [%]"), _within_percent),
    )
    caption = tr(
        "Errors of joints against the truth, both hands: {who}. Axis, bone length: medians.", who=who
    )
    return table_cells.table_of(caption, columns, _blocks(scored), source="joint_errors")


def _within_percent(scored: Scored) -> str:
    """Return the percentage of halves of joints whose true error is within the stated region."""
    halves = [row[half] for row in scored.rows for half in HALVES_WITHIN_95]
    return _percent([half for half in halves if half is not None])


def _percent(answers: Sequence[bool]) -> str:
    return number(100.0 * sum(answers) / len(answers) if answers else None, 0)


def _sizes(scored: Scored, name: str) -> list[float]:
    return [abs(row[name]) for row in scored.rows if row[name] is not None]


PRINTED = Path(__file__).parent / "paper_tables.tsv"
"""File of the printed numbers, cm: a row per table, hand and statistic, and a column per digit."""

PAPER_DIGITS = ("thumb", "index", "middle", "ring", "little")
STATISTICS = {"max": N_("Max"), "min": N_("Min"), "mean": N_("Average"), "sd": N_("Standard Deviation")}
"""Row headings as in the paper; its values are in centimetres."""


def study_table(results: StudyResults, trial: Trial, model: SkeletonModel) -> DataTable:
    """Return the study's table for a subject and task, first-frame binding, in the paper's layout, cm."""
    blocks, notes = [], []
    for recording in trial.recordings.values():
        digits = tuple(results.layouts[recording.hand].digits)
        rows: dict[str, Any] = {d: results.tip_error(recording, model.name, d, FIRST_FRAME) for d in digits}
        cells = []
        for name, words in STATISTICS.items():
            values_mm = [row[f"{name}_mm"] if row else None for row in rows.values()]
            numbers = [number(None if value is None else value / 10) for value in values_mm]
            cells.append((f"{tr(words)} [cm]", *numbers))
        blocks.append(RowBlock(_header(recording.hand.hand, digits), tuple(cells)))
        notes += _notes(results, recording, rows)
    caption = f"{trial.who}, {trial.title}, {tr('model {model}', model=model.name)}."
    return DataTable(caption, tuple(blocks), tuple(notes), source="tip_errors")


def printed_table(table: int) -> DataTable:
    """Return one of the paper's Tables 1 to 4 as printed, cm."""
    with PRINTED.open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream, delimiter="\t") if row["table"] == str(table)]
    blocks = []
    for hand in HANDS:
        numbers = {row["statistic"]: [row[d] for d in PAPER_DIGITS] for row in rows if row["hand"] == hand}
        cells = ((f"{tr(words)} [cm]", *numbers[name]) for name, words in STATISTICS.items())
        blocks.append(RowBlock(_header(hand, PAPER_DIGITS), tuple(cells)))
    return DataTable(tr("Table {table} as printed in the paper.", table=table), tuple(blocks))


def table_title(model: SkeletonModel) -> str:
    """Return a model's name, preceded by the number of its table if it is in the paper."""
    if model.paper_table is None:
        return model.name
    return tr("Table {n}: {name}", n=model.paper_table, name=model.name)


def has_the_papers_digits(results: StudyResults, trial: Trial) -> bool:
    """Return whether the trial's layouts have the digits of the paper's tables."""
    layouts = (results.layouts[recording.hand] for recording in trial.recordings.values())
    return all(tuple(layout.digits) == PAPER_DIGITS for layout in layouts)


def least_squares_table(results: StudyResults, trial: Trial) -> DataTable:
    """Return a table of tip errors with least-squares binding, mean and p95 by hand, model and digit, mm."""
    blocks = []
    for hand, recording in trial.recordings.items():
        digits = tuple(results.layouts[recording.hand].digits)
        titles = [f"{title(digit)} {kind}" for digit in digits for kind in (tr("mean"), "p95")]
        rows = []
        for model in results.models:
            errors = [results.tip_error(recording, model, digit, LEAST_SQUARES) for digit in digits]
            cells = [number(row[name] if row else None) for row in errors for name in ("mean_mm", "p95_mm")]
            seen = {tr("yes") if row["held_out"] else tr("no") for row in errors if row is not None}
            rows.append((model, *cells, "/".join(sorted(seen)) or number(None)))
        blocks.append(RowBlock((tr("{hand} hand", hand=title(hand)), *titles, tr("Held out")), tuple(rows)))
    caption = tr("Tip error, least-squares binding, mean and 95th percentile (p95) [mm]: {who}, {title}.",
                 who=trial.who, title=trial.title)  # fmt: skip
    return DataTable(caption, tuple(blocks), source="tip_errors")


def _header(hand: str, digits: tuple[str, ...]) -> tuple[str, ...]:
    return (tr("Error ({hand} hand)", hand=title(hand)), *map(title, digits))


def _notes(results: StudyResults, recording: Recording, rows: Mapping[str, TipErrorsRow | None]) -> list[str]:
    """Return notes on why cells are empty or doubtful, and on the number of frames behind the values."""
    reasons: dict[str, list[str]] = defaultdict(list)
    status, message = results.status_of(recording)
    for digit, row in rows.items():
        if row is None:
            why = tr("no tip error")
            if status != "used":
                why = ": ".join(filter(None, (word(status), translated(message))))
            reasons[why].append(digit)
            continue
        if row["message"] or row["mean_mm"] is None:
            reasons[translated(row["message"]) or tr("no tip error")].append(digit)
        if row["mean_mm"] is not None and row["n_frames"] < row["n_frames_total"]:
            frames = tr("from {n} of {total} frames", n=row["n_frames"], total=row["n_frames_total"])
            reasons[frames].append(digit)
    hand = tr("{hand} hand", hand=title(recording.hand.hand))
    return [f"{hand}, {listed(map(word, digits))}: {why.rstrip('.')}." for why, digits in reasons.items()]
