"""Lists of the recordings and of all problems."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from shukotsu.report.study_results import StudyResults, hand_of, recording_key
from shukotsu.report.table_cells import DataTable, quantity_column, table_of, text_column
from shukotsu.study.findings import STAGE, faults
from shukotsu.translation import ngettext, tr, translated, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import ProblemsRow

STATUS_MARKS = {"used": "", "excluded": "○ ", "failed": "✕ ", "missing": "? ", "refused": "✕ "}


def recordings_table(results: StudyResults) -> DataTable:
    """Return a table of all recordings of the sheet with their status."""
    texts = {
        "file": tr("File"), "subject": tr("Subject"), "session": tr("Session"), "hand": tr("Hand"),
        "task": tr("Task"), "trial": tr("Trial"), "role": tr("Role"), "shown": tr("Status"),
    }  # fmt: skip
    rows = []
    for recording in results.recordings:
        status, message = results.status_of(recording)
        row = results.recording_row_of.get(recording_key(recording), {}) | recording.key
        row |= {"file": recording.source.file_as_written, "role": recording.role, "message": message}
        rows.append(row | {"shown": STATUS_MARKS.get(status, "") + word(status)})
    columns = (
        *(text_column(texts[name], name) for name in texts if name != "session" or results.has_sessions),
        *map(quantity_column, ("n_frames", "duration_s", "valid_percent")),
        text_column(tr("Message"), "message"),
    )
    return table_of(tr("All recordings in the recordings sheet."), columns, rows)


@dataclass(frozen=True)
class ListedFault:
    """A fault as listed on pages.

    where : its recording, hand or model, or the number of those with it. places : these, if there are
    several. evidence : the evidence for it in each of them.
    """

    where: str
    severity: str
    text: str
    places: str = ""
    evidence: tuple[str, ...] = ()


def faults_listed(rows: Sequence[ProblemsRow]) -> list[ListedFault]:
    """Group findings by fault; return each fault with the recordings that have it."""
    listed = []
    for fault in faults(rows):
        of_rows = (": ".join(filter(None, (where(seen.row), seen.what))) for seen in fault.seen)
        evidence = tuple(f"{where(seen.row)}: {seen.evidence}" for seen in fault.seen if seen.evidence)
        places = list(dict.fromkeys(of_rows))
        several = ngettext("{n} recording", "{n} recordings", len(places))
        if not all(seen.row["task"] for seen in fault.seen):  # of a hand, or of a model
            several = ngettext("{n} place", "{n} places", len(places))
        listed.append(_listed_fault(places, several, fault.severity, fault.text, evidence))
    return listed


def _listed_fault(
    places: Sequence[str], several: str, severity: str, text: str, evidence: tuple[str, ...] = ()
) -> ListedFault:
    """Return a fault of one or several places; the evidence is listed only for several."""
    if len(places) == 1:
        return ListedFault(places[0], severity, text)
    return ListedFault(several, severity, text, "; ".join(places), evidence)


_GRAVITY = ("suspect", "refused", "note")


def all_problems(results: StudyResults) -> list[ListedFault]:
    """Return all findings to resolve and all other problems, the most severe first.

    Recordings that were not used for a reason that is not among the problems come last, one item per reason.
    """
    apart = {id(row) for row in (*results.findings, *results.accepted)}
    others = [row for row in results.rows.problems if id(row) not in apart]
    every = [*results.findings, *others]
    rows = sorted(every, key=lambda row: (row["stage"] != STAGE, _GRAVITY.index(row["severity"])))
    messages = {row["message"] for row in results.rows.problems}
    unused: dict[str, list[str]] = defaultdict(list)
    for recording in results.recordings:
        status, message = results.status_of(recording)
        if status != "used" and not (message and message in messages):
            reason = ": ".join(filter(None, (word(status), translated(message))))
            unused[reason].append(recording.source.file_as_written)
    listed = faults_listed(rows)
    for reason, files in unused.items():
        several = ngettext("{n} recording", "{n} recordings", len(files))
        listed.append(_listed_fault(files, several, "note", reason))
    return listed


def where(problem: ProblemsRow) -> str:
    """Return what a row of problems is about, in words."""
    names = (
        str(hand_of(problem).who) if problem["subject"] else "",
        tr("{hand} hand", hand=problem["hand"]) if problem["hand"] else "",
        problem["task"],
        tr("model {model}", model=problem["model"]) if problem["model"] else "",
    )
    return tr(", ").join(filter(None, names)) or tr("the study")
