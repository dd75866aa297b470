"""Command line: poses tables -> a Motion-BIDS dataset, new or one to add to."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.errors import InputError
from shukotsu.stages import command_line

if TYPE_CHECKING:
    import pyarrow as pa

    from shukotsu.motion_bids.motion_files import Column
    from shukotsu.skeleton.rotations import Array


def build_parser() -> argparse.ArgumentParser:
    """Give the subcommand's argument parser."""
    parser = command_line.parser(
        "shukotsu export-bids",
        "Write poses tables into a Motion-BIDS dataset; what else is in it stays as it is.",
        "shukotsu export-bids --poses poses.parquet --out dataset",
        records_failure=False,
    )
    parser.add_argument("--poses", type=Path, nargs="+", required=True, help="poses tables, one a recording")
    parser.add_argument("--out", type=Path, required=True, help="the dataset's folder, new or a BIDS dataset")
    parser.add_argument(
        "--rate-hz", type=_positive, help="nominal frames a second; computed from the times if absent"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace recordings that are there already")
    return parser


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < 1e9:
        raise argparse.ArgumentTypeError(f"is {text!r}; expected frames a second above 0")
    return number


def main(argv: list[str]) -> int:
    """Run the subcommand; gives the exit code."""
    return command_line.run(build_parser, argv, export)


def export(arguments: argparse.Namespace) -> None:
    """Write the recordings of poses tables into the dataset in a folder, all tables checked before.

    Files of other recordings stay, and so do the dataset's own where it has them. Raises InputError where the
    folder holds something else, a recording is there already, or a table is none or has no times and no rate
    is given.
    """
    from shukotsu.motion_bids.dataset_files import add_participants, check_folder
    from shukotsu.motion_bids.labels import recording_stem
    from shukotsu.motion_bids.motion_files import ENDINGS, TrackingSystem
    from shukotsu.schemas.poses import recording_name

    check_folder(arguments.out)
    named: dict[str, Path] = {}
    subjects = []
    for path in arguments.poses:
        name = recording_name(path)
        if not (name.subject and name.task):
            raise InputError(f"{path}: names no subject or no task; BIDS needs both in a file's name")
        stem = recording_stem(name)
        if stem in named:
            raise InputError(f"{path}: is of {name}, as {named[stem]} is; give each recording its trial")
        named[stem] = path
        subjects.append(name.subject)
        files = [TrackingSystem(name, "", (), {}).file(arguments.out, ending) for ending in ENDINGS]
        existing = [file for file in files if file.exists()]
        if existing and not arguments.overwrite:
            raise InputError(f"{existing[0]}: is there already; give --overwrite to replace the recording")
        _rate_hz(path, _Grid(path), arguments.rate_hz)
    add_participants(arguments.out, subjects)
    for path in arguments.poses:
        _write_recording(path, arguments.out, arguments.rate_hz)


class _Grid:
    """A poses table of S segments and T frames: numbers (T,) and, by segment, (S, T), gaps NaN."""

    def __init__(self, path: Path) -> None:
        import numpy as np

        from shukotsu.schemas.catalogue import POSES
        from shukotsu.schemas.tables import column_array, read_table

        table = read_table(path, POSES)
        if not table.num_rows:
            raise InputError(f"{path}: has no rows; there is nothing to export")
        self.segments = tuple(dict.fromkeys(table.column("segment").unique().to_pylist()))

        def by_segment(name: str) -> Any:
            return column_array(table, name).reshape(len(self.segments), -1)

        self.frame = by_segment("frame")[0]
        self.time_s: Array = by_segment("time_s").astype(float)
        self.numbers = np.stack([by_segment(name).astype(float) for name in _NUMBERS], -1)
        self.valid = by_segment("valid").astype(bool)
        bits, self.flag_names = _flag_bits(table)
        self.flag_bits = bits.reshape(len(self.segments), -1)

    @property
    def first_times(self) -> Array:
        """Times (T,) of the first segment that has one, NaN where none has."""
        import numpy as np

        place = np.isfinite(self.time_s).argmax(0)[None]
        return np.asarray(np.take_along_axis(self.time_s, place, 0)[0])


_NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


def _flag_bits(table: pa.Table) -> tuple[Any, tuple[str, ...]]:
    """Flags of every row as bits, and the flag that each bit stands for."""
    import numpy as np

    encoded = table.column("flags").combine_chunks().dictionary_encode()
    texts = [text.split(";") if text else [] for text in encoded.dictionary.to_pylist()]
    names = tuple(sorted({flag for flags in texts for flag in flags}))
    bits = np.array([sum(1 << names.index(flag) for flag in flags) for flags in texts], np.int64)
    return bits[np.asarray(encoded.indices)], names


def _rate_hz(path: Path, grid: _Grid, rate_hz: float | None) -> float:
    """Nominal rate from the times where none is given; InputError where it does not follow from them."""
    import numpy as np

    known = np.isfinite(grid.first_times)
    steps = np.diff(grid.first_times[known]) / np.diff(grid.frame[known])
    step_s = float(np.median(steps)) if len(steps) else 0.0
    if rate_hz is None and step_s <= 0:
        raise InputError(f"{path}: has no times to tell the sampling frequency from; give --rate-hz")
    return rate_hz or round(1 / step_s, 6)


def _write_recording(path: Path, folder: Path, rate_hz: float | None) -> None:
    from shukotsu.files.whole_files import file_sha256
    from shukotsu.motion_bids.motion_files import TrackingSystem, sampling_rates, write_tracking_system
    from shukotsu.schemas import PROGRAM, VERSION
    from shukotsu.schemas.poses import recording_name
    from shukotsu.schemas.tables import read_metadata

    grid, name, parameters = _Grid(path), recording_name(path), read_metadata(path)["parameters"]
    details = {
        "FlagChannels": {
            own: f"{own}_flags" for own, bits in zip(grid.segments, grid.flag_bits, strict=True) if bits.any()
        },
        "FlagBits": list(grid.flag_names),
        "program": f"{PROGRAM} {VERSION}",
        **{key: value for key, value in vars(name).items() if value or key != "session"},
        "layout": parameters.get("layout", "n/a"),
        "notes": [note for note in parameters.get("notes", []) if note],
        "inputs_sha256": {path.name: file_sha256(path)},
    }
    system = TrackingSystem(name, "", grid.segments, details)
    columns = list(_columns(grid))
    rates = sampling_rates(_rate_hz(path, grid, rate_hz), grid.first_times)
    write_tracking_system(folder, system, rates, columns, [columns])


def _columns(grid: _Grid) -> Iterator[Column]:
    """Columns of motion.tsv in their order: the frame, times, then every receiver's."""
    import numpy as np

    from shukotsu.motion_bids.motion_files import frame_column, receiver_columns, time_columns

    def start_s(time_s: Array) -> float:
        return next((float(value) for value in time_s if np.isfinite(value)), float("nan"))

    yield frame_column(grid.frame)
    shared = ((grid.time_s == grid.first_times) | np.isnan(grid.time_s)).all()
    if shared:
        yield from time_columns(grid.first_times, start_s(grid.first_times))
    for index, segment in enumerate(grid.segments):
        if not shared:
            yield from time_columns(grid.time_s[index], start_s(grid.time_s[index]), segment)
        valid, bits = grid.valid[index], grid.flag_bits[index]
        status = ("good", "n/a") if valid.any() else ("bad", "no pose of this receiver may be used")
        numbers = grid.numbers[index]
        yield from receiver_columns(segment, numbers[:, :3], numbers[:, 3:], *status)
        yield _whole_number(segment, "valid", valid.astype(np.int8), "1 where the pose may be used", status)
        if bits.any():
            what = "what was seen of the pose, bit by bit as FlagBits in motion.json says"
            yield _whole_number(segment, "flags", bits, what, status)


def _whole_number(segment: str, name: str, numbers: Any, what: str, status: Sequence[str]) -> Column:
    import pyarrow as pa

    from shukotsu.motion_bids.motion_files import Column

    text = pa.array(numbers).cast(pa.string())
    return Column(text, f"{segment}_{name}", "n/a", "MISC", segment, "n/a", what, *status)
