"""The study's tables from those of its hands; whatever could not be had is a row with its reason."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import yaml

from schemas import PROGRAM, VERSION
from schemas.catalogue import POSES, PROBLEMS, RECEIVERS, RECORDINGS, TABLES
from schemas.config_files import read_config
from schemas.errors import InputError
from schemas.files import file_sha256, write_text
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.results import FIT_TABLES, HAND_TABLES, SCORE_TABLES, Results
from schemas.study import Hand, Recording, Study, correction_problems, read_corrections
from schemas.tables import (
    Provenance,
    columns_from_rows,
    read_metadata,
    read_table,
    rows_of,
    write_table,
)


def gather_study(study: Study, results: Results) -> None:
    """Write the study-wide tables into its results folder."""
    problems: list[dict[str, Any]] = []
    recordings = [_recording_row(recording, results, problems) for recording in study.recordings]
    models = {name: read_model(path.absolute()) for name, path in study.models.items()}
    fitted = [name for name, model in models.items() if model.fitting is not None]
    for name, stage in HAND_TABLES.items():
        _write_whole(results, name, _parts(study, results, name, list(models)), stage, problems)
    for name, stage in FIT_TABLES.items():
        whole = _write_whole(results, name, _parts(study, results, name, fitted), stage, problems)
        if name == RECEIVERS.name:
            problems += _receiver_problems(whole)
    for name, stage in SCORE_TABLES.items():
        scored = [(_whose(hand), results.score_table(hand, name)) for hand in study.hands]
        _write_whole(results, name, scored, stage, problems)
    problems += _uncalibrated(study) + _correction_problems(study)
    _write_resolved(study, results)
    provenance = Provenance.of(list(study.sheets.values()))
    unique = list({(row["where"], row["message"]): row for row in reversed(problems)}.values())[::-1]
    write_table(
        results.study_table("recordings"), RECORDINGS, columns_from_rows(RECORDINGS, recordings), provenance
    )
    write_table(results.study_table("problems"), PROBLEMS, columns_from_rows(PROBLEMS, unique), provenance)


def _uncalibrated(study: Study) -> list[dict[str, Any]]:
    """Name the hands that no recording calibrates: nothing failed, and yet there is no skeleton."""
    message = "no recording calibrates this hand, so none of its joints could be solved"
    return [
        {"where": f"{hand.subject}, {hand.hand}", "stage": "solve_joints", "message": message}
        for hand in study.hands
        if not study.of(hand, ("calibration", "both"))
    ]


def _write_resolved(study: Study, results: Results) -> None:
    """Write the study with its layouts and models, every default filled in, as one YAML file."""
    layouts = dict.fromkeys(recording.layout for recording in study.recordings)
    whole = {
        "program": f"{PROGRAM} {VERSION}",
        "study": study.config,
        "layouts": [read_config(path, "layout") for path in layouts],
        "models": [read_config(path, "model") for path in study.models.values()],
    }
    text = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True, width=100)
    write_text(results.resolved, text)


def _correction_problems(study: Study) -> list[dict[str, Any]]:
    path = study.sheets.get("corrections")
    if path is None:
        return []
    layout = read_layout(study.layout.absolute())
    messages = correction_problems(read_corrections(path), path, study.hands, layout)
    return [{"where": path.name, "stage": "project_planes", "message": message} for message in messages]


def _whose(hand: Hand, model: str = "") -> str:
    whose = f"subject {hand.subject}, {hand.hand} hand"
    return f"{whose}, model {model}" if model else whose


def _parts(study: Study, results: Results, name: str, models: Sequence[str]) -> list[tuple[str, Path]]:
    """Whose a table of a hand under a model is, and its file."""
    return [
        (_whose(hand, model), results.hand_table(model, hand, name))
        for model in models
        for hand in study.hands
    ]


def _write_whole(
    results: Results,
    name: str,
    sources: Sequence[tuple[str, Path]],
    stage: str,
    problems: list[dict[str, Any]],
) -> pa.Table:
    """Concatenate one table over hands and models; a part that failed becomes a problem."""
    table, parts = TABLES[name], []
    files = [path for _, path in sources]
    for where, path in sources:
        try:
            parts.append(read_table(path, table).replace_schema_metadata(None))
        except InputError as error:
            problems.append({"where": where, "stage": stage, "message": str(error)})
    bare = table.arrow_schema({}).remove_metadata()
    whole = pa.concat_tables([part.cast(bare) for part in parts]) if parts else bare.empty_table()
    columns = {column.name: whole.column(column.name) for column in table.columns}
    hashed = [
        (path.relative_to(results.folder).as_posix(), file_sha256(path)) for path in files if path.is_file()
    ]
    write_table(results.study_table(name), table, columns, Provenance(tuple(hashed)))
    return whole


def _receiver_problems(receivers: pa.Table) -> list[dict[str, Any]]:
    """Receivers that came loose, and touches that were refused, once however many models say so.

    A receiver without a valid pose is named with its recording.
    """
    return [
        {
            "where": f"subject {row['subject']}, {row['hand']} hand, {row['segment']}",
            "stage": FIT_TABLES[RECEIVERS.name],
            "message": row["message"],
        }
        for row in rows_of(receivers)
        if row["message"] and row["status"] != "failed"
    ]


def _recording_row(recording: Recording, results: Results, problems: list[dict[str, Any]]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "subject": recording.hand.subject,
        "hand": recording.hand.hand,
        "task": recording.task,
        "trial": recording.trial,
        "role": recording.role,
        "file": recording.file_as_written,
        "status": "used",
        "n_frames": 0,
        "message": "",
    }
    if recording.exclude:
        return row | {"status": "excluded", "message": recording.exclude}
    names = (recording.hand.subject, recording.hand.hand, recording.task, recording.trial)
    problem = {"where": ", ".join(filter(None, names)), "stage": "capture"}
    path = results.poses(recording)
    try:
        table = read_table(path, POSES, ["segment", "frame", "time_s", "valid"])
        parameters = read_metadata(path)["parameters"]
    except InputError as error:
        problems.append(problem | {"message": str(error)})
        return row | {"status": "failed", "message": str(error)}
    absent = parameters.get("absent", [])
    dead = _dead(table, absent)
    doubts = [f"no usable pose of {', '.join(dead)}; check that receiver"] if dead else []
    doubts += [parameters["doubt"]] if parameters.get("doubt") else []
    doubts += parameters.get("losses", [])
    problems += [problem | {"message": doubt} for doubt in doubts]
    said = "; ".join(dict.fromkeys([*doubts, *parameters.get("notes", [])]))
    return row | _counts(table, absent, parameters.get("missing_frames", 0)) | {"message": said}


def _dead(table: pa.Table, absent: Sequence[str]) -> list[str]:
    """Segments of which no pose may be used, those that the recording lacks among them."""
    ever = table.group_by("segment", use_threads=False).aggregate([("valid", "any")])
    never = [row["segment"] for row in rows_of(ever) if not row["valid_any"]]
    return list(dict.fromkeys([*absent, *never]))


def _counts(table: pa.Table, absent: Sequence[str], missing_frames: int) -> dict[str, Any]:
    segments = table.column("segment").unique().to_pylist()
    n_segments = len(segments)
    n_frames = table.num_rows // max(n_segments, 1)
    time_s = table.column("time_s").to_numpy()
    known = time_s[np.isfinite(time_s)]
    n_valid = int(np.sum(table.column("valid").to_numpy()))
    expected = (n_frames + missing_frames) * len({*segments, *absent})
    return {
        "n_frames": n_frames,
        "duration_s": float(np.ptp(known)) if len(known) else None,
        "valid_percent": 100.0 * n_valid / expected if expected else None,
    }
