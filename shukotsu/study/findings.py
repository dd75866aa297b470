"""Findings: what was declared of a recording and cannot be. Kinds of them stand in `mistakes.yaml`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import yaml

from shukotsu.resources import ROOT
from shukotsu.study.finding_sentences import (
    MISTAKES,
    Values,
    cure_of,
    evidence_of,
    key_of,
    sentence_of,
    what_and_cure,
    what_of,
)
from shukotsu.translation import foreign

REFUSED, SUSPECT, NOTE = "refused", "suspect", "note"
STAGE = "check_recordings"

Row = dict[str, Any]
"""Of the problems table, or of the findings table."""


@dataclass(frozen=True)
class Finding:
    """One finding in one recording. severity : refused (not used), suspect (judges nothing) or note.

    variant : which of its kind's sentences says it, see `finding_sentences`. values : that the sentence is
    made of; numbers to six digits, as tables keep them. accepted : the reason of a study that lets it stand.
    """

    kind: str
    severity: str
    variant: str = ""
    values: Values = field(default_factory=dict)
    accepted: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", {name: plain(value) for name, value in self.values.items()})

    @property
    def message(self) -> str:
        """The English sentence."""
        return sentence_of(self.kind, self.variant, self.values, self.accepted)

    @property
    def columns(self) -> dict[str, str]:
        """Columns of a table's row."""
        return {
            "kind": self.kind,
            "severity": self.severity,
            "variant": self.variant,
            "values": values_text(self.values),
            "accepted": self.accepted,
            "message": self.message,
        }

    def accept(self, reason: str) -> Finding:
        """Return the finding as a study that gives a reason has it: a suspect one becomes a note."""
        if not reason or self.severity != SUSPECT:
            return self
        return replace(self, severity=NOTE, accepted=reason)


def worded(kind: str, severity: str, text: str) -> Finding:
    """Make a finding of a message, or of a text of which nothing else is known, as of a reader's refusal."""
    return Finding(kind, severity, values={"text": text})


def plain(value: Any) -> Any:
    """Return a value as JSON keeps it, numbers to six digits."""
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def problem_row(stage: str, finding: Finding, **where: str) -> dict[str, str]:
    """Return a row of the problems table; where : what it is about, of its first columns."""
    whole = dict.fromkeys(("subject", "session", "hand", "task", "model"), "")
    return {**whole, **where, "stage": stage, **finding.columns}


def problem_of(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row of the findings table as the problems table has it."""
    kept = {name: value for name, value in row.items() if name != "trial"}
    task = ", ".join(filter(None, (row["task"], row["trial"])))
    return {**kept, "task": task, "model": "", "stage": STAGE}


def values_text(values: Values) -> str:
    """Return values as a table's column has them: JSON, empty where there is none."""
    return json.dumps(dict(values), ensure_ascii=False) if values else ""


def values_of(text: str) -> Values:
    """Return the values of a table's column."""
    return dict(json.loads(text)) if text else {}


@dataclass(frozen=True)
class Kind:
    """What a kind of finding means, what usually causes it, and what cures it."""

    meaning: str
    cause: str
    cure: str


@cache
def kinds() -> dict[str, Kind]:
    """Return every kind of mistake, from `mistakes.yaml`."""
    content = yaml.load((ROOT / "schemas" / "mistakes.yaml").read_bytes(), yaml.CBaseLoader)
    return {name: Kind(**texts) for name, texts in content.items()}


def same_file(hand: str, task: str, subject: str = "", session: str = "") -> Finding:
    """Return that the poses are those of another recording; subject : where it is another's, or session's."""
    other = {"subject": subject, "session": session, "hand": hand, "task": task}
    return Finding("same-file", SUSPECT, values=other)


def unchecked(message: str) -> Finding:
    """Return that a recording could not be checked: of what is not known nobody is suspected."""
    return Finding("unchecked", NOTE, "", {"reason": message})


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


def faults(rows: Iterable[Row]) -> list[Fault]:
    """Put rows of one fault together: of the same kind, variant, severity, cure and reason to accept it."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        cure = _cure(row) if is_declared(row) else row["message"]
        names = ("stage", "kind", "variant", "severity", "accepted")
        groups.setdefault((*(row.get(name, "") for name in names), cure), []).append(row)
    return [_fault(alike) for alike in groups.values()]


def _fault(rows: list[Row]) -> Fault:
    first = rows[0]
    severity, accepted = first["severity"], first["accepted"]
    if len(rows) == 1 or not is_declared(first):
        return Fault(severity, accepted, row_sentence(first), tuple(Seen(row) for row in rows))
    whats = [what_of(row["kind"], row["variant"], values_of(row["values"])) for row in rows]
    shown = [evidence_of(values_of(row["values"])) for row in rows]
    what = whats[0] if len(set(whats)) == 1 else ""
    text = what_and_cure(what, first["kind"], first["variant"], values_of(first["values"]), accepted)
    return Fault(severity, accepted, text, tuple(map(Seen, rows, [""] * len(rows) if what else whats, shown)))


def _cure(row: Row) -> str:
    return cure_of(row["kind"], row["variant"], values_of(row["values"]))
