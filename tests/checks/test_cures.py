"""Cures are true: done word for word to file, mapping, layout or sheet, nothing is found, and joints
are where they were without the mistake.
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
from shukotsu.fit.fit import FitSettings, fit_hand
from shukotsu.hand.rotations import Array, about_axis, conjugate, multiply, unit
from shukotsu.readers import import_recording
from shukotsu.simulate import recording
from shukotsu.simulate.simulation import LAYOUT
from shukotsu.study import findings
from shukotsu.study.config_files import config_path, loaded_yaml, read_config, yaml_text
from shukotsu.study.findings import Finding
from shukotsu.study.layout import Layout, read_layout
from shukotsu.tables.limits import MM_PER_UNIT, SECONDS_PER_UNIT
from shukotsu.tables.poses import Poses, read_poses

NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
PARTS = {"quaternion": ("1", "2", "3", "4"), "euler": ("az", "el", "ro")}
MOST_TIMES = 6


@dataclass(frozen=True)
class Brought:
    """A recording as its laboratory has it.

    table : the file's columns by title, a row a receiver and frame where there is no mapping, else a row a
    frame. mapping, layout : as their YAML files. sheet : the recording's row, by column.
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
        """Titles of the receiver's numbers."""
        if self.mapping is None:
            return [*NUMBERS]
        return [*self.receivers[segment]["position"], *self.receivers[segment]["orientation"]]

    def rows(self, segment: str) -> Any:
        """Which rows are the receiver's."""
        if self.mapping is not None:
            return slice(None)
        if "segment" in self.table:
            return self.table["segment"] == segment
        return self.table["receiver"] == self.layout["segments"][segment].get("receiver")

    def numbers(self, segment: str) -> Array:
        """The receiver's numbers, (frames, N)."""
        return np.stack([self.table[title][self.rows(segment)] for title in self.columns(segment)], -1)

    def repeats(self, segment: str) -> Any:
        """Frames (F,) in which the receiver's numbers are those of the frame before."""
        numbers = self.numbers(segment)
        return np.concatenate([[False], (numbers[1:] == numbers[:-1]).all(-1)])

    def emptied(self, segment: str, frames: Any) -> Brought:
        """Leave the receiver's numbers empty in those of its frames."""
        table = {title: column.copy() for title, column in self.table.items()}
        for title in self.columns(segment):
            table[title][np.arange(len(table[title]))[self.rows(segment)][frames]] = np.nan
        return replace(self, table=table)

    def with_columns(self, **columns: Any) -> Brought:
        """Return the file with other columns."""
        return replace(self, table={**self.table, **columns})

    def with_keys(self, **keys: Any) -> Brought:
        """Return the mapping with other keys; there must be one."""
        assert self.mapping is not None, f"there is no mapping to write {keys} into"
        return replace(self, mapping={**self.mapping, **keys})


def tidy(planted: Planted) -> Brought:
    columns = recording.tidy(planted.poses).to_pydict()
    layout = read_config(config_path(LAYOUT, "layout", Path()), "layout")
    table = {name: np.array(column) for name, column in columns.items()}
    return Brought(table, None, layout, {"hand": planted.hand})


def with_stations(planted: Planted) -> Brought:
    brought = tidy(planted)
    table, segments = dict(brought.table), brought.layout["segments"]
    table["receiver"] = np.array([segments[name]["receiver"] for name in table.pop("segment")])
    return replace(brought, table=table)


def wide(planted: Planted) -> Brought:
    """Bring a row a frame: centimetres, milliseconds, quaternions x, y, z, w of the inverse rotation."""
    orientation = {"kind": "quaternion", "order": "xyzw", "rotates": "transmitter-to-receiver"}
    numbers = conjugate(planted.poses.quaternion)[..., [1, 2, 3, 0]]
    return _row_a_frame(planted, numbers, orientation, "cm", "ms")


def angles(planted: Planted) -> Brought:
    """Bring a row a frame: inches, seconds, azimuth, elevation and roll in degrees."""
    quaternion = planted.poses.quaternion
    turns = Rotation.from_quat(quaternion.reshape(-1, 4), scalar_first=True)
    numbers = turns.as_euler("ZYX", degrees=True).reshape(*quaternion.shape[:2], 3)
    return _row_a_frame(planted, numbers, {"kind": "euler", "axes": "ZYX", "unit": "deg"}, "inch", "s")


def _row_a_frame(
    planted: Planted, turning: Array, orientation: Mapping[str, str], unit: str, time_unit: str
) -> Brought:
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


Door = Callable[[Planted], Brought]


@dataclass(frozen=True)
class Result:
    """Hold the findings in what was brought, and the recordings that its hand is solved from."""

    findings: tuple[Finding, ...] = ()
    recordings: tuple[Poses, ...] = ()
    layout: Layout | None = None
    hand: str = ""

    @property
    def to_do(self) -> list[str]:
        """Sentences of findings that ask for something."""
        messages = [finding.message for finding in self.findings]
        return [message for message in messages if not re.search("nothing (more )?has to be done", message)]

    @cached_property
    def centre_mm(self) -> dict[str, Array]:
        """Joints as the whole hand's fit has them: (2, 3), along the axes of both bones."""
        if self.layout is None:
            return {}
        quick, segments = FitSettings(n_frames=40, rounds=0), self.layout.segments
        joints = fit_hand(self.recordings, self.layout, self.hand, settings=quick).joints
        ends = {
            name: ((joint.parent_segment, joint.parent_mm), (joint.child_segment, joint.child_mm))
            for name, joint in joints.items()
        }
        return {
            name: np.array([segments[end].axes.T @ centre for end, centre in halves])
            for name, halves in ends.items()
        }


def check(brought: Brought) -> Result:
    """Import and check a recording as `shukotsu check FILE` does, and solve its joints."""
    if brought.sheet.get("exclude"):
        return Result()
    hand = brought.sheet["hand"]
    with TemporaryDirectory() as name:
        folder = Path(name)
        poses, layout, mapping = (folder / name for name in ("poses.parquet", "own.yaml", "mapping.yaml"))
        layout.write_text(yaml_text({**brought.layout, "layout": "own"}), "utf-8")
        columns = {title: pa.array(column, from_pandas=True) for title, column in brought.table.items()}
        pyarrow.csv.write_csv(pa.table(columns), folder / "recording.csv")
        options = [f"--in={folder / 'recording.csv'}", f"--out={poses}", f"--layout={layout}"]
        options += [f"--hand={hand}", "--subject=-", "--task=-", "--record-failure"]
        if brought.mapping is not None:
            mapping.write_text(yaml_text(brought.mapping), "utf-8")
            options.append(f"--mapping={mapping}")
        options += ["--repair-hemisphere"] * (brought.sheet.get("hemisphere") == "repair")
        with redirect_stderr(StringIO()):  # notes of the import
            import_recording.import_recording(import_recording.build_parser().parse_args(options))
        worn = read_layout(layout)
        checked = checked_poses(poses, worn.of_hand(hand))
        seen = tuple(name for name in worn.expected if name != "forearm")
        return Result(checked.findings, (read_poses(poses, seen),), worn, hand)


# --- what sentences say -----------------------------------------------------------------------------------

Follow = Callable[[re.Match[str], Brought, Brought], Brought]
"""What is brought after the words are followed; its last argument is the faultless recording, for what only
its laboratory can look up."""


def obeyed(brought: Brought, right: Brought) -> tuple[Result, Result]:
    """Follow the first finding's sentence, check again, and repeat until nothing new is found.

    Return the first and the last result. right : the faultless recording.
    """
    first = last = check(brought)
    done: set[str] = set()
    while (left := last.to_do) and left[0] not in done and len(done) < MOST_TIMES:
        done.add(left[0])
        words, follow = next(
            (words, follow) for pattern, follow in RULES if (words := re.search(pattern, left[0]))
        )
        brought = follow(words, brought, right)
        last = check(brought)
    return first, last


def _written(text: str) -> dict[str, Any]:
    """Read the text between backticks as YAML."""
    codes = re.findall("`([^`]+)`", text)
    return {key: value for code in codes for key, value in loaded_yaml(code, "a cure").items()}


def _key(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return brought.with_keys(**_written(words[1]))


def _key_under(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return brought.with_keys(**{words[2]: {**(brought.mapping or {})[words[2]], **_written(words[1])}})


def _fixed_axes(words: re.Match[str], brought: Brought, right: Brought) -> Brought:
    return _reversed_columns(_key_under(words, brought, right))


def _not_in_step(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """The tracker's rate, which who owns it knows: that of new values."""
    csv = {**(brought.mapping or {})["csv"], **_written(words[1])}
    times = brought.table[csv["time"]][~brought.repeats(brought.worn[0])]
    interval_s = np.median(np.diff(times)) * SECONDS_PER_UNIT[csv["time_unit"]]
    return brought.with_keys(csv=csv, rate_hz=float(1 / interval_s))


def _pairs(words: re.Match[str]) -> dict[str, str]:
    """Every segment's partner, both ways round."""
    pairs = re.findall(r"(\w+) (?:and|with) (\w+)", words["pairs"])
    return dict(pairs) | {second: first for first, second in pairs}


def _names(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return _renamed_receivers(brought, _pairs(words))


def _renamed_receivers(brought: Brought, partners: Mapping[str, str]) -> Brought:
    receivers = {partners.get(name, name): columns for name, columns in brought.receivers.items()}
    return brought.with_keys(receivers=receivers)


def _names_in_file(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """In the file's column segment or, where it has stations, in the layout."""
    partners = _pairs(words)
    if "segment" in brought.table:
        names = brought.table["segment"]
        return brought.with_columns(segment=np.array([partners.get(name, name) for name in names]))
    before = brought.layout["segments"]
    segments = {
        name: {**part, "receiver": before[partners[name]]["receiver"]} if name in partners else part
        for name, part in before.items()
    }
    return replace(brought, layout={**brought.layout, "segments": segments})


def _exchanged_numbers(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """In frames as the file has them, or as rows of a file without them are counted."""
    table, pair = {title: column.copy() for title, column in brought.table.items()}, (words[1], words[2])
    for here, there in (pair, pair[::-1]):
        frame = table["frame"] if "frame" in table else np.arange(len(table["t"]))
        rows, others = (np.arange(len(frame))[brought.rows(name)] for name in (here, there))
        among = (frame[rows] >= int(words[3])) & (frame[rows] <= int(words[4]))
        for title, other in zip(brought.columns(here), brought.columns(there), strict=True):
            table[title][rows[among]] = brought.table[other][others[among]]
    return replace(brought, table=table)


def _added(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    late = float(words[1]) * (brought.table["frame"] >= int(words[2]))
    return brought.with_columns(time_s=brought.table["time_s"] + late)


def _renamed(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    old, new = (part.split(", ") for part in (words[1], words[2]))
    named = brought.with_columns(**{title: brought.table[name] for name, title in zip(old, new, strict=True)})
    return _negated(words[3] or "", named)


def _negated(names: str, brought: Brought) -> Brought:
    return brought.with_columns(**{name: -brought.table[name] for name in re.findall(r"\w+_mm|q\w", names)})


def _multiplied(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    names = ["time_s"] if words[1] == "the times" else re.findall(r"\w+_mm|time_s", words[1])
    return brought.with_columns(**{name: brought.table[name] * float(words[2]) for name in names})


def _in_place(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    new, old = (part.split(", ") for part in (words[1], words[2]))
    moved = {
        name: (-1.0 if taken.startswith("-") else 1.0) * brought.table[taken.lstrip("-")]
        for name, taken in zip(old, new, strict=True)
    }
    return brought.with_columns(**moved)


def _spiked(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """Frames as the file has them."""
    for segment, frame in re.findall(r"(\w+) in frame (\d+)", words[1]):
        brought = brought.emptied(segment, brought.table["frame"][brought.rows(segment)] == int(frame))
    return brought


def _zeroed(_words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """Every pose at 0, 0, 0 and not turned, as a quaternion 1 or as angles 0."""
    for segment in brought.worn:
        numbers = brought.numbers(segment)
        brought = brought.emptied(segment, (numbers[:, :3] == 0).all(-1) & (np.abs(numbers).sum(-1) <= 1))
    return brought


def _stuck(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return brought.emptied(words[1], brought.repeats(words[1]))


def _rows_left_out(_words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    kept = np.ones(len(brought.table["frame"]), bool)
    for segment in brought.worn:
        kept[brought.rows(segment)] = ~brought.repeats(segment)
    return replace(brought, table={title: column[kept] for title, column in brought.table.items()})


def _in_layout(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return replace(brought, layout={**brought.layout, **_written(words[1])})


def _under_segment(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    segments = brought.layout["segments"]
    turned = {**segments, words[2]: {**segments[words[2]], **_written(words[1])}}
    return replace(brought, layout={**brought.layout, "segments": turned})


def _in_sheet(column: str, value: str) -> Follow:
    return lambda _words, brought, _: replace(brought, sheet={**brought.sheet, column: value})


def _other_hand(words: re.Match[str], brought: Brought, right: Brought) -> Brought:
    """Which of the two it is, its laboratory knows."""
    if right.sheet["hand"] == words[1]:
        return replace(brought, sheet={**brought.sheet, "hand": words[1]})
    assert right.sheet["hand"] == words[2]
    return right if words[3].startswith("export it") else _negated(words[3], brought)


def _looked_up(_words: re.Match[str], _brought: Brought, right: Brought) -> Brought:
    return right


def _not_worn(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    before = brought.layout["segments"]
    names = re.findall(r"\w+_\w+", words[1])
    segments = {name: {**before[name], **_written(words[2])} for name in names}
    return replace(brought, layout={**brought.layout, "segments": {**before, **segments}})


RULES: Sequence[tuple[str, Follow]] = (
    (r"(?:pose of|receiver for) (.+), which the layout .* write (`[^`]+`) under these segments", _not_worn),
    (
        r"write (`axes: \w+`) under `(orientation)` in the mapping, and reverse the order of the columns",
        _fixed_axes,
    ),
    (r"write (`in_step: false`) under `csv` and the tracker's `rate_hz` in the mapping", _not_in_step),
    (r"write ((?:`[^`]+`(?: and )?)+) under `(\w+)` in the mapping", _key_under),
    (r"write (`[^`]+`) in the mapping", _key),
    (r"exchange these names under `receivers` in the mapping: (?P<pairs>.+)\.", _names),
    (r"exchange these names in the file's column .* in the layout: (?P<pairs>.+)\.", _names_in_file),
    (r"rename the file's columns (.+) to ([^.]+?)(?:, and negate (.+))?\.$", _renamed),
    (r"; negate (.+) in the file", lambda words, brought, _: _negated(words[1], brought)),
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
"""By the words of a sentence, as one expression: what is done."""


# --- what is planted --------------------------------------------------------------------------------------

Plant = Callable[[Planted, Door, np.random.Generator], Brought]


@dataclass(frozen=True)
class Case:
    """A mistake of its kind that comes through a door; planted : what is wrong, in words.

    other_frames : whether joints are solved from others than without the mistake: the cure leaves poses out,
    or receivers are turned, by whose axes the model samples postures.
    """

    key: str
    planted: str
    door: Door
    plant: Plant
    other_frames: bool = False

    @property
    def name(self) -> str:
        """All of it in words."""
        return f"{self.key}, {self.door.__name__}: {self.planted}"


def _recorded(*names: str) -> Plant:
    def plant(planted: Planted, door: Door, rng: np.random.Generator) -> Brought:
        for name in names:
            planted = MISTAKES[name][1](planted, rng)
        return door(planted)

    return plant


def _numbers(change: Callable[[Planted], Planted]) -> Plant:
    return lambda planted, door, _: door(change(planted))


def _brought(change: Callable[[Brought], Brought]) -> Plant:
    return lambda planted, door, _: change(door(planted))


def _in_mapping(group: str = "", **keys: Any) -> Plant:
    def change(brought: Brought) -> Brought:
        return brought.with_keys(**({group: {**(brought.mapping or {})[group], **keys}} if group else keys))

    return _brought(change)


def _swapped(*pairs: tuple[str, str]) -> Plant:
    partners = dict(pairs) | {second: first for first, second in pairs}
    return _brought(lambda brought: _renamed_receivers(brought, partners))


def _reversed_columns(brought: Brought) -> Brought:
    receivers = brought.receivers.items()
    reverse = {name: {**each, "orientation": each["orientation"][::-1]} for name, each in receivers}
    return brought.with_keys(receivers=reverse)


def _both(first: Plant, second: Plant) -> Plant:
    """Two mistakes at once, of which the second is one of the mapping."""
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


def _some_off(planted: Planted, door: Door, rng: np.random.Generator) -> Brought:
    position = planted.poses.position_mm.copy()
    for row in rng.choice(np.arange(10, len(position) - 10, 10), 4, replace=False):
        position[row, rng.integers(position.shape[1])] += 85 * unit(rng.normal(size=3))
    return door(changed(planted, position_mm=position))


def _zeros(planted: Planted, door: Door, rng: np.random.Generator) -> Brought:
    position, quaternion = planted.poses.position_mm.copy(), planted.poses.quaternion.copy()
    for receiver in rng.choice(position.shape[1], 2, replace=False):
        position[200:300, receiver], quaternion[200:300, receiver] = 0, [1, 0, 0, 0]
    return door(changed(planted, position_mm=position, quaternion=quaternion))


def _turned(planted: Planted) -> Planted:
    """The receiver over the ring finger's middle phalanx, strapped on turned."""
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


def _in_radians(brought: Brought) -> Brought:
    titles = [title for receiver in brought.receivers.values() for title in receiver["orientation"]]
    return brought.with_columns(**{title: np.radians(brought.table[title]) for title in titles})


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
        _in_mapping("orientation", order="wxyz", rotates="receiver-to-transmitter"),
    ),
    Case("quaternion-order/order", "w, x, y, z as x, y, z, w", tidy, _numbers(_scalar_first_under_xyzw)),
    Case("quaternion-order/order", "z, w, y, x", wide, _in_mapping("orientation", order="wzyx")),
    Case("quaternion-order/order", "x, w, y, z", wide, _in_mapping("orientation", order="xwyz")),
    Case("quaternion-inverse", "inverse", tidy, _recorded("inverse rotations")),
    Case(
        "quaternion-inverse", "rotates", wide, _in_mapping("orientation", rotates="receiver-to-transmitter"),
    ),
    Case("euler-order/axes", "axes: XYZ, inverse angles", angles, _both(
            _recorded("inverse rotations"),
            _in_mapping("orientation", rotates="transmitter-to-receiver", axes="XYZ"),
        )),
    Case(
        "euler-order/fixed", "fixed axes", angles,
        _both(_brought(_reversed_columns), _in_mapping("orientation", axes="XYZ")),
    ),
    Case("units/positions-small", "centimetres", tidy, _recorded("centimetres read as mm")),
    Case("units/positions-small", "position_unit: mm", wide, _in_mapping(position_unit="mm")),
    Case("units/degrees", "unit: rad", angles, _in_mapping("orientation", unit="rad")),
    Case("units/positions-large", "position_unit: inch", wide, _in_mapping(position_unit="inch")),
    Case("units/radians", "radians", angles, _brought(_in_radians)),
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
"""Every kind that a recording alone shows, by every rule that cures it."""


FAR_MM, FAR_OF_OTHER_FRAMES_MM = 0.1, 5.0
"""How far a joint's centre may be from that without the mistake; the latter: solved from other frames,
which moves the base of the thumb by 4 mm, and a mistake each joint by 18 and more.
"""

QUICK = {"units/positions-small, tidy: centimetres", "receivers-swapped, wide: names"}
"""Without and with a mapping, for every run of the tests."""


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
def test_a_cure_done_word_for_word_cures(case: Case) -> None:
    planted, clean = hand_of(7), without_mistake(case.door)
    assert clean.findings == ()
    wrong, cured = obeyed(case.plant(planted, case.door, np.random.default_rng(3)), case.door(planted))
    assert wrong.findings[0].key in case.key.split(" and ")
    assert cured.to_do == []
    if case.key != "too-short":  # which leaves the recording out, so that there is no joint
        assert apart_mm(cured, clean) < (FAR_OF_OTHER_FRAMES_MM if case.other_frames else FAR_MM)


@pytest.mark.slow
@pytest.mark.parametrize("door", [tidy, wide])
def test_a_layout_says_that_nobody_wore_a_receiver(door: Door) -> None:
    right = door(hand_of(7))
    little = [name for name in right.worn if name.startswith("little_")]
    brought = right
    if right.mapping is None:
        for name in little:
            brought = brought.emptied(name, slice(None))
    else:
        brought = right.with_keys(receivers={n: c for n, c in right.receivers.items() if n not in little})
    wrong, cured = obeyed(brought, right)
    assert [(finding.kind, finding.severity) for finding in wrong.findings] == [("receivers-absent", "note")]
    assert wrong.findings[0].values["segments"] == little
    assert cured.findings == ()
    assert cured.layout is not None
    assert not {*little} & {*cured.layout.expected}


NOTHING_TO_WRITE = {
    **dict.fromkeys(("sudden-change/one", "sudden-change/until", "sudden-change/all"), "it is made again"),
    "receiver-stuck/all-along": "it is made again",
    "spikes/left-out": "the room is put right",
    "hemisphere/jumps": "the import puts the same right as hemisphere/left-out",
    "hemisphere/undecided": "the laboratory alone knows which numbers are on the wrong side",
    **dict.fromkeys(("same-file", "other-person/another", "other-person/put-on-anew"), "by the sheet alone"),
    "unchecked": "the check failed",
    **dict.fromkeys(
        ("cluster-not-rigid", "cluster-not-rigid/apart"), "with a C3D file's clusters, in test_inspect_file"
    ),
    **dict.fromkeys(("receivers-absent", "receivers-absent/unmapped"), "by a layout, above"),
}
"""Mistakes whose cure cannot be followed with one recording, and why."""


def test_every_cure_is_followed() -> None:
    """But for those with a reason, and where the sentence says that nothing has to be done."""
    idle = {key for key, texts in findings.MISTAKES.items() if "nothing has to be done" in texts["cure"]}
    followed = {key for case in CASES for key in case.key.split(" and ")}
    assert {*findings.MISTAKES} - idle - followed == {*NOTHING_TO_WRITE}
