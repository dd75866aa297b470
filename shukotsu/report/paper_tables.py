"""The paper's Tables 1 to 4: as printed, and as the study has them, in one layout.

Saito, Mitobe, Suzuki, Yoshimura, "Modeling of Hand Skeletal Structure from Magnetic Motion Capture Data",
section 6.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from functools import cache
from pathlib import Path

from shukotsu.report.study_results import FIRST_FRAME, HANDS, LEAST_SQUARES, Row, StudyResults, Trial
from shukotsu.report.table_cells import Block, DataTable, number, title
from shukotsu.study.model import SkeletonModel
from shukotsu.study.study import Recording
from shukotsu.translation import N_, listed, tr, translated, word

PRINTED = Path(__file__).parent / "paper_tables.tsv"
"""A row a table, hand and statistic, a column a digit: centimetres, digit by digit as printed."""

PAPER_DIGITS = ("thumb", "index", "middle", "ring", "little")
STATISTICS = {"max": N_("Max"), "min": N_("Min"), "mean": N_("Average"), "sd": N_("Standard Deviation")}
"""As the paper heads its rows, which are in centimetres."""


def study_table(results: StudyResults, trial: Trial, model: SkeletonModel) -> DataTable:
    """Return the study's table for one subject and task, first-frame binding, in the paper's layout, cm."""
    blocks, notes = [], []
    for recording in trial.recordings.values():
        digits = tuple(results.layouts[recording.hand].digits)
        rows = {d: results.tip_error(recording, model.name, d, FIRST_FRAME) for d in digits}
        cells = (
            (f"{tr(words)} [cm]", *(_cm(row, f"{name}_mm") for row in rows.values()))
            for name, words in STATISTICS.items()
        )
        blocks.append(Block(_header(recording.hand.hand, digits), tuple(cells)))
        notes += _notes(results, recording, rows)
    caption = f"{trial.who}, {trial.title}, {tr('model {model}', model=model.name)}."
    return DataTable(caption, tuple(blocks), tuple(notes))


@cache
def _printed() -> dict[tuple[int, str, str], tuple[str, ...]]:
    with PRINTED.open(encoding="utf-8", newline="") as stream:
        return {
            (int(row["table"]), row["hand"], row["statistic"]): tuple(row[digit] for digit in PAPER_DIGITS)
            for row in csv.DictReader(stream, delimiter="\t")
        }


def printed_table(table: int) -> DataTable:
    """Return one of the paper's Tables 1 to 4, as printed, cm."""
    blocks = (
        Block(
            _header(hand, PAPER_DIGITS),
            tuple(
                (f"{tr(words)} [cm]", *_printed()[table, hand, name]) for name, words in STATISTICS.items()
            ),
        )
        for hand in HANDS
    )
    return DataTable(tr("Table {table}, as the paper prints it.", table=table), tuple(blocks))


def table_title(model: SkeletonModel) -> str:
    """Return a model's name, with the number of the paper's table where the paper has it."""
    if model.paper_table is None:
        return model.name
    return tr("Table {n}: {name}", n=model.paper_table, name=model.name)


def is_the_papers_hand(results: StudyResults, trial: Trial) -> bool:
    """Return whether the trial's layouts have the digits of the paper's tables."""
    layouts = (results.layouts[recording.hand] for recording in trial.recordings.values())
    return all(tuple(layout.digits) == PAPER_DIGITS for layout in layouts)


def least_squares_table(results: StudyResults, trial: Trial) -> DataTable:
    """Return mean and 95th percentile of the tip error, mm, least-squares binding, by hand, model, digit."""
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
        blocks.append(Block((tr("{hand} hand", hand=title(hand)), *titles, tr("Held out")), tuple(rows)))
    caption = tr("Tip error, least-squares binding, mean and 95th percentile (p95) [mm]: {who}, {title}.",
                 who=trial.who, title=trial.title)  # fmt: skip
    return DataTable(caption, tuple(blocks))


def _cm(row: Row | None, name: str) -> str:
    return number(None if row is None or row[name] is None else row[name] / 10)


def _header(hand: str, digits: tuple[str, ...]) -> tuple[str, ...]:
    return (tr("Error ({hand} hand)", hand=title(hand)), *map(title, digits))


def _notes(results: StudyResults, recording: Recording, rows: dict[str, Row | None]) -> list[str]:
    """Return why cells are empty or doubtful, a line a reason, and how many frames the numbers rest on."""
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
