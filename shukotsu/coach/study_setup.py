"""Read from a study what the coach must know of a hand, and enter there what came of it."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shukotsu.coach.setup import CoachSetup, checked_setup
from shukotsu.coach.study_sheets import add_row, further_columns, name_sheet
from shukotsu.errors import InputError
from shukotsu.schemas.config_files import config_path, read_config
from shukotsu.schemas.layout import FINGER_MM
from shukotsu.schemas.model import model_from_config
from shukotsu.schemas.plan import rows_of_session
from shukotsu.schemas.sheets import MEASUREMENTS, PARTICIPANTS, RECORDINGS, SHEETS, TOUCHES, Row, read_sheet
from shukotsu.schemas.study import path_token

CAPTURES = "captures"
"""Folder of archives, beside the study file."""

USUAL_MODEL = "whole-hand"


def setup_of(study: Path, subject: str, hand: str, session: str, task: str) -> CoachSetup:
    """Give what a study says of a hand. Raises InputError where the study cannot be read, or has no model
    that fits a whole hand.
    """
    config = read_config(study, "study")
    folder = study.parent
    layout = read_config(config_path(config["layout"], "layout", folder), "layout")
    layout = layout | {"wanted_mm": config["wanted_mm"] or layout["wanted_mm"] or FINGER_MM}
    recordings = _rows(folder, config, RECORDINGS.name, further_columns(config))
    people = _rows(folder, config, PARTICIPANTS.name, config["factors"])
    person = next((row.values for row in people if row["subject"] == subject), {})
    own = [
        row
        for row in _rows(folder, config, MEASUREMENTS.name)
        if (row["subject"], row["hand"]) == (subject, hand)
    ]
    return checked_setup(
        CoachSetup(
            study=config["study"],
            subject=subject,
            hand=hand,
            session=session,
            task=task,
            trial=_free_trial(recordings, subject, hand, session, task),
            layout=layout,
            wanted_mm=float(layout["wanted_mm"]),
            model=_model(config, folder),
            hand_length_mm=person.get("hand_length_mm"),
            hand_breadth_mm=person.get("hand_breadth_mm"),
            measurements=tuple(
                {name: row[name] for name in ("quantity", "value_mm", "sd_mm")}
                for row in rows_of_session(own, MEASUREMENTS, session)
            ),
        )
    )


def _model(config: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Give the content of the study's model that fits the whole hand, or of the one that ships."""
    for name in [*config["models"], USUAL_MODEL]:
        content = read_config(config_path(name, "model", folder), "model")
        fitting = model_from_config(content, name).fitting
        if fitting is not None and fitting.steps:
            return content
    raise InputError(f"models: expected one that fits the whole hand, such as {USUAL_MODEL}")


def _rows(folder: Path, config: Mapping[str, Any], name: str, more: Sequence[str] = ()) -> list[Row]:
    return read_sheet(folder / config[name], SHEETS[name], more) if name in config else []


def _entered_as(study: Path, setup: CoachSetup, config: Mapping[str, Any], row: Mapping[str, Any]) -> str:
    """Add a row to the sheet of recordings; give the repetition that it became."""
    trial = setup.trial
    while True:
        try:
            add_row(
                study.parent / config["recordings"], RECORDINGS, {**row, "task": setup.task, "trial": trial}
            )
            return trial
        except InputError:
            rows = _rows(study.parent, config, RECORDINGS.name, further_columns(config))
            free = _free_trial(rows, setup.subject, setup.hand, setup.session, setup.task)
            if free == trial:
                raise
            trial = free


def _free_trial(rows: Sequence[Row], subject: str, hand: str, session: str, task: str) -> str:
    """Give the first repetition of the task that the sheet does not have yet; empty for the first."""
    whose = (subject, session, hand, task)
    known = {
        row["trial"] for row in rows if (row["subject"], row["session"], row["hand"], row["task"]) == whose
    }
    return next(trial for trial in ("", *map(str, range(2, len(known) + 3))) if trial not in known)


def archive_of(study: Path, setup: CoachSetup) -> Path:
    """Give where the hand's archive goes, a name that is not there yet: captures/03_right_rom.arrows beside
    the study file.
    """
    parts = [
        setup.subject,
        *filter(None, [setup.session and f"ses-{setup.session}"]),
        setup.hand,
        setup.task,
        setup.trial,
    ]
    stem = "_".join(path_token(part) for part in parts if part)
    folder = study.parent / CAPTURES
    names = [stem, *(f"{stem}_{number}" for number in range(2, 1000))]
    return next(path for name in names if not (path := folder / f"{name}.arrows").exists())


def enter_recording(
    study: Path,
    setup: CoachSetup,
    archive: Path,
    exclude: str,
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
) -> list[Path]:
    """Enter a recording, its touches and lengths into the study's sheets; give those that were written.

    exclude : why the study shall leave it out, and its touches; empty for one that it uses. Where another
    coach has entered this repetition meanwhile it becomes the next one.
    """
    config = read_config(study, "study")
    sheets = [study.parent / config["recordings"]]
    file = Path(os.path.relpath(archive, study.parent)).as_posix()
    row = setup.whose | {"role": "calibration", "file": file, "exclude": exclude}
    trial = _entered_as(study, setup, config, row)
    for name, own in rows.items():
        if own and not (exclude and name == TOUCHES.name):
            sheets.append(name_sheet(study, name, f"{name}.tsv"))
            for each in own:
                own_trial = {"trial": trial} if name == TOUCHES.name else {}
                try:
                    add_row(sheets[-1], SHEETS[name], {**each, **own_trial})
                except InputError as error:
                    print(f"note: not entered: {error}", file=sys.stderr)
    return sheets
