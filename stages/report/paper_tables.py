"""The paper's Tables 1 to 4: as printed, and as the study gives them, in one layout.

Saito, Mitobe, Suzuki, Yoshimura, "Modeling of Hand Skeletal Structure from Magnetic Motion Capture Data",
section 6.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from functools import cache
from pathlib import Path

from shukotsu.schemas.model import SkeletonModel
from shukotsu.schemas.study import Recording
from shukotsu.sentences.translation import N_, listed, tr, translated, word
from shukotsu.stages.report.study_results import FIRST_FRAME, HANDS, LEAST_SQUARES, Row, StudyResults, Trial
from shukotsu.stages.report.table_cells import Block, DataTable, number, title

PRINTED = Path(__file__).parent / "paper_tables.tsv"

PAPER_DIGITS = ("thumb", "index", "middle", "ring", "little")
STATISTICS = {
    "max": N_("Max [cm]"),
    "min": N_("Min [cm]"),
    "mean": N_("Average [cm]"),
    "sd": N_("Standard Deviation [cm]"),
}
TITLES = {
    1: N_(
        "Position error of the fingertip without estimating metacarpal posture in the model shown in Fig. 3"
    ),
    2: N_("Position error of the fingertip with estimating metacarpal posture in the model shown in Fig. 3"),
    3: N_("Position error of the fingertip with estimating metacarpal posture in the model shown in Fig. 4"),
    4: N_(
        "Position error of the fingertip with estimating metacarpal posture and corrected joint "
        "positions in the model shown in Fig. 4"
    ),
}

_Printed = dict[tuple[int, str, str, str], str]


def own_table(results: StudyResults, trial: Trial, model: SkeletonModel) -> DataTable:
    """The study's table for one subject and task, first-frame binding, in the paper's layout, cm."""
    blocks, notes = [], []
    for recording in trial.recordings.values():
        digits = tuple(results.layouts[recording.hand].digits)
        rows = {d: results.tip_error(recording, model.name, d, FIRST_FRAME) for d in digits}
        blocks.append(_own_block(recording, rows))
        notes += _notes(results, recording, rows)
    notes += [
        tr("The sheet has no {hand}-hand recording of this task.", hand=hand)
        for hand in HANDS
        if hand not in trial.recordings
    ]
    table = (
        ""
        if model.paper_table is None
        else tr("Table {paper_table}, this study: ", paper_table=model.paper_table)
    )
    caption = tr(
        "{table}{who}, {title}, model {name}.", table=table, who=trial.who, title=trial.title, name=model.name
    )
    return DataTable(caption, tuple(blocks), tuple(notes))


def printed_table(table: int) -> DataTable:
    """One of the paper's Tables 1 to 4, as printed, cm."""
    values = _printed()
    blocks = tuple(
        Block(
            _header(hand, PAPER_DIGITS),
            tuple(
                (tr(words), *(values[table, hand, digit, statistic] for digit in PAPER_DIGITS))
                for statistic, words in STATISTICS.items()
            ),
        )
        for hand in HANDS
    )
    return DataTable(tr("Table {table}, as the paper prints it.", table=table), blocks)


def table_title(model: SkeletonModel) -> str:
    """Title a model's table, in the paper's words where the paper has that table."""
    if model.paper_table is None:
        return tr("Model {name}, in the layout of the paper's tables", name=model.name)
    return tr(
        "Table {paper_table}. {TITLES}", paper_table=model.paper_table, TITLES=tr(TITLES[model.paper_table])
    )


def is_the_papers_hand(results: StudyResults, trial: Trial) -> bool:
    """Return whether the trial's layouts have the digits of the paper's tables."""
    layouts = (results.layouts[recording.hand] for recording in trial.recordings.values())
    return all(tuple(layout.digits) == PAPER_DIGITS for layout in layouts)


def least_squares_table(results: StudyResults, trial: Trial) -> DataTable:
    """Mean and 95th percentile of the tip error, mm, least-squares binding, by hand, model and digit."""
    blocks = []
    for hand, recording in trial.recordings.items():
        digits = tuple(results.layouts[recording.hand].digits)
        titles = [f"{title(digit)} {kind}" for digit in digits for kind in (tr("mean"), "p95")]
        rows = []
        for model in results.models:
            found = [results.tip_error(recording, model, digit, LEAST_SQUARES) for digit in digits]
            cells = [
                number(None if row is None else row[name]) for row in found for name in ("mean_mm", "p95_mm")
            ]
            rows.append((model, *cells, _held_out(found)))
        blocks.append(Block((tr("{hand} hand [mm]", hand=title(hand)), *titles, tr("Held out")), tuple(rows)))
    caption = tr(
        "Tip error with the least-squares binding, mean and 95th percentile (p95), in mm: {who}, {title}.",
        who=trial.who,
        title=trial.title,
    )
    return DataTable(caption, tuple(blocks))


@cache
def _printed() -> _Printed:
    with PRINTED.open(encoding="utf-8", newline="") as stream:
        return {
            (int(row["table"]), row["hand"], row["digit"], row["statistic"]): row["value_cm"]
            for row in csv.DictReader(stream, delimiter="\t")
        }


def _own_block(recording: Recording, rows: dict[str, Row | None]) -> Block:
    return Block(
        _header(recording.hand.hand, tuple(rows)),
        tuple(
            (tr(words), *(_cm(None if row is None else row[f"{statistic}_mm"]) for row in rows.values()))
            for statistic, words in STATISTICS.items()
        ),
    )


def _header(hand: str, digits: tuple[str, ...]) -> tuple[str, ...]:
    return (tr("Error ({hand} hand)", hand=title(hand)), *map(title, digits))


def _cm(value_mm: float | None) -> str:
    return number(None if value_mm is None else value_mm / 10)


def _notes(results: StudyResults, recording: Recording, rows: dict[str, Row | None]) -> list[str]:
    """Why cells are empty or doubtful, one line a reason, and how many frames the numbers rest on."""
    reasons: dict[str, list[str]] = defaultdict(list)
    frames: dict[str, list[str]] = defaultdict(list)
    status, message = results.status_of(recording)
    for digit, row in rows.items():
        if row is None:
            why = (
                tr("no tip error was computed")
                if status == "used"
                else tr("recording {status}", status=status)
            )
            reasons[why + (f" ({translated(message)})" if message and status != "used" else "")].append(digit)
            continue
        if row["message"] or row["mean_mm"] is None:
            reasons[translated(row["message"]) or tr("no frame has an error")].append(digit)
        if row["mean_mm"] is not None and row["n_frames"] < row["n_frames_total"]:
            frames[f"{row['n_frames']} of {row['n_frames_total']} frames"].append(digit)
    hand = tr("{hand} hand", hand=title(recording.hand.hand))
    notes = [
        f"{hand}, {listed(map(word, digits))}: {reason.rstrip('.')}." for reason, digits in reasons.items()
    ]
    return notes + [
        tr("{hand}, {digits}: from {text}.", hand=hand, digits=listed(map(word, digits)), text=text)
        for text, digits in frames.items()
    ]


def _held_out(rows: list[Row | None]) -> str:
    words = {tr("yes") if row["held_out"] else tr("no") for row in rows if row is not None}
    return "/".join(sorted(words)) or number(None)
