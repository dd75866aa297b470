"""Model what a laboratory has of a recording: file, mapping, layout, row of the sheet; and its findings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from functools import cached_property
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from benchmarks.faultless_hands import Planted
from shukotsu.checks.checked_subject import checked_poses
from shukotsu.fit.fit import Settings, fit_hand
from shukotsu.hand.rotations import Array, conjugate, matrix
from shukotsu.readers import import_recording
from shukotsu.simulate.simulation import LAYOUT
from shukotsu.study.config_files import config_path, read_config, yaml_text
from shukotsu.study.findings import Finding
from shukotsu.study.layout import Layout, read_layout
from shukotsu.tables.limits import MM_PER_UNIT
from shukotsu.tables.poses import Poses, read_poses

NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
PARTS = {"quaternion": ("1", "2", "3", "4"), "euler": ("az", "el", "ro")}
SECONDS = {"s": 1.0, "ms": 1e-3}


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

    def columns(self, segment: str) -> list[str]:
        """Titles of the receiver's numbers."""
        if self.mapping is None:
            return [*NUMBERS]
        receiver = self.mapping["receivers"][segment]
        return [*receiver["position"], *receiver["orientation"]]

    def rows(self, segment: str) -> Any:
        """Which rows are the receiver's."""
        if self.mapping is not None:
            return slice(None)
        if "segment" in self.table:
            return self.table["segment"] == segment
        return self.table["receiver"] == self.layout["segments"][segment]["receiver"]

    def numbers(self, segment: str) -> Array:
        """The receiver's numbers, (frames, N)."""
        return np.stack([self.table[title][self.rows(segment)] for title in self.columns(segment)], -1)

    def emptied(self, segment: str, frames: Any) -> Brought:
        """Leave the receiver's numbers empty in those of its frames."""
        table = {title: column.copy() for title, column in self.table.items()}
        for title in self.columns(segment):
            numbers = table[title][self.rows(segment)]
            numbers[frames] = np.nan
            table[title][self.rows(segment)] = numbers
        return replace(self, table=table)

    def with_columns(self, **columns: Any) -> Brought:
        """Return the file with other columns."""
        return replace(self, table={**self.table, **columns})


def tidy(planted: Planted) -> Brought:
    poses = planted.poses
    frames, segments = poses.valid.shape
    numbers = np.concatenate([poses.position_mm, poses.quaternion], -1).reshape(-1, 7)
    table = {
        "frame": np.repeat(poses.frame, segments),
        "time_s": np.repeat(poses.time_s, segments),
        "segment": np.tile(poses.segments, frames),
        **dict(zip(NUMBERS, numbers.T, strict=True)),
    }
    return Brought(table, None, _layout(), {"hand": planted.hand})


def with_stations(planted: Planted) -> Brought:
    brought = tidy(planted)
    segments = brought.layout["segments"].items()
    station = {name: part["receiver"] for name, part in segments if "receiver" in part}
    table = dict(brought.table)
    table["receiver"] = np.array([station[name] for name in table.pop("segment")])
    return replace(brought, table=table)


def wide(planted: Planted) -> Brought:
    """Bring a row a frame: centimetres, milliseconds, quaternions x, y, z, w of the inverse rotation."""
    orientation = {"kind": "quaternion", "order": "xyzw", "rotates": "transmitter-to-receiver"}
    numbers = conjugate(planted.poses.quaternion)[..., [1, 2, 3, 0]]
    return _row_a_frame(planted, numbers, orientation, "cm", "ms")


def angles(planted: Planted) -> Brought:
    """Bring a row a frame: inches, seconds, azimuth, elevation and roll in degrees."""
    from scipy.spatial.transform import Rotation

    turned = matrix(planted.poses.quaternion)
    numbers = Rotation.from_matrix(turned.reshape(-1, 3, 3)).as_euler("ZYX", degrees=True)
    orientation = {"kind": "euler", "axes": "ZYX", "unit": "deg"}
    return _row_a_frame(planted, numbers.reshape(*turned.shape[:2], 3), orientation, "inch", "s")


Door = Callable[[Planted], Brought]


def _layout() -> dict[str, Any]:
    return read_config(config_path(LAYOUT, "layout", Path()), "layout")


def _row_a_frame(
    planted: Planted, turning: Array, orientation: Mapping[str, str], unit: str, time_unit: str
) -> Brought:
    poses = planted.poses
    table = {"t": poses.time_s / SECONDS[time_unit]}
    receivers = {}
    for place, segment in enumerate(poses.segments):
        position = [f"{segment} {axis}" for axis in "xyz"]
        turns = [f"{segment} {part}" for part in PARTS[orientation["kind"]]]
        table |= dict(zip(position, poses.position_mm[:, place].T / MM_PER_UNIT[unit], strict=True))
        table |= dict(zip(turns, turning[:, place].T, strict=True))
        receivers[segment] = {"position": position, "orientation": turns}
    mapping = {
        "format": "csv",
        "position_unit": unit,
        "orientation": dict(orientation),
        "receivers": receivers,
        "csv": {"time": "t", "time_unit": time_unit},
    }
    return Brought(table, mapping, _layout(), {"hand": planted.hand})


@dataclass(frozen=True)
class Result:
    """Hold the findings in what was brought, and the recordings that its hand is solved from."""

    findings: tuple[Finding, ...] = ()
    recordings: tuple[Poses, ...] = ()
    layout: Layout | None = None
    hand: str = ""

    @cached_property
    def centre_mm(self) -> dict[str, Array]:
        """Joints as the whole hand's fit has them: (2, 3), along the axes of both bones."""
        if self.layout is None:
            return {}
        quick, segments = Settings(n_frames=40, rounds=0), self.layout.segments
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
    with TemporaryDirectory() as folder:
        poses, layout = Path(folder, "poses.parquet"), Path(folder, "own.yaml")
        options = [*_written(brought, Path(folder)), f"--out={poses}", f"--layout={layout}"]
        options += [f"--hand={brought.sheet['hand']}", "--subject=-", "--task=-", "--record-failure"]
        with redirect_stderr(StringIO()):  # notes of the import
            import_recording.import_recording(import_recording.build_parser().parse_args(options))
        worn = read_layout(layout)
        checked = checked_poses(poses, worn.of_hand(brought.sheet["hand"]))
        seen = tuple(name for name in worn.expected if name != "forearm")
        return Result(checked.findings, (read_poses(poses, seen),), worn, brought.sheet["hand"])


def _written(brought: Brought, folder: Path) -> Iterator[str]:
    """Write what was brought; give the options that name it."""
    file = folder / "recording.csv"
    (folder / "own.yaml").write_text(yaml_text({**brought.layout, "layout": "own"}), "utf-8")
    columns = {title: pa.array(column, from_pandas=True) for title, column in brought.table.items()}
    pyarrow.csv.write_csv(pa.table(columns), file)
    yield f"--in={file}"
    if brought.mapping is not None:
        (folder / "mapping.yaml").write_text(yaml_text(brought.mapping), "utf-8")
        yield f"--mapping={folder / 'mapping.yaml'}"
    if brought.sheet.get("hemisphere") == "repair":
        yield "--repair-hemisphere"
