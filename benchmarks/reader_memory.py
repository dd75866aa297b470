"""Import and inspect of a large file of every format: the most memory that each takes, against the limit."""

from __future__ import annotations

import argparse
import json
import struct
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from benchmarks.benchmark_table import Cell, TextTable, write_tables
from benchmarks.captures import write_capture
from benchmarks.long_recordings import RATE_HZ, write_long_recording
from benchmarks.processes import run_python
from schemas.layout import read_layout
from schemas.limits import MEMORY_BYTES, MEMORY_PER_BYTE

PAGE, MARKS = "reliability.md", "memory"
LAYOUT = "liberty16"
PARTS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
FORMATS = ("tidy Parquet", "tidy CSV", "raw capture", "mapped CSV", "matrices", "Motion-BIDS", "XDF", "C3D")
C3D_FRAMES = 65_000
"""A header counts no more."""


@dataclass(frozen=True)
class LargeFile:
    """A recording; mapping : how to read it, where it needs one."""

    path: Path
    mapping: Mapping[str, Any] | None = None


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--minutes", type=float, default=10.0, help="of 16 receivers at 240 Hz (10)")
    parser.add_argument("--formats", nargs="*", choices=FORMATS, help="these alone")
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{PAGE}")


def run(
    minutes: float = 10.0, formats: Sequence[str] | None = None, write: bool = False
) -> Iterator[TextTable]:
    """Give the table for recordings of that length."""
    rows: list[tuple[Cell, ...]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tidy = folder / "tidy.parquet"
        write_long_recording(tidy, minutes)
        for kind in formats or FORMATS:
            file = _WRITERS[kind](folder, tidy, minutes)
            rows += _rows(kind, file, folder)
            if file.path != tidy:
                file.path.unlink()
    table = TextTable(
        f"reader_memory: 16 receivers at {RATE_HZ} Hz, {minutes:g} minutes (C3D {C3D_FRAMES} frames)",
        ("format", "command", "file MB:.0f", "most memory MB:.0f", "allowed MB:.0f"),
        rows,
        "The most memory that was resident in the process or one that it started, the program's own some "
        "140 MB among it. Allowed: four times the file and 300 MB.",
    )
    yield table
    if write:
        write_tables(
            PAGE, [table], f"python -m benchmarks reader_memory --minutes {minutes:g} --write", MARKS
        )


def _rows(kind: str, file: LargeFile, folder: Path) -> Iterator[tuple[Cell, ...]]:
    mapping = []
    if file.mapping is not None:
        path = folder / "mapping.yaml"
        path.write_text(json.dumps(file.mapping), "utf-8")
        mapping = [f"--mapping={path}"]
    who = ["--layout", LAYOUT, "--subject", "01", "--hand", "right", "--task", "rom"]
    out = ["--out", str(folder / "poses.parquet")]
    size = file.path.stat().st_size
    allowed = (MEMORY_PER_BYTE * size + MEMORY_BYTES) / 1e6
    for command, options in (
        ("import", ["--in", str(file.path), *who, *out, *mapping]),
        ("inspect", [str(file.path)]),
    ):
        usage = run_python("-m", "stages.capture", command, *options)
        yield kind, command, size / 1e6, usage.memory_mb, allowed


def _tidy(_: Path, tidy: Path, __: float) -> LargeFile:
    return LargeFile(tidy)


def _csv(folder: Path, tidy: Path, _: float) -> LargeFile:
    path = folder / "tidy.csv"
    with pq.ParquetFile(tidy) as file, pa_csv.CSVWriter(path, file.schema_arrow) as writer:
        for batch in file.iter_batches():
            writer.write_batch(batch)
    return LargeFile(path)


def _capture(folder: Path, _: Path, minutes: float) -> LargeFile:
    write_capture(folder / "rom.arrows", 60 * minutes)
    return LargeFile(folder / "rom.arrows")


def _frames(tidy: Path) -> tuple[tuple[str, ...], np.ndarray]:
    """Segments, and the poses of half a minute, (T, S, 7)."""
    segments = read_layout(LAYOUT).expected
    rows = next(pq.ParquetFile(tidy).iter_batches(7200 * len(segments))).to_pandas()
    return segments, np.stack(
        [rows.loc[rows.segment == name, list(PARTS)].to_numpy()[:7000] for name in segments], 1
    )


def _repeated(path: Path, head: bytes, tile: bytes, times: int) -> None:
    with path.open("wb") as stream:
        stream.write(head)
        for _ in range(times):
            stream.write(tile)


def _text_rows(numbers: np.ndarray, separator: str) -> bytes:
    """A line a row of numbers (N, C), six decimals."""
    table = pa.table({str(index): np.round(column, 6) for index, column in enumerate(numbers.T)})
    out = pa.BufferOutputStream()
    pa_csv.write_csv(table, out, pa_csv.WriteOptions(include_header=False, delimiter=separator))
    return bytes(out.getvalue().to_pybytes())


def _mapped_csv(folder: Path, tidy: Path, minutes: float) -> LargeFile:
    segments, poses = _frames(tidy)
    names = [f"{segment}_{part}" for segment in segments for part in PARTS]
    tile = _text_rows(poses.reshape(len(poses), -1), ",")
    _repeated(folder / "wide.txt", ",".join(names).encode() + b"\n", tile, _times(minutes, poses))
    receivers = {
        segment: {key: [f"{segment}_{part}" for part in parts] for key, parts in _GROUPS.items()}
        for segment in segments
    }
    orientation = {"kind": "quaternion", "order": "wxyz"}
    mapping = {"format": "csv", "position_unit": "mm", "rate_hz": RATE_HZ, "orientation": orientation}
    return LargeFile(folder / "wide.txt", {**mapping, "receivers": receivers})


_GROUPS = {"position": PARTS[:3], "orientation": PARTS[3:]}


def _times(minutes: float, poses: np.ndarray) -> int:
    return max(1, round(minutes * 60 * RATE_HZ / len(poses)))


def _matrices(folder: Path, tidy: Path, minutes: float) -> LargeFile:
    from skeleton.rotations import matrix

    segments, poses = _frames(tidy)
    flat = np.nan_to_num(poses.reshape(-1, 7))
    flat[~flat[:, 3:].any(-1), 3] = 1.0
    turned = matrix(flat[:, 3:] / np.linalg.norm(flat[:, 3:], axis=-1, keepdims=True))
    matrices = np.zeros((len(flat), 4, 4))
    matrices[:, :3, :3], matrices[:, :3, 3], matrices[:, 3, 3] = turned, flat[:, :3], 1.0
    tile = _text_rows(matrices.reshape(-1, 4), " ")
    _repeated(folder / "rom.traj", b"", tile, _times(minutes, poses))
    mapping = {"format": "matrices", "position_unit": "mm", "rate_hz": RATE_HZ}
    return LargeFile(folder / "rom.traj", {**mapping, "receivers": {one: {} for one in segments}})


def _motion_bids(folder: Path, tidy: Path, minutes: float) -> LargeFile:
    segments, poses = _frames(tidy)
    stem = "sub-01_task-rom_tracksys-right"
    parts = [(axis, "POS", "mm") for axis in "xyz"] + [(f"quat_{axis}", "ORNT", "n/a") for axis in "wxyz"]
    lines = ["name\tcomponent\ttype\ttracked_point\tunits"]
    lines += [f"{s}_{part}\t{part}\t{kind}\t{s}\t{unit}" for s in segments for part, kind, unit in parts]
    (folder / f"{stem}_channels.tsv").write_text("\n".join(lines) + "\n", "utf-8")
    (folder / f"{stem}_motion.json").write_text(json.dumps({"SamplingFrequency": RATE_HZ}), "utf-8")
    tile = _text_rows(poses.reshape(len(poses), -1), "\t").replace(b"\t\t", b"\tn/a\t")
    _repeated(folder / f"{stem}_motion.tsv", b"", tile, _times(minutes, poses))
    return LargeFile(folder / f"{stem}_motion.tsv")


def _xdf(folder: Path, tidy: Path, minutes: float) -> LargeFile:
    segments, poses = _frames(tidy)
    kinds = [f"Position{axis}" for axis in "XYZ"] + [f"Orientation{part}" for part in "ABCD"]
    unit = "millimeters"
    channels = "".join(
        f"<channel><label>{segment}_{kind}</label><marker>{segment}</marker><type>{kind}</type>"
        f"<unit>{unit if kind.startswith('P') else ''}</unit></channel>"
        for segment in segments
        for kind in kinds
    )
    head = (
        f"<info><name>t</name><type>MoCap</type><channel_count>{len(segments) * 7}</channel_count>"
        f"<nominal_srate>{RATE_HZ}</nominal_srate><channel_format>double64</channel_format>"
        f"<desc><channels>{channels}</channels></desc></info>"
    )
    number = struct.pack("<I", 1)
    start = b"XDF:" + _chunk(1, b"<info><version>1.0</version></info>") + _chunk(2, number + head.encode())
    stamped = [b"\x08" + struct.pack("<d", i / RATE_HZ) + frame.tobytes() for i, frame in enumerate(poses)]
    sizes = range(0, len(stamped), 100)
    tile = b"".join(
        _chunk(
            3,
            number
            + b"\x04"
            + struct.pack("<I", len(stamped[at : at + 100]))
            + b"".join(stamped[at : at + 100]),
        )
        for at in sizes
    )
    _repeated(folder / "rom.xdf", start, tile, _times(minutes, poses))
    return LargeFile(folder / "rom.xdf")


def _chunk(tag: int, content: bytes) -> bytes:
    return struct.pack("<BIH", 4, 2 + len(content), tag) + content


_WRITE_C3D = """
import sys
import ezc3d, numpy as np
frames, segments = int(sys.argv[2]), sys.argv[3].split(",")
shape = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0]])
moved = 30 * np.sin(np.arange(frames) / 100)[:, None, None]
file = ezc3d.c3d()
file["parameters"]["POINT"]["RATE"]["value"] = [240.0]
file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
file["parameters"]["POINT"]["LABELS"]["value"] = [f"{one}{number}" for one in segments for number in "123"]
points = np.concatenate([shape + moved + 100 * index for index in range(len(segments))], 1)
file["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], -1).transpose(2, 1, 0)
file.write(sys.argv[1])
"""


def _c3d(folder: Path, _: Path, __: float) -> LargeFile:
    segments: Sequence[str] = read_layout(LAYOUT).expected
    path = folder / "rom.c3d"
    run_python("-c", _WRITE_C3D, str(path), str(C3D_FRAMES), ",".join(segments))
    receivers = {one: {"markers": [f"{one}{number}" for number in "123"]} for one in segments}
    return LargeFile(path, {"format": "c3d", "position_unit": "mm", "receivers": receivers})


_WRITERS: Mapping[str, Callable[[Path, Path, float], LargeFile]] = {
    "tidy Parquet": _tidy,
    "tidy CSV": _csv,
    "raw capture": _capture,
    "mapped CSV": _mapped_csv,
    "matrices": _matrices,
    "Motion-BIDS": _motion_bids,
    "XDF": _xdf,
    "C3D": _c3d,
}
