"""The files of a BIDS dataset: its description, its tables and JSON objects."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv

from schemas import PROGRAM, VERSION, limits, text_files
from schemas.errors import InputError
from schemas.files import replacing

BIDS_VERSION = "1.10.0"
DESCRIPTION = "dataset_description.json"
"""The one file of a dataset that is there before its recordings."""
BEFORE_DESCRIPTION = ("README", "participants.tsv", "participants.json")
"""Files of a dataset that are written before its description."""


def check_folder(folder: Path) -> None:
    """Raise InputError where a folder to write to is a file or holds something else than a dataset."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; expected a folder for the dataset")
    if folder.is_dir() and not (folder / DESCRIPTION).is_file() and _others(folder):
        raise InputError(
            f"{folder}: holds files but no {DESCRIPTION}; expected a new folder or a BIDS dataset"
        )


def _others(folder: Path) -> bool:
    """Whether a folder holds what is not written before the description; a kill leaves only that."""
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


def write_motion(path: Path, blocks: Iterable[Sequence[pa.Array]]) -> None:
    """Write a motion.tsv, which has no header. blocks : some rows of every column as text at a time."""
    options = pa_csv.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
    with replacing(path) as temporary, temporary.open("wb") as stream:
        for texts in blocks:
            names = [str(index) for index in range(len(texts))]
            table = pa.table([text.fill_null("n/a") for text in texts], names=names)
            pa_csv.write_csv(table, stream, options)
