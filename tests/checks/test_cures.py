"""The cures in findings work: applied literally to file, mapping, layout or sheet, they leave no finding, and
joints are where they are without the mistake.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pytest
from scipy.spatial.transform import Rotation
from simulated_poses import hand_of

from benchmarks.faultless_hands import Planted, changed, exchange_receivers
from benchmarks.mistakes import BONES, MISTAKES
from shukotsu.checks.checked_subject import checked_poses
from shukotsu.checks.hypotheses import SENSES
from shukotsu.fit.fit import FitSettings, fit_hand
from shukotsu.hand.rotations import Array, about_axis, conjugate, multiply, unit
from shukotsu.readers.import_recording import import_for_the_moment
from shukotsu.simulate import recording
from shukotsu.simulate.simulation import LAYOUT
from shukotsu.study import findings
from shukotsu.study.config_files import config_path, loaded_yaml, read_config, yaml_text
from shukotsu.study.findings import Finding
from shukotsu.study.layout import Layout, read_layout
from shukotsu.tables.limits import MM_PER_UNIT, SECONDS_PER_UNIT
from shukotsu.tables.poses import NUMBERS, Poses, read_poses

PARTS = {
    "quaternion": ("1", "2", "3", "4"),
    "euler": ("az", "el", "ro"),
    "rotation-vector": ("rx", "ry", "rz"),
}
MOST_TIMES = 6


@dataclass(frozen=True)
class LabFile:
    """A recording as a laboratory brings it.

    table : the file's columns by title; without a mapping one row per receiver and frame, else one per frame.
    mapping, layout : contents of their YAML files. sheet : the recording's row of the sheet, by column.
    """

    table: Mapping[str, Any]
    mapping: Mapping[str, Any] | None
    layout: Mapping[str, Any]
    sheet: Mapping[str, str]

    @property
    def receivers(self) -> dict[str, dict[str, Any]]:
        """The mapping's columns by segment."""
        receivers: dict[str, dict[str, Any]] = (self.mapping or {}).get("receivers", {})
        return receivers

    @property
    def worn(self) -> list[str]:
        """Segments that have a receiver."""
        return [*self.receivers] or [name for name in self.layout["segments"] if self.rows(name).any()]

    def columns(self, segment: str) -> list[str]:
        """Return the titles of the receiver's columns of numbers."""
        if self.mapping is None:
            return [*NUMBERS]
        return [*self.receivers[segment]["position"], *self.receivers[segment]["orientation"]]

    def rows(self, segment: str) -> Any:
        """Return an index of the receiver's rows."""
        if self.mapping is not None:
            return slice(None)
        if "segment" in self.table:
            return self.table["segment"] == segment
        return self.table["receiver"] == self.layout["segments"][segment].get("receiver")

    def numbers(self, segment: str) -> Array:
        """Return the receiver's numbers, (frames, N)."""
        return np.stack([self.table[title][self.rows(segment)] for title in self.columns(segment)], -1)

    def repeats(self, segment: str) -> Any:
        """Return whether the receiver's numbers repeat those of the previous frame, (F,)."""
        numbers = self.numbers(segment)
        return np.concatenate([[False], (numbers[1:] == numbers[:-1]).all(-1)])

    def emptied(self, segment: str, frames: Any) -> LabFile:
        """Return the file with the receiver's numbers empty in the given frames."""
        table = {title: column.copy() for title, column in self.table.items()}
        for title in self.columns(segment):
            table[title][np.arange(len(table[title]))[self.rows(segment)][frames]] = np.nan
        return replace(self, table=table)

    def with_columns(self, **columns: Any) -> LabFile:
        """Return the file with columns replaced or added."""
        return replace(self, table={**self.table, **columns})

    def with_keys(self, **keys: Any) -> LabFile:
        """Return the recording with keys of its mapping replaced or added; it must have a mapping."""
        assert self.mapping is not None, f"there is no mapping to write {keys} into"
        return replace(self, mapping={**self.mapping, **keys})

    def with_segments(self, keys: Mapping[str, Mapping[str, Any]]) -> LabFile:
        """Return the recording with keys of its layout's segments replaced or added."""
        before = self.layout["segments"]
        changed = {name: {**before[name], **anew} for name, anew in keys.items()}
        return replace(self, layout={**self.layout, "segments": {**before, **changed}})


def tidy(planted: Planted) -> LabFile:
    columns = recording.tidy(planted.poses).to_pydict()
    layout = read_config(config_path(LAYOUT, "layout", Path()), "layout")
    table = {name: np.array(column) for name, column in columns.items()}
    return LabFile(table, None, layout, {"hand": planted.hand})


def with_stations(planted: Planted) -> LabFile:
    lab_file = tidy(planted)
    table, segments = dict(lab_file.table), lab_file.layout["segments"]
    table["receiver"] = np.array([segments[name]["receiver"] for name in table.pop("segment")])
    return replace(lab_file, table=table)


def wide(planted: Planted) -> LabFile:
    """Return one row per frame: centimetres, milliseconds, quaternions x, y, z, w of the inverse rotation."""
    orientation = {"kind": "quaternion", "order": "xyzw", "rotates": SENSES[1]}
    numbers = conjugate(planted.poses.quaternion)[..., [1, 2, 3, 0]]
    return _row_a_frame(planted, numbers, orientation, "cm", "ms")


def angles(planted: Planted) -> LabFile:
    """Return one row per frame: inches, seconds, azimuth, elevation and roll in degrees."""
    quaternion = planted.poses.quaternion
    turns = Rotation.from_quat(quaternion.reshape(-1, 4), scalar_first=True)
    numbers = turns.as_euler("ZYX", degrees=True).reshape(*quaternion.shape[:2], 3)
    return _row_a_frame(planted, numbers, {"kind": "euler", "axes": "ZYX", "unit": "deg"}, "inch", "s")


def vectors(planted: Planted) -> LabFile:
    """Return one row per frame: millimetres, seconds, rotation vectors in degrees."""
    quaternion = planted.poses.quaternion
    turns = Rotation.from_quat(quaternion.reshape(-1, 4), scalar_first=True)
    numbers = turns.as_rotvec(degrees=True).reshape(*quaternion.shape[:2], 3)
    return _row_a_frame(planted, numbers, {"kind": "rotation-vector", "unit": "deg"}, "mm", "s")


def _row_a_frame(
    planted: Planted, turning: Array, orientation: Mapping[str, str], unit: str, time_unit: str
) -> LabFile:
    poses, receivers = planted.poses, {}
    table = {"t": poses.time_s / SECONDS_PER_UNIT[time_unit]}
    for index, segment in enumerate(poses.segments):
        position = [f"{segment} {axis}" for axis in "xyz"]
        turns = [f"{segment} {part}" for part in PARTS[orientation["kind"]]]
        table |= dict(zip(position, poses.position_mm[:, index].T / MM_PER_UNIT[unit], strict=True))
        table |= dict(zip(turns, turning[:, index].T, strict=True))
        receivers[segment] = {"position": position, "orientation": turns}
    csv = {"time": "t", "time_unit": time_unit}
    mapping = {"format": "csv", "position_unit": unit, "orientation": orientation, "receivers": receivers}
    return replace(tidy(planted), table=table, mapping={**mapping, "csv": csv})


Door = Callable[[Planted], LabFile]


@dataclass(frozen=True)
class Result:
    """The findings in a recording, and the poses, layout and hand from which joints are solved."""

    findings: tuple[Finding, ...] = ()
    recordings: tuple[Poses, ...] = ()
    layout: Layout | None = None
    hand: str = ""

    @property
    def to_do(self) -> list[str]:
        """Messages of the findings that ask for an action."""
        messages = [finding.message for finding in self.findings]
        return [message for message in messages if not re.search("nothing (more )?has to be done", message)]

    @cached_property
    def centre_mm(self) -> dict[str, Array]:
        """Joint centres (2, 3) of the whole-hand fit in mm, along the axes of both bones, by joint."""
        if self.layout is None:
            return {}
        quick, segments = FitSettings(n_frames=40, rounds=0), self.layout.segments
        joints = fit_hand(self.recordings, self.layout, self.hand, settings=quick).joints
        centre_mm = {}
        for name, joint in joints.items():
            in_parent = segments[joint.parent_segment].axes.T @ joint.parent_mm
            in_child = segments[joint.child_segment].axes.T @ joint.child_mm
            centre_mm[name] = np.array([in_parent, in_child])
        return centre_mm


def check(lab_file: LabFile) -> Result:
    """Import and check a recording as `shukotsu check FILE` does, and solve its joints."""
    if lab_file.sheet.get("exclude"):
        return Result()
    hand = lab_file.sheet["hand"]
    with TemporaryDirectory() as name:
        folder = Path(name)
        poses, layout, mapping = (folder / name for name in ("poses.parquet", "own.yaml", "mapping.yaml"))
        layout.write_text(yaml_text({**lab_file.layout, "layout": "own"}), "utf-8")
        columns = {title: pa.array(column, from_pandas=True) for title, column in lab_file.table.items()}
        pyarrow.csv.write_csv(pa.table(columns), folder / "recording.csv")
        options = ["--repair-hemisphere"] * (lab_file.sheet.get("hemisphere") == "repair")
        if lab_file.mapping is not None:
            mapping.write_text(yaml_text(lab_file.mapping), "utf-8")
            options.append(f"--mapping={mapping}")
        with redirect_stderr(StringIO()):  # notes of the import
            import_for_the_moment(folder / "recording.csv", str(layout), hand, poses, *options)
        worn = read_layout(layout)
        checked = checked_poses(poses, worn.of_hand(hand))
        seen = tuple(name for name in worn.expected if name != "forearm")
        return Result(checked.findings, (read_poses(poses, seen),), worn, hand)


# --- following the cures ----------------------------------------------------------------------------------

Follow = Callable[[re.Match[str], LabFile, LabFile], LabFile]
"""Applies a cure's matched words to a recording; the last argument is the faultless recording, for what only
its laboratory can look up.
"""


def with_cures_applied(lab_file: LabFile, right: LabFile) -> tuple[Result, Result]:
    """Apply the first finding's cure, check again, and repeat until no new finding appears.

    Return the results of the first and the last check. right : the faultless recording.
    """
    first = last = check(lab_file)
    done: set[str] = set()
    while (left := last.to_do) and left[0] not in done and len(done) < MOST_TIMES:
        done.add(left[0])
        words, follow = next(
            (words, follow) for pattern, follow in RULES if (words := re.search(pattern, left[0]))
        )
        lab_file = follow(words, lab_file, right)
        last = check(lab_file)
    return first, last


def _written(text: str) -> dict[str, Any]:
    """Read the text between backticks as YAML."""
    codes = re.findall("`([^`]+)`", text)
    return {key: value for code in codes for key, value in loaded_yaml(code, "a cure").items()}


def _key_under(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    return lab_file.with_keys(**{words[2]: {**(lab_file.mapping or {})[words[2]], **_written(words[1])}})


def _fixed_axes(words: re.Match[str], lab_file: LabFile, right: LabFile) -> LabFile:
    return _reversed_columns(_key_under(words, lab_file, right))


def _not_in_step(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    """Add the tracker's rate, which its owner knows: here that of the distinct values."""
    csv = {**(lab_file.mapping or {})["csv"], **_written(words[1])}
    times = lab_file.table[csv["time"]][~lab_file.repeats(lab_file.worn[0])]
    interval_s = np.median(np.diff(times)) * SECONDS_PER_UNIT[csv["time_unit"]]
    return lab_file.with_keys(csv=csv, rate_hz=float(1 / interval_s))


def _pairs(words: re.Match[str]) -> dict[str, str]:
    """Return each segment's partner, in both directions."""
    pairs = re.findall(r"(\w+) (?:and|with) (\w+)", words["pairs"])
    return dict(pairs) | {second: first for first, second in pairs}


def _names(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    return _renamed_receivers(lab_file, _pairs(words))


def _renamed_receivers(lab_file: LabFile, partners: Mapping[str, str]) -> LabFile:
    receivers = {partners.get(name, name): columns for name, columns in lab_file.receivers.items()}
    return lab_file.with_keys(receivers=receivers)


def _names_in_file(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    """Exchange names in the file's column segment or, if the file has stations, in the layout."""
    partners = _pairs(words)
    if "segment" in lab_file.table:
        names = lab_file.table["segment"]
        return lab_file.with_columns(segment=np.array([partners.get(name, name) for name in names]))
    segments = lab_file.layout["segments"]
    stations = {name: {"receiver": segments[other]["receiver"]} for name, other in partners.items()}
    return lab_file.with_segments(stations)


def _exchanged_numbers(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    """Exchange numbers in the given frames: of the column frame, or row numbers in a file without it."""
    table, pair = {title: column.copy() for title, column in lab_file.table.items()}, (words[1], words[2])
    for here, there in (pair, pair[::-1]):
        frame = table["frame"] if "frame" in table else np.arange(len(table["t"]))
        rows, others = (np.arange(len(frame))[lab_file.rows(name)] for name in (here, there))
        among = (frame[rows] >= int(words[3])) & (frame[rows] <= int(words[4]))
        for title, other in zip(lab_file.columns(here), lab_file.columns(there), strict=True):
            table[title][rows[among]] = lab_file.table[other][others[among]]
    return replace(lab_file, table=table)


def _added(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    late = float(words[1]) * (lab_file.table["frame"] >= int(words[2]))
    return lab_file.with_columns(time_s=lab_file.table["time_s"] + late)


def _renamed(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    old, new = (part.split(", ") for part in (words[1], words[2]))
    columns = {title: lab_file.table[name] for name, title in zip(old, new, strict=True)}
    return _negated(words[3] or "", lab_file.with_columns(**columns))


def _negated(names: str, lab_file: LabFile) -> LabFile:
    return lab_file.with_columns(**{name: -lab_file.table[name] for name in re.findall(r"\w+_mm|q\w", names)})


def _multiplied(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    names = ["time_s"] if words[1] == "the times" else re.findall(r"\w+_mm|time_s", words[1])
    return lab_file.with_columns(**{name: lab_file.table[name] * float(words[2]) for name in names})


def _in_place(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    new, old = (part.split(", ") for part in (words[1], words[2]))
    moved = {
        name: (-1.0 if taken.startswith("-") else 1.0) * lab_file.table[taken.lstrip("-")]
        for name, taken in zip(old, new, strict=True)
    }
    return lab_file.with_columns(**moved)


def _spiked(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    """Empty the poses in the named frames, as the file numbers them."""
    for segment, frame in re.findall(r"(\w+) in frame (\d+)", words[1]):
        lab_file = lab_file.emptied(segment, lab_file.table["frame"][lab_file.rows(segment)] == int(frame))
    return lab_file


def _zeroed(_words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    """Empty every pose at 0, 0, 0 with the identity rotation, as a quaternion or as zero angles."""
    for segment in lab_file.worn:
        numbers = lab_file.numbers(segment)
        lab_file = lab_file.emptied(segment, (numbers[:, :3] == 0).all(-1) & (np.abs(numbers).sum(-1) <= 1))
    return lab_file


def _stuck(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    return lab_file.emptied(words[1], lab_file.repeats(words[1]))


def _rows_left_out(_words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    kept = np.ones(len(lab_file.table["frame"]), bool)
    for segment in lab_file.worn:
        kept[lab_file.rows(segment)] = ~lab_file.repeats(segment)
    return replace(lab_file, table={title: column[kept] for title, column in lab_file.table.items()})


def _in_layout(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    return replace(lab_file, layout={**lab_file.layout, **_written(words[1])})


def _under_segment(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    return lab_file.with_segments({words[2]: _written(words[1])})


def _in_sheet(column: str, value: str) -> Follow:
    return lambda _words, lab_file, _: replace(lab_file, sheet={**lab_file.sheet, column: value})


def _other_hand(words: re.Match[str], lab_file: LabFile, right: LabFile) -> LabFile:
    """Apply the one of two alternatives that is true of the recording, as its laboratory would know."""
    if right.sheet["hand"] == words[1]:
        return replace(lab_file, sheet={**lab_file.sheet, "hand": words[1]})
    assert right.sheet["hand"] == words[2]
    return right if words[3].startswith("export it") else _negated(words[3], lab_file)


def _looked_up(_words: re.Match[str], _changed_file: LabFile, right: LabFile) -> LabFile:
    return right


def _not_worn(words: re.Match[str], lab_file: LabFile, _: LabFile) -> LabFile:
    return lab_file.with_segments(dict.fromkeys(re.findall(r"\w+_\w+", words[1]), _written(words[2])))


RULES: Sequence[tuple[str, Follow]] = (
    (r"(?:pose of|receiver for) (.+), which the layout .* write (`[^`]+`) under these segments", _not_worn),
    (
        r"write (`axes: \w+`) under `(orientation)` in the mapping, and reverse the order of the columns",
        _fixed_axes,
    ),
    (r"write (`in_step: false`) under `csv` and the tracker's `rate_hz` in the mapping", _not_in_step),
    (r"write ((?:`[^`]+`(?: and )?)+) under `(\w+)` in the mapping", _key_under),
    (r"write (`[^`]+`) in the mapping", lambda words, lab_file, _: lab_file.with_keys(**_written(words[1]))),
    (r"exchange these names under `receivers` in the mapping: (?P<pairs>.+)\.", _names),
    (r"exchange these names in the file's column .* in the layout: (?P<pairs>.+)\.", _names_in_file),
    (r"rename the file's columns (.+) to ([^.]+?)(?:, and negate (.+))?\.$", _renamed),
    (r"; negate (.+) in the file", lambda words, lab_file, _: _negated(words[1], lab_file)),
    (
        r"receivers (\w+) and (\w+) are exchanged.*exchange the numbers of .* in frames (\d+) to (\d+)",
        _exchanged_numbers,
    ),
    (r"add (\S+) s to all times from frame (\d+) on in the file", _added),
    (r"multiply (.+) by (\S+) in the file", _multiplied),
    (r"put (\S+_mm, \S+_mm, \S+_mm) in place of (.+) in the file", _in_place),
    (r"such as (.*?): .*leave the numbers of these poses empty in the file, and check again", _spiked),
    (r"0, 0, 0 without rotation.*leave the numbers of these poses empty in the file", _zeroed),
    (r"The receiver (\w+) .*leave its numbers empty where they repeat the previous ones", _stuck),
    (r"delete the rows of the file that repeat those of the frame before", _rows_left_out),
    (r"write (`[^`]+`) under the segment (\w+) in the layout", _under_segment),
    (r"write (`[^`]+`) in the layout", _in_layout),
    (r"write `repair` in the column hemisphere of the recordings sheet", _in_sheet("hemisphere", "repair")),
    (
        r"write `(\w+)` in the column hand of the recordings sheet .*; or, if it is a (\w+) hand and the "
        r"file is mirrored, (.+)\.",
        _other_hand,
    ),
    (r"give a reason under `exclude` in the recordings sheet", _in_sheet("exclude", "too short")),
    (r"name the right columns in the mapping|put the right columns into the file", _looked_up),
    (r"name separate columns or a separate `value` for each of them in the mapping", _looked_up),
    (r"export the file again, with separate numbers for each receiver", _looked_up),
)
"""What to do, by a regular expression that matches the cure."""


# --- planted mistakes -------------------------------------------------------------------------------------

Plant = Callable[[Planted, Door, np.random.Generator], LabFile]


@dataclass(frozen=True)
class Case:
    """A mistake planted in a recording that is brought in one of the file forms (door).

    planted : what is wrong, in words. other_frames : whether the cure changes the frames that joints are
    solved from: it leaves poses out, or receivers are turned, whose axes decide which postures are sampled.
    """

    key: str
    planted: str
    door: Door
    plant: Plant
    other_frames: bool = False

    @property
    def name(self) -> str:
        """Description for the test's id."""
        return f"{self.key}, {self.door.__name__}: {self.planted}"


def _recorded(*names: str) -> Plant:
    def plant(planted: Planted, door: Door, rng: np.random.Generator) -> LabFile:
        for name in names:
            planted = MISTAKES[name][1](planted, rng)
        return door(planted)

    return plant


def _numbers(change: Callable[[Planted], Planted]) -> Plant:
    return lambda planted, door, _: door(change(planted))


def _changed_file(change: Callable[[LabFile], LabFile]) -> Plant:
    return lambda planted, door, _: change(door(planted))


def _in_mapping(group: str = "", **keys: Any) -> Plant:
    def change(lab_file: LabFile) -> LabFile:
        return lab_file.with_keys(**({group: {**(lab_file.mapping or {})[group], **keys}} if group else keys))

    return _changed_file(change)


def _swapped(*pairs: tuple[str, str]) -> Plant:
    partners = dict(pairs) | {second: first for first, second in pairs}
    return _changed_file(lambda lab_file: _renamed_receivers(lab_file, partners))


def _reversed_columns(lab_file: LabFile) -> LabFile:
    receivers = lab_file.receivers.items()
    reverse = {name: {**each, "orientation": each["orientation"][::-1]} for name, each in receivers}
    return lab_file.with_keys(receivers=reverse)


def _both(first: Plant, second: Plant) -> Plant:
    """Plant two mistakes at once, the second in the mapping."""
    return lambda planted, door, rng: second(planted, lambda _: first(planted, door, rng), rng)


def _clocked(planted: Planted, fall_s: float) -> Planted:
    return changed(planted, time_s=planted.poses.time_s - fall_s * (planted.poses.time_s > 2))


def _mirrored(planted: Planted) -> Planted:
    position, quaternion = planted.poses.position_mm * [1, -1, 1], planted.poses.quaternion * [1, -1, 1, -1]
    return changed(planted, position_mm=position, quaternion=quaternion)


def _half_the_rate(planted: Planted) -> Planted:
    rows = np.arange(len(planted.poses.frame)) // 2 * 2
    poses = planted.poses
    return changed(planted, position_mm=poses.position_mm[rows], quaternion=poses.quaternion[rows])


def _some_off(planted: Planted, door: Door, rng: np.random.Generator) -> LabFile:
    position = planted.poses.position_mm.copy()
    for row in rng.choice(np.arange(10, len(position) - 10, 10), 4, replace=False):
        position[row, rng.integers(position.shape[1])] += 85 * unit(rng.normal(size=3))
    return door(changed(planted, position_mm=position))


def _zeros(planted: Planted, door: Door, rng: np.random.Generator) -> LabFile:
    position, quaternion = planted.poses.position_mm.copy(), planted.poses.quaternion.copy()
    for receiver in rng.choice(position.shape[1], 2, replace=False):
        position[200:300, receiver], quaternion[200:300, receiver] = 0, [1, 0, 0, 0]
    return door(changed(planted, position_mm=position, quaternion=quaternion))


def _turned(planted: Planted) -> Planted:
    """Turn the receiver over the ring finger's middle phalanx by 180 deg about its y axis."""
    quaternion, receiver = planted.poses.quaternion.copy(), planted.poses.index("ring_middle")
    quaternion[:, receiver] = multiply(quaternion[:, receiver], about_axis(np.eye(3)[1], np.pi))
    return changed(planted, quaternion=quaternion)


def _inverse_xyzw(planted: Planted) -> Planted:
    return changed(planted, quaternion=conjugate(planted.poses.quaternion)[..., [1, 2, 3, 0]])


def _scalar_first_under_xyzw(planted: Planted) -> Planted:
    return changed(planted, quaternion=planted.poses.quaternion[..., [3, 0, 1, 2]])


def _change_places(planted: Planted) -> Planted:
    poses = planted.poses
    swapped = exchange_receivers(poses, ("index_middle", "ring_middle"))
    late, names = (poses.frame > 450)[:, None, None], ("position_mm", "quaternion")
    return changed(planted, **{n: np.where(late, getattr(swapped, n), getattr(poses, n)) for n in names})


def _in_radians(lab_file: LabFile) -> LabFile:
    titles = [title for receiver in lab_file.receivers.values() for title in receiver["orientation"]]
    return lab_file.with_columns(**{title: np.radians(lab_file.table[title]) for title in titles})


def _twice(planted: Planted) -> Planted:
    position, quaternion = planted.poses.position_mm.copy(), planted.poses.quaternion.copy()
    first, second = (planted.poses.index(f"index_{bone}") for bone in ("middle", "distal"))
    position[:, first], quaternion[:, first] = position[:, second], quaternion[:, second]
    return changed(planted, position_mm=position, quaternion=quaternion)


CASES: Sequence[Case] = (
    Case("quaternion-order/order", "x, y, z, w", tidy, _recorded("x, y, z, w read as w, x, y, z")),
    Case("quaternion-order/inverse-too", "x, y, z, w of the inverse", tidy, _numbers(_inverse_xyzw)),
    Case(
        "quaternion-order/inverse-too", "order: wxyz, rotates", wide,
        _in_mapping("orientation", order="wxyz", rotates=SENSES[0]),
    ),
    Case("quaternion-order/order", "w, x, y, z as x, y, z, w", tidy, _numbers(_scalar_first_under_xyzw)),
    Case("quaternion-order/order", "z, w, y, x", wide, _in_mapping("orientation", order="wzyx")),
    Case("quaternion-order/order", "x, w, y, z", wide, _in_mapping("orientation", order="xwyz")),
    Case("quaternion-inverse", "inverse", tidy, _recorded("inverse rotations")),
    Case("quaternion-inverse", "rotates", wide, _in_mapping("orientation", rotates=SENSES[0])),
    Case(
        "euler-order/axes", "axes: XYZ, inverse angles", angles,
        _both(_recorded("inverse rotations"), _in_mapping("orientation", rotates=SENSES[1], axes="XYZ")),
    ),
    Case(
        "euler-order/fixed", "fixed axes", angles,
        _both(_changed_file(_reversed_columns), _in_mapping("orientation", axes="XYZ")),
    ),
    Case("units/positions-small", "centimetres", tidy, _recorded("centimetres read as mm")),
    Case("units/positions-small", "position_unit: mm", wide, _in_mapping(position_unit="mm")),
    Case("units/degrees", "unit: rad", angles, _in_mapping("orientation", unit="rad")),
    Case("units/positions-large", "position_unit: inch", wide, _in_mapping(position_unit="inch")),
    Case("units/radians", "radians", angles, _changed_file(_in_radians)),
    Case("units/radians", "rotation vectors in radians", vectors, _changed_file(_in_radians)),
    Case("time-unit/scaled", "seconds", tidy, _recorded("seconds read as milliseconds")),
    Case("time-unit/rate", "rate_hz", wide, _in_mapping(csv={}, rate_hz=0.24)),
    Case("time-unit", "milliseconds", tidy, _recorded("milliseconds read as seconds")),
    Case("time-unit", "time_unit: s", wide, _in_mapping("csv", time_unit="s")),
    Case("clock/midnight", "midnight", tidy, _numbers(partial(_clocked, fall_s=86400.0))),
    Case("clock/wrap", "wrap", tidy, _numbers(partial(_clocked, fall_s=2**32 / 1e3))),
    Case("hemisphere/all-along", "one", tidy, _recorded("a receiver on the other side all along")),
    Case("hemisphere/whole", "all receivers", tidy, _recorded("positions negated")),
    Case("hemisphere/left-out", "flips", tidy, _recorded("one to three receivers flip"), other_frames=True),
    Case(
        "receiver-stuck/at-times", "hangs", tidy,
        _recorded("a receiver hangs for a while"), other_frames=True,
    ),
    Case("receiver-stuck/repeated", "repeats", tidy, _numbers(_half_the_rate), other_frames=True),
    Case("receiver-stuck/repeated", "repeats", wide, _numbers(_half_the_rate), other_frames=True),
    Case("spikes/some", "four poses off", tidy, _some_off, other_frames=True),
    Case("spikes/all", "random numbers", tidy, _recorded("random poses")),
    Case("receivers-swapped", "on a finger", tidy, _recorded("neighbours on a finger")),
    Case("receivers-swapped", "names", wide, _swapped(("index_proximal", "index_middle"))),
    Case("receivers-swapped/in-part", "half", tidy, _numbers(_change_places)),
    Case("receivers-swapped/in-part", "half", wide, _numbers(_change_places)),
    Case("digits-swapped/two", "two", tidy, _recorded("neighbouring fingers")),
    Case("digits-swapped/reversed", "reversed", with_stations, _recorded("fingers in the opposite order")),
    Case(
        "digits-swapped/two", "two", wide, _swapped(*((f"middle_{bone}", f"ring_{bone}") for bone in BONES)),
    ),
    Case("wrong-hand", "hand", tidy, _recorded("the other hand")),
    Case("wrong-hand", "mirrored file", tidy, _numbers(_mirrored)),
    Case("wrong-hand", "mirrored file", angles, _numbers(_mirrored)),
    Case("axes-mirrored/negated", "one negated", tidy, _recorded("one axis negated")),
    Case("axes-mirrored/exchanged", "another order, one negated", tidy, _recorded("y up and z up mixed")),
    Case("axes-mirrored/exchanged", "position_axes", wide, _in_mapping(position_axes=["z", "x", "-y"])),
    Case("receiver-turned/one", "one by 180 deg", wide, _numbers(_turned), other_frames=True),
    Case("receiver-turned/all", "all", wide, _recorded("all receivers"), other_frames=True),
    Case("too-short", "cut off", tidy, _recorded("2 to 39 frames")),
    Case("zeros", "two receivers", tidy, _zeros, other_frames=True),
    Case("receivers-alike", "exported twice", tidy, _numbers(_twice)),
    Case(
        "units/positions-small and receivers-swapped", "two", wide,
        _both(_swapped(("index_proximal", "index_middle")), _in_mapping(position_unit="mm")),
    ),
    Case(
        "quaternion-inverse and receivers-swapped", "two", tidy,
        _recorded("inverse rotations", "on two fingers"),
    ),
    Case(
        "hemisphere/left-out and quaternion-order/order", "flips", wide,
        _both(_recorded("one to three receivers flip"), _in_mapping("orientation", order="wxyz")),
        other_frames=True,
    ),
)  # fmt: skip
"""Every kind of mistake that one recording shows, once per rule that cures it."""


FAR_MM, FAR_OF_OTHER_FRAMES_MM = 0.1, 5.0
"""How far a joint centre may be from that without the mistake. The latter is for centres solved from other
frames, which moves the base of the thumb by 4 mm; a mistake moves each joint by at least 18 mm.
"""

QUICK = {"units/positions-small, tidy: centimetres", "receivers-swapped, wide: names"}
"""One case without and one with a mapping that are not marked slow themselves."""


@cache
def without_mistake(door: Door) -> Result:
    return check(door(hand_of(7)))


def apart_mm(cured: Result, clean: Result) -> float:
    assert {*cured.centre_mm} == {*clean.centre_mm}
    return max(float(np.abs(mm - clean.centre_mm[name]).max()) for name, mm in cured.centre_mm.items())


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=() if case.name in QUICK else pytest.mark.slow, id=case.name)
        for case in CASES
    ],
)
def test_a_cure_applied_literally_removes_the_finding(case: Case) -> None:
    planted, clean = hand_of(7), without_mistake(case.door)
    assert clean.findings == ()
    wrong, cured = with_cures_applied(
        case.plant(planted, case.door, np.random.default_rng(3)), case.door(planted)
    )
    assert wrong.findings[0].key in case.key.split(" and ")
    assert cured.to_do == []
    if case.key != "too-short":  # whose cure excludes the recording, so that there is no joint
        assert apart_mm(cured, clean) < (FAR_OF_OTHER_FRAMES_MM if case.other_frames else FAR_MM)


@pytest.mark.slow
@pytest.mark.parametrize("door", [tidy, wide])
def test_a_layout_can_state_that_receivers_were_not_worn(door: Door) -> None:
    right = door(hand_of(7))
    little = [name for name in right.worn if name.startswith("little_")]
    lab_file = right
    if right.mapping is None:
        for name in little:
            lab_file = lab_file.emptied(name, slice(None))
    else:
        lab_file = right.with_keys(receivers={n: c for n, c in right.receivers.items() if n not in little})
    wrong, cured = with_cures_applied(lab_file, right)
    assert [(finding.kind, finding.severity) for finding in wrong.findings] == [("receivers-absent", "note")]
    assert wrong.findings[0].values["segments"] == little
    assert cured.findings == ()
    assert cured.layout is not None
    assert not {*little} & {*cured.layout.expected}


NOTHING_TO_WRITE = {
    **dict.fromkeys(("sudden-change/one", "sudden-change/until", "sudden-change/all"), "record again"),
    "receiver-stuck/all-along": "record again",
    "spikes/left-out": "the room must be changed",
    "hemisphere/jumps": "the import repairs it as hemisphere/left-out",
    "hemisphere/undecided": "the laboratory alone knows which numbers are on the wrong side",
    **dict.fromkeys(("same-file", "other-person/another", "other-person/put-on-anew"), "in the sheet alone"),
    "unchecked": "the check failed",
    **dict.fromkeys(
        ("cluster-not-rigid", "cluster-not-rigid/apart"), "with a C3D file's clusters, in test_inspect_file"
    ),
    **dict.fromkeys(("receivers-absent", "receivers-absent/unmapped"), "tested above with a layout"),
}
"""Kinds whose cure is not tested here with one recording, and the reason."""


def test_every_cure_is_tested() -> None:
    """Except those listed with a reason and those whose cure is that nothing has to be done."""
    idle = {key for key, texts in findings.MISTAKES.items() if "nothing has to be done" in texts["cure"]}
    followed = {key for case in CASES for key in case.key.split(" and ")}
    assert {*findings.MISTAKES} - idle - followed == {*NOTHING_TO_WRITE}
