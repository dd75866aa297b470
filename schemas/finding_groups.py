"""Findings by fault: what is wrong in the same way and has the same cure is one item, wherever it is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from shukotsu.schemas.findings import values_of
from shukotsu.sentences.finding_sentences import (
    MISTAKES,
    cure_of,
    evidence_of,
    key_of,
    sentence_of,
    what_and_cure,
    what_of,
)
from shukotsu.sentences.translation import foreign

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
    """Return whether the row is one of the sentences of docs/mistakes.md, and so has a cure."""
    return key_of(row["kind"], row["variant"]) in MISTAKES


def row_sentence(row: Row) -> str:
    """Return the sentence of one row."""
    text = sentence_of(row["kind"], row["variant"], values_of(row["values"]), row["accepted"])
    return text or foreign(row["message"])


def row_what(row: Row) -> str:
    """Describe the mistake in a row of a declared kind, without evidence and cure."""
    return what_of(row["kind"], row["variant"], values_of(row["values"]))


def faults(rows: Iterable[Row]) -> list[Fault]:
    """Put rows of one fault together: of the same kind, variant, severity, cure and reason to accept it."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        cure = _cure(row) if is_declared(row) else row["message"]
        names = ("stage", "kind", "variant", "severity", "accepted")
        groups.setdefault((*(row.get(name, "") for name in names), cure), []).append(row)
    return [_fault(own) for own in groups.values()]


def _fault(rows: list[Row]) -> Fault:
    first = rows[0]
    severity, accepted = first["severity"], first["accepted"]
    if len(rows) == 1 or not is_declared(first):
        return Fault(severity, accepted, row_sentence(first), tuple(Seen(row) for row in rows))
    whats = [row_what(row) for row in rows]
    shown = [evidence_of(values_of(row["values"])) for row in rows]
    what = whats[0] if len(set(whats)) == 1 else ""
    text = what_and_cure(what, first["kind"], first["variant"], values_of(first["values"]), accepted)
    return Fault(severity, accepted, text, tuple(map(Seen, rows, [""] * len(rows) if what else whats, shown)))


def _cure(row: Row) -> str:
    return cure_of(row["kind"], row["variant"], values_of(row["values"]))
