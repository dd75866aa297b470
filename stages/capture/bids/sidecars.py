"""The files beside a `*_motion.tsv` that say what its columns are, found by BIDS's inheritance principle."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.errors import InputError

MOTION_ENDING = "_motion.tsv"

OWN_KEY = "Shukotsu"
"""The key of motion.json under which the exporter says what BIDS has no key for."""

_REQUIRED = ("name", "component", "type", "tracked_point", "units")

_LEVELS = 4
"""motion, session, subject and dataset folder: where a sidecar may lie."""


@dataclass(frozen=True)
class Channel:
    """One row of channels.tsv, which describes the column of motion.tsv at its `index` from 0."""

    index: int
    name: str
    component: str
    type: str
    tracked_point: str
    units: str
    reference_frame: str


@dataclass(frozen=True)
class Sidecars:
    """What the files beside a motion.tsv say; both JSON objects are empty where there is no file."""

    channels_path: Path
    channels: tuple[Channel, ...]
    motion: Mapping[str, Any]
    channels_json: Mapping[str, Any]

    def points(self) -> tuple[str, ...]:
        """The tracked points that have a position or an orientation, in the order of the columns."""
        posed = [c.tracked_point for c in self.channels if c.type in ("POS", "ORNT")]
        return tuple(dict.fromkeys(point for point in posed if point != "n/a"))

    def own(self) -> Mapping[str, Any]:
        """What this program's exporter wrote; empty in a file of others."""
        found = self.motion.get(OWN_KEY, {})
        return found if isinstance(found, dict) else {}

    def by_name(self, name: object) -> Channel | None:
        """The channel of that name; None where there is none."""
        return next((channel for channel in self.channels if channel.name == name), None)

    def frame_levels(self, frame: str) -> Mapping[str, Any]:
        """What channels.json says of a reference frame; empty where it says nothing."""
        found: Any = self.channels_json
        for key in ("reference_frame", "Levels", frame):
            found = found.get(key) if isinstance(found, dict) else None
        return found if isinstance(found, dict) else {}

    def sampling_frequency_hz(self) -> float | None:
        """SamplingFrequency of motion.json; None where there is none above 0 and below 1e9."""
        value = self.motion.get("SamplingFrequency")
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e9:
            return None
        return float(value)


def read_sidecars(path: Path) -> Sidecars:
    """Read what lies beside a motion.tsv, or above it where it is inherited.

    Raises InputError where the file has another ending, channels.tsv is absent, or a sidecar is none.
    """
    if not path.name.endswith(MOTION_ENDING):
        raise InputError(
            f"{path}: is not named as Motion-BIDS has it; expected a name that ends in {MOTION_ENDING}"
        )
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a recording")
    tables = list(_inherited(path, "channels", ".tsv"))
    if not tables:
        expected = path.name.removesuffix(MOTION_ENDING) + "_channels.tsv"
        raise InputError(
            f"{path}: no {expected} lies beside it; it says what the columns are, so copy it too"
        )
    return Sidecars(tables[-1], _channels(tables[-1]), _merged(path, "motion"), _merged(path, "channels"))


def _inherited(path: Path, suffix: str, ending: str) -> Iterator[Path]:
    """Give the sidecars that apply to a motion.tsv, the nearest and most specific last."""
    entities = set(path.name.removesuffix(MOTION_ENDING).split("_"))
    folders = [path.parent, *path.absolute().parent.parents[: _LEVELS - 1]]
    root = next((i for i, folder in enumerate(folders) if (folder / "dataset_description.json").is_file()), 0)
    for folder in reversed(folders[: root + 1]):
        found = []
        for candidate in sorted(folder.glob(f"*{suffix}{ending}")):
            *own, last = candidate.name.removesuffix(ending).split("_")
            if last == suffix and set(own) <= entities and candidate.is_file():
                found.append((len(own), candidate))
        yield from (candidate for _, candidate in sorted(found))


def _merged(path: Path, suffix: str) -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for sidecar in _inherited(path, suffix, ".json"):
        merged |= read_json(sidecar)
    return merged


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object; InputError where the file holds none."""
    try:
        loaded = json.loads(_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not valid JSON ({error}); expected an object") from error
    if not isinstance(loaded, dict):
        raise InputError(f"{path}: holds no JSON object; expected one, in braces")
    return loaded


def read_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    """Read a small TSV file with a header: its columns and its rows.

    Raises InputError where a row has another number of cells.
    """
    reader = csv.reader(io.StringIO(_text(path), newline=""), delimiter="\t", quoting=csv.QUOTE_NONE)
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


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text; save it as UTF-8") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def _channels(path: Path) -> tuple[Channel, ...]:
    header, rows = read_rows(path)
    missing = [name for name in _REQUIRED if name not in header]
    if missing:
        raise InputError(f"{path}: column {', '.join(missing)} is missing; found {', '.join(header)}")
    if not rows:
        raise InputError(f"{path}: has a header but no rows; expected one row a column of motion.tsv")
    channels = []
    for index, row in enumerate(rows):
        cells = dict(zip(header, row, strict=True))
        channels.append(
            Channel(
                index,
                cells["name"],
                cells["component"].lower(),
                cells["type"].upper(),
                cells["tracked_point"],
                cells["units"],
                cells.get("reference_frame", "n/a"),
            )
        )
    return tuple(channels)
