"""Trace the numbers to recordings, models, configuration, program versions, hashes of the inputs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from shukotsu.schemas.finding_groups import Fault, faults
from shukotsu.schemas.findings import STAGE
from shukotsu.sentences.translation import N_, ngettext, tr, translated, word
from shukotsu.stages.report.study_results import Row, StudyResults, hand_of, recording_key
from shukotsu.stages.report.table_cells import DataTable, quantity_column, table_of, text_column

_RECORDING_TEXTS = (
    N_("File"),
    N_("Subject"),
    N_("Session"),
    N_("Hand"),
    N_("Task"),
    N_("Trial"),
    N_("Role"),
)
_STATUS = N_("Status")
STATUS_MARKS = {
    "used": N_("used"),
    "excluded": N_("○ excluded"),
    "failed": N_("✕ failed"),
    "missing": N_("? missing"),
}


def recordings_table(results: StudyResults, whose: str = N_("of the study's sheet")) -> DataTable:
    """Every recording of the sheet and what became of it."""
    rows = []
    for recording in results.recordings:
        key = recording_key(recording)
        status, message = results.status_of(recording)
        texts = (recording.file_as_written, *key, recording.role)
        row = dict(zip(_RECORDING_TEXTS, texts, strict=True)) | {"message": message}
        rows.append(
            results.recording_row_of.get(key, {}) | row | {_STATUS: tr(STATUS_MARKS.get(status, status))}
        )
    columns = (
        *(
            text_column(heading, heading)
            for heading in (*_RECORDING_TEXTS, _STATUS)
            if heading != "Session" or results.has_sessions
        ),
        *map(quantity_column, ("n_frames", "duration_s", "valid_percent")),
        text_column(tr("Message"), "message"),
    )
    return table_of(tr("Every recording {whose}.", whose=tr(whose)), columns, rows)


@dataclass(frozen=True)
class Found:
    """A fault as pages list it. where : its recording, or how many have it. places : those of several.
    evidence : what shows it in each of them.
    """

    where: str
    severity: str
    text: str
    places: str = ""
    evidence: tuple[str, ...] = ()


def found(rows: Sequence[Row]) -> list[Found]:
    """Findings by fault, each with the recordings that have it."""
    return [_found(fault) for fault in faults(rows)]


_GRAVITY = ("suspect", "refused", "note")


def all_problems(results: StudyResults) -> list[Found]:
    """Return all that is to be settled or did not go as the study asked, the gravest first."""
    rows = sorted(
        [*results.findings, *results.other_problems],
        key=lambda row: (row["stage"] != STAGE, _GRAVITY.index(row["severity"])),
    )
    return [*found(rows), *_unused(results)]


def _unused(results: StudyResults) -> list[Found]:
    """Recordings that were not used for a reason that no problem tells, one item a reason."""
    messages = {row["message"] for row in results.problems}
    files: dict[str, list[str]] = defaultdict(list)
    for recording in results.recordings:
        status, message = results.status_of(recording)
        if status != "used" and not (message and message in messages):
            why = translated(message) or tr("no reason given")
            files[f"{word(status)}: {why}"].append(recording.file_as_written)
    return [
        Found(names[0], "note", reason)
        if len(names) == 1
        else Found(ngettext("{n} recording", "{n} recordings", len(names)), "note", reason, "; ".join(names))
        for reason, names in files.items()
    ]


def _found(fault: Fault) -> Found:
    places = places_of(fault)
    if len(places) == 1:
        return Found(places[0], fault.severity, fault.text)
    evidence = tuple(f"{where(seen.row)}: {seen.evidence}" for seen in fault.seen if seen.evidence)
    return Found(
        ngettext("{n} recording", "{n} recordings", len(places)),
        fault.severity,
        fault.text,
        "; ".join(places),
        evidence,
    )


def places_of(fault: Fault) -> list[str]:
    """List where a fault is, each place once; with what is wrong there where that differs."""
    return list(dict.fromkeys(": ".join(filter(None, (where(own.row), own.what))) for own in fault.seen))


def where(problem: Row) -> str:
    """Name in words what a row of problems is about."""
    named = (
        tr("{who}", who=hand_of(problem).who) if problem["subject"] else "",
        tr("{hand} hand", hand=problem["hand"]) if problem["hand"] else "",
        problem["task"],
        tr("model {model}", model=problem["model"]) if problem["model"] else "",
    )
    return tr(", ").join(filter(None, named)) or tr("the study")
