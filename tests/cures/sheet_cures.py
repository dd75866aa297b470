"""Mistakes of a recordings sheet that its recordings show together, and their cures followed in the sheet."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cures.brought_files import Result
from cures.followed_cures import NoSuchCureError

from benchmarks.faultless_hands import Planted, changed, own_hand
from shukotsu.checks.checked_recording import CheckedRecording, check_recording
from shukotsu.checks.compared_recordings import compared
from shukotsu.schemas.layout import read_layout
from shukotsu.stages.simulate.simulation import LAYOUT

Row = Mapping[str, str]
"""Of a recordings sheet, by column."""


@dataclass(frozen=True)
class SheetCase:
    """Three rows of a hand of which the last is wrong; right : as it should be."""

    kind: str
    planted: str
    right: Sequence[Row]
    wrong: Sequence[Row]


@dataclass(frozen=True)
class Files:
    """Recordings that a sheet names, by file, and what was found in each alone."""

    planted: Mapping[str, Planted]
    checked: Mapping[str, CheckedRecording]


def _row(task: str, file: str, subject: str = "01", session: str = "") -> Row:
    return {"subject": subject, "session": session, "task": task, "file": file, "exclude": ""}


_TWO = (_row("rom", "rom.csv"), _row("opposition", "opposition.csv"))

SHEET_CASES = (
    SheetCase("same-file", "file", (*_TWO, _row("again", "again.csv")), (*_TWO, _row("again", "rom.csv"))),
    SheetCase(
        "other-person", "subject",
        (*_TWO, _row("again", "other.csv", subject="02")), (*_TWO, _row("again", "other.csv")),
    ),
    SheetCase(
        "other-person", "session",
        (*_TWO, _row("again", "anew.csv", session="2")), (*_TWO, _row("again", "anew.csv")),
    ),
)  # fmt: skip


def files_of(seed: int, hand: str) -> Files:
    """Record a person twice, once more with receivers put on anew, and somebody else.

    The person's other hand, mirrored, is as long and wears its receivers elsewhere.
    """
    other = {"right": "left", "left": "right"}[hand]
    own = {f"{task}.csv": own_hand(seed, hand, task) for task in ("rom", "opposition")}
    poses = own_hand(seed, other, "rom").poses
    place, turn = poses.position_mm * [1, -1, 1], poses.quaternion * [1, -1, 1, -1]
    anew = changed(own["rom.csv"], position_mm=place, quaternion=turn)
    again = _second_half(own["opposition.csv"])
    planted = {**own, "again.csv": again, "anew.csv": anew, "other.csv": own_hand(seed + 500, hand, "rom")}
    layout = read_layout(LAYOUT)
    return Files(planted, {name: check_recording(p.poses, layout, p.hand) for name, p in planted.items()})


def _second_half(planted: Planted) -> Planted:
    half = planted.poses.take(slice(len(planted.poses.frame) // 2, None))
    return Planted(half, planted.hand, planted.declared)


def check_sheet(rows: Sequence[Row], files: Files) -> Result:
    """Check recordings, those of a subject's session together; the joints are those of the first session."""
    used = [row for row in rows if not row["exclude"]]
    whose = [(row["subject"], row["session"]) for row in used]
    findings = []
    for unit in dict.fromkeys(whose):
        own = [row for row, of in zip(used, whose, strict=True) if of == unit]
        named = [(row["task"], files.planted[row["file"]].hand, files.checked[row["file"]]) for row in own]
        findings += [finding for one in compared(named) for finding in one.findings]
    first = [files.planted[row["file"]] for row, of in zip(used, whose, strict=True) if of == whose[0]]
    return Result(tuple(findings), tuple(one.poses for one in first), read_layout(LAYOUT), first[0].hand)


def obeyed_in_sheet(case: SheetCase, files: Files, *, second: bool = False) -> tuple[Result, Result]:
    """Check before and after the sentence's cure; second : take the other one where it leaves a choice."""
    before = check_sheet(case.wrong, files)
    return before, check_sheet(_followed(before.findings[0].message, case, second=second), files)


def _followed(sentence: str, case: SheetCase, *, second: bool) -> Sequence[Row]:
    """Correct the last row, as its laboratory knows it. Raises NoSuchCureError where nothing says how."""
    *others, last = case.wrong
    columns = re.search(r"correct the column (\w+)(?: or (\w+))? of the recordings sheet", sentence)
    if second and "give a reason under `exclude` for one of the two" in sentence:
        return [*others, {**last, "exclude": "the same file"}]
    if columns:
        names = [name for name in columns.groups() if name]
        return [*others, {**last, **{name: case.right[-1][name] for name in names}}]
    if "give this recording a session of its own in the column session" in sentence:
        return [*others, {**last, "session": "another"}]
    raise NoSuchCureError(sentence)
