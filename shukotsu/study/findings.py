"""Findings: contradictions between a recording's declared properties and its poses; sentences are made on
display.

Kinds are explained in `mistakes.yaml`; sentences by kind and variant are in `finding_sentences.yaml`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, BinaryIO

import yaml

from shukotsu.resources import ROOT
from shukotsu.translation import N_, filled, foreign, listed, ngettext, tr, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import FindingsRow, MovedReceiversRow, ProblemsRow

REFUSED, SUSPECT, NOTE = "refused", "suspect", "note"
EXIT_CODES = {NOTE: 0, SUSPECT: 1, REFUSED: 2}
"""Exit codes of a check by the gravest finding."""
STAGE = "check_recordings"

LEAST_LOST = 2.0
"""Percent of a receiver's poses in a recording; fewer that are left out change no number that is shown."""

Values = Mapping[str, Any]
"""By name: numbers, words, or lists of them, as JSON has them."""

_SENTENCES: dict[str, Any] = yaml.load(
    (ROOT / "schemas" / "finding_sentences.yaml").read_bytes(), yaml.CBaseLoader
)
MISTAKES: Mapping[str, Mapping[str, Any]] = _SENTENCES["mistakes"]
EVIDENCE: Mapping[str, str] = _SENTENCES["evidence"]
EFFECT: str = _SENTENCES["effect"]
PROBLEMS: Mapping[str, str | list[str]] = _SENTENCES["problems"]


def extracted(
    file: BinaryIO, *_: object, **__: object
) -> Iterator[tuple[int, str | None, str | list[str], list[str]]]:
    """Yield the messages of `finding_sentences.yaml` to translate; an extractor for Babel."""
    content = yaml.load(file, yaml.CBaseLoader)
    texts = [text for mistake in content["mistakes"].values() for text in mistake.values()]
    for text in (*texts, *content["evidence"].values(), content["effect"], *content["problems"].values()):
        if not isinstance(text, dict):  # keys of a mapping stay as they are
            yield 0, "ngettext" if isinstance(text, list) else None, text, []


@dataclass(frozen=True)
class Finding:
    """One finding in one recording. severity : refused (not used), suspect (judges nothing) or note.

    variant : which of its kind's sentences says it, see `finding_sentences.yaml`. values : what it is made
    of, numbers to six digits, as tables keep them. accepted : the reason of a study that lets it stand.
    """

    kind: str
    severity: str
    variant: str = ""
    values: Values = field(default_factory=dict)
    accepted: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", {name: plain(value) for name, value in self.values.items()})

    @property
    def key(self) -> str:
        """The name of its kind's variant among MISTAKES and PROBLEMS."""
        return f"{self.kind}/{self.variant}" if self.variant else self.kind

    @property
    def message(self) -> str:
        """The sentence: of a mistake its description, evidence, cure and the reason to accept it; of others
        by kind, or the text in its values.
        """
        if self.key in MISTAKES:
            return self.with_cure(f"{self.what} ({self.evidence})" if self.evidence else self.what)
        if template := PROBLEMS.get(self.key):
            texts = template if isinstance(template, str) else (template[0], template[1])
            return filled(texts, {"n": self.values.get("count", 1), **self.values})
        segment = f"{word(self.values['segment'])}: " if "segment" in self.values else ""
        return segment + foreign(str(self.values.get("text", "")))

    def with_cure(self, what: str) -> str:
        """Join the description of a mistake and its cure in a sentence; without `what` the cure alone."""
        cure = self.cure
        text = tr("{what}; {cure}", what=what, cure=cure) if what else cure[0].upper() + cure[1:]
        text = tr("{text}.", text=text)
        if not self.accepted:
            return text
        return tr("{finding} Accepted: {reason}", finding=text, reason=self.accepted)

    @property
    def what(self) -> str:
        """The description of a mistake and its probable cause, with a capital first letter."""
        what = MISTAKES[self.key]["what"]
        text = tr(what, **_placeholders(self.values))
        return text[0].upper() + text[1:]

    @property
    def cure(self) -> str:
        """The cure of a mistake in words."""
        mistake, placeholders = MISTAKES[self.key], _placeholders(self.values)
        cure = mistake["cure"]
        if self.values.get("unmapped"):
            cure = mistake.get("table_cure", cure)
        if isinstance(cure, str):
            return tr(cure, **placeholders)
        written = listed(f"`{key.format(**placeholders)}`" for key in cure["written"])
        if "under" in cure:
            return tr("write {written} under `{key}` in the mapping", written=written, key=cure["under"])
        return tr("write {written} in the mapping", written=written)

    @property
    def evidence(self) -> str:
        """What undoing a mistake changes, and how much it matters; empty where poses alone show it."""
        placeholders, seen = _placeholders(self.values), self.values.get("seen", "")
        evidence = [tr(EVIDENCE[seen], **placeholders)] if seen else []
        if "effect" in self.values and seen not in ("scale", "reach"):  # of an absurd size a gap says nothing
            evidence.append(tr(EFFECT, **placeholders))
        return "; ".join(evidence)

    @property
    def line(self) -> str:
        """The finding as one line for a terminal, with text to type in quotes."""
        return f"{self.severity}: {self.kind}: {in_quotes(self.message)}"

    @property
    def columns(self) -> dict[str, str]:
        """Columns of a table's row; values as JSON, empty where there is none."""
        return {
            "kind": self.kind,
            "severity": self.severity,
            "variant": self.variant,
            "values": json.dumps(self.values, ensure_ascii=False) if self.values else "",
            "accepted": self.accepted,
            "message": self.message,
        }

    def accept(self, reason: str) -> Finding:
        """Return the finding as accepted by the study with that reason: a suspect one becomes a note."""
        if not reason or self.severity != SUSPECT:
            return self
        return replace(self, severity=NOTE, accepted=reason)


def severity_of_loss(percent: float) -> str:
    """Return the severity of leaving out this percentage of a receiver's poses; a note changes no number."""
    return SUSPECT if percent >= LEAST_LOST else NOTE


def finding_of_text(kind: str, severity: str, text: str) -> Finding:
    """Make a finding of a message, or of a text of which nothing else is known, as of a reader's refusal."""
    return Finding(kind, severity, values={"text": text})


def plain(value: Any) -> Any:
    """Return a value as JSON keeps it, numbers to six digits."""
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def problem_row(stage: str, finding: Finding, **where: str) -> ProblemsRow:
    """Return a row of the problems table; where : what it is about, of its first columns."""
    columns: Any = dict.fromkeys(("subject", "session", "hand", "task", "model"), "")
    row: ProblemsRow = {"stage": stage}
    row |= columns | where | finding.columns
    return row


def problem_of(row: FindingsRow) -> ProblemsRow:
    """Return a row of the findings table as the problems table has it."""
    kept: Any = {name: value for name, value in row.items() if name != "trial"}
    problem: ProblemsRow = kept | {"task": title_of(row), "model": "", "stage": STAGE}
    return problem


def title_of(row: Mapping[str, Any]) -> str:
    """Return the task and the trial, where there is one, of a table's row."""
    return ", ".join(filter(None, (row["task"], row["trial"])))


def moved_finding(row: MovedReceiversRow) -> Finding:
    """Return the finding of a row of moved_receivers."""
    is_timed = row["from_s"] is not None and math.isfinite(row["from_s"])
    values = {
        "segment": row["segment"],
        "recording": title_of(row),
        **({"first_s": row["from_s"]} if is_timed else {"number": row["from_frame"]}),
        "mm": row["shift_mm"],
        "deg": row["turn_deg"],
        "joints": row["joints"].split(";"),
    }
    return Finding("receiver-moved", SUSPECT, "" if is_timed else "in-frame", values)


def finding_of(row: Mapping[str, Any]) -> Finding:
    """Return the finding of a table's row."""
    values = values_of(row["values"])
    return Finding(row["kind"], row["severity"], row["variant"], values, row["accepted"])


def values_of(text: str) -> Values:
    """Return the values of a table's column."""
    return dict(json.loads(text)) if text else {}


def same_file(hand: str, task: str, subject: str = "", session: str = "") -> Finding:
    """Return that the poses are those of another recording; subject : where it is another's, or session's."""
    other = {"subject": subject, "session": session, "hand": hand, "task": task}
    return Finding("same-file", SUSPECT, values=other)


def unchecked_finding(message: str) -> Finding:
    """Return the note that a recording could not be checked."""
    return Finding("unchecked", NOTE, "", {"reason": message})


@dataclass(frozen=True)
class Seen:
    """A row that has a fault. what : what is wrong there, where that differs from row to row. evidence : what
    shows it there. Both are empty where the fault's text says it all.
    """

    row: ProblemsRow
    what: str = ""
    evidence: str = ""


@dataclass(frozen=True)
class Fault:
    """A fault. text : what is wrong, what to do, and why it is accepted, if it is."""

    severity: str
    accepted: str
    text: str
    seen: tuple[Seen, ...]


def row_sentence(row: ProblemsRow) -> str:
    """Return the sentence of one row."""
    return finding_of(row).message or foreign(row["message"])


def faults(rows: Iterable[ProblemsRow]) -> list[Fault]:
    """Group rows of the same fault: equal kind, variant, severity, cure and reason to accept it."""
    groups: dict[tuple[str, ...], list[ProblemsRow]] = {}
    for row in rows:
        finding = finding_of(row)
        cure = finding.cure if finding.key in MISTAKES else row["message"]
        names = ("stage", "kind", "variant", "severity", "accepted")
        groups.setdefault((*(str(row.get(name, "")) for name in names), cure), []).append(row)
    return [_fault(alike) for alike in groups.values()]


def _fault(rows: list[ProblemsRow]) -> Fault:
    findings = [finding_of(row) for row in rows]
    first = findings[0]
    if len(rows) == 1 or first.key not in MISTAKES:
        return Fault(first.severity, first.accepted, row_sentence(rows[0]), tuple(map(Seen, rows)))
    whats, shown = [finding.what for finding in findings], [finding.evidence for finding in findings]
    what = whats[0] if len(set(whats)) == 1 else ""
    seen = tuple(map(Seen, rows, [""] * len(rows) if what else whats, shown))
    return Fault(first.severity, first.accepted, first.with_cure(what), seen)


def in_quotes(text: str) -> str:
    """Return text for a terminal, with quotes instead of backticks."""
    return text.replace("`", '"')


def _placeholders(values: Values) -> dict[str, Any]:
    """Return the values, and the phrases that are made of several of them."""
    phrases: dict[str, Any] = {"others": 0, **values}
    if "first_s" in values:
        phrases["at"] = tr("at {time_s:.2f} s", time_s=values["first_s"])
    elif "first_row" in values:
        phrases["at"] = tr("in row {row} of its rows", row=values["first_row"])
    if "counts" in values:
        counts = zip(values["counts"], values["of"], strict=True)
        phrases["which"] = tr(", ").join(f"{word(name)}: {n}" for n, name in counts)
    if "negated" in values:
        phrases["negated"] = listed(values["negated"])
    if "spiked" in values:
        phrases["spiked"] = tr(", ").join(
            tr("{segment} in frame {n}", segment=segment, n=frame) + "".join(f" ({s:.2f} s)" for s in time_s)
            for segment, frame, *time_s in values["spiked"]
        )
    pairs = values.get("pairs", [])
    if "segment_2" in values:
        pairs = [(values["segment"], values["segment_2"])]
    phrases["exchanged"] = ", ".join(tr("{code} with {code_2}", code=a, code_2=b) for a, b in pairs)
    if "columns" in values:
        phrases["millimetres"] = ", ".join(f"{axis}_mm" for axis in values["columns"].split(", "))
    if "frames" in values:
        duration = f" ({values['duration_s']:.2g} s)" if "duration_s" in values else ""
        phrases["length"] = ngettext("{n} frame", "{n} frames", values["frames"]) + duration
    if "turn_deg" in values:
        axis, about = values["turn_axis"], N_("{deg} deg about a diagonal")
        if axis:
            about = N_("{deg} deg about its {axis} axis")
        phrases["how"] = tr(about, deg=values["turn_deg"], axis=axis)
        axes = (f"{name}: {values[name]}" for name in ("distal", "lateral", "dorsal"))
        phrases["receiver_axes"] = f"{{{', '.join(axes)}}}"
    if "task" in values:
        person = tr("subject {subject}", subject=values["subject"]) if values["subject"] else ""
        person += tr(", session {session}", session=values["session"]) if values["session"] else ""
        hand = tr("{hand} hand", hand=values["hand"])
        phrases["other"] = tr(", ").join(filter(None, (person, hand, values["task"])))
    # what is to be written into a file stays as it is, whatever the language
    phrases["code"] = values.get("segment", values.get("hand", ""))
    return phrases
