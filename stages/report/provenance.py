"""Where the numbers come from: recordings, models, configuration, program versions, hashes of the inputs."""

from __future__ import annotations

import platform
from importlib import metadata

import yaml

from schemas import VERSION
from schemas.errors import InputError
from schemas.model import SkeletonModel
from schemas.study import Recording
from schemas.tables import read_metadata
from stages.report.data_table import Block, DataTable, number
from stages.report.study_results import Row, StudyResults, recording_key

PACKAGES = ("numpy", "pyarrow", "scipy", "snakemake")

STATUS_MARKS = {"used": "used", "excluded": "○ excluded", "failed": "✕ failed", "missing": "? missing"}


def recordings_table(results: StudyResults, whose: str = "of the study's sheet") -> DataTable:
    """Every recording of the sheet and what became of it."""
    header = (
        "File",
        "Subject",
        "Hand",
        "Task",
        "Trial",
        "Role",
        "Status",
        "Frames",
        "Duration [s]",
        "Valid [%]",
        "Message",
    )
    rows = tuple(_recording_cells(results, recording) for recording in results.study.recordings)
    return DataTable(f"Every recording {whose}.", (Block(header, rows),), (), frozenset({*range(7), 10}))


def problems_table(results: StudyResults, whose: str = "as the study asked") -> DataTable | None:
    """Everything that did not go as the study asked; None where all did."""
    rows = [(row["where"], row["stage"], row["message"]) for row in results.problems]
    told = {row["message"] for row in results.problems}
    for recording in results.study.recordings:
        status, message = results.status_of(recording)
        if status != "used" and not (message and message in told):
            reason = f"{status}: {message or 'no reason given'}"
            rows.append((recording.file_as_written, "recordings", reason))
    if not rows:
        return None
    return DataTable(
        f"Everything that did not go {whose}.",
        (Block(("Where", "Stage", "What happened"), tuple(rows)),),
        (),
        frozenset({0, 1, 2}),
    )


def models_table(results: StudyResults) -> DataTable:
    """The skeleton models in words."""
    rows = tuple(_model_cells(model) for model in results.models.values())
    header = ("Model", "Description", "Paper's table", "Wrist", "First joints of their own", "Metacarpals")
    return DataTable("Skeleton models.", (Block(header, rows),), (), frozenset(range(6)))


def versions_table() -> DataTable:
    """The program and the packages that made this page."""
    rows = [("shukotsu", VERSION), ("python", platform.python_version())]
    rows += [(package, _version(package)) for package in PACKAGES]
    return DataTable(
        "Program and package versions.", (Block(("Program", "Version"), tuple(rows)),), (), frozenset({0, 1})
    )


def inputs_table(results: StudyResults, whose: str = "of the study") -> DataTable:
    """SHA-256 of the files that each recording's poses were made from."""
    rows = [row for recording in results.study.recordings for row in _input_rows(results, recording)]
    return DataTable(
        f"Input files {whose} and their SHA-256.",
        (Block(("Recording", "Input file", "SHA-256"), tuple(rows)),),
        () if rows else ("No poses table is there to read hashes from.",),
        frozenset({0, 1, 2}),
    )


def config_text(results: StudyResults) -> str:
    """The study's configuration as YAML, defaults filled in."""
    return yaml.safe_dump(results.study.config, sort_keys=False, allow_unicode=True, width=100)


def _recording_cells(results: StudyResults, recording: Recording) -> tuple[str, ...]:
    row: Row = results.recording_row_of.get(recording_key(recording), {})
    status, message = results.status_of(recording)
    frames = row.get("n_frames")
    return (
        recording.file_as_written,
        *recording_key(recording),
        recording.role,
        STATUS_MARKS.get(status, status),
        number(frames, 0),
        number(row.get("duration_s")),
        number(row.get("valid_percent"), 1),
        message,
    )


def _model_cells(model: SkeletonModel) -> tuple[str, ...]:
    return (
        model.name,
        model.description,
        "" if model.paper_table is None else str(model.paper_table),
        model.wrist,
        ", ".join(model.own_cmc) or "none",
        f"without a receiver: {model.unmeasured}; with one: {model.measured}",
    )


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def _input_rows(results: StudyResults, recording: Recording) -> list[tuple[str, str, str]]:
    try:
        inputs = read_metadata(results.paths.poses(recording)).get("inputs", [])
    except InputError:
        return []
    name = ", ".join(part for part in recording_key(recording) if part)
    return [(name, entry["file"], entry["sha256"]) for entry in inputs]
