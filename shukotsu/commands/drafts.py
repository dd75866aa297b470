"""Drafts for a folder of recordings, for a person to look over: what their names say, and their mappings."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from shukotsu.commands.inspect_file import describe
from shukotsu.errors import InputError
from shukotsu.readers.inspection.description import CHECK
from shukotsu.study.config_files import loaded_yaml
from shukotsu.study.layout import Layout

HANDS = {
    **dict.fromkeys(("r", "rh", "right", "re", "rechts"), "right"),
    **dict.fromkeys(("l", "lh", "left", "li", "links"), "left"),
}
"""What names of files call a hand, in lower case."""
CALIBRATIONS = ("cal", "calib", "calibration", "rom", "kalibrierung")
"""What names of files call a recording in which every joint moves through its range, in lower case."""
_KEYS = {
    "subject": "sub|subj|subject|participant",
    "session": "ses|sess|session|day|visit",
    "task": "task",
    "trial": "run|trial|take|rep",
    "hand": "hand",
}
_KEYED = re.compile(
    "|".join(
        rf"\b(?:{words})(?:[- ](?P<{key}>[^\W_]+)|(?P<{key}_number>\d+))(?=$|[-_. /])"
        for key, words in _KEYS.items()
    ),
    re.I,
)
"""A word and what it names: sub-03, Session 2, trial01."""
_DATE = re.compile(r"(?<!\d)(19|20)\d\d[-_.]?\d\d[-_.]?\d\d([T_ -]?\d\d[-_.:h]?\d\d([-_.:m]?\d\d)?)?(?!\d)")
_APART = re.compile(r"\b(P|S|VP)[- ](?=\d)", re.I)
"""A subject's name of which the number stands apart: P 01."""
_WITH_HAND = re.compile(r"(\w*\d)([LR])")
"""A subject's name with its hand's letter: P01L."""


@dataclass(frozen=True)
class NameParts:
    """The cells of a row of the recordings sheet that a name says; empty what it does not."""

    subject: str = ""
    session: str = ""
    hand: str = ""
    task: str = ""
    trial: str = ""
    role: str = ""


def parts_of_names(names: Iterable[Path]) -> list[NameParts]:
    """Read names of files, whose folders below that of the recordings are parts of them.

    Where a hand has a calibration by its name, others are for evaluation; else for both.
    """
    parts = [_parts(name) for name in names]
    calibrated = {_whose(each) for each in parts if each.role}
    roles = ["evaluation" if _whose(each) in calibrated else "both" for each in parts]
    return [
        each if each.role or not each.task else replace(each, role=role)
        for each, role in zip(parts, roles, strict=True)
    ]


def _whose(parts: NameParts) -> tuple[str, str, str]:
    return parts.subject, parts.session, parts.hand


def _parts(name: Path) -> NameParts:
    text = _DATE.sub(" ", name.with_suffix("").as_posix().removesuffix("_motion")).replace("_", " ")
    text = _APART.sub(r"\1", text)
    cells: dict[str, str] = {}
    for match in _KEYED.finditer(text):
        for key, value in match.groupdict().items():
            if value:
                cells.setdefault(key.removesuffix("_number"), value)
    words: list[str] = []  # a hand's letter behind a subject's number is a word
    for word in filter(None, re.split(r"[\W_]+", _KEYED.sub(" ", text))):
        lettered = _WITH_HAND.fullmatch(word)
        words += lettered.groups() if lettered else [word]
    sides = [cells.pop("hand", ""), *words]
    cells["hand"] = next((HANDS[word.lower()] for word in sides if word.lower() in HANDS), "")
    words = [word for word, _ in groupby(word for word in words if word.lower() not in HANDS)]
    # The subject is the word like P01, or else the first of several but a calibration's.
    others = [word for word in words if word.lower() not in CALIBRATIONS]
    coded = [word for word in others if re.fullmatch(r"[A-Za-z]{1,2}\d+", word)]
    first = others[0] if others and ("task" in cells or len(words) > 1) else ""
    subject = cells.get("subject") or next(iter(coded), first)
    if subject in words:
        words.remove(subject)
    if "trial" not in cells and len(words) > 1 and words[-1].isdigit():
        cells["trial"] = words.pop()
    task = cells.pop("task", "-".join(words))
    is_calibration = any(word in CALIBRATIONS for word in re.split(r"[\W\d_]+", task.lower()))
    role = "calibration" if is_calibration else ""
    return NameParts(**cells | {"subject": subject, "task": task, "role": role})


@dataclass(frozen=True)
class Drafts:
    """Mappings to edit: texts by file's name; of recordings, the name, or why one is refused."""

    texts: dict[str, str]
    of: dict[Path, str]
    refused: dict[Path, str]


def draft_mappings(
    recordings: Sequence[Path], layout: Layout, inspected: Callable[[int], None] = lambda _: None
) -> Drafts:
    """Draft a mapping for every recording that needs one; inspected : told how many have been looked at.

    Files are alike where their drafts say the same; what one leaves open may be settled in another.
    """
    groups: list[tuple[str, Any, list[Path]]] = []
    refused = {}
    for count, recording in enumerate(recordings, 1):
        try:
            text = describe(recording, layout).draft
        except InputError as error:
            refused[recording], text = str(error), ""
        inspected(count)
        if not text:
            continue
        config = loaded_yaml(text, str(recording))
        number = next((n for n, (_, other, _) in enumerate(groups) if _alike(config, other)), len(groups))
        if number == len(groups):
            groups.append((text, config, []))
        first, _, alike = groups[number]
        alike.append(recording)
        if text.count(CHECK) < first.count(CHECK):
            groups[number] = text, config, alike
    names = ["mapping.yaml", *(f"mapping-{number}.yaml" for number in range(2, len(groups) + 1))]
    of = {each: name for name, (_, _, alike) in zip(names, groups, strict=False) for each in alike}
    return Drafts({name: text for name, (text, _, _) in zip(names, groups, strict=False)}, of, refused)


def _alike(first: Any, second: Any) -> bool:
    """Whether two drafts say the same, but for what either leaves open."""
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return first.keys() == second.keys() and all(_alike(first[key], second[key]) for key in first)
    return first == second or CHECK in (first, second)
