"""The study's tables from those of its hands; whatever could not be had is a row with its reason."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import yaml

from schemas import PROGRAM, VERSION
from schemas.catalogue import PROBLEMS, RECEIVERS, RECORDINGS, TABLES
from schemas.config_files import read_config
from schemas.files import write_text
from schemas.joined_tables import join_tables
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.results import FIT_TABLES, HAND_TABLES, SCORE_TABLES, Part, Results
from schemas.study import Study, correction_problems, read_corrections
from schemas.tables import Provenance, columns_from_rows, read_table, write_table
from stages.gather.parts import Row, failing, receiver_problems, recording_row

TABLES_AT_ONCE = 2


def gather_study(study: Study, results: Results) -> None:
    """Write the study-wide tables into its results folder."""
    problems: list[dict[str, Any]] = []
    recordings = [recording_row(recording, results, problems) for recording in study.recordings]
    models = {name: read_model(path.absolute()) for name, path in study.models.items()}
    fitted = [name for name, model in models.items() if model.fitting is not None]
    names = (*HAND_TABLES, *FIT_TABLES, *SCORE_TABLES)
    with ThreadPoolExecutor(TABLES_AT_ONCE) as pool:  # copying and hashing run side by side
        for found in pool.map(
            lambda name: _write_whole(results, name, results.parts(name, study.hands, models, fitted)), names
        ):
            problems += found
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


def _write_whole(results: Results, name: str, parts: Sequence[Part]) -> list[Row]:
    """Write one of the study's tables; give what is wrong in it."""

    def provenance(digests: dict[Path, str]) -> Provenance:
        return Provenance(
            tuple((path.relative_to(results.folder).as_posix(), digest) for path, digest in digests.items())
        )

    problems: list[Row] = []
    paths = [part.path for part in parts]
    join_tables(results.study_table(name), TABLES[name], paths, provenance, failing(parts, problems))
    if name == RECEIVERS.name:
        problems += receiver_problems(read_table(results.study_table(name), RECEIVERS))
    return problems
