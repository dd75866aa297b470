"""Where the numbers come from: recordings, models, configuration, program versions, hashes of the inputs."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata

import yaml

from schemas import VERSION
from schemas.errors import InputError
from schemas.finding_groups import Fault, faults
from schemas.model import SkeletonModel
from schemas.study import Recording, Study
from schemas.tables import read_metadata
from stages.report.study_results import Row, StudyResults, hand_of, recording_key
from stages.report.table_cells import Block, DataTable, counted, number_column, table_of, text_column
from stages.report.wording import mark, say, told, word

PACKAGES = ("numpy", "pyarrow", "scipy", "snakemake")

_RECORDING_TEXTS = (
    mark("File"),
    mark("Subject"),
    mark("Session"),
    mark("Hand"),
    mark("Task"),
    mark("Trial"),
    mark("Role"),
)
_STATUS = mark("Status")
STATUS_MARKS = {
    "used": mark("used"),
    "excluded": mark("○ excluded"),
    "failed": mark("✕ failed"),
    "missing": mark("? missing"),
}


def recordings_table(results: StudyResults, whose: str = mark("of the study's sheet")) -> DataTable:
    """Every recording of the sheet and what became of it."""
    rows = []
    for recording in results.recordings:
        key = recording_key(recording)
        status, message = results.status_of(recording)
        texts = (recording.file_as_written, *key, recording.role)
        row = dict(zip(_RECORDING_TEXTS, texts, strict=True)) | {"message": message}
        rows.append(
            results.recording_row_of.get(key, {}) | row | {_STATUS: say(STATUS_MARKS.get(status, status))}
        )
    columns = (
        *(
            text_column(heading, heading)
            for heading in (*_RECORDING_TEXTS, _STATUS)
            if heading != "Session" or results.has_sessions
        ),
        number_column(say("Frames"), "n_frames", 0),
        number_column(say("Duration [s]"), "duration_s"),
        number_column(say("Valid [%]"), "valid_percent", 1),
        text_column(say("Message"), "message"),
    )
    return table_of(say("Every recording {whose}.", whose=say(whose)), columns, rows)


def problems_table(results: StudyResults, whose: str = mark("as the study asked")) -> DataTable | None:
    """Everything that did not go as the study asked, but what the findings say; None where all did.

    A row of what went wrong in the same way.
    """
    rows = [_problem_cells(fault) for fault in faults(results.other_problems, say)]
    messages = {row["message"] for row in results.problems}
    for recording in results.recordings:
        status, message = results.status_of(recording)
        if status != "used" and not (message and message in messages):
            reason = f"{word(status)}: {told(message) or say('no reason given')}"
            rows.append((recording.file_as_written, "recordings", reason))
    if not rows:
        return None
    return DataTable(
        say("Everything that did not go {whose}.", whose=say(whose)),
        (Block((say("Where"), say("Stage"), say("What happened")), tuple(rows)),),
        (),
        frozenset({0, 1, 2}),
    )


def _problem_cells(fault: Fault) -> tuple[str, str, str]:
    stage, places = fault.seen[0].row["stage"], "; ".join(places_of(fault))
    if any(seen.what for seen in fault.seen):
        return counted(len(fault.seen), "recording"), stage, f"{fault.text} {places}"
    return places, stage, fault.text


@dataclass(frozen=True)
class Found:
    """A fault as pages list it. where : its recording, or how many have it. places : those of several.
    evidence : what shows it in each of them.
    """

    where: str
    severity: str
    text: str
    places: str = ""
    evidence: tuple[str, ...] = ()


def found(rows: Sequence[Row]) -> list[Found]:
    """Findings by fault, each with the recordings that have it."""
    return [_found(fault) for fault in faults(rows, say)]


def _found(fault: Fault) -> Found:
    places = places_of(fault)
    if len(places) == 1:
        return Found(places[0], fault.severity, fault.text)
    evidence = tuple(f"{where(seen.row)}: {seen.evidence}" for seen in fault.seen if seen.evidence)
    return Found(counted(len(places), "recording"), fault.severity, fault.text, "; ".join(places), evidence)


def places_of(fault: Fault) -> list[str]:
    """Where a fault is, each place once; with what is wrong there where that differs."""
    return list(dict.fromkeys(": ".join(filter(None, (where(own.row), own.what))) for own in fault.seen))


def where(problem: Row) -> str:
    """What a row of problems is about, in words."""
    named = (
        say("{who}", who=hand_of(problem).who) if problem["subject"] else "",
        say("{hand} hand", hand=problem["hand"]) if problem["hand"] else "",
        problem["task"],
        say("model {model}", model=problem["model"]) if problem["model"] else "",
    )
    return say(", ").join(filter(None, named)) or say("the study")


def models_table(results: StudyResults) -> DataTable:
    """The skeleton models in words."""
    rows = tuple(_model_cells(model) for model in results.models.values())
    header = (
        say("Model"),
        say("Description"),
        say("Paper's table"),
        say("Wrist"),
        say("First joints of their own"),
        say("Metacarpals"),
    )
    return DataTable(say("Skeleton models."), (Block(header, rows),), (), frozenset(range(6)))


def versions_table() -> DataTable:
    """The program and the packages that made this page."""
    rows = [("shukotsu", VERSION), ("python", platform.python_version())]
    rows += [(package, _version(package)) for package in PACKAGES]
    return DataTable(
        say("Program and package versions."),
        (Block((say("Program"), say("Version")), tuple(rows)),),
        (),
        frozenset({0, 1}),
    )


def inputs_table(results: StudyResults, whose: str = mark("of the study")) -> DataTable:
    """SHA-256 of the files that each recording's poses were made from."""
    rows = [row for recording in results.recordings for row in _input_rows(results, recording)]
    return DataTable(
        say("Input files {whose} and their SHA-256.", whose=say(whose)),
        (Block((say("Recording"), say("Input file"), say("SHA-256")), tuple(rows)),),
        () if rows else (say("No poses table is there to read hashes from."),),
        frozenset({0, 1, 2}),
    )


def config_text(study: Study) -> str:
    """The study's configuration as YAML, defaults filled in."""
    return yaml.safe_dump(study.config, sort_keys=False, allow_unicode=True, width=100)


def _model_cells(model: SkeletonModel) -> tuple[str, ...]:
    return (
        model.name,
        told(model.description),
        "" if model.paper_table is None else str(model.paper_table),
        model.wrist,
        ", ".join(model.own_cmc) or say("none"),
        say(
            "without a receiver: {unmeasured}; with one: {measured}",
            unmeasured=model.unmeasured,
            measured=model.measured,
        ),
    )


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return say("not installed")


def _input_rows(results: StudyResults, recording: Recording) -> list[tuple[str, str, str]]:
    try:
        inputs = read_metadata(results.poses(recording)).get("inputs", [])
    except InputError:
        return []
    name = ", ".join(part for part in recording_key(recording) if part)
    return [(name, entry["file"], entry["sha256"]) for entry in inputs]
