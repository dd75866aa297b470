"""Findings: contradictions between a recording's declared properties and its poses.

A finding is stored as a kind, a variant and values; its sentence is composed when it is displayed.
`mistakes.yaml` explains the kinds; `finding_sentences.yaml` has the sentences by kind and variant.
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
"""Exit code of a check by the severity of its most severe finding."""
STAGE = "check_recordings"

LEAST_LOST = 2.0
"""Percentage of a receiver's poses in a recording; leaving out fewer changes no number that is displayed."""

Values = Mapping[str, Any]
"""Values of a finding by name: numbers, words, or lists of them, all of JSON types."""

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
        if not isinstance(text, dict):  # a cure that lists keys of a mapping is not translated
            yield 0, "ngettext" if isinstance(text, list) else None, text, []


@dataclass(frozen=True)
class Finding:
    """One finding in one recording.

    Attributes
    ----------
    kind
        Key of its description in `mistakes.yaml` or `finding_sentences.yaml`.
    severity
        refused (the recording is not used), suspect (its hand's joints are not believed) or note.
    variant
        Which of its kind's sentences in `finding_sentences.yaml` applies.
    values
        Values to fill into the sentence, numbers rounded to six digits as in tables.
    accepted
        The reason that the study states for accepting the finding, or empty.

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
        """Key of its sentences in MISTAKES or PROBLEMS: the kind, with the variant if it has one."""
        return f"{self.kind}/{self.variant}" if self.variant else self.kind

    @property
    def message(self) -> str:
        """The finding as a sentence.

        For a mistake: its description, evidence, cure and the reason for accepting it. For other findings:
        the sentence of their kind, or the text in their values.
        """
        if self.key in MISTAKES:
            return self.with_cure(f"{self.what} ({self.evidence})" if self.evidence else self.what)
        if template := PROBLEMS.get(self.key):
            texts = template if isinstance(template, str) else (template[0], template[1])
            return filled(texts, {"n": self.values.get("count", 1), **self.values})
        segment = f"{word(self.values['segment'])}: " if "segment" in self.values else ""
        return segment + foreign(str(self.values.get("text", "")))

    def with_cure(self, what: str) -> str:
        """Return a sentence of the description `what` of a mistake and its cure, or of the cure alone."""
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
        keys = self.values.get("cure", ""), "table_cure" if self.values.get("unmapped") else "", "cure"
        cure = next(mistake[key] for key in keys if key in mistake)
        if isinstance(cure, str):
            return tr(cure, **placeholders)
        written = listed(f"`{key.format(**placeholders)}`" for key in cure["written"])
        if "under" in cure:
            return tr("write {written} under `{key}` in the mapping", written=written, key=cure["under"])
        return tr("write {written} in the mapping", written=written)

    @property
    def evidence(self) -> str:
        """How the poses improve if the mistake is undone, and its effect; empty if neither was determined."""
        placeholders, seen = _placeholders(self.values), self.values.get("seen", "")
        evidence = [tr(EVIDENCE[seen], **placeholders)] if seen else []
        if "effect" in self.values and seen not in ("scale", "reach"):  # at a wrong scale a gap means nothing
            evidence.append(tr(EFFECT, **placeholders))
        return "; ".join(evidence)

    @property
    def line(self) -> str:
        """The finding as one line for a terminal, with text to type in quotes."""
        return f"{self.severity}: {self.kind}: {in_quotes(self.message)}"

    @property
    def columns(self) -> dict[str, str]:
        """Columns of its row in a table; values as JSON text, empty if it has none."""
        return {
            "kind": self.kind,
            "severity": self.severity,
            "variant": self.variant,
            "values": json.dumps(self.values, ensure_ascii=False) if self.values else "",
            "accepted": self.accepted,
            "message": self.message,
        }

    def accept(self, reason: str) -> Finding:
        """Return the finding as a note with the study's reason if it is suspect, else unchanged."""
        if not reason or self.severity != SUSPECT:
            return self
        return replace(self, severity=NOTE, accepted=reason)


def severity_of_loss(percent: float) -> str:
    """Return the severity of leaving out this percentage of a receiver's poses: note below LEAST_LOST."""
    return SUSPECT if percent >= LEAST_LOST else NOTE


def finding_of_text(kind: str, severity: str, text: str) -> Finding:
    """Make a finding of a finished message, such as a reader's error, that has no values to fill in."""
    return Finding(kind, severity, values={"text": text})


def plain(value: Any) -> Any:
    """Return a value in JSON types, with floats rounded to six significant digits."""
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def problem_row(stage: str, finding: Finding, **where: str) -> ProblemsRow:
    """Return a row of the problems table; where : the subject, session, hand, task and model it is about."""
    columns: Any = dict.fromkeys(("subject", "session", "hand", "task", "model"), "")
    row: ProblemsRow = {"stage": stage}
    row |= columns | where | finding.columns
    return row


def problem_of(row: FindingsRow) -> ProblemsRow:
    """Return the row of the problems table for a row of the findings table."""
    kept: Any = {name: value for name, value in row.items() if name != "trial"}
    problem: ProblemsRow = kept | {"task": title_of(row), "model": "", "stage": STAGE}
    return problem


def title_of(row: Mapping[str, Any]) -> str:
    """Return the task of a table's row, followed by its trial if it has one."""
    return ", ".join(filter(None, (row["task"], row["trial"])))


def moved_finding(row: MovedReceiversRow) -> Finding:
    """Return the finding for a row of moved_receivers."""
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
    """Return the finding that a row of findings or problems describes."""
    values = json.loads(row["values"]) if row["values"] else {}
    return Finding(row["kind"], row["severity"], row["variant"], values, row["accepted"])


def same_file(hand: str, task: str, subject: str = "", session: str = "") -> Finding:
    """Return the finding that the poses equal those of another recording.

    subject, session : whose the other recording is; empty if they are the same as this one's.
    """
    other = {"subject": subject, "session": session, "hand": hand, "task": task}
    return Finding("same-file", SUSPECT, values=other)


def unchecked_finding(message: str) -> Finding:
    """Return a note that a recording could not be checked, with the reason in `message`."""
    return Finding("unchecked", NOTE, "", {"reason": message})


@dataclass(frozen=True)
class Seen:
    """A row of the problems table that has a fault.

    what : description of the fault in this row, if it differs between the rows. evidence : evidence for it in
    this row. Both are empty if the fault's text is complete without them.
    """

    row: ProblemsRow
    what: str = ""
    evidence: str = ""


@dataclass(frozen=True)
class Fault:
    """A fault and the rows that have it. text : what is wrong, the cure, and why it is accepted, if it is."""

    severity: str
    accepted: str
    text: str
    seen: tuple[Seen, ...]


def row_sentence(row: ProblemsRow) -> str:
    """Return the sentence that describes one row of the problems table."""
    return finding_of(row).message or foreign(row["message"])


def faults(rows: Iterable[ProblemsRow]) -> list[Fault]:
    """Group rows with the same fault, those of equal stage, kind, variant, severity, acceptance and cure."""
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
    """Return text for a terminal, with double quotes instead of backticks."""
    return text.replace("`", '"')


def _placeholders(values: Values) -> dict[str, Any]:
    """Return the values for a sentence's placeholders, with phrases that combine several of them."""
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
    # a name to be typed into a file is not translated
    phrases["code"] = values.get("segment", values.get("hand", ""))
    return phrases
