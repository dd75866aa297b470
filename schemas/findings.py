"""Findings: what was declared of a recording and cannot be. docs/mistakes.md is made of this module."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from shukotsu.sentences.finding_sentences import Values, sentence_of

REFUSED, SUSPECT, NOTE = "refused", "suspect", "note"
STAGE = "check_recordings"


@dataclass(frozen=True)
class Finding:
    """Hold one finding in one recording. severity : refused (not used), suspect (judges nothing) or note.

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
        """The finding as a table's row has it."""
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
    """A row of the problems table; where : what it is about, of its first columns."""
    whole = dict.fromkeys(("subject", "session", "hand", "task", "model"), "")
    return {**whole, **where, "stage": stage, **finding.columns}


def problem_of(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row of the findings table as the problems table has it."""
    kept = {name: value for name, value in row.items() if name != "trial"}
    task = ", ".join(filter(None, (row["task"], row["trial"])))
    return {**kept, "task": task, "model": "", "stage": STAGE}


def values_text(values: Values) -> str:
    """Values as a table's column has them: JSON, empty where there is none."""
    return json.dumps(dict(values), ensure_ascii=False) if values else ""


def values_of(text: str) -> Values:
    """The values of a table's column."""
    return dict(json.loads(text)) if text else {}


@dataclass(frozen=True)
class Kind:
    """Hold what a kind of finding means, what usually causes it, and what cures it."""

    meaning: str
    cause: str
    cure: str


KINDS: Mapping[str, Kind] = {
    "quaternion-order": Kind(
        "The four numbers of the quaternions stand in another order than was declared.",
        "Half of all programs write x, y, z, w, the others w, x, y, z.",
        "`order: xyzw` (or `wxyz`) under `orientation` in the mapping; in a tidy table, the columns' names.",
    ),
    "quaternion-inverse": Kind(
        "The rotations take the transmitter's coordinates to the receiver's, not the other way round.",
        "Some systems write the inverse rotation: a trakSTAR its quaternions, not its angles.",
        "`rotates: transmitter-to-receiver` under `orientation` in the mapping; in a tidy table, negate qx, "
        "qy and qz.",
    ),
    "euler-order": Kind(
        "The three angles turn about other axes, or in another order, than the mapping says.",
        "Azimuth, elevation and roll are ZYX; motion-capture programs let one choose among many orders.",
        "`axes` under `orientation` in the mapping; of angles about fixed axes, in the opposite order.",
    ),
    "units": Kind(
        "Positions or angles are in another unit than was declared.",
        "Metres, centimetres or inches given as millimetres; radians given as degrees.",
        "`position_unit`, or `unit` under `orientation`, in the mapping; in a tidy table, positions in mm.",
    ),
    "time-unit": Kind(
        "Times are in another unit than was declared.",
        "Milliseconds or microseconds given as seconds, or the other way round.",
        "`time_unit` under `csv`, or `rate_hz`, in the mapping; in a tidy table, `time_s` in seconds.",
    ),
    "clock": Kind(
        "Times jump ahead, go back or stand still: the device's clock does not run on.",
        "The tracker was started again within the file; midnight; a counter that is full begins again; a "
        "clock that was set; a pause.",
        "None is needed for joints; of midnight and a full counter, what is to be added to later times.",
    ),
    "hemisphere": Kind(
        "A receiver's position jumps to the other side of the transmitter, or is there all along.",
        "A magnetic tracker cannot tell a place from the one opposite; it was started with, or crossed into, "
        "the other hemisphere.",
        "`repair` in the column `hemisphere` of the recordings sheet, or `--repair-hemisphere`.",
    ),
    "receiver-stuck": Kind(
        "A receiver gives one and the same pose while the others move.",
        "A cable or a channel that hung; a program that repeats the last value.",
        "Leave the numbers empty where they repeat those before, which makes them gaps; `csv.in_step: false` "
        "in the mapping where a program repeats values.",
    ),
    "sudden-change": Kind(
        "From one moment on, and for good, a receiver is not where its neighbours say, or none is.",
        "A receiver that fell off and hangs from its cable; a program that changed the unit or the order of "
        "numbers in the middle of a file.",
        "Record again with the receiver in its place; of a file that changes, export it again. What was "
        "recorded before is used, if it suffices.",
    ),
    "spikes": Kind(
        "Single poses are where nothing can be, or all of them jump about.",
        "Metal or a motor near the transmitter, bytes lost on the line, a column that is no position.",
        "Leave the numbers of these poses empty; where all poses jump, look for the right columns.",
    ),
    "receivers-swapped": Kind(
        "Two receivers stand for each other's segments.",
        "Two plugs or two lines of a layout exchanged.",
        "Exchange the two names in the mapping (`receivers`) or the file's column `segment`; of a file with "
        "stations, the two numbers in the layout (`receiver`).",
    ),
    "digits-swapped": Kind(
        "All receivers of two digits stand for each other's segments.",
        "Two bundles of cables exchanged, or digits counted from the other side.",
        "Exchange the names of their segments, as for two receivers.",
    ),
    "wrong-hand": Kind(
        "The hand is the other one than was declared, or the recording is mirrored.",
        "A wrong word in the recordings sheet; an export with a left-handed frame.",
        "The column `hand` of the recordings sheet (or `--hand`); a mirrored file is mirrored back: `y_mm`, "
        "`qx` and `qz` negated.",
    ),
    "axes-mirrored": Kind(
        "Axes of the positions are negated or exchanged while those of the rotations are not.",
        "Columns in another order; one of two frames with z up, the other with y up; a left-handed frame.",
        "`position_axes` in the mapping; in a tidy table, the columns exchanged and negated.",
    ),
    "receiver-turned": Kind(
        "A receiver is turned on its bone by quarter turns against what the layout says, or sits on "
        "another.",
        "A receiver strapped on sideways or back to front.",
        "`receiver_axes` in the layout, for all receivers or under one segment.",
    ),
    "other-person": Kind(
        "Bones are of other lengths than in the subject's other recordings.",
        "A file of somebody else, or a wrong subject in the sheet.",
        "The column `subject` or `file` of the recordings sheet.",
    ),
    "same-file": Kind(
        "The poses are, number by number, those of another recording of the sheet.",
        "One file named twice, or copied under another name.",
        "The column `file` of the recordings sheet; or leave one row out with `exclude`.",
    ),
    "too-short": Kind(
        "The recording is too short to say anything of a joint.",
        "A recording stopped at once, or a file cut off.",
        "Record it again; or leave it out with `exclude`.",
    ),
    "zeros": Kind(
        "Poses are at 0, 0, 0 and not turned, to the last bit.",
        "Programs that write zeros, or no rotation, for a receiver that they do not see.",
        "Leave the numbers of these poses empty, which makes them gaps.",
    ),
    "receivers-alike": Kind(
        "Two receivers have one and the same pose, to the last bit.",
        "Columns or a station named twice in the mapping or the layout; an export that repeats a receiver.",
        "Each receiver's own columns or `value` in the mapping; or export the file again.",
    ),
    "unchecked": Kind(
        "The recording was not tested against what was declared of it, so nothing is said of it here.",
        "A fault of this program.",
        "Look at its picture and its joints' gaps yourself; please report a fault with the log.",
    ),
}  # fmt: skip


def same_file(hand: str, task: str, subject: str = "", session: str = "") -> Finding:
    """Say that the poses are those of another recording; subject : where it is another's, or session's."""
    other = {"subject": subject, "session": session, "hand": hand, "task": task}
    return Finding("same-file", SUSPECT, values=other)


def unchecked(message: str) -> Finding:
    """Say that a recording could not be checked: of what is not known nobody is suspected."""
    return Finding("unchecked", NOTE, "", {"reason": message})


def mistakes_page() -> str:
    """Return the guide's page of mistakes: every kind with its cause and cure."""
    lines = [
        "# Mistakes that are named",
        "",
        "Before joints are solved, what was declared about a recording is tested against its poses: every",
        "mistake of this page is undone on them, one after the other. Where that explains the poses",
        "decisively better (joints close, lengths and places are a hand's, joints turn as joints do), it is",
        "named in one sentence with what to write. `shukotsu check`, `import` and `inspect` say the same",
        "([how often they are right](mistakes-benchmark.md)). You see a symptom and not a name? Begin at",
        "[what went wrong](what-went-wrong.md).",
        "",
        "A finding says how much it matters: the median gap of the joints concerned (how far apart the two",
        "receivers of a joint have its centre) as declared and put right, and how many centres move by more",
        "than 2 mm on their bones. Where no joint closes better and none moves, it says that nothing",
        "measurable is gained. What is wrong in the same way, and has the same cure, is one item of the",
        "report and of the terminal, with the recordings that have it.",
        "",
        "A finding is `refused` (the recording is not used), `suspect` (solved and shown, in no headline and",
        "no statistic) or a `note`; a reason in the column `accept` of the recordings sheet makes suspect",
        "findings notes. A hand with a refused or suspect recording tells the person's other hand nothing.",
        "All are in `problems.parquet`: `kind`, `variant` (which of the kind's sentences)",
        "and `values` (its numbers, receivers and joints as JSON), so that nobody has to take a sentence",
        "apart. For layouts that are no hand, digits, the other",
        "hand, turned receivers and small errors of the unit are not named.",
        "",
    ]
    for name, kind in KINDS.items():
        lines += [
            f"## {name}",
            "",
            kind.meaning,
            "",
            f"- **Usual cause**: {kind.cause}",
            f"- **Cure**: {kind.cure}",
            "",
        ]
    return "\n".join(lines[:-1]) + "\n"
