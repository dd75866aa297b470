"""A mapping describes how to read a laboratory's own file format; no unit or convention is guessed."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError, count_of, list_names
from shukotsu.study.config_files import check_config, read_yaml
from shukotsu.study.file_formats import FORMATS
from shukotsu.tables.limits import MM_PER_UNIT


@dataclass(frozen=True)
class FileMapping:
    """The content of a mapping file; the keys of `config` are defined in `json/mapping.schema.json`."""

    where: str
    format: str
    mm_per_unit: float
    rate_hz: float | None
    orientation: Mapping[str, Any] | None
    receivers: Mapping[str, Mapping[str, Any]]
    fixed: tuple[str, ...]
    config: Mapping[str, Any]

    @property
    def position_axes(self) -> tuple[str, ...]:
        """The file's axes that become x, y and z: letters, each preceded by a minus if it is negated."""
        return tuple(self.config.get("position_axes", "xyz"))

    @property
    def details(self) -> Mapping[str, Any]:
        """The format's own group of keys with defaults filled in; empty if the format has none."""
        group: Mapping[str, Any] = self.config.get(self.format, {})
        return group


def read_mapping(path: Path, hand: str = "right") -> FileMapping:
    """Read a mapping file for a hand (right or left).

    Raises InputError if it does not exist, is not YAML, is incomplete or contradicts itself.
    """
    return mapping_from_config(read_yaml(path, "mapping"), str(path), hand)


def mapping_from_config(loaded: Any, where: str, hand: str = "right") -> FileMapping:
    """Check a loaded mapping and fill in its defaults.

    where : name of the mapping for messages. hand : right or left, which selects the receivers.
    Raises InputError if the mapping is incomplete or contradicts itself.
    """
    if isinstance(loaded, dict) and (fault := next(_first_faults(loaded), "")):
        raise InputError(f"{where}: {fault}")
    config = check_config(loaded, "mapping", where)
    if fault := next(_faults(config, loaded.keys()), ""):
        raise InputError(f"{where}: {fault}")
    if "left_receivers" in config:
        others = {key: value for key, value in loaded.items() if key != "left_receivers"}
        of_left = mapping_from_config(others | {"receivers": loaded["left_receivers"]}, where)
        return of_left if hand == "left" else replace(of_left, receivers=config["receivers"])
    mm_per_unit, fixed = MM_PER_UNIT[config["position_unit"]], tuple(config["fixed"])
    rate_hz, orientation = config.get("rate_hz"), config.get("orientation")
    receivers = config["receivers"]
    return FileMapping(where, config["format"], mm_per_unit, rate_hz, orientation, receivers, fixed, config)


_UNEDITED = re.compile(r"CHECK(\d+|_\w+)?")
"""Placeholder in a drafted mapping for a value that cannot be inferred from the file."""

_SEGMENT_NAME = re.compile(r"[a-z][a-z0-9_]*")


def _unedited_keys(value: object, path: str) -> Iterator[str]:
    if isinstance(value, str) and _UNEDITED.fullmatch(value):
        yield path
    elif isinstance(value, list):
        for part in value:
            yield from _unedited_keys(part, path)
    elif isinstance(value, Mapping):
        for key, part in value.items():
            inner = f"{path}.{key}" if path else str(key)
            if _UNEDITED.fullmatch(str(key)):
                yield inner
            yield from _unedited_keys(part, inner)


def _first_faults(loaded: Mapping[str, Any]) -> Iterator[str]:
    """Yield messages about the most frequent mistakes that are clearer than those of the schema check."""
    if places := list(dict.fromkeys(_unedited_keys(loaded, ""))):
        verb = "says" if len(places) == 1 else "say"
        yield f"{list_names(places, 4)} still {verb} CHECK: put the truth there"
    receivers = loaded.get("receivers")
    for name in receivers if isinstance(receivers, Mapping) else ():
        if not _SEGMENT_NAME.fullmatch(str(name)):
            bare = re.sub(r"[^a-z0-9]+", "_", str(name).lower()).strip("_")
            guess = f"; did you mean {bare!r}?" if _SEGMENT_NAME.fullmatch(bare) else ""
            yield (
                f"receivers: {name!r} is not a valid segment name; names are lower case letters, digits and "
                f"underscores{guess}"
            )


_NEEDED = {"quaternion": ("order",), "euler": ("axes", "unit"), "rotation-vector": ("unit",), "matrix": ()}
_NUMBERS = {"quaternion": 4, "euler": 3, "rotation-vector": 3, "matrix": 9}

_WIDE_KEYS = ("position", "orientation", "time", "quality")
"""Keys that a receiver can have in a mapping of format csv with wide rows."""

_LONG_KEYS = ("receiver", "position", "orientation")
"""Keys that the group `csv` must have with long rows."""


def _faults(config: Mapping[str, Any], keys: Collection[str]) -> Iterator[str]:
    """Yield messages about contradictions that the schema allows; keys : those in the file, not defaults."""
    form, axes = config["format"], config["position_axes"]
    odd = sorted(FORMATS.keys() & {*keys} - {form})
    if odd:
        yield f"{odd[0]}: is for another format; format is {form}"
    if "orientation" in config:
        yield from _orientation_faults(form, config["orientation"])
    if sorted(axis[-1] for axis in axes) != ["x", "y", "z"]:
        yield f"position_axes: is {', '.join(axes)}; expected each of x, y and z once"
    if form == "c3d" and axes != ["x", "y", "z"]:
        yield "position_axes: a C3D file has positions and rotations in one frame; leave it out"
    rows = config["csv"]["rows"] if form == "csv" else ""
    reads = _WIDE_KEYS if rows == "wide" else FORMATS[form].receiver_keys
    for segment, receiver in config["receivers"].items():
        odd = [key for key in receiver if key not in reads]
        if odd:
            what = " ".join(("csv with", rows, "rows")) if rows else form
            yield (
                f"receivers.{segment}.{odd[0]}: does not belong to {what}, which reads "
                f"{', '.join(reads) or 'no key here'}; leave it out"
            )
        if segment in config["fixed"]:
            yield f"fixed: {segment} has a receiver too; keep one of the two"
    if form == "csv":
        yield from _csv_faults(config)
    if form == "c3d":
        yield from _c3d_faults(config["receivers"])
    if form == "capture":
        stated = {name: name in config for name in ("orientation", "rate_hz")}
        stated |= {"fixed": bool(config["fixed"]), "position_axes": axes != ["x", "y", "z"]}
        if key := next((name for name, is_stated in stated.items() if is_stated), None):
            yield f"{key}: is stated in the raw capture itself; leave it out"


def _orientation_faults(form: str, orientation: Mapping[str, Any]) -> Iterator[str]:
    kind, axes = orientation["kind"], orientation.get("axes", "XYZ")
    if subject_and_verb := FORMATS[form].needs_no_orientation:
        yield f"orientation: {subject_and_verb} none; leave it out"
    missing = [key for key in _NEEDED[kind] if key not in orientation]
    if missing:
        yield f"orientation: {kind} needs the key {', '.join(map(repr, missing))}"
    odd = [key for key in ("order", "axes", "unit") if key in orientation and key not in _NEEDED[kind]]
    if odd:
        yield f"orientation.{odd[0]}: does not belong to {kind}; leave it out"
    if axes[0] == axes[1] or axes[1] == axes[2]:
        yield f"orientation.axes: {axes} rotates twice in a row about the same axis"


def _csv_faults(config: Mapping[str, Any]) -> Iterator[str]:
    table, receivers, long = config["csv"], config["receivers"], config["csv"]["rows"] == "long"
    if table["delimiter"] == table["decimal"]:
        yield "csv.decimal: the comma cannot both separate cells and be a decimal mark"
    if "orientation" not in config:
        yield "the key 'orientation' is missing: state how the file represents the receivers' orientations"
    missing = [key for key in _LONG_KEYS if key not in table]
    if long and missing:
        yield f"csv: long rows need the key {', '.join(map(repr, missing))}"
    odd = [key for key in (*_LONG_KEYS, "quality") if key in table]
    if odd and not long:
        yield f"csv.{odd[0]}: is for long rows; with wide rows give it to each receiver"
    segments: dict[str, str] = {}
    for segment, receiver in receivers.items():
        for key in ("value",) if long else ("position", "orientation"):
            if key not in receiver:
                yield f"receivers.{segment}: the key {key!r} is missing"
        other = segments.setdefault(str(receiver.get("value", segment)), segment)
        if other != segment:
            yield f"receivers: {other} and {segment} both have value {receiver['value']!r}"
    groups = [("csv", table), *((f"receivers.{name}", part) for name, part in receivers.items())]
    for path, group in groups:
        columns, kind = group.get("orientation", []), config["orientation"]["kind"]
        if columns and len(columns) != _NUMBERS[kind]:
            yield f"{path}.orientation: has {count_of(len(columns), 'column')}; {kind} means {_NUMBERS[kind]}"
        for key in ("position", "orientation", "time", "nanoseconds", "quality", "frame", "receiver"):
            cell = group.get(key, [])
            for column in cell if isinstance(cell, list) else [cell]:
                if isinstance(column, str) and not table["header"]:
                    yield f"{path}.{key}: {column!r} is a name; without a header give numbers"
    if "nanoseconds" in table and table.get("time_unit") != "s":
        yield "csv.nanoseconds: is added to a time column of whole seconds, with time_unit: s"
    for column, keys in (("time", ["time_unit"]), ("quality", ["quality_above", "quality_below"])):
        paths = [path for path, group in groups if column in group]
        units = [key for key in keys if key in table]
        if paths and not units:
            yield f"{paths[0]}.{column}: needs {' or '.join(f'csv.{key}' for key in keys)}"
        if units and not paths:
            yield f"csv.{units[0]}: no {column} column is named"
    timed = "time" in table or all("time" in part for part in receivers.values())
    if not table["in_step"] and not (timed and "rate_hz" in config):
        yield (
            "csv.in_step: receivers that are not in step need a time column and rate_hz, the rate of the "
            "grid of frames that they are put on"
        )


def _c3d_faults(receivers: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    for segment, receiver in receivers.items():
        if len(receiver) != 1:
            yield f"receivers.{segment}: needs either 'markers' or 'rotation'"
        markers = receiver.get("markers", [])
        if 0 < len(markers) < 3:
            yield f"receivers.{segment}.markers: has {len(markers)}; expected 3 or more of a rigid cluster"
        for marker in markers:
            if markers.count(marker) > 1:
                yield f"receivers.{segment}.markers: {marker!r} is named twice"
