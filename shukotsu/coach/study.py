"""Read a study's information on a hand, and add the calibration to its sheet of recordings."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from shukotsu.coach.coach import CoachedHand
from shukotsu.errors import InputError
from shukotsu.fit.measurements import Measurement
from shukotsu.hand.known_digits import no_whole_hand
from shukotsu.study import config_files, plan
from shukotsu.study.layout import read_layout
from shukotsu.study.model import read_model
from shukotsu.study.sheets import MEASUREMENTS, PARTICIPANTS, RECORDINGS, Row, Sheet, read_sheet, sheet_rows
from shukotsu.study.study import SIZES
from shukotsu.tables import limits, text_files, whole_files
from shukotsu.tables.subjects import path_token

CAPTURES = "captures"
"""Folder of archives, next to the study file or in the working folder."""
USUAL_LAYOUT, USUAL_MODEL, TASK = "liberty16", "whole-hand", "rom"
_BOM = b"\xef\xbb\xbf"


def hand_alone(layout: str | None, hand: str) -> CoachedHand:
    """Return a hand without a study. Raises InputError if the layout does not exist or is not of a hand."""
    return _checked(CoachedHand(hand, read_layout(layout or USUAL_LAYOUT), read_model(USUAL_MODEL)))


def hand_of(study: Path, subject: str, hand: str, layout: str | None = None) -> CoachedHand:
    """Return a hand as described by a study.

    layout : layout to use instead of the study's. Raises InputError if the study cannot be read.
    """
    config = config_files.read_config(study, "study")
    whose = {"subject": subject, "hand": hand}
    people = _rows(study, config, PARTICIPANTS, {"subject": subject})
    sizes_mm = {name: people[0][name] for name in SIZES} if people else {}
    rows = plan.rows_of_session(_rows(study, config, MEASUREMENTS, whose), MEASUREMENTS, "")
    measurements = tuple(Measurement(row["quantity"], row["value_mm"], row["sd_mm"]) for row in rows)
    models = [read_model(name, study.parent) for name in [*config["models"], USUAL_MODEL]]
    model = next(model for model in models if model.fitting is not None and model.fitting.steps)
    read = read_layout(layout or config["layout"], Path() if layout else study.parent)
    read = replace(read, wanted_mm=float(config["wanted_mm"] or read.wanted_mm))
    return _checked(CoachedHand(hand, read, model, whose, sizes_mm, measurements))


def _checked(hand: CoachedHand) -> CoachedHand:
    """Return the hand with the layout of its side. Raises InputError if the layout is not of a whole hand."""
    if reason := no_whole_hand(hand.layout, hand.model.name):
        raise InputError(reason)
    return replace(hand, layout=hand.layout.of_hand(hand.hand))


def _rows(study: Path, config: Mapping[str, Any], sheet: Sheet, key: Mapping[str, str]) -> list[Row]:
    """Return the rows of a sheet of the study, if it has that sheet, whose cells are those of `key`."""
    if sheet.name not in config:
        return []
    factors = config["factors"] if sheet in (RECORDINGS, PARTICIPANTS) else ()
    rows = read_sheet(study.parent / config[sheet.name], sheet, factors)
    return [row for row in rows if all(row[name] == cell for name, cell in key.items())]


def new_archive(folder: Path, whose: Mapping[str, str], hand: str) -> Path:
    """Return the path of the next archive that does not exist yet, such as captures/03_right_rom.arrows."""
    stem = "_".join(path_token(part) for part in (whose.get("subject", ""), hand, TASK) if part)
    names = [stem, *(f"{stem}_{number}" for number in range(2, 1000))]
    return next(path for name in names if not (path := folder / CAPTURES / f"{name}.arrows").exists())


def enter_recording(study: Path, whose: Mapping[str, str], archive: Path, exclude: str = "") -> Path:
    """Add a recording to the study's sheet of recordings, as the next repetition of its task.

    All bytes of the sheet are kept; columns that only the new row needs are appended to its header.

    Parameters
    ----------
    study : Path
        The study file.
    whose : mapping
        Subject and hand.
    archive : Path
        The recording.
    exclude : str
        Reason why the study should exclude it, or "".

    Returns
    -------
    Path
        The sheet.

    Raises
    ------
    InputError
        If the sheet would be invalid with the new row; it is left unchanged.
    StorageError
        If the sheet cannot be written; it is left unchanged.

    """
    config = config_files.read_config(study, "study")
    key = {**whose, "session": "", "task": TASK}
    trials = {row["trial"] for row in _rows(study, config, RECORDINGS, key)}
    trial = next(name for name in ("", *map(str, range(2, len(trials) + 3))) if name not in trials)
    file = Path(os.path.relpath(archive, study.parent)).as_posix()
    cells = {**key, "trial": trial, "role": "calibration", "file": file, "exclude": exclude}
    sheet = Path(os.path.realpath(study.parent / config["recordings"]))  # keeps a symbolic link
    with text_files.reading(sheet, "the sheet of recordings"):
        data = limits.read_whole(sheet, "the sheet of recordings", limits.SHEET_BYTES)
    parts = re.split(r"(\r\n|\r|\n)", text_files.decode_text(sheet, data, "the sheet of recordings"))
    at = next(number for number in range(0, len(parts), 2) if parts[number].strip())
    header = [cell.strip() for cell in parts[at].split("\t")]
    new = [name for name, cell in cells.items() if cell and name not in header]
    parts[at] += "".join(f"\t{name}" for name in new)
    end = parts[1] if len(parts) > 1 else "\n"
    line = "\t".join(cells.get(name, "") for name in [*header, *new])
    text = "".join(parts)
    text += "" if text.endswith(("\n", "\r")) else end
    text += line + end
    sheet_rows(sheet, re.sub("\r\n?", "\n", text), RECORDINGS, header)
    with whole_files.replacing(sheet) as temporary:
        temporary.write_bytes((_BOM if data.startswith(_BOM) else b"") + text.encode())
        temporary.chmod(sheet.stat().st_mode)
    return Path(study.parent / config["recordings"])
