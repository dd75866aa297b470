"""The study's tables from those of its subjects; whatever failed is a row of problems with its reason."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from shukotsu.checks.compared_recordings import copies
from shukotsu.errors import INTERNAL
from shukotsu.files.whole_files import write_text
from shukotsu.schemas import PROGRAM, VERSION
from shukotsu.schemas.catalogue import (
    CLOCKS,
    FINDINGS,
    JOINT_CENTRES,
    JOINT_SOLUTIONS,
    MOVED_RECEIVERS,
    PROBLEMS,
    RECEIVERS,
    RECORDINGS,
    TABLES,
)
from shukotsu.schemas.config_files import REFERENCE, read_config, yaml_text
from shukotsu.schemas.findings import (
    NOTE,
    REFUSED,
    STAGE,
    Finding,
    problem_of,
    problem_row,
    worded,
)
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.parts import part_metadata
from shukotsu.schemas.plan import SubjectPlan, read_plan
from shukotsu.schemas.recording_summary import recording_row
from shukotsu.schemas.results import GATHERED_TABLES, Results
from shukotsu.schemas.sheets import CORRECTIONS, read_sheet
from shukotsu.schemas.study import Study, columns_handed_on, correction_problems, unmatched_rows
from shukotsu.schemas.tables import (
    Column,
    Provenance,
    Table,
    columns_from_rows,
    read_metadata,
    read_table,
    rows_of,
    write_table,
)
from shukotsu.schemas.verdict import TOO_CLOSE, doubts_of

Row = dict[str, Any]


def gather_study(study: Study, results: Results) -> None:
    """Write the study-wide tables into its results folder. Raises TableError where a subject's is damaged."""
    plans = [read_plan(results.plan(*who)) for who in study.sessions]
    problems: list[Row] = []
    problems += [
        problem_row("plan", worded("recording", REFUSED, row.message), **vars(row.hand), task=row.task)
        for row in study.unusable
    ]
    recordings = [row for plan in plans for row in _recording_rows(plan, problems)]
    problems += [row for plan in plans for row in _finding_rows(plan, recordings)]
    problems += _same_files(plans)
    problems += [row for plan in plans for row in _bugs(plan)]
    for name in GATHERED_TABLES:
        problems += _gather_table(results, name, plans)
    problems += [row for plan in plans for row in _uncalibrated(plan)]
    problems += _correction_rows(study)
    problems += [problem_row("plan", worded("sheet", REFUSED, text)) for text in unmatched_rows(study)]
    problems += [problem_row("plan", worded("sheet", NOTE, text)) for text in columns_handed_on(study)]
    _write_resolved(study, results)
    provenance = Provenance.of(list(study.sheets.values()))
    unique = list({tuple(row[key] for key in _UNIQUE): row for row in reversed(problems)}.values())[::-1]
    for table, rows in ((_with_further_columns(study, recordings), recordings), (PROBLEMS, unique)):
        write_table(results.study_table(table.name), table, columns_from_rows(table, rows), provenance)


def _with_further_columns(study: Study, rows: Sequence[Row]) -> Table:
    """Return the recordings table with what the sheet has besides, which is put into the rows."""
    own = {column.name for column in RECORDINGS.columns}
    names = {name: f"{name}_of_sheet" if name in own else name for name, _ in study.recordings[0].more}
    more = {tuple(one.key.values()): one.more for one in study.recordings}
    for row in rows:
        row |= {names[name]: text for name, text in more[tuple(row[key] for key in RECORDINGS.key)]}
    text = pa.string()
    columns = [Column(name, text, "", "as in the recordings sheet", nullable=True) for name in names.values()]
    return replace(RECORDINGS, columns=(*RECORDINGS.columns, *columns))


_UNIQUE = ("subject", "session", "hand", "task", "model", "message")


def _recording_rows(plan: SubjectPlan, problems: list[Row]) -> Iterator[Row]:
    """A subject's rows of the recordings table; what is wrong with a recording joins the problems."""
    for recording in plan.recordings:
        row, own = recording_row(recording, plan.poses(recording))
        where = {**vars(recording.hand), "task": recording.title}
        problems += [problem_row("capture", one, **where) for one in own]
        yield row


def _finding_rows(plan: SubjectPlan, recordings: Sequence[Row]) -> Iterator[Row]:
    """Return a subject's findings; a recording that one refuses is no longer called used."""
    by_name = {tuple(row[key] for key in RECORDINGS.key): row for row in recordings}
    for row in rows_of(read_table(plan.table(FINDINGS.name), FINDINGS)):
        recording = by_name[tuple(row[key] for key in RECORDINGS.key)]
        if row["severity"] == REFUSED and recording["status"] == "used":
            recording |= {"status": REFUSED, "message": row["message"]}
        yield problem_of(row)


def _same_files(plans: Sequence[SubjectPlan]) -> Iterator[Row]:
    """Name recordings whose poses are, number by number, those of another subject's, or another session's."""
    digests = {plan.who: read_metadata(plan.table(FINDINGS.name))["parameters"]["digests"] for plan in plans}
    of_recordings = (
        (own, digests[plan.who].get("/".join(own.key.values()), ""))
        for plan in plans
        for own in plan.recordings
    )
    for own, finding in copies(of_recordings):
        yield problem_row(STAGE, finding, **vars(own.hand), task=own.title)


def _gather_table(results: Results, name: str, plans: Sequence[SubjectPlan]) -> list[Row]:
    """Write one of the study's tables, of whole skeletons; give the problems in it."""
    table, stage = TABLES[name], GATHERED_TABLES[name]
    files = [(plan, file) for plan in plans for file in plan.files_of(name)]
    tables = [table.arrow_schema({}).remove_metadata().empty_table()]
    problems: list[Row] = []
    for plan, file in files:
        tables.append(_whole_skeletons(file, table))
        problems += _part_problems(plan, file, table, stage)
    rows = pa.concat_tables([own.replace_schema_metadata() for own in tables])
    provenance = Provenance.of([file for _, file in files], results.folder)
    columns = {column.name: rows.column(column.name) for column in table.columns}
    write_table(results.study_table(name), table, columns, provenance)
    of_rows = {
        RECEIVERS.name: _receiver_problems,
        MOVED_RECEIVERS.name: _moved_problems,
        CLOCKS.name: _clock_problems,
        JOINT_CENTRES.name: _joint_problems,
    }
    return problems + (of_rows[name](rows) if name in of_rows else [])


def _whole_skeletons(file: Path, table: Table) -> pa.Table:
    rows = read_table(file, table)
    if "made_without" not in table.key:
        return rows
    return rows.filter(pc.equal(rows.column("made_without"), ""))


_WRITTEN_BEFORE = (
    (JOINT_SOLUTIONS, "joint_solutions", "solve_joints"),
    (JOINT_CENTRES, "projected_joints", "project_planes"),
    (RECEIVERS, RECEIVERS.name, "fit_hand"),
)
"""Tables of stages whose failures others pass on, by form and file, and the rule that writes each."""


def _bugs(plan: SubjectPlan) -> Iterator[Row]:
    """Name bugs with the stage that they are in, before others pass them on as their own failures."""
    references = [plan.fit_table(hand, REFERENCE, RECEIVERS.name) for hand in plan.hands]
    for table, name, stage in _WRITTEN_BEFORE:
        files = plan.files_of(name) + (references if name == RECEIVERS.name else [])
        for file in filter(Path.is_file, files):
            problems = _part_problems(plan, file, table, stage)
            yield from (row for row in problems if row["message"].startswith(INTERNAL))


def _part_problems(plan: SubjectPlan, file: Path, table: Table, stage: str) -> Iterator[Row]:
    """Parts that failed, and what a stage notes of others."""
    for part, parameters in part_metadata(file, table).items():
        where = {**vars(plan.hand(part.hand)), "model": part.model}
        kind = "skeleton" if part.model else "hand"
        for name, severity in (("failure", REFUSED), ("note", NOTE)):
            if name in parameters and not part.made_without:
                yield problem_row(stage, worded(kind, severity, parameters[name]), **where)


RECEIVER_KINDS = {
    "": "receiver",
    "step": "receiver-loose",
    "slide": "receiver-slid",
}
"""Kinds of problems by what displaced a receiver."""

OF_A_MODEL = ("subject", "session", "hand", "model")


def _receiver_problems(receivers: pa.Table) -> list[Row]:
    """Receivers that came loose or slid, and touches that were refused, once however many models say so; a
    disturbed field once for all receivers that are in it.

    A receiver without a valid pose is named with its recording.
    """
    problems, in_field = [], dict[tuple[str, ...], list[Row]]()
    for row in rows_of(receivers):
        if not row["message"] or row["status"] == "failed":
            continue
        if row["loose_kind"] == "field":
            in_field.setdefault(tuple(row[key] for key in OF_A_MODEL), []).append(row)
            continue
        values = {"segment": row["segment"], "text": row["message"]}
        found = Finding(RECEIVER_KINDS[row["loose_kind"]], NOTE, "", values)
        problems.append(problem_row("fit_hand", found, **_hand_of(row)))
    for rows in in_field.values():
        found = Finding("field-disturbed", NOTE, "", _field_values(rows))
        problems.append(problem_row("fit_hand", found, **_hand_of(rows[0])))
    return problems


def _moved_problems(moved: pa.Table) -> list[Row]:
    """Receivers that sit elsewhere in a recording than in the calibration."""
    return [
        problem_row(
            "fit_hand",
            Finding("receiver-moved", NOTE, "", {"segment": row["segment"], "text": row["message"]}),
            **_hand_of(row),
            task=_title(row),
        )
        for row in rows_of(moved)
        if row["message"]
    ]


def _title(row: Row) -> str:
    return ", ".join(filter(None, (row["task"], row["trial"])))


def _hand_of(row: Row) -> dict[str, str]:
    return {key: row[key] for key in ("subject", "session", "hand")}


def _field_values(rows: Sequence[Row]) -> dict[str, Any]:
    """Summarise a disturbed field's effect on the receivers in it, from their rows."""
    mm, deg, share = (
        max(row[name] for row in rows) for name in ("loose_shift_mm", "loose_turn_deg", "left_out_share")
    )
    return {
        **{axis: rows[0][f"field_{axis}_mm"] for axis in "xyz"},
        "count": len(rows),
        "mm": mm,
        "deg": deg,
        "percent": 100 * share,
        "segments": [row["segment"] for row in rows],
    }


def _joint_problems(joints: pa.Table) -> list[Row]:
    """Neighbouring MCP centres that are nearer to each other than any hand has them, under each model."""
    return [
        problem_row(
            "estimate_metacarpals",
            Finding(TOO_CLOSE, NOTE, "", values),
            **{key: row[key] for key in OF_A_MODEL},
        )
        for row in rows_of(joints)
        if (values := doubts_of(row).get(TOO_CLOSE))
    ]


def _clock_problems(clocks: pa.Table) -> list[Row]:
    """Recordings whose events were not read, or stand on a clock not sure to be theirs."""
    return [
        problem_row(
            "align_events",
            worded("events", NOTE, row["message"]),
            **{name: row[name] for name in ("subject", "session", "hand")},
            task=_title(row),
        )
        for row in rows_of(clocks)
        if row["status"] in ("weak", "failed")
    ]


def _uncalibrated(plan: SubjectPlan) -> Iterator[Row]:
    """Name the hands that no recording calibrates: nothing failed, and yet there is no skeleton."""
    for hand in plan.hands:
        if not plan.all_calibrating(hand):
            own = Finding("hand", REFUSED, "uncalibrated")
            yield problem_row("solve_joints", own, **vars(plan.hand(hand)))


def _correction_rows(study: Study) -> list[Row]:
    path = study.sheets.get("corrections")
    if path is None:
        return []
    layout = read_layout(study.layout.absolute())
    messages = correction_problems(read_sheet(path, CORRECTIONS), path, study.hands, layout)
    return [problem_row("project_planes", worded("correction", REFUSED, text)) for text in messages]


def _write_resolved(study: Study, results: Results) -> None:
    """Write the study with its layouts and models, every default filled in, as one YAML file."""
    layouts = dict.fromkeys(recording.layout for recording in study.recordings)
    whole = {
        "program": f"{PROGRAM} {VERSION}",
        "study": study.config,
        "layouts": [read_config(path, "layout") for path in layouts],
        "models": [read_config(path, "model") for path in study.models.values()],
    }
    write_text(results.resolved, yaml_text(whole))
