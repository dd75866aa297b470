"""The files beside a `*_motion.tsv` that say what its columns are, found by BIDS's inheritance principle."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.bids.channels import OWN_KEY
from schemas.bids.dataset_files import read_rows, read_text
from schemas.errors import InputError

MOTION_ENDING = "_motion.tsv"

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

    @property
    def title(self) -> str:
        """What the column goes by, which has no header and whose name may be another's too."""
        return f"{self.index + 1} ({self.name})"


@dataclass(frozen=True)
class Sidecars:
    """What the files beside a motion.tsv say; both JSON objects are empty where there is no file."""

    channels_path: Path
    channels: tuple[Channel, ...]
    motion: Mapping[str, Any]
    channels_json: Mapping[str, Any]

    def of_type(self, kind: str, point: str) -> list[Channel]:
        """Channels of a type and a tracked point, in the order of the columns."""
        return [c for c in self.channels if c.type == kind and c.tracked_point == point]

    def points(self) -> tuple[str, ...]:
        """The tracked points that have a position or an orientation, in the order of the columns."""
        posed = [c.tracked_point for c in self.channels if c.type in ("POS", "ORNT")]
        return tuple(dict.fromkeys(point for point in posed if point != "n/a"))

    def own(self) -> Mapping[str, Any]:
        """What this program's exporter wrote; empty in a file of others."""
        content = self.motion.get(OWN_KEY, {})
        return content if isinstance(content, dict) else {}

    def frame_levels(self, frame: str) -> Mapping[str, Any]:
        """What channels.json says of a reference frame; empty where it says nothing."""
        content: Any = self.channels_json
        for key in ("reference_frame", "Levels", frame):
            content = content.get(key) if isinstance(content, dict) else None
        return content if isinstance(content, dict) else {}

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
        sidecars = []
        for candidate in sorted(folder.glob(f"*{suffix}{ending}")):
            *own, last = candidate.name.removesuffix(ending).split("_")
            if last == suffix and set(own) <= entities and candidate.is_file():
                sidecars.append((len(own), candidate))
        yield from (candidate for _, candidate in sorted(sidecars))


def _merged(path: Path, suffix: str) -> dict[str, Any]:
    """The keys of the JSON sidecars that apply; InputError where one holds no object."""
    merged: dict[str, Any] = {}
    for sidecar in _inherited(path, suffix, ".json"):
        try:
            loaded = json.loads(read_text(sidecar))
        except (ValueError, RecursionError) as error:
            raise InputError(f"{sidecar}: is not valid JSON ({error}); expected an object") from error
        if not isinstance(loaded, dict):
            raise InputError(f"{sidecar}: holds no JSON object; expected one, in braces")
        merged |= loaded
    return merged


def _channels(path: Path) -> tuple[Channel, ...]:
    header, rows = read_rows(path)
    missing = [name for name in _REQUIRED if name not in header]
    if missing:
        raise InputError(f"{path}: column {', '.join(missing)} is missing; found {', '.join(header)}")
    if not rows:
        raise InputError(f"{path}: has a header but no rows; expected one row a column of motion.tsv")
    return tuple(
        Channel(
            index,
            cells["name"],
            cells["component"].lower(),
            cells["type"].upper(),
            cells["tracked_point"],
            cells["units"],
            cells.get("reference_frame", "n/a"),
        )
        for index, cells in enumerate(dict(zip(header, row, strict=True)) for row in rows)
    )
