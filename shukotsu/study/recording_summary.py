"""A subject's contribution to the study's tables: rows of recordings, short tables, and problems."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from shukotsu.arrays import Array
from shukotsu.errors import InputError, TableError
from shukotsu.study.findings import (
    NOTE,
    REFUSED,
    Finding,
    finding_of_text,
    moved_finding,
    problem_of,
    problem_row,
    severity_of_loss,
    title_of,
)
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.results import GATHERED_TABLES, SUBJECT_TABLES
from shukotsu.study.study import Recording
from shukotsu.study.verdict import TOO_CLOSE, doubts_of
from shukotsu.tables import typed_table
from shukotsu.tables.catalogue import FINDINGS, POSES, RECORDINGS, TABLES, table_in
from shukotsu.tables.device_clock import device_clock
from shukotsu.tables.parts import part_metadata

if TYPE_CHECKING:
    from shukotsu.tables.rows import ProblemsRow, ReceiversRow, RecordingsRow


@dataclass(frozen=True)
class SubjectTables:
    """A subject's rows of the tables recordings and problems, and of GATHERED_TABLES for whole skeletons."""

    recordings: list[RecordingsRow]
    problems: list[ProblemsRow]
    tables: Mapping[str, pa.Table]


def subject_tables(plan: SubjectPlan) -> SubjectTables:
    """Read one subject's rows of the study's tables and collect its problems.

    A recording that a finding refuses has the status refused. Raises TableError if a table is damaged.
    """
    recordings: list[RecordingsRow] = []
    problems: list[ProblemsRow] = []
    for recording in plan.recordings:
        row, findings = recording_row(recording, plan.poses(recording))
        where = {**vars(recording.hand), "task": recording.title}
        problems += [problem_row("capture", finding, **where) for finding in findings]
        recordings.append(row)
    by_name = {typed_table.key_of(row, RECORDINGS.key): row for row in recordings}
    for finding in typed_table.rows_of(typed_table.read_table(plan.table("findings"), FINDINGS)):
        row = by_name[typed_table.key_of(finding, RECORDINGS.key)]
        if finding["severity"] == REFUSED and row["status"] == "used":
            row |= {"status": REFUSED, "message": finding["message"]}
        problems.append(problem_of(finding))
    tables = {}
    accepted = {(recording.hand.hand, recording.title): recording.accept for recording in plan.recordings}
    problems_of_rows: dict[str, Callable[[pa.Table, Accepted], list[ProblemsRow]]] = {
        "receivers": _receiver_problems,
        "moved_receivers": _moved_problems,
        "clocks": _clock_problems,
        "joint_centres": _joint_problems,
    }
    for name in GATHERED_TABLES:
        table, parts = TABLES[name], [TABLES[name].arrow_schema({}).remove_metadata().empty_table()]
        for file in plan.files_of(name):
            rows = typed_table.read_table(file, table)
            whole = "made_without" in table.key
            parts.append(rows.filter(pc.equal(rows.column("made_without"), "")) if whole else rows)
            problems += part_problems(plan, file, name)
        tables[name] = pa.concat_tables([part.replace_schema_metadata() for part in parts])
        if name in problems_of_rows:
            problems += problems_of_rows[name](tables[name], accepted)
    for hand in plan.hands:
        if not plan.all_calibrating(hand):
            uncalibrated = Finding("hand", REFUSED, "uncalibrated")
            problems.append(problem_row("solve_joints", uncalibrated, **vars(plan.hand(hand))))
    return SubjectTables(recordings, problems, tables)


def part_problems(plan: SubjectPlan, file: Path, name: str) -> Iterator[ProblemsRow]:
    """Yield a problem for each part of a table that failed or that its stage wrote a note to.

    name : the table's name in SUBJECT_TABLES or FIT_TABLES.
    """
    stage = SUBJECT_TABLES.get(name, "fit_hand")
    for part, parameters in part_metadata(file, table_in(name)).items():
        where = {**vars(plan.hand(part.hand)), "model": part.model}
        kind = "skeleton" if part.model else "hand"
        for name, severity in (("failure", REFUSED), ("note", NOTE)):
            if name in parameters and not part.made_without:
                yield problem_row(stage, finding_of_text(kind, severity, parameters[name]), **where)


RECEIVER_KINDS = {"": "receiver", "step": "receiver-loose", "slide": "receiver-slid"}
"""Kinds of problems by the `loose_kind` of a receiver."""

OF_A_MODEL = ("subject", "session", "hand", "model")


Accepted = Mapping[tuple[str, str], str]
"""The study's reason for accepting suspect findings, by hand and title of the recording."""


def _receiver_problems(receivers: pa.Table, accepted: Accepted) -> list[ProblemsRow]:
    """Return the problems that rows of receivers report: receivers that came loose or slid, refused touches.

    A disturbed field is one problem for all receivers that it affects, per hand and model.
    """
    problems = []
    in_field: dict[tuple[str, ...], list[ReceiversRow]] = {}
    for row in typed_table.rows_of(receivers):
        if not row["message"] or row["status"] == "failed":
            continue
        if row["loose_kind"] == "field":
            in_field.setdefault(typed_table.key_of(row, OF_A_MODEL), []).append(row)
            continue
        values = {"segment": row["segment"], "text": row["message"]}
        severity = severity_of_loss(100 * (row["left_out_share"] or 0.0))
        finding = Finding(RECEIVER_KINDS[row["loose_kind"]], severity, "", values)
        finding = finding.accept(accepted.get((row["hand"], row["loose_task"]), ""))
        problems.append(_problem_of_hand(row, finding))
    for rows in in_field.values():
        values = _field_values(rows)
        finding = Finding("field-disturbed", severity_of_loss(values["percent"]), "", values)
        reason = next((r for (hand, _), r in accepted.items() if r and hand == rows[0]["hand"]), "")
        problems.append(_problem_of_hand(rows[0], finding.accept(reason)))
    return problems


def _moved_problems(moved: pa.Table, accepted: Accepted) -> list[ProblemsRow]:
    """Return the problems of receivers that sit elsewhere in a recording than during calibration.

    Their frames in that recording are not used.
    """
    return [
        _problem_of_hand(row, moved_finding(row).accept(accepted.get((row["hand"], title_of(row)), "")))
        for row in typed_table.rows_of(moved)
    ]


def _problem_of_hand(row: Mapping[str, Any], finding: Finding, stage: str = "fit_hand") -> ProblemsRow:
    """Return a row of problems for the hand that `row` is about, and for its recording if it names one."""
    keys = {key: row[key] for key in ("subject", "session", "hand")}
    return problem_row(stage, finding, **keys, task=title_of(row) if "task" in row else "")


def _field_values(rows: Sequence[ReceiversRow]) -> dict[str, Any]:
    """Summarise a disturbed field's effect on the receivers it affects, given their rows."""
    return {
        **dict(zip("xyz", typed_table.vector_of(rows[0], "field_", "_mm").tolist(), strict=True)),
        "count": len(rows),
        "mm": max(row["loose_shift_mm"] for row in rows),
        "deg": max(row["loose_turn_deg"] for row in rows),
        "percent": 100 * max(row["left_out_share"] for row in rows),
        "segments": [row["segment"] for row in rows],
    }


def _joint_problems(joints: pa.Table, _: Accepted) -> list[ProblemsRow]:
    """Return a problem for each MCP centre that is closer to its neighbour than in any hand, by model."""
    problems = []
    for row in typed_table.rows_of(joints):
        if values := doubts_of(row).get(TOO_CLOSE):
            finding, keys = Finding(TOO_CLOSE, NOTE, "", values), {key: row[key] for key in OF_A_MODEL}
            problems.append(problem_row("estimate_metacarpals", finding, **keys))
    return problems


def _clock_problems(clocks: pa.Table, _: Accepted) -> list[ProblemsRow]:
    """Return a problem for each recording whose events were not read or whose clock is uncertain."""
    return [
        _problem_of_hand(row, finding_of_text("events", NOTE, row["message"]), "align_events")
        for row in typed_table.rows_of(clocks)
        if row["status"] in ("weak", "failed")
    ]


def recording_row(recording: Recording, poses: Path) -> tuple[RecordingsRow, list[Finding]]:
    """Return the recording's row of the recordings table, and its problems.

    poses : the recording's poses table, which need not exist for an excluded recording.
    """
    row: RecordingsRow = {
        "role": recording.role,
        "file": recording.source.file_as_written,
        "status": "used",
        "n_frames": 0,
        "n_receivers": 0,
        "message": "",
    }
    key: Any = recording.key
    row |= key
    if recording.exclude:
        return row | {"status": "excluded", "message": recording.exclude}, []
    try:
        n_rows, n_valid, time_s = sum_poses(poses)
    except InputError as error:
        failed = finding_of_text("recording", REFUSED, str(error))
        return row | {"status": "failed", "message": failed.message}, [failed]
    parameters = typed_table.read_metadata(poses)["parameters"]
    notes, absent, losses = (_texts(poses, parameters, name) for name in ("notes", "absent", "losses"))
    missing = parameters.get("missing_frames", 0)
    if not isinstance(missing, int):
        raise TableError(
            f"{poses}: its metadata have no number of missing_frames; make it with shukotsu.readers"
        )
    dead = dict.fromkeys([*absent, *(segment for segment, count in n_valid.items() if not count)])
    unseen = [Finding("recording", NOTE, "no-pose", {"segments": [*dead]})] if dead else []
    problems = [finding_of_text("recording", NOTE, loss) for loss in losses]
    row["message"] = "; ".join(dict.fromkeys([*(each.message for each in (*unseen, *problems)), *notes]))
    if not any(n_valid.values()):  # recordings with some valid poses get this finding from the checks
        problems = unseen + problems
    n_frames = n_rows // max(len(n_valid), 1)
    expected = (n_frames + missing) * len({*n_valid, *absent})
    row["tracker"] = str(parameters.get("tracker", ""))
    row["n_frames"] = n_frames
    row["n_receivers"] = sum(1 for count in n_valid.values() if count)
    row["duration_s"] = device_clock(time_s)[0]
    row["valid_percent"] = 100.0 * sum(n_valid.values()) / expected if expected else None
    return row, problems


def _texts(path: Path, parameters: Mapping[str, Any], name: str) -> list[str]:
    """Return a list of texts in the poses table's parameters. Raises TableError if it is anything else."""
    texts = parameters.get(name, [])
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise TableError(f"{path}: its metadata have no list of {name}; make it with shukotsu.readers")
    return texts


def sum_poses(poses: Path) -> tuple[int, dict[str, int], Array]:
    """Count the rows of a poses table in total and the valid ones by segment, and collect its times.

    Returns the two counts and time_s (T,): each frame's time in the first segment that has one, else NaN.
    """
    n_rows, n_valid, seen, time_s = 0, dict[str, int](), dict[str, int](), np.zeros(0)
    for rows in typed_table.read_row_groups(poses, POSES, ["segment", "time_s", "valid"]):
        n_rows += rows.num_rows
        for segment in pc.unique(rows["segment"]).to_pylist():
            of_segment = rows.filter(pc.equal(rows["segment"], segment))
            start, end = seen.get(segment, 0), seen.get(segment, 0) + of_segment.num_rows
            n_valid[segment] = n_valid.get(segment, 0) + pc.sum(of_segment["valid"]).as_py()
            time_s = np.concatenate([time_s, np.full(max(0, end - len(time_s)), np.nan)])
            times = time_s[start:end]
            np.copyto(times, typed_table.column_array(of_segment, "time_s"), where=np.isnan(times))
            seen[segment] = end
    return n_rows, n_valid, time_s
