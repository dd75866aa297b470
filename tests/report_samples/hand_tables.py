"""The tables of a made-up study's subjects: its study-wide tables, taken apart again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from report_samples.made_study import lacking_text
from shukotsu.study.plan import StudyPlans, plan_text, read_plan
from shukotsu.study.results import GATHERED_TABLES, Results
from shukotsu.study.study import Study
from shukotsu.tables.catalogue import FINDINGS, TABLES
from shukotsu.tables.parts import Part, parts_writer
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Provenance, Table, columns_from_rows, read_table, write_table
from shukotsu.tables.whole_files import write_text

FITTED = ("receivers", "gains", "moved_receivers")


def write_subject_tables(study: Study, results: Results) -> None:
    """Write every subject's plan, and the short tables that its study-wide ones would be gathered from.

    Of the joint solves no row.
    """
    write_plans(study, results)
    for subject in study.subjects:
        plan = read_plan(results.plan(subject))
        none: dict[Part, list[dict[str, Any]]] = {part: [] for part in plan.parts()}
        write_parts(plan.table("joint_solutions"), TABLES["joint_solutions"], none)
        columns = columns_from_rows(FINDINGS, [])
        write_table(plan.table("findings"), FINDINGS, columns, Provenance((), {"digests": {}}))
        for name in GATHERED_TABLES:
            rows = _of_subject(results, TABLES[name], subject)
            if name not in FITTED:
                write_parts(plan.table(name), TABLES[name], _parts(rows, subject))
                continue
            for hand in plan.hands:
                for model in plan.fitted_models:
                    of_hand = rows.filter(
                        pc.and_(pc.equal(rows["hand"], hand), pc.equal(rows["model"], model))
                    )
                    part = Part(hand, model, "", subject)
                    write_parts(plan.fit_table(hand, model, name), TABLES[name], {part: of_hand.to_pylist()})


def write_plans(study: Study, results: Results) -> None:
    plans = StudyPlans(study, results.folder)
    for subject in study.subjects:
        write_text(results.plan(subject), plan_text(plans.content(subject)))


def write_tips(study: Study, results: Results, models: Sequence[str] = ()) -> None:
    """Write every subject's tips, of those models or of all, as the study-wide table has them."""
    for subject in study.subjects:
        rows = _of_subject(results, TABLES["tips"], subject).to_pylist()
        kept = [row for row in rows if row["model"] in (models or study.models)]
        path = results.subject(subject) / "tips.parquet"
        parts = {Part(row["hand"], row["model"], "", subject): [] for row in kept}
        for row in kept:
            parts[Part(row["hand"], row["model"], "", subject)].append(row)
        write_parts(path, TABLES["tips"], parts)


def write_parts(path: Path, table: Table, rows_of: Mapping[Part, Sequence[dict[str, Any]]]) -> None:
    columns = {column.name for column in table.columns}
    with parts_writer(path, table, Provenance()) as writer:
        for part, rows in rows_of.items():
            keys = {"hand": part.hand, "model": part.model}
            common = lacking_text(table) | {name: keys[name] for name in keys.keys() & columns}
            writer.rows(part, [common | row for row in rows])


def part_of(hand: Hand, model: str) -> Part:
    """The whole skeleton of a hand under a model."""
    return Part(hand.hand, model, "", hand.subject)


def _of_subject(results: Results, table: Table, subject: str) -> pa.Table:
    whole = read_table(results.study_table(table.name), table)
    return whole.filter(pc.equal(whole["subject"], subject))


def _parts(rows: pa.Table, subject: str) -> dict[Part, list[dict[str, Any]]]:
    parts: dict[Part, list[dict[str, Any]]] = {}
    of_models = "made_without" in rows.column_names
    for row in rows.to_pylist():
        model = row["model"] if of_models else ""
        parts.setdefault(Part(row["hand"], model, "", subject), []).append(row)
    return parts
