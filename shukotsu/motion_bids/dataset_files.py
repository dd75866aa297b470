"""The files of a whole BIDS dataset: its description, its participants; tables and JSON objects."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.files import limits, text_files
from shukotsu.files.whole_files import write_text
from shukotsu.motion_bids.labels import label
from shukotsu.schemas import PROGRAM, VERSION

OWN_KEY = "Shukotsu"
"""The key of motion.json under which stands what BIDS has no key for."""
BIDS_VERSION = "1.10.0"
DESCRIPTION = "dataset_description.json"
"""The one file of a dataset that is there before its recordings."""
PARTICIPANTS = "participants.tsv"
BEFORE_DESCRIPTION = ("README", PARTICIPANTS, "participants.json")
"""Files of a dataset that are written before its description."""

README = f"""Hand motion from magnetic receivers, exported by {PROGRAM}.

Every recording of one hand has tracking systems in sub-*/motion. "righthand" or "lefthand" are the
receivers as they were recorded. The same with "skeleton" and the name of a skeleton model are that person's
joints and bones, computed from the receivers: positions of joints, rotations of the bones that start there,
and joint angles where the anatomy is known. All have the same frames and the same clock.

Positions are in metres and orientations are unit quaternions, to the frame of the transmitter, which did not
move; joint angles are in degrees. n/a stands where there was no pose; nothing was filled or smoothed unless
"notes" in motion.json says so. Names that BIDS does not allow in a file name are written out in full under
"{OWN_KEY}" in each motion.json, and subjects' names in participants.tsv: in a label, Q starts the stand-in of
a character that it may not hold (Qs a blank, Qd a hyphen, Qu an underscore, Qp a point, QQ the letter Q, Qx
and x around any other character's code point in hexadecimal).
"""


def check_folder(folder: Path) -> None:
    """Raise InputError where a folder to write to is a file or holds something else than a dataset."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; expected a folder for the dataset")
    if folder.is_dir() and not (folder / DESCRIPTION).is_file() and _others(folder):
        raise InputError(
            f"{folder}: holds files but no {DESCRIPTION}; expected a new folder or a BIDS dataset"
        )


def _others(folder: Path) -> bool:
    """Tell whether a folder holds what is not written before the description; a kill leaves only that."""
    return any(path.name not in BEFORE_DESCRIPTION for path in folder.glob("[!.]*"))


def description_json(name: str, licence: str = "") -> dict[str, Any]:
    """The content of dataset_description.json."""
    return {
        "Name": name,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        **({"License": licence} if licence else {}),
        "GeneratedBy": [{"Name": PROGRAM, "Version": VERSION}],
    }


def read_text(path: Path) -> str:
    """Read a sidecar. Raises InputError where it cannot be read or is not UTF-8."""
    return text_files.read_text(path, "a sidecar of the recording", limits.SHEET_BYTES)


def read_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    """Read a small TSV file with a header: its columns and its rows.

    Raises InputError where a row has another number of cells.
    """
    reader = csv.reader(io.StringIO(read_text(path), newline=""), delimiter="\t", quoting=csv.QUOTE_NONE)
    try:
        records = [(reader.line_num, [cell.strip() for cell in record]) for record in reader if record]
    except csv.Error as error:
        raise InputError(f"{path}: cannot be read as tab-separated text ({error})") from error
    if not records:
        raise InputError(f"{path}: is empty; expected a header line")
    header = records[0][1]
    for line, record in records[1:]:
        if len(record) != len(header):
            raise InputError(
                f"{path}: line {line}: has {len(record)} cells; expected {len(header)} as in the header"
            )
    return header, [record for _, record in records[1:]]


def tsv_text(rows: Iterable[Sequence[str]]) -> str:
    """Give rows of cells as the text of a TSV file."""
    return "".join("\t".join(row) + "\n" for row in rows)


def tsv_cell(value: object) -> str:
    """Give a value as a cell: no tab, no line break, n/a for nothing."""
    return "n/a" if value is None else " ".join(str(value).split()) or "n/a"


def json_text(content: Mapping[str, Any]) -> str:
    """Give a JSON object as the text of a sidecar."""
    return json.dumps(content, ensure_ascii=False, indent=2) + "\n"


def write_dataset_files(
    folder: Path, name: str, participants: Mapping[str, Mapping[str, Any]], licence: str = ""
) -> None:
    """Write or replace the files that describe a whole dataset: name, licence, README, participants.

    participants : subject -> more columns of participants.tsv, None where not known; all subjects have the
    same ones. The order of subjects does not matter. Raises InputError where the folder is no dataset.
    """
    check_folder(folder)
    write_text(folder / "README", README)
    names = dict.fromkeys(column for known in participants.values() for column in known)
    columns = [column for column in names if column not in ("participant_id", "name")]
    rows = [
        [f"sub-{label(subject)}", tsv_cell(subject), *(tsv_cell(known.get(column)) for column in columns)]
        for subject, known in participants.items()
    ]
    header = ["participant_id", "name", *columns]
    write_text(folder / PARTICIPANTS, tsv_text([header, *sorted(rows)]))
    columns_json = _NAME | {column: _described(column) for column in columns}
    write_text(folder / "participants.json", json_text(columns_json))
    write_text(folder / DESCRIPTION, json_text(description_json(name, licence)))  # last: then all is there


def add_participants(folder: Path, subjects: Iterable[str], licence: str = "") -> None:
    """Add subjects that a dataset does not have; what it has stays as it is, a new one is made.

    Raises InputError where the folder holds something else.
    """
    check_folder(folder)
    path = folder / PARTICIPANTS
    header, rows = read_rows(path) if path.exists() else (["participant_id", "name"], [])
    if "participant_id" not in header:
        raise InputError(f"{path}: column participant_id is missing; found {', '.join(header)}")
    place, before = header.index("participant_id"), len(rows)
    for subject in dict.fromkeys(subjects):
        cells = {"participant_id": f"sub-{label(subject)}", "name": tsv_cell(subject)}
        if cells["participant_id"] not in [row[place] for row in rows]:
            after = (i for i, row in enumerate(rows) if row[place] > cells["participant_id"])
            rows.insert(next(after, len(rows)), [cells.get(column, "n/a") for column in header])
    if len(rows) > before or not path.exists():
        write_text(path, tsv_text([header, *rows]))
    if not any(folder.glob("README*")):
        write_text(folder / "README", README)
    if not (folder / "participants.json").exists() and "name" in header:
        write_text(folder / "participants.json", json_text(_NAME))
    if not (folder / DESCRIPTION).exists():
        write_text(folder / DESCRIPTION, json_text(description_json(folder.resolve().name, licence)))


_NAME = {"name": {"Description": "The subject's name, of which participant_id is made."}}


def _described(column: str) -> dict[str, str]:
    described = {"Description": f"{column} as the study's participants sheet has it."}
    return described | ({"Units": "mm"} if column.endswith("_mm") else {})
