"""A mapping: how a lab's own file is to be read, each unit and convention said and none guessed."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError, listed
from shukotsu.schemas.config_files import check_config, read_yaml
from shukotsu.schemas.units import MM_PER_UNIT


@dataclass(frozen=True)
class FileMapping:
    """One mapping file, read and checked; the keys of `config` are those of `json/mapping.schema.json`."""

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
        """Return the file's axes that are x, y and z: each a letter, with a minus where it is negated."""
        return tuple(self.config.get("position_axes", "xyz"))

    @property
    def details(self) -> Mapping[str, Any]:
        """The group of keys that belongs to the format, defaults filled in; empty where there is none."""
        group: Mapping[str, Any] = self.config.get(self.format, {})
        return group


def read_mapping(path: Path) -> FileMapping:
    """Read a mapping file. Raises InputError where it is absent, no YAML or does not say enough."""
    return mapping_from_config(read_yaml(path, "mapping"), str(path))


def mapping_from_config(loaded: Any, where: str) -> FileMapping:
    """Check a loaded mapping, fill in its defaults; `where` names it in messages."""
    if isinstance(loaded, dict):
        # Before the schema does, and in words, what a draft or a first mapping most often gets wrong.
        if left := list(dict.fromkeys(_unedited(loaded, ""))):
            verb = "says" if len(left) == 1 else "say"
            raise InputError(f"{where}: {listed(left, 4)} still {verb} CHECK: put the truth there")
        _check_names(loaded, where)
    config = check_config(loaded, "mapping", where)
    odd = sorted({"csv", "c3d", "xdf"} & loaded.keys() - {config["format"]})
    if odd:
        raise InputError(f"{where}: {odd[0]}: is for another format; format is {config['format']}")
    _check_orientation(config, where)
    _check_position_axes(config, where)
    _check_receivers(config, where)
    if config["format"] in _CHECKS:
        _CHECKS[config["format"]](config, where)
    return FileMapping(
        where,
        config["format"],
        MM_PER_UNIT[config["position_unit"]],
        config.get("rate_hz"),
        config.get("orientation"),
        config["receivers"],
        tuple(config["fixed"]),
        config,
    )


_UNEDITED = re.compile(r"CHECK(\d+|_\w+)?")
"""What a drafted mapping has where the file cannot say the truth."""

_SEGMENT_NAME = re.compile(r"[a-z][a-z0-9_]*")


def _unedited(value: object, place: str) -> Iterator[str]:
    if isinstance(value, str) and _UNEDITED.fullmatch(value):
        yield place
    elif isinstance(value, list):
        for part in value:
            yield from _unedited(part, place)
    elif isinstance(value, Mapping):
        for key, part in value.items():
            inner = f"{place}.{key}" if place else str(key)
            if _UNEDITED.fullmatch(str(key)):
                yield inner
            yield from _unedited(part, inner)


def _check_names(loaded: Mapping[str, Any], where: str) -> None:
    """Refuse names that no segment has."""
    receivers = loaded.get("receivers")
    for name in receivers if isinstance(receivers, Mapping) else ():
        if not _SEGMENT_NAME.fullmatch(str(name)):
            bare = re.sub(r"[^a-z0-9]+", "_", str(name).lower()).strip("_")
            guess = f"; did you mean {bare!r}?" if _SEGMENT_NAME.fullmatch(bare) else ""
            raise InputError(
                f"{where}: receivers: {name!r} is no segment's name; names are lower case letters, digits "
                f"and underscores{guess}"
            )


_NEEDED = {"quaternion": ("order",), "euler": ("axes", "unit"), "matrix": ()}
_NUMBERS = {"quaternion": 4, "euler": 3, "matrix": 9}

_TURNED = {"c3d": "a C3D file needs", "sequence": "a sequence's transforms need"}

_RECEIVER_KEYS = {
    "wide": ("position", "orientation", "time", "quality"),
    "long": ("value",),
    "c3d": ("markers", "rotation"),
    "xdf": ("value",),
    "capture": ("value",),
    "sequence": ("value",),
}
"""The keys of a receiver that a format (of csv: its kind of rows) reads."""

_LONG_KEYS = ("receiver", "position", "orientation")
"""Of csv with long rows."""


def _check_orientation(config: Mapping[str, Any], where: str) -> None:
    orientation = config.get("orientation")
    if orientation is None:
        return
    if config["format"] in _TURNED:
        raise InputError(f"{where}: orientation: {_TURNED[config['format']]} none; leave it out")
    kind = orientation["kind"]
    missing = [key for key in _NEEDED[kind] if key not in orientation]
    if missing:
        raise InputError(f"{where}: orientation: {kind} needs the key {', '.join(map(repr, missing))}")
    odd = [key for key in ("order", "axes", "unit") if key in orientation and key not in _NEEDED[kind]]
    if odd:
        raise InputError(f"{where}: orientation.{odd[0]}: does not belong to {kind}; leave it out")
    axes = orientation.get("axes", "XYZ")
    if axes[0] == axes[1] or axes[1] == axes[2]:
        raise InputError(f"{where}: orientation.axes: {axes} turns twice in a row about one axis")


def _check_position_axes(config: Mapping[str, Any], where: str) -> None:
    axes = config["position_axes"]
    if sorted(axis[-1] for axis in axes) != ["x", "y", "z"]:
        raise InputError(f"{where}: position_axes: is {', '.join(axes)}; expected each of x, y and z once")
    if config["format"] == "c3d" and axes != ["x", "y", "z"]:
        raise InputError(
            f"{where}: position_axes: a C3D file has positions and rotations in one frame; leave it out"
        )


def _check_receivers(config: Mapping[str, Any], where: str) -> None:
    """Refuse keys that the format does not read, and a segment that both moves and is fixed."""
    name = config["csv"]["rows"] if config["format"] == "csv" else config["format"]
    what = f"csv with {name} rows" if config["format"] == "csv" else name
    known = _RECEIVER_KEYS[name]
    for segment, receiver in config["receivers"].items():
        odd = [key for key in receiver if key not in known]
        if odd:
            raise InputError(
                f"{where}: receivers.{segment}.{odd[0]}: does not belong to {what}, "
                f"which reads {', '.join(known) or 'no key here'}; leave it out"
            )
        if segment in config["fixed"]:
            raise InputError(f"{where}: fixed: {segment} has a receiver too; keep one of the two")


def _check_csv(config: Mapping[str, Any], where: str) -> None:
    table = config["csv"]
    if table["delimiter"] == table["decimal"]:
        raise InputError(f"{where}: csv.decimal: the comma cannot both separate cells and be a decimal mark")
    _check_rows(config, where)
    groups = [("csv", table), *((f"receivers.{name}", part) for name, part in config["receivers"].items())]
    for place, group in groups:
        _check_columns(group, place, config, where)
    _check_pair(groups, "time", [key for key in ("time_unit",) if key in table], "csv.time_unit", where)
    limits = [key for key in ("quality_above", "quality_below") if key in table]
    _check_pair(groups, "quality", limits, "csv.quality_above or csv.quality_below", where)
    timed = "time" in table or all("time" in part for part in config["receivers"].values())
    if not table["in_step"] and not (timed and "rate_hz" in config):
        raise InputError(
            f"{where}: csv.in_step: receivers that are not in step need a time column and rate_hz, "
            "the rate of the grid of frames that they are put on"
        )


def _check_rows(config: Mapping[str, Any], where: str) -> None:
    """Refuse keys that long rows need or wide rows do not have, and two receivers of one value."""
    table, long = config["csv"], config["csv"]["rows"] == "long"
    if "orientation" not in config:
        raise InputError(
            f"{where}: the key 'orientation' is missing: a receiver has positions and turns; say where"
        )
    missing = [key for key in _LONG_KEYS if key not in table]
    if long and missing:
        raise InputError(f"{where}: csv: long rows need the key {', '.join(map(repr, missing))}")
    odd = [key for key in (*_LONG_KEYS, "quality") if key in table]
    if odd and not long:
        raise InputError(f"{where}: csv.{odd[0]}: is for long rows; with wide rows give it to each receiver")
    seen: dict[str, str] = {}
    for segment, receiver in config["receivers"].items():
        for key in ("value",) if long else ("position", "orientation"):
            if key not in receiver:
                raise InputError(f"{where}: receivers.{segment}: the key {key!r} is missing")
        other = seen.setdefault(str(receiver.get("value", segment)), segment)
        if other != segment:
            raise InputError(
                f"{where}: receivers: {other} and {segment} both have value {receiver['value']!r}"
            )


def _check_columns(group: Mapping[str, Any], place: str, config: Mapping[str, Any], where: str) -> None:
    """Refuse a wrong count of orientation columns, and column names where there is no header."""
    columns, kind = group.get("orientation", []), config["orientation"]["kind"]
    if columns and len(columns) != _NUMBERS[kind]:
        raise InputError(
            f"{where}: {place}.orientation: has {len(columns)} columns; {kind} means {_NUMBERS[kind]}"
        )
    for key in ("position", "orientation", "time", "quality", "frame", "receiver"):
        named = group.get(key, [])
        for column in named if isinstance(named, list) else [named]:
            if isinstance(column, str) and not config["csv"]["header"]:
                raise InputError(
                    f"{where}: {place}.{key}: {column!r} is a name; without a header give numbers"
                )


def _check_pair(
    groups: Sequence[tuple[str, Mapping[str, Any]]], column: str, keys: list[str], needed: str, where: str
) -> None:
    """Refuse a column without the key that says how to read it, and that key without a column."""
    places = [place for place, group in groups if column in group]
    if places and not keys:
        raise InputError(f"{where}: {places[0]}.{column}: needs {needed}")
    if keys and not places:
        raise InputError(f"{where}: csv.{keys[0]}: no {column} column is named")


def _check_c3d(config: Mapping[str, Any], where: str) -> None:
    for segment, receiver in config["receivers"].items():
        if len(receiver) != 1:
            raise InputError(f"{where}: receivers.{segment}: needs either 'markers' or 'rotation'")
        markers = receiver.get("markers", [])
        if 0 < len(markers) < 3:
            raise InputError(
                f"{where}: receivers.{segment}.markers: has {len(markers)}; "
                "expected 3 or more of a rigid cluster"
            )
        twice = [marker for marker in markers if markers.count(marker) > 1]
        if twice:
            raise InputError(f"{where}: receivers.{segment}.markers: {twice[0]!r} is named twice")


def _check_capture(config: Mapping[str, Any], where: str) -> None:
    told = config["fixed"] or config["position_axes"] != ["x", "y", "z"]
    odd = [key for key in ("orientation", "rate_hz") if key in config]
    if told or odd:
        key = (odd or ["fixed" if config["fixed"] else "position_axes"])[0]
        raise InputError(f"{where}: {key}: a raw capture says it itself; leave it out")


_CHECKS: dict[str, Callable[[Mapping[str, Any], str], None]] = {
    "csv": _check_csv,
    "c3d": _check_c3d,
    "capture": _check_capture,
}
