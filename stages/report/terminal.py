"""The study's tables as plain text, for a terminal of 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from shukotsu.schemas.finding_groups import Fault, faults
from shukotsu.sentences.finding_sentences import in_quotes
from shukotsu.sentences.translation import ngettext
from shukotsu.stages.report.headline import opening, used_text
from shukotsu.stages.report.paper_tables import own_table, table_title
from shukotsu.stages.report.provenance import places_of, where
from shukotsu.stages.report.score_tables import score_table
from shukotsu.stages.report.study_results import Row, StudyResults, Trial
from shukotsu.stages.report.table_cells import DataTable

WIDTH = 79
MOST_PROBLEMS, MOST_PLACES = 10, 4
_HEADING, _CELL = 25, 8
"""Narrowest columns: of the headings, of the numbers."""


def terminal_tables(results: StudyResults) -> str:
    """The subjects' tables of the models that reproduce one of the paper's, then all scores, as text.

    Of a subject with recordings of role both only their tables stand in the paper's form, as the paper scored
    the recording that it solved its joints from; the others are in the report.
    """
    models = sorted(
        (model for model in results.models.values() if model.paper_table is not None),
        key=lambda model: model.paper_table or 0,
    )
    problems = _problems(results)
    parts = [_wrapped(f"Study {results.name}: {used_text(results)} {opening(results)}"), *problems]
    for who in results.sessions:
        for trial in _as_the_paper(results.trials(*who)):
            parts += [
                f"{_wrapped(table_title(model))}\n{table_text(own_table(results, trial, model))}"
                for model in models
            ]
    if len(parts) == 1 + len(problems):
        parts.append("No recording was evaluated with a model of one of the paper's tables.")
    scores = (score_table(results, t, compact=True) for who in results.sessions for t in results.trials(*who))
    parts += [table_text(table) for table in scores if table is not None]
    return "\n\n".join(parts) + "\n"


def _problems(results: StudyResults) -> list[str]:
    """List what went wrong, what was found in recordings first, and what is accepted of it: a paragraph each.

    An item is what is wrong in the same way; the first ones, for all stand in the report.
    """
    lists = {
        "Found in the recordings, to be settled first:": results.findings,
        "What went wrong:": results.other_problems,
        "Accepted in the recordings sheet:": results.accepted,
    }
    return ["\n".join([heading, *_items(rows)]) for heading, rows in lists.items() if rows]


def _items(rows: list[Row]) -> list[str]:
    found = faults(rows)
    more = [f"- and {len(found) - MOST_PROBLEMS} more; see the report"] if len(found) > MOST_PROBLEMS else []
    return [*(line for fault in found[:MOST_PROBLEMS] for line in _item(fault)), *more]


def _item(fault: Fault) -> list[str]:
    """A fault's lines: where it is and what it is; of several recordings what shows it in the first, too."""
    places, stage = places_of(fault), fault.seen[0].row["stage"]
    named = "; ".join(places[:MOST_PLACES])
    named += f"; and {len(places) - MOST_PLACES} more" if len(places) > MOST_PLACES else ""
    text, evidence = in_quotes(fault.text), fault.seen[0].evidence
    if not evidence and not fault.seen[0].what:
        return [_wrapped(f"- {named}, {stage}: {text}")]
    below = [named, *([f"{where(fault.seen[0].row)}: {evidence}"] if evidence else [])]
    recordings = ngettext("{n} recording", "{n} recordings", len(places))
    head = f"- {recordings}, {stage}: {text}"
    return [_wrapped(head), *(_wrapped(line, indent="  ") for line in below)]


def _as_the_paper(trials: Iterable[Trial]) -> list[Trial]:
    every = list(trials)
    both = [trial for trial in every if any(r.role == "both" for r in trial.recordings.values())]
    return both or every


def table_text(table: DataTable) -> str:
    """One table as text: its caption, its blocks under each other, its notes."""
    lines = [_wrapped(table.caption)]
    every = [row for block in table.blocks for row in (block.header, *block.rows)]
    heading = max(_HEADING, *(len(row[0]) + 1 for row in every))
    cell_width = max(_CELL, *(len(cell) + 1 for row in every for cell in row[1:]))
    for block in table.blocks:
        lines.append("")
        lines += [
            f"{row[0]:<{heading}}" + "".join(f"{cell:>{cell_width}}" for cell in row[1:])
            for row in (block.header, *block.rows)
        ]
    if table.notes:
        lines.append("")
        lines += [_wrapped(note) for note in table.notes]
    return "\n".join(lines)


def _wrapped(text: str, indent: str = "") -> str:
    return textwrap.fill(text, WIDTH, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)
