"""One flipped bit in every kind of file: how often it is refused, said, or another number in silence."""

from __future__ import annotations

import argparse
import contextlib
import io
import random
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pyarrow.parquet as pq

from benchmarks.benchmark_table import Cell, TextTable, write_tables
from benchmarks.captures import write_capture
from schemas.catalogue import TABLES
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.parts import part_metadata
from schemas.tables import read_metadata, read_table
from stages.capture.__main__ import main as capture
from stages.capture.formats.readers import find_reader
from stages.estimate_metacarpals.__main__ import main as estimate_metacarpals
from stages.evaluate_tips.__main__ import main as evaluate_tips
from stages.project_planes.__main__ import main as project_planes
from stages.simulate.__main__ import main as simulate
from stages.simulate.simulation import LAYOUT
from stages.solve_joints.__main__ import main as solve_joints
from trackers.archive import open_archive
from trackers.decode.stream import Tally, blocks_of

PAGE = "reliability.md"
REFUSED, SAID, SAME, OTHER = "refused", "said", "the same", "other"
FRAMES = 400
CAPTURE_S = 2.0

_SUBJECT_TABLES = ("joint_solutions", "joint_centres", "bone_lengths", "metacarpals", "tips", "tip_errors")


@dataclass(frozen=True)
class FileKind:
    """A file; `read` gives all that a stage takes from it, and whether the reader says that it is damaged."""

    name: str
    path: Path
    read: Callable[[Path], tuple[object, bool]]


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--flips", type=int, default=2000, help="over all kinds of file together (2000)")
    parser.add_argument("--seed", type=int, default=1, help="of the places (1)")
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{PAGE}")


def run(flips: int = 2000, seed: int = 1, write: bool = False) -> Iterator[TextTable]:
    """Give the table of so many flips."""
    with tempfile.TemporaryDirectory() as folder:
        kinds = files_of_a_study(Path(folder))
        chance = random.Random(seed)
        rows = [_row(kind, -(-flips // len(kinds)), chance) for kind in kinds]
    columns = ("file", "flips:d", f"{REFUSED}:d", f"{SAID}:d", f"{SAME}:d", f"{OTHER}:d")
    table = TextTable(
        "One flipped bit, at a random place",
        columns,
        rows,
        "Refused: with a sentence that names the file. Said: read, with a note of what is damaged and left "
        "out. The same: no number changed. Other: other numbers in silence. What other programs write may "
        "hold no checksum, as the last two rows.",
    )
    yield table
    if write:
        write_tables(PAGE, [table], f"python -m benchmarks bit_flips --flips {flips} --write")


def _row(kind: FileKind, flips: int, chance: random.Random) -> tuple[Cell, ...]:
    counts = flip_outcomes(kind, flips, chance)
    return (kind.name, flips, *(counts[outcome] for outcome in (REFUSED, SAID, SAME, OTHER)))


def flip_outcomes(kind: FileKind, flips: int, chance: random.Random) -> Counter[str]:
    """Count what becomes of a file with one flipped bit, at so many places one after the other."""
    clean, (expected, _) = kind.path.read_bytes(), kind.read(kind.path)
    counts: Counter[str] = Counter()
    for _ in range(flips):
        place = chance.randrange(8 * len(clean))
        data = bytearray(clean)
        data[place // 8] ^= 1 << place % 8
        kind.path.unlink()  # another file on the disk, which no reader can have in memory
        kind.path.write_bytes(data)
        try:
            found, said = kind.read(kind.path)
        except InputError:
            counts[REFUSED] += 1
        else:
            counts[SAME if found == expected else SAID if said else OTHER] += 1
    kind.path.write_bytes(clean)
    return counts


def files_of_a_study(folder: Path) -> list[FileKind]:
    """Make a small hand's files: its recording in several formats, and the tables of every stage."""
    paths = {name: folder / f"{name}.parquet" for name in ("rom", "poses", *_SUBJECT_TABLES)}
    _make_tables(paths)
    write_capture(folder / "rom.arrows", CAPTURE_S)
    recording = pq.read_table(paths["rom"])
    pq.write_table(recording, folder / "foreign.parquet")
    pq.write_table(recording, folder / "checked.parquet", write_page_checksum=True)
    recording.to_pandas().to_csv(folder / "rom.csv", index=False)
    return [
        *(FileKind(f"table {name}", paths[name], _table(name)) for name in ("poses", *_SUBJECT_TABLES)),
        FileKind("simulated recording (Parquet)", paths["rom"], _samples),
        FileKind("raw capture (.arrows)", folder / "rom.arrows", _rows_of_capture),
        FileKind("recording (Parquet with page checksums)", folder / "checked.parquet", _samples),
        FileKind("recording (Parquet without)", folder / "foreign.parquet", _samples),
        FileKind("recording (CSV)", folder / "rom.csv", _samples),
    ]


def _make_tables(paths: dict[str, Path]) -> None:
    words = {name: str(path) for name, path in paths.items()}
    hand = ["--layout", LAYOUT, "--model", "paper-fig4"]
    both = ["--calibration", words["poses"], "--poses", words["poses"]]
    joints = str(paths["poses"].with_name("projected.parquet"))
    who = ["--subject", "01", "--hand", "right", "--task", "rom"]
    built = ["--out-joints", words["joint_centres"], "--out-bones", words["bone_lengths"]]
    skeleton = ["--joints", words["joint_centres"], "--bones", words["bone_lengths"]]
    skeleton += ["--metacarpals", words["metacarpals"]]
    steps = (
        (simulate, [*who, "--seed", "1", "--frames", str(FRAMES), "--out", words["rom"]]),
        (capture, ["import", "--in", words["rom"], "--layout", LAYOUT, *who, "--out", words["poses"]]),
        (solve_joints, [*hand, "--poses", words["poses"], "--out", words["joint_solutions"]]),
        (project_planes, [*hand, "--joints", words["joint_solutions"], "--out", joints]),
        (estimate_metacarpals, [*hand, *both, "--joints", joints, *built, "--out", words["metacarpals"]]),
        (
            evaluate_tips,
            [*hand, *both, *skeleton, "--out", words["tips"], "--out-errors", words["tip_errors"]],
        ),
    )
    for main, argv in steps:
        with contextlib.redirect_stderr(io.StringIO()) as said:
            code = main(argv)
        if code:
            raise RuntimeError(said.getvalue())


def _table(name: str) -> Callable[[Path], tuple[object, bool]]:
    def read(path: Path) -> tuple[object, bool]:
        rows = read_table(path, TABLES[name])
        parts = part_metadata(path, TABLES[name]) if name in _SUBJECT_TABLES else None
        return (rows.to_pydict().__repr__(), read_metadata(path), parts), False

    return read


def _samples(path: Path) -> tuple[object, bool]:
    layout = read_layout(LAYOUT)
    samples = find_reader(path, "auto")(path, layout, None)
    arrays = (samples.segment, samples.frame, samples.time_s, samples.numbers)
    return (samples.segments, *(array.tobytes() for array in arrays)), False


def _rows_of_capture(path: Path) -> tuple[object, bool]:
    archive, tally = open_archive(path), Tally()
    blocks = [
        (block.records.frame.tobytes(), block.records.position_mm.tobytes(), block.host_ns.tobytes())
        for block in blocks_of(archive, tally)
    ]
    lost = tally.spoilt_bytes or tally.unreadable_bytes or tally.missing_rows or tally.summary is None
    return (dict(archive.about), blocks, tally.events, tally.summary), bool(
        lost
    ) or "damaged" in archive.about
