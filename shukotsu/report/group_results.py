"""How the levels of a study's factors differ in movement: a table of groups, and every subject's number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from shukotsu.movement.study_comparison import (
    QUANTITIES,
    WITHIN,
    RecordingLevels,
    level_column,
    mark_suspect,
    numbers_of,
    subject_means,
    why_untested,
)
from shukotsu.report.belief import NOT
from shukotsu.report.movement_results import StudyMovement, movement_table
from shukotsu.report.study_results import Row, StudyResults
from shukotsu.report.table_cells import DASH, DataTable, RowBlock, number, p_text
from shukotsu.study.study import Study, factor_levels, not_compared
from shukotsu.translation import N_, listed, ngettext, tr, word

MOST_SHOWN, MOST_DRAWN = 8, 4
"""Numbers of a factor that are in its table, and in its figure, beside those that the study file names."""
_LABELS = {
    "range_deg": N_("Range of motion"),
    "full_range_deg": N_("Full range"),
    "median_deg": N_("Posture, median"),
    "speed_median_deg_s": N_("Speed, median"),
    "speed_p95_deg_s": N_("Speed, 95 %"),
    "path_length_mm": N_("Path length"),
    "speed_median_mm_s": N_("Speed, median"),
    "speed_p95_mm_s": N_("Speed, 95 %"),
}
_QUANTITIES = {quantity.name: quantity for quantity in QUANTITIES}


@dataclass(frozen=True)
class DrawnDifference:
    """A number at two levels or more, by level and then subject. paired : whether subjects have them all."""

    title: str
    axis: str
    levels: dict[str, dict[str, float]]
    paired: bool


@dataclass(frozen=True)
class ComparedFactor:
    """A factor: its levels in words, why nothing is compared (or empty), the table, and what is drawn."""

    name: str
    levels: str
    reason: str
    table: DataTable | None
    drawn: tuple[DrawnDifference, ...]


def compared_factors(results: StudyResults, study: Study, movement: StudyMovement) -> list[ComparedFactor]:
    """Return what is shown of every factor of the study file, in its order."""
    if not study.factors:
        return []
    problems = pd.DataFrame(results.problems, columns=["subject", "session", "hand", "severity"])
    everything = mark_suspect(factor_levels(study), study.factors, problems)
    reasons, asked = not_compared(study), study.config["compare"]
    factors = []
    for factor in study.factors:
        of_level = everything.rows.groupby(level_column(factor), sort=False)["subject"].nunique()
        levels = [
            f"{word(str(level)) or DASH} ({ngettext('{n} subject', '{n} subjects', n)})"
            for level, n in of_level.items()
        ]
        rows = _chosen(movement, factor, asked)
        reason = reasons.get(factor, "")
        if not rows and not reason:
            reason = tr("no hand and task has numbers at two of its levels, so nothing is compared")
        known = [row for row in rows if row["difference"] is not None][: MOST_DRAWN + len(asked)]
        drawn = tuple(_drawn(results, everything, movement.model, row) for row in known)
        table = _table(factor, rows, asked) if rows else None
        factors.append(ComparedFactor(factor, listed(levels), reason, table, drawn))
    return factors


def subject_groups(study: Study) -> dict[str, str]:
    """Return each subject's level of the study's first factor between subjects; of all '' without one."""
    rows, skipped = factor_levels(study), not_compared(study)
    for factor in study.factors:
        levels = [*dict.fromkeys((row["subject"], row[factor]) for row in rows if row[factor])]
        if factor not in skipped and len(levels) == len(dict(levels)):
            return dict(levels)
    return dict.fromkeys(study.subjects, "")


def _chosen(movement: StudyMovement, factor: str, asked: Sequence[str]) -> list[Row]:
    """Return rows of movement_differences: those that the study file names, then those that differ most."""
    rows = movement.differences[movement.differences["factor"] == factor]
    named = (rows["quantity"] + " " + rows["of"]).isin(asked).to_numpy(bool)
    doubted = {joint for joint, shown in movement.believed.items() if shown == NOT}
    sure = np.array([of.partition(" ")[0] not in doubted for of in rows["of"]], bool)
    others = rows[~named & sure & rows["difference"].notna().to_numpy()]
    size = others["effect_size"].abs().fillna(0.0)
    most = others.assign(size=-size).sort_values(["p", "size"], kind="stable", na_position="last")
    chosen = pd.concat([rows[named], most.head(MOST_SHOWN).drop(columns="size")])
    return [
        {str(name): None if value != value else value for name, value in row.items()}
        for row in chosen.to_dict("records")
    ]


def _title(row: Row) -> str:
    """Write what a row compares, in words: the quantity and whose it is."""
    of = ", ".join(word(part) for part in str(row["of"]).split(" "))
    return f"{_axis(row)}, {of}"


def _axis(row: Row) -> str:
    return f"{tr(_LABELS[row['quantity']])} [{_QUANTITIES[row['quantity']].unit}]"


def _table(factor: str, rows: Sequence[Row], asked: Sequence[str]) -> DataTable:
    """Tabulate the rows, a block for every two levels."""
    blocks = []
    for pair in dict.fromkeys((row["level"], row["other_level"]) for row in rows):
        of_level = tr("n, mean ± SD")
        names = [f"{word(level)}: {of_level}" for level in pair]
        header = (tr("Number"), tr("Hand"), tr("Task"), *names, tr("Difference"), tr("95 % interval"))
        cells = [_cells(row) for row in rows if (row["level"], row["other_level"]) == pair]
        blocks.append(RowBlock((*header, tr("p, corrected")), tuple(cells)))
    there = {f"{row['quantity']} {row['of']}" for row in rows}
    absent = [name for name in asked if name not in there]
    notes = [tr("Not measured: {names}.", names=", ".join(absent))] if absent else []
    caption = tr(
        "{factor}: numbers that the study file names, then at most {n} that differ most; means over subjects "
        "(movement_differences.parquet).",
        factor=factor,
        n=MOST_SHOWN,
    )
    return DataTable(caption, tuple(blocks), tuple(notes), frozenset({0, 1, 2, 7}), "movement_differences")


def _cells(row: Row) -> tuple[str, ...]:
    def of_level(prefix: str, n: int) -> str:
        sd = row[f"{prefix}sd"]
        spread = f" ± {number(sd, 1)}" if sd is not None else ""
        return f"{n}, {number(row[f'{prefix}mean'], 1)}{spread}" if n else DASH

    interval = DASH if row["low"] is None else f"{number(row['low'], 1)} – {number(row['high'], 1)}"
    p = row["p_holm"]
    why = why_untested(row["design"], row["n"], row["n_other"]) if p is None else p_text(p)
    levels = of_level("", row["n"]), of_level("other_", row["n_other"])
    where = word(row["hand"]), row["task"]
    return (_title(row), *where, *levels, number(row["difference"], 1), interval, why)


def _drawn(results: StudyResults, everything: RecordingLevels, model: str, row: Row) -> DrawnDifference:
    """Return every subject's number at the row's two levels: those that its means are of."""
    quantity, factor = _QUANTITIES[row["quantity"]], row["factor"]
    numbers = numbers_of(quantity, movement_table(results, quantity.table, model), everything.counted)
    means = subject_means(numbers[numbers["of"] == row["of"]], factor, ["hand", "task"])
    wide = means.unstack("level").reset_index()
    for place in ("hand", "task"):
        wide = wide[(wide[place] == row[place]) | (place == factor)]
    by_subject = wide.groupby("subject", sort=False)[[row["level"], row["other_level"]]].mean()
    paired = row["design"] == WITHIN
    both = by_subject.notna().all(axis=1)
    by_subject = by_subject[both if paired else ~both]
    levels = {
        str(level): {str(subject): float(value) for subject, value in by_subject[level].dropna().items()}
        for level in by_subject
    }
    where = ", ".join(filter(None, (word(row["hand"]), row["task"])))
    return DrawnDifference(f"{_title(row)}; {where}", _axis(row), levels, paired)
