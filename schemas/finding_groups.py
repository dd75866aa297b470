"""Findings by fault: what is wrong in the same way and has the same cure is one item, wherever it is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from schemas.finding_sentences import (
    SENTENCES,
    Say,
    accepted_text,
    cure_of,
    english,
    evidence_of,
    sentence_of,
    what_and_cure,
    what_of,
)
from schemas.findings import KINDS, values_of

Row = dict[str, Any]
"""Of the problems table, or of the findings table."""


@dataclass(frozen=True)
class Seen:
    """A row that has a fault. what : what is wrong there, where that differs from row to row. evidence : what
    shows it there. Both are empty where the fault's text says it all.
    """

    row: Row
    what: str = ""
    evidence: str = ""


@dataclass(frozen=True)
class Fault:
    """One item. text : what is wrong and what to do, and where it is accepted why."""

    severity: str
    accepted: str
    text: str
    seen: tuple[Seen, ...]


def is_declared(row: Row) -> bool:
    """Whether the row is one of the sentences of docs/mistakes.md, and so has a cure."""
    return row["variant"] in SENTENCES.get(row["kind"], {})


def row_sentence(row: Row, say: Say = english) -> str:
    """The sentence of one row."""
    values = values_of(row["values"])
    if not values and not row["variant"] and not is_declared(row):
        return say("{message}", message=row["message"])
    return sentence_of(row["kind"], row["variant"], values, row["accepted"], say)


def row_what(row: Row, say: Say = english) -> str:
    """What is wrong by a row of a declared kind, without what shows it and what to do."""
    return what_of(row["kind"], row["variant"], values_of(row["values"]), say)


def faults(rows: Iterable[Row], say: Say = english) -> list[Fault]:
    """Put rows of one fault together: of the same kind, variant, severity, cure and reason to accept it."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        said = _cure(row, say) if is_declared(row) else row["message"]
        names = ("stage", "kind", "variant", "severity", "accepted")
        groups.setdefault((*(row.get(name, "") for name in names), said), []).append(row)
    return [_fault(own, say) for own in groups.values()]


def _fault(rows: list[Row], say: Say) -> Fault:
    first = rows[0]
    severity, accepted = first["severity"], first["accepted"]
    if len(rows) == 1 or not is_declared(first):
        return Fault(severity, accepted, row_sentence(first, say), tuple(Seen(row) for row in rows))
    whats = [row_what(row, say) for row in rows]
    shown = [evidence_of(values_of(row["values"]), say) for row in rows]
    what = whats[0]
    if len(set(whats)) > 1:
        what = say(KINDS[first["kind"]].meaning).rstrip(".。")
    else:
        whats = [""] * len(rows)
    text = accepted_text(what_and_cure(what, _cure(first, say), say), accepted, say)
    return Fault(severity, accepted, text, tuple(map(Seen, rows, whats, shown)))


def _cure(row: Row, say: Say) -> str:
    return cure_of(row["kind"], row["variant"], values_of(row["values"]), say)
