"""Combine the subjects' tables into the study's; each failure becomes a row of `problems` with its reason."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from shukotsu.checks.checked_subject import copies
from shukotsu.errors import INTERNAL
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.scores.agreement import agreement
from shukotsu.study import config_files, plan_file, recording_summary, sheets
from shukotsu.study.findings import NOTE, REFUSED, STAGE, finding_of_text, problem_row
from shukotsu.study.layout import read_layout
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.results import GATHERED_TABLES, Results
from shukotsu.study.study import Study, correction_problems, unmatched_rows, unused_columns
from shukotsu.tables.catalogue import AGREEMENT, PROBLEMS, RECORDINGS, TABLES
from shukotsu.tables.typed_table import (
    Column,
    Provenance,
    Table,
    columns_from_rows,
    key_of,
    read_metadata,
    write_table,
)
from shukotsu.tables.whole_files import write_text

if TYPE_CHECKING:
    from shukotsu.tables.rows import ProblemsRow, RecordingsRow


def gather_study(study: Study, results: Results) -> None:
    """Write the study's tables into its results folder. Raises TableError if a subject's table is damaged."""
    plans = [plan_file.read_plan(results.plan(*who)) for who in study.sessions]
    of_subjects = [recording_summary.subject_tables(plan) for plan in plans]
    recordings = [row for subject in of_subjects for row in subject.recordings]
    problems: list[ProblemsRow] = []
    for row in study.unusable:
        finding = finding_of_text("recording", REFUSED, row.message)
        problems.append(problem_row("plan", finding, **vars(row.hand), task=row.task))
    for plan, subject in zip(plans, of_subjects, strict=True):
        problems += [*_bugs(plan), *subject.problems]
    # find recordings whose poses equal those of another subject or session
    digests = {plan.who: read_metadata(plan.table("findings"))["parameters"]["digests"] for plan in plans}
    of_recordings = (
        (recording, digests[plan.who].get("/".join(recording.key.values()), ""))
        for plan in plans
        for recording in plan.recordings
    )
    for recording, finding in copies(of_recordings):
        problems.append(problem_row(STAGE, finding, **vars(recording.hand), task=recording.title))
    of_sheets: list[tuple[str, str, str, str]] = []  # rule, kind, severity and sentence of problems of sheets
    if (sheet := study.sheets.get("corrections")) is not None:
        layout = read_layout(study.layout.absolute())
        texts = correction_problems(sheets.read_sheet(sheet, sheets.CORRECTIONS), sheet, study.hands, layout)
        of_sheets += [("project_planes", "correction", REFUSED, text) for text in texts]
    of_sheets += [("plan", "sheet", REFUSED, text) for text in unmatched_rows(study)]
    of_sheets += [("plan", "sheet", NOTE, text) for text in unused_columns(study)]
    problems += [problem_row(rule, finding_of_text(kind, how, text)) for rule, kind, how, text in of_sheets]
    for name in GATHERED_TABLES:
        rows = pa.concat_tables([subject.tables[name] for subject in of_subjects])
        files = [file for plan in plans for file in plan.files_of(name)]
        columns = {column.name: rows.column(column.name) for column in TABLES[name].columns}
        provenance = Provenance.of(files, results.folder)
        write_table(results.study_table(name), TABLES[name], columns, provenance)
    # write the study, its layouts and its models with all defaults into one YAML file
    layouts = dict.fromkeys(recording.source.layout for recording in study.recordings)
    whole = {
        "program": f"{PROGRAM} {VERSION}",
        "study": study.config,
        "layouts": [config_files.read_config(path, "layout") for path in layouts],
        "models": [config_files.read_config(path, "model") for path in study.models.values()],
    }
    write_text(results.resolved, config_files.yaml_text(whole))
    provenance = Provenance.of(list(study.sheets.values()))
    key = ("subject", "session", "hand", "task", "model", "message")
    unique = list({key_of(row, key): row for row in reversed(problems)}.values())[::-1]
    whole_table = _with_further_columns(study, recordings)
    tables = ((whole_table, recordings), (PROBLEMS, unique), (AGREEMENT, agreement(plans)))
    for table, table_rows in tables:
        write_table(results.study_table(table.name), table, columns_from_rows(table, table_rows), provenance)


def _with_further_columns(study: Study, rows: Sequence[RecordingsRow]) -> Table:
    """Add the sheet's further columns to the rows; return the table's definition with these columns."""
    taken = {column.name for column in RECORDINGS.columns}
    names = {name: f"{name}_of_sheet" if name in taken else name for name, _ in study.recordings[0].more}
    more = {tuple(recording.key.values()): recording.more for recording in study.recordings}
    for row in rows:
        columns: Any = {names[name]: text for name, text in more[key_of(row, RECORDINGS.key)]}
        row |= columns
    text = pa.string()
    columns = [Column(name, text, "", "as in the recordings sheet", nullable=True) for name in names.values()]
    return replace(RECORDINGS, columns=(*RECORDINGS.columns, *columns))


def _bugs(plan: SubjectPlan) -> Iterator[ProblemsRow]:
    """Yield internal errors with the stage that caused them; later stages repeat them as their own."""
    references = [plan.table("receivers", hand, config_files.REFERENCE) for hand in plan.hands]
    for name in ("joint_solutions", "projected_joints", "receivers"):  # those whose failures are repeated
        files = plan.files_of(name) + (references if name == "receivers" else [])
        for file in filter(Path.is_file, files):
            problems = recording_summary.part_problems(plan, file, name)
            yield from (row for row in problems if row["message"].startswith(INTERNAL))
