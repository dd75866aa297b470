"""Command line: make a study folder with files to edit, drafted from existing recordings if there are any."""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu import command_line
from shukotsu.commands.inspect_file import describe
from shukotsu.errors import InputError, count_of, list_names
from shukotsu.study.file_formats import FORMATS
from shukotsu.tables.line_printer import progress

if TYPE_CHECKING:
    from shukotsu.study.layout import Layout

TEMPLATES = Path(__file__).parent / "templates"
STUDY = {"en": "study.yaml", "ja": "study.ja.yaml"}
"""Template by the language of its comments and of the report."""
COLUMNS = ("subject", "hand", "task", "role", "file")
MORE_COLUMNS = ("session", "trial", "mapping")
"""Columns that a drafted sheet has only if a recording has a value for them."""
RECORDINGS = {ending for form in FORMATS.values() for ending in form.endings if ending != ".txt"}
"""Endings of files that may be recordings; .txt is left out because such files are mostly notes."""
BESIDE = ("_channels.tsv", "_events.tsv", "_scans.tsv", "participants.tsv")
"""Endings of the tables that accompany recordings in Motion-BIDS."""


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu new",
        "Make a study folder: study.yaml with comments, recordings.tsv and participants.tsv to fill in. "
        "Existing files are never overwritten.",
        "shukotsu new piano --recordings captures",
    )
    add = parser.add_argument
    named = "the folder; the study is named after it (letters, digits, - and _)"
    add("folder", type=Path, metavar="FOLDER", help=named)
    drafted = (
        "a folder of recordings: a row is drafted for each from its name (P01_L_calib), and a mapping for "
        "those of another program"
    )
    add("--recordings", type=Path, metavar="FILES", help=drafted)
    add("--layout", default="liberty16", help="a layout that ships, or a path (default: liberty16)")
    add("--language", choices=STUDY, default="en", help="of the comments and of the report (default: en)")
    return parser


def new_study(arguments: argparse.Namespace) -> None:
    """Write the three files, and mappings if recordings need them; print what to do with them.

    Raises InputError if one of the files exists, if the layout is invalid, or if the folder of recordings
    contains none.
    """
    from shukotsu.study.config_files import config_path, shipped_names
    from shukotsu.tables.whole_files import write_text

    folder: Path = arguments.folder
    name = folder.resolve().name
    # the study's name is part of paths and of commands
    study = re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-_")[:100] or "study"
    template = (TEMPLATES / STUDY[arguments.language]).read_text("utf-8")
    sheet, mappings, notes = _draft_sheet(arguments)
    notes += [f"the study is called {study}, and results go to results/{study}"] if study != name else []
    subjects = filter(None, dict.fromkeys(row[0] for row in sheet[1:]))
    shipped_layouts, path = shipped_names("layout"), config_path(arguments.layout, "layout", Path())
    layout = arguments.layout if arguments.layout in shipped_layouts else _from(path, folder)
    texts = {
        "study.yaml": template.replace("{name}", study).replace("{layout}", layout),
        "recordings.tsv": "".join("\t".join(row) + "\n" for row in sheet),
        "participants.tsv": "subject\thand_length_mm\thand_breadth_mm\n"
        + "".join(f"{subject}\n" for subject in subjects),
        **mappings,
    }
    folder.mkdir(parents=True, exist_ok=True)
    if kept := [folder / file for file in texts if (folder / file).exists()]:
        raise InputError(f"{kept[0]}: already exists; name another folder, or edit that file")
    for file, text in texts.items():
        write_text(folder / file, text)
        print(folder / file)
    print("".join(f"note: {note}\n" for note in notes), end="")
    quoted = shlex.quote(str(folder))
    print(f"next: {_next(folder, sheet, mappings)}, then: cd {quoted}; shukotsu check; shukotsu run")


def _draft_sheet(arguments: argparse.Namespace) -> tuple[list[Sequence[str]], dict[str, str], list[str]]:
    """Return a draft of the recordings sheet, header first, mappings by file name, and notes for the user."""
    from shukotsu.study.layout import read_layout

    layout = read_layout(arguments.layout)
    if arguments.recordings is None:
        return [COLUMNS], {}, []
    paths = recordings_in(arguments.recordings)
    root = arguments.recordings.resolve()
    with progress("inspected", len(paths)) as inspected:
        texts, mapping_of, reasons = draft_mappings(paths, layout, inspected)
    cells = []
    for path, parts in zip(paths, parts_of_names(path.relative_to(root) for path in paths), strict=True):
        mapping = mapping_of.get(path, "")
        of_both = "left_receivers" in texts.get(mapping, "") and not parts.hand
        row = {**vars(parts), "file": _from(path, arguments.folder), "mapping": mapping}
        cells += [row | {"hand": hand} for hand in ("right", "left")] if of_both else [row]
    columns = [*COLUMNS, *(name for name in MORE_COLUMNS if any(row[name] for row in cells))]
    notes = [f"{reason}; its row stays until you remove it" for reason in reasons]
    return [columns, *([row[name] for name in columns] for row in cells)], texts, notes


def _next(folder: Path, sheet: Sequence[Sequence[str]], mappings: Mapping[str, str]) -> str:
    """Return a sentence on how to complete the drafted files; mappings : texts by file name."""
    rows = sheet[1:]
    empty = sum(not all(row[:4]) for row in rows)
    if not rows:
        return f"write a row for each recording into {folder / 'recordings.tsv'}"
    filled = f", and fill in the {empty} that their names leave open" if empty else ""
    drafted = f"the {count_of(len(rows), 'row')} of {folder / 'recordings.tsv'}, drafted from names"
    what = f"look over {drafted}{filled}"
    if open_ones := [name for name, text in mappings.items() if "CHECK" in text]:
        verb = "says" if len(open_ones) == 1 else "say"
        what += f"; put the truth where {list_names(open_ones)} in {folder} {verb} CHECK"
    return what


def recordings_in(captures: Path) -> list[Path]:
    """Return the files of a folder that may be recordings, sorted. Raises InputError if there are none."""
    if not captures.is_dir():
        raise InputError(f"--recordings: {captures}: no such folder; give the folder of your recordings")
    files = (path for path in captures.rglob("*") if path.suffix.lower() in RECORDINGS and path.is_file())
    root = captures.resolve()
    paths = sorted(root / path.relative_to(captures) for path in files if not path.name.endswith(BESIDE))
    if not paths:
        endings = ", ".join(sorted(RECORDINGS))
        raise InputError(
            f"--recordings: {captures}: contains no recording; expected files that end in {endings}"
        )
    return paths


def _from(path: Path, folder: Path) -> str:
    """Return a file's path as written in the study's files: relative to `folder` if it is inside it."""
    path, base = path.resolve(), folder.resolve()
    return str(path.relative_to(base) if path.is_relative_to(base) else path)


HANDS = {
    **dict.fromkeys(("r", "rh", "right", "re", "rechts"), "right"),
    **dict.fromkeys(("l", "lh", "left", "li", "links"), "left"),
}
"""Hands by the words that file names use for them, in lower case."""
CALIBRATIONS = ("cal", "calib", "calibration", "rom", "kalibrierung")
"""Words in file names, in lower case, for a recording in which every joint moves through its range."""
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
"""A key word with its value: sub-03, Session 2, trial01."""
_DATE = re.compile(r"(?<!\d)(19|20)\d\d[-_.]?\d\d[-_.]?\d\d([T_ -]?\d\d[-_.:h]?\d\d([-_.:m]?\d\d)?)?(?!\d)")
_APART = re.compile(r"\b(P|S|VP)[- ](?=\d)", re.I)
"""A subject's letters, separated from the number: P 01."""
_WITH_HAND = re.compile(r"(\w*\d)([LR])")
"""A subject's name followed by the letter of a hand: P01L."""


@dataclass(frozen=True)
class NameParts:
    """Cells of a row of the recordings sheet as far as a file name determines them; the others are empty."""

    subject: str = ""
    session: str = ""
    hand: str = ""
    task: str = ""
    trial: str = ""
    role: str = ""


def parts_of_names(names: Iterable[Path]) -> list[NameParts]:
    """Return the cells that each path, relative to the folder of recordings, determines.

    If the name of one of a hand's recordings marks it as a calibration, the role of the others is evaluation;
    if none is marked, their role is both.
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
    words: list[str] = []  # a hand's letter after a subject's number is a separate word
    for word in filter(None, re.split(r"[\W_]+", _KEYED.sub(" ", text))):
        lettered = _WITH_HAND.fullmatch(word)
        words += lettered.groups() if lettered else [word]
    sides = [cells.pop("hand", ""), *words]
    cells["hand"] = next((HANDS[word.lower()] for word in sides if word.lower() in HANDS), "")
    words = [word for word, _ in groupby(word for word in words if word.lower() not in HANDS)]
    # The subject is a word like P01, or else the first of several words that does not mean calibration.
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


def draft_mappings(
    recordings: Sequence[Path], layout: Layout, inspected: Callable[[int], None]
) -> tuple[dict[str, str], dict[Path, str], list[str]]:
    """Draft the mappings that recordings need.

    Recordings share a mapping if their drafts are equal except for values that one of them leaves open.
    inspected : called with the number of files read so far. Returns the mappings' texts by file name, these
    names by recording, and the reasons why recordings were not read.
    """
    from shukotsu.readers.inspection.description import CHECK
    from shukotsu.study.config_files import loaded_yaml

    def are_alike(first: Any, second: Any) -> bool:
        """Return whether two drafts are equal except for values that one of them leaves open."""
        if isinstance(first, Mapping) and isinstance(second, Mapping):
            return first.keys() == second.keys() and all(are_alike(first[key], second[key]) for key in first)
        return first == second or CHECK in (first, second)

    drafts: dict[str, tuple[str, Any]] = {}  # text and content by file name
    mapping_of, reasons = {}, []
    for count, recording in enumerate(recordings, 1):
        try:
            text = describe(recording, layout).draft
        except InputError as error:
            reasons.append(str(error))
            text = ""
        inspected(count)
        if not text:
            continue
        config = loaded_yaml(text, str(recording))
        new = f"mapping-{len(drafts) + 1}.yaml" if drafts else "mapping.yaml"
        name = next((name for name, (_, other) in drafts.items() if are_alike(config, other)), new)
        if name == new or text.count(CHECK) < drafts[name][0].count(CHECK):
            drafts[name] = text, config
        mapping_of[recording] = name
    return {name: text for name, (text, _) in drafts.items()}, mapping_of, reasons


main = command_line.script(build_parser, new_study)
