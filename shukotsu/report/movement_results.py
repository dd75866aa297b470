"""Movement results for the report: tables under one model, curves over cycles, and differences of factors."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow.compute as pc

from shukotsu.movement import study_comparison
from shukotsu.movement.cycles import MOST_EVENTS, PERCENT
from shukotsu.movement.study_comparison import QUANTITIES, WITHIN, RecordingLevels
from shukotsu.report.belief import NOT, study_beliefs
from shukotsu.report.study_results import StudyResults
from shukotsu.report.table_cells import DASH, DataTable, RowBlock, number, p_text
from shukotsu.study.study import Recording, Study, factor_levels, not_compared
from shukotsu.tables import catalogue
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Table, read_table
from shukotsu.translation import N_, listed, ngettext, tr, translated, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import MovementDifferencesRow

RANGE = "range_deg"
"""The quantity shown in figures; the others are in tables."""
OF_ANGLE = ["joint", "angle"]
_MOST_REASONS = 3


@dataclass(frozen=True)
class Curve:
    """An angle over the cycle: mean and standard deviation, deg, over n cycles or subjects.

    Each has the shape (101,), by percent of the cycle; mean and standard deviation are NaN if undefined.
    """

    mean_deg: npt.NDArray[np.float64]
    sd_deg: npt.NDArray[np.float64]
    n: npt.NDArray[np.float64]


def recording_curves(
    results: StudyResults, recording: Recording, model: str
) -> dict[str, dict[str, dict[str, Curve]]]:
    """Return a recording's curves over its cycles under a model, by event, joint and angle."""
    rows = results.recording_rows(catalogue.CYCLE_CURVES, recording, model)
    curves: dict[str, dict[str, dict[str, Curve]]] = {}
    for (event, joint, angle), group in groupby(rows, itemgetter("event", *OF_ANGLE)):
        of = list(group)
        numbers = (np.array([row[name] for row in of], float) for name in ("mean_deg", "sd_deg", "n_cycles"))
        curves.setdefault(event, {}).setdefault(joint, {})[angle] = Curve(*numbers)
    return curves


def why_no_curves(results: StudyResults, recording: Recording, model: str) -> str:
    """Return a sentence that states why a recording has no curves over cycles under a model."""
    cycles = results.recording_rows(catalogue.MOVEMENT_CYCLES, recording)
    if not cycles:
        return tr(
            "No event starts a cycle in this recording, so no angles are averaged over cycles; the study's "
            "events sheet lists the events that start cycles"
        )
    if not any(row["used"] for row in cycles):
        texts = [*dict.fromkeys(row["message"] for row in cycles)][:_MOST_REASONS]
        reasons = listed(map(translated, texts))
        return ngettext(
            "The only cycle of this recording cannot be used ({reasons}), so no angles are averaged",
            "None of the {n} cycles of this recording can be used ({reasons}), so no angles are averaged",
            len(cycles),
            reasons=reasons,
        )
    return tr("{model} has no joint angle in the cycles of this recording", model=model)


@dataclass(frozen=True)
class StudyMovement:
    """A study's movement under one model, without hands with a suspect finding.

    ranges : one row per recording and angle. curves : rows of cycle_curves, for flexion in evaluated
    recordings. differences, reliability : rows of that model. believed : displayed verdict by joint. measured
    : whether any recording has joint angles, including those of suspect hands. tasks : tasks in the order of
    display, each with whether it is used for calibration only. Tables that are empty or missing have no rows.
    """

    model: str
    ranges: pd.DataFrame
    curves: pd.DataFrame
    differences: pd.DataFrame
    reliability: pd.DataFrame
    believed: dict[str, str]
    measured: bool
    tasks: Mapping[str, bool]

    @cached_property
    def subject_means(self) -> pd.DataFrame:
        """Range of motion, deg, by task, joint, angle and subject: mean over trials, sessions and hands."""
        return _means_by_subject(self.ranges, ["task", *OF_ANGLE], RANGE)

    def level_curves(self, level_of: Mapping[str, str]) -> dict[tuple[str, str], dict[str, dict[str, Curve]]]:
        """Return curves over subjects' mean cycles, by task and event, joint and level.

        level_of : level by subject; subjects without a level are left out. Only the MOST_EVENTS events of a
        task that most subjects have are included.
        """
        means = _means_by_subject(self.curves, ["task", "event", "joint", "cycle_percent"], "mean_deg")
        means = means.assign(level=means["subject"].map(dict(level_of))).dropna(subset=["level", "mean_deg"])
        curves: dict[tuple[str, str], dict[str, dict[str, Curve]]] = {}
        for task in self.tasks:
            of_task = means[means["task"] == task]
            most = of_task.groupby("event", sort=False)["subject"].nunique()
            for event in most.sort_values(ascending=False, kind="stable").index[:MOST_EVENTS]:
                of_joints = curves.setdefault((task, str(event)), {})
                of_event = of_task[of_task["event"] == event]
                for (joint, level), rows in of_event.groupby(["joint", "level"], sort=False):
                    numbers = rows.groupby("cycle_percent")["mean_deg"].agg(["mean", "std", "count"])
                    mean_deg, sd_deg, n = numbers.reindex(PERCENT).to_numpy(float).T
                    curve = Curve(mean_deg, sd_deg, np.nan_to_num(n))
                    of_joints.setdefault(str(joint), {})[str(level)] = curve
        return curves


def _means_by_subject(numbers: pd.DataFrame, of: Sequence[str], value: str) -> pd.DataFrame:
    """Return means over trials, then sessions, then hands, by subject and the columns `of`."""
    whose = [*of, "subject", "hand", "session"]
    for _ in range(3):
        numbers = numbers.groupby(whose, sort=False)[value].mean().reset_index()
        whose.pop()
    return numbers


def read_movement(results: StudyResults) -> StudyMovement:
    """Read the study's tables of movement under the leading model, without suspect hands.

    Ranges include those of calibration recordings. Raises InputError if a file is not the expected table.
    """
    model = results.leading
    measured = movement_table(results, catalogue.RANGES_OF_MOTION, model)
    curves = movement_table(results, catalogue.CYCLE_CURVES, model, "flexion")
    roles: dict[str, set[str]] = defaultdict(set)
    for recording in results.shown:
        roles[recording.task].add(recording.role)
    tasks = {
        task: roles[task] == {"calibration"}
        for task in sorted(roles, key=lambda t: "calibration" not in roles[t])
    }

    def counted(rows: pd.DataFrame) -> pd.DataFrame:
        hands = map(Hand, rows["subject"], rows["hand"], rows["session"])
        return rows[np.array([hand not in results.suspect for hand in hands], bool)]

    ranges = counted(measured)
    return StudyMovement(
        model=model,
        ranges=ranges[ranges[RANGE].notna()],
        curves=counted(curves[~curves["task"].isin([task for task, only in tasks.items() if only])]),
        differences=movement_table(results, catalogue.MOVEMENT_DIFFERENCES, model),
        reliability=movement_table(results, catalogue.MOVEMENT_RELIABILITY, model),
        measured=bool(measured[RANGE].notna().any()),
        believed=study_beliefs(results.judging, model),
        tasks=tasks,
    )


def movement_table(results: StudyResults, table: Table, model: str, angle: str = "") -> pd.DataFrame:
    """Return a table's rows of a model and, if given, of an angle; no rows if the study has no such table."""
    path = results.paths.study_table(table.name)
    rows = read_table(path, table) if path.is_file() else table.arrow_schema({}).empty_table()
    for column, value in (("model", model), ("angle", angle)):
        rows = rows.filter(pc.equal(rows.column(column), value)) if value else rows
    return rows.replace_schema_metadata().to_pandas()


MOST_SHOWN, MOST_DRAWN = 8, 4
"""Largest numbers of quantities in a factor's table and in its figures, besides those in the study file."""
_LABELS = {
    "range_deg": N_("Range of motion"),
    "full_range_deg": N_("Full range"),
    "median_deg": N_("Posture, median"),
    "speed_median_deg_s": N_("Median speed"),
    "speed_p95_deg_s": N_("Speed, 95th percentile"),
    "path_length_mm": N_("Path length"),
    "speed_median_mm_s": N_("Median speed"),
    "speed_p95_mm_s": N_("Speed, 95th percentile"),
}
_QUANTITIES = {quantity.name: quantity for quantity in QUANTITIES}


@dataclass(frozen=True)
class DrawnDifference:
    """A quantity's values by level, then subject; paired : whether each subject has a value at all levels."""

    title: str
    axis: str
    levels: dict[str, dict[str, float]]
    paired: bool


@dataclass(frozen=True)
class ComparedFactor:
    """A factor: its levels, the reason if it is not compared (else empty), its table and its figures."""

    name: str
    levels: str
    reason: str
    table: DataTable | None
    drawn: tuple[DrawnDifference, ...]


def compared_factors(results: StudyResults, study: Study, movement: StudyMovement) -> list[ComparedFactor]:
    """Return the factors of the study file, in its order, each with its table and figures."""
    problems = pd.DataFrame(results.rows.problems, columns=["subject", "session", "hand", "severity"])
    everything = study_comparison.mark_suspect(factor_levels(study), study.factors, problems)
    reasons, asked = not_compared(study), study.config["compare"]
    factors = []
    for factor in study.factors:
        column = study_comparison.level_column(factor)
        of_level = everything.rows.groupby(column, sort=False)["subject"].nunique()
        levels = [
            f"{word(str(level)) or DASH} ({ngettext('{n} subject', '{n} subjects', n)})"
            for level, n in of_level.items()
        ]
        rows = _chosen(movement, factor, asked)
        reason = reasons.get(factor, "")
        if not rows and not reason:
            reason = tr("no hand and task has values at two of its levels, so nothing is compared")
        measured = [row for row in rows if row["difference"] is not None][: MOST_DRAWN + len(asked)]
        drawn = tuple(_drawn(results, everything, movement.model, row) for row in measured)
        table = _table(factor, rows, asked) if rows else None
        factors.append(ComparedFactor(factor, listed(levels), reason, table, drawn))
    return factors


def subject_groups(study: Study) -> dict[str, str]:
    """Return each subject's level of the first compared factor that is constant within subjects.

    Without such a factor, every level is an empty string.
    """
    rows, skipped = factor_levels(study), not_compared(study)
    for factor in study.factors:
        levels = [*dict.fromkeys((row["subject"], row[factor]) for row in rows if row[factor])]
        if factor not in skipped and len(levels) == len(dict(levels)):
            return dict(levels)
    return dict.fromkeys(study.subjects, "")


def _chosen(movement: StudyMovement, factor: str, asked: Sequence[str]) -> list[Any]:
    """Return rows of movement_differences: those that the study file names, then the largest differences."""
    rows = movement.differences[movement.differences["factor"] == factor]
    named = (rows["quantity"] + " " + rows["of"]).isin(asked).to_numpy(bool)
    doubted = {joint for joint, shown in movement.believed.items() if shown == NOT}
    sure = np.array([of.partition(" ")[0] not in doubted for of in rows["of"]], bool)
    others = rows[~named & sure & rows["difference"].notna().to_numpy()]
    size = others["effect_size"].abs().fillna(0.0)
    most = others.assign(size=-size).sort_values(["p", "size"], kind="stable", na_position="last")
    chosen = pd.concat([rows[named], most.head(MOST_SHOWN).drop(columns="size")])
    records: list[Any] = chosen.astype(object).where(chosen.notna(), None).to_dict("records")
    return records


def _title(row: Mapping[str, Any]) -> str:
    """Return what a row compares in words: the quantity, and its joint, angle or digit."""
    of = ", ".join(word(part) for part in str(row["of"]).split(" "))
    return f"{_axis(row)}, {of}"


def _axis(row: Mapping[str, Any]) -> str:
    return f"{tr(_LABELS[row['quantity']])} [{_QUANTITIES[row['quantity']].unit}]"


def _table(factor: str, rows: Sequence[MovementDifferencesRow], asked: Sequence[str]) -> DataTable:
    """Return a table of the rows, with a block for each pair of levels."""
    blocks = []
    for pair in dict.fromkeys((row["level"], row["other_level"]) for row in rows):
        of_level = tr("n, mean ± SD")
        names = [f"{word(level)}: {of_level}" for level in pair]
        header = (tr("Quantity"), tr("Hand"), tr("Task"), *names, tr("Difference"), tr("95 % interval"))
        cells = [_cells(row) for row in rows if (row["level"], row["other_level"]) == pair]
        blocks.append(RowBlock((*header, tr("p, corrected")), tuple(cells)))
    there = {f"{row['quantity']} {row['of']}" for row in rows}
    absent = [name for name in asked if name not in there]
    notes = [tr("Not measured: {names}.", names=", ".join(absent))] if absent else []
    caption = tr(
        "{factor}: the quantities that the study file lists, then up to {n} others that differ most; means "
        "over subjects (movement_differences.parquet).",
        factor=factor,
        n=MOST_SHOWN,
    )
    return DataTable(caption, tuple(blocks), tuple(notes), frozenset({0, 1, 2, 7}), "movement_differences")


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    def of_level(prefix: str, n: int) -> str:
        sd = row[f"{prefix}sd"]
        spread = f" ± {number(sd, 1)}" if sd is not None else ""
        return f"{n}, {number(row[f'{prefix}mean'], 1)}{spread}" if n else DASH

    interval = DASH if row["low"] is None else f"{number(row['low'], 1)} – {number(row['high'], 1)}"
    p = row["p_holm"]
    why = study_comparison.why_untested(row["design"], row["n"], row["n_other"]) if p is None else p_text(p)
    levels = of_level("", row["n"]), of_level("other_", row["n_other"])
    where = word(row["hand"]), row["task"]
    return (_title(row), *where, *levels, number(row["difference"], 1), interval, why)


def _drawn(
    results: StudyResults, everything: RecordingLevels, model: str, row: MovementDifferencesRow
) -> DrawnDifference:
    """Return the subjects' values at the row's two levels, from which its means are computed."""
    quantity, factor = _QUANTITIES[row["quantity"]], row["factor"]
    table = movement_table(results, quantity.table, model)
    numbers = study_comparison.numbers_of(quantity, table, everything.counted)
    means = study_comparison.subject_means(numbers[numbers["of"] == row["of"]], factor, ["hand", "task"])
    wide = means.unstack("level").reset_index()
    for column in ("hand", "task"):
        wide = wide[(wide[column] == row[column]) | (column == factor)]
    by_subject = wide.groupby("subject", sort=False)[[row["level"], row["other_level"]]].mean()
    paired = row["design"] == WITHIN
    both = by_subject.notna().all(axis=1)
    by_subject = by_subject[both if paired else ~both]
    levels = {str(level): by_subject[level].dropna().to_dict() for level in by_subject}
    where = ", ".join(filter(None, (word(row["hand"]), row["task"])))
    return DrawnDifference(f"{_title(row)}; {where}", _axis(row), levels, paired)
