"""Every reader and decoder, and what must hold whatever bytes it is given.

A decoder gives every byte of any stream to one record, reply or skip, the same however the stream is cut. A
reader gives what it reads, or InputError of one sentence. Nothing raises anything else, warns or hangs.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import random
import tempfile
import zlib
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import event_files

from fuzzing import sample_tables
from fuzzing.damage import damage, damage_values
from fuzzing.decoding import check_decoder, check_settings
from fuzzing.sample_files import RECORDINGS, SEGMENTS, Recording, capture_bytes
from fuzzing.tracker_streams import Stream, streams
from shukotsu.errors import MOST_LETTERS, InputError
from shukotsu.schemas.catalogue import POSES, TABLES
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.mapping import read_mapping
from shukotsu.schemas.model import read_model
from shukotsu.schemas.parts import check_subject, one_hand_of, open_parts, part_metadata
from shukotsu.schemas.plan import StudyPlans, read_plan
from shukotsu.schemas.poses import check_layout, frame_count, one_hand, pose_blocks, read_poses, usable_poses
from shukotsu.schemas.recording_summary import recording_row
from shukotsu.schemas.results import SUBJECT_TABLES
from shukotsu.schemas.sheets import SHEETS, read_sheet
from shukotsu.schemas.study import Hand, read_study
from shukotsu.schemas.study import Recording as StudyRecording
from shukotsu.schemas.tables import read_metadata, read_table, rows_of
from shukotsu.stages.align_events.recording_events import read_events
from shukotsu.stages.capture.formats.readers import find_parts_reader
from shukotsu.stages.capture.import_recording import build_parser, import_recording
from shukotsu.stages.capture.inspect_file import inspect
from shukotsu.stages.capture.poses_table import poses_table
from shukotsu.trackers.archive import open_archive

FOLDER_OF_SEEDS = Path(__file__).with_name("seeds")
"""Inputs that failed once, in a folder for each target."""

LAYOUT = "liberty16"
NOT_INSPECTED = ("xdf", "sequence")


@dataclass(frozen=True)
class Target:
    """Hold what is fuzzed.

    seeds : clean inputs. check : takes an input, gives the name of its outcome, or raises. damage : makes
    another input of one. share : of all inputs, against other targets': less where a reader takes long.
    """

    seeds: Sequence[bytes]
    check: Callable[[bytes], str]
    damage: Callable[[bytes, random.Random], bytes] = damage
    share: float = 1.0


@cache
def scratch() -> Path:
    """A folder in memory where the system has one."""
    memory = Path("/dev/shm")
    folder = tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None)
    _kept.append(folder)
    return Path(folder.name)


_kept: list[Any] = []


def _put(path: Path, data: bytes) -> None:
    """Write a file that nobody can have kept: another one on the disk."""
    path.unlink(missing_ok=True)
    path.write_bytes(data)


def sentence_or(take: Callable[[], object]) -> str:
    """Call a reader; "refused" where it raises InputError of one sentence, else "read"."""
    try:
        take()
    except InputError as error:
        text = str(error)
        if not text.isprintable() or not 0 < len(text) <= MOST_LETTERS:
            raise AssertionError(f"no sentence: {text!r}") from error
        return "refused"
    return "read"


def _files(
    name: str,
    files: Mapping[str, bytes],
    take: Callable[[Path], object],
    *,
    more: Sequence[bytes] = (),
    share: float = 1.0,
    structured: bool = False,
) -> Target:
    """A target of files in a folder, of which an input spoils one; take : reads that one, or all.

    An input is the file's bytes, and where there are several its number before them.
    """
    names = sorted(files)
    folder = scratch() / name.replace(" ", "_")
    folder.mkdir(exist_ok=True)
    for file, data in files.items():
        _put(folder / file, data)
    last = names[0]

    def check(data: bytes) -> str:
        nonlocal last
        chosen = names[data[0] % len(names)] if len(names) > 1 and data else names[0]
        if chosen != last:
            _put(folder / last, files[last])
            last = chosen
        _put(folder / chosen, data[1:] if len(names) > 1 else data)
        return sentence_or(lambda: take(folder / chosen))

    several = len(names) > 1
    seeds = [bytes([number]) * several + files[file] for number, file in enumerate(names)]
    change = damage_values if structured else damage
    if several:

        def changed(data: bytes, chance: random.Random) -> bytes:
            head = data[:1] if chance.randrange(8) else chance.randbytes(1)
            spoil = damage_values if structured and chance.randrange(2) else damage
            return head + spoil(data[1:], chance)

        change = changed
    return Target((*seeds, *more), check, change, share)


def _decoder(kind: str) -> Target:
    """A family and mode; an input is a stream, the number of the output list before it."""
    clean = [stream for name, stream in streams().items() if name.startswith(kind)]

    def check(data: bytes) -> str:
        if not data:
            return "refused"
        stream = clean[data[0] % len(clean)]
        return check_decoder(stream.settings, data[1:], random.Random(zlib.crc32(data)))

    seeds = [bytes([number]) + stream.data[:3000] for number, stream in enumerate(clean)]
    return Target(seeds, check, lambda data, chance: data[:1] + damage(data[1:], chance), 1.0)


def _settings() -> Target:
    """Settings as JSON in a line, and the stream that they are of behind it."""

    def seed(stream: Stream) -> bytes:
        return json.dumps(stream.settings.to_json()).encode() + b"\n" + stream.data[:400]

    def check(data: bytes) -> str:
        text, _, stream = data.partition(b"\n")
        return check_settings(text, stream, random.Random(zlib.crc32(data)))

    def changed(data: bytes, chance: random.Random) -> bytes:
        text, _, stream = data.partition(b"\n")
        return damage_values(text, chance).replace(b"\n", b" ") + b"\n" + stream

    return Target([seed(stream) for stream in streams().values()], check, changed, 3.0)


def _archive() -> Target:
    def take(path: Path) -> None:
        for piece in open_archive(path).pieces():
            assert len(piece.host_ns) == len(piece.kind) == len(piece.data)

    return _files("archive", {"a.arrows": capture_bytes()}, take, share=4.0)


def _archive_settings() -> Target:
    """A raw capture with sound checksums whose settings say anything, and whose bytes are any."""
    from shukotsu.trackers.archive import ArchiveWriter

    clean = streams()

    def capture(data: bytes) -> bytes:
        text, _, stream = data.partition(b"\n")
        try:
            settings = json.loads(text)
        except (ValueError, RecursionError):
            return text
        with tempfile.TemporaryDirectory(dir=scratch()) as name:
            writer = ArchiveWriter(Path(name, "a.arrows"), {"note": "made up"}, lambda: 0)
            writer.settings(settings, 0)
            writer.received(stream, 4_166_667)
            writer.close({"records": 1}, 5_000_000)
            return Path(name, "a.arrows").read_bytes()

    def seed(stream: Stream) -> bytes:
        return json.dumps(stream.settings.to_json()).encode() + b"\n" + stream.data[:600]

    path = scratch() / "settings.arrows"

    def check(data: bytes) -> str:
        try:
            written = capture(data)
        except (AttributeError, TypeError, ValueError):  # what the recorder itself never writes
            return "refused"
        _put(path, written)
        return sentence_or(lambda: _samples(path, None))

    def changed(data: bytes, chance: random.Random) -> bytes:
        text, _, stream = data.partition(b"\n")
        return damage_values(text, chance).replace(b"\n", b" ") + b"\n" + damage(stream, chance)

    return Target([seed(stream) for stream in clean.values()], check, changed, 0.4)


def _samples(path: Path, mapping_path: Path | None) -> None:
    """Read a recording and check it as import does, up to the rows of the poses table."""
    layout = read_layout(LAYOUT)
    mapping = read_mapping(mapping_path) if mapping_path else None
    parents = {joint.child: joint.parent_receiver for joint in layout.solvable}
    parts = find_parts_reader(path, "auto", mapping)(path, layout, mapping)
    with closing(poses_table(parts, parents, scratch())) as poses:
        for columns in poses.row_groups():
            assert len(columns["segment"] if not isinstance(columns["segment"], str) else poses.frame)


def _with_mapping(recording: Recording) -> dict[str, bytes]:
    if recording.mapping is None:
        return dict(recording.files)
    return {**recording.files, "mapping.yaml": json.dumps(recording.mapping, indent=1).encode()}


def _reader(name: str) -> Target:
    recording = RECORDINGS[name]()

    def take(path: Path) -> None:
        mapping = path.with_name("mapping.yaml") if recording.mapping is not None else None
        _samples(path.with_name(recording.path), mapping)

    share = {"c3d": 0.05, "mapped csv": 0.5, "capture": 0.3, "xdf": 1.5}.get(name, 1.0)
    return _files(f"file {name}", _with_mapping(recording), take, share=share, structured=True)


def _packed_xdf() -> Target:
    """Even: a stream to be packed; odd: packed bytes."""
    clean = RECORDINGS["xdf"]().files["a.xdf"]
    path = scratch() / "a.xdfz"

    def check(data: bytes) -> str:
        _put(path, gzip.compress(data[1:], 1) if data[:1] and data[0] % 2 == 0 else data[1:])
        return sentence_or(lambda: _samples(path, None))

    seeds = [b"\0" + clean, b"\1" + gzip.compress(clean, mtime=0)]
    return Target(seeds, check, lambda data, chance: data[:1] + damage(data[1:], chance), 1.0)


def _inspection(name: str) -> Target:
    """Give what `inspect` prints of a file, import's refusals and the findings among it."""
    recording = RECORDINGS[name]()

    def take(path: Path) -> None:
        named = path.with_name(recording.path)
        with contextlib.redirect_stdout(io.StringIO()):
            inspect(Namespace(file=named, layout=LAYOUT, hand=None, write_mapping=None))

    share = {"c3d": 0.05, "capture": 0.05}.get(name, 0.2)
    return _files(f"inspect {name}", recording.files, take, share=share, structured=True)


def _import() -> Target:
    """A tidy CSV from the command's options to the table and its findings."""
    recording = RECORDINGS["csv"]()

    def take(path: Path) -> None:
        options = {"in": path, "layout": LAYOUT, "hand": "right", "out": path.with_name("out.parquet")}
        given = [f"--{key}={value}" for key, value in (options | {"subject": "-", "task": "-"}).items()]
        with contextlib.redirect_stderr(io.StringIO()):
            import_recording(build_parser().parse_args(given))

    return _files("import", recording.files, take, share=0.2)


def _read_poses(path: Path) -> None:
    segments = tuple(SEGMENTS.values())
    frame_count(path)
    read_poses(path, (*segments, "thumb_distal"))
    for block in pose_blocks(path, segments, 4):
        assert len(block.frame) <= 4
    check_layout(path, read_layout(LAYOUT))
    one_hand([path], None, None, None)
    usable_poses([path])
    files = (path, "a.csv", Path(LAYOUT), "auto", None, "keep", "")
    recording_row(StudyRecording(Hand("01", "right"), "rom", "", "both", *files), path)


def _read_any_table(path: Path, name: str) -> None:
    table = TABLES[name]
    if table is POSES:
        _read_poses(path)
        return
    list(rows_of(read_table(path, table)))
    read_metadata(path)
    if name not in SUBJECT_TABLES:
        return
    check_subject(path, "01")
    one_hand_of(path, table, None, None, None)
    part_metadata(path, table)
    with open_parts(path, table) as parts:
        for part in sample_tables.PARTS[:1]:
            parts.rows(part)
            parts.part(part)
            if name in ("metacarpals", "tips"):
                parts.recording(part, "rom", "", "digit", ["frame"], name="thumb")


def _tables() -> Target:
    files = {f"{name}.parquet": sample_tables.table_bytes(table) for name, table in TABLES.items()}
    return _files("tables", files, lambda path: _read_any_table(path, path.stem), share=2.0)


def _table_metadata() -> Target:
    """The JSON that this program writes into tables: of which table (even) or of its parts (odd)."""
    names = ("poses", "joint_solutions", "tips", "findings")
    path = scratch() / "metadata.parquet"

    def check(data: bytes) -> str:
        head, text = (data[0] if data else 0), data[1:]
        name = names[head // 2 % len(names)]
        given = {"parts": text} if head % 2 else {"metadata": text}
        _put(path, sample_tables.table_bytes(TABLES[name], **given))
        return sentence_or(lambda: _read_any_table(path, name))

    seeds = [
        bytes([2 * index]) + json.dumps(sample_tables.metadata_of(TABLES[name])).encode()
        for index, name in enumerate(names)
    ]
    seeds += [bytes([3]) + json.dumps(sample_tables.parts_list()).encode()]
    return Target(seeds, check, lambda data, chance: data[:1] + damage_values(data[1:], chance), 0.3)


def _inspect_table() -> Target:
    files = {f"{name}.parquet": sample_tables.table_bytes(TABLES[name]) for name in ("poses", "tips")}

    def take(path: Path) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            inspect(Namespace(file=path, layout=LAYOUT, hand=None, write_mapping=None))

    return _files("inspect tables", files, take, share=0.7)


def _plan() -> Target:
    def take(path: Path) -> None:
        plan = read_plan(path)
        plan.parts()
        for hand in plan.hands:
            plan.check_calibration_left(hand)
            for name in ("tips", "receivers"):
                plan.files_of(name)
        for recording in plan.recordings:
            plan.poses(recording), plan.truth(recording), recording.name, recording.hand.folder

    with tempfile.TemporaryDirectory() as folder:
        seed = sample_tables.plan_bytes(Path(folder))
    return _files("plan", {"plan.json": seed}, take, structured=True, share=0.5)


def _study() -> Target:
    def take(path: Path) -> None:
        study = read_study(path.with_name("study.yaml"))
        plans = StudyPlans(study, Path("results/a"))
        for subject in study.subjects:
            plans.content(subject)

    return _files("study", sample_tables.STUDY, take, structured=True, share=0.3)


def _sheets() -> Target:
    files = {f"{name}.tsv": sample_tables.STUDY[f"{name}.tsv"] for name in SHEETS}
    return _files("sheets", files, lambda path: read_sheet(path, SHEETS[path.stem]), share=5.0)


def _events(name: str) -> Target:
    return _files(f"events {name}", {name: event_files.SAMPLES[name]()}, read_events)


def _layout() -> Target:
    first, *more = sample_tables.LAYOUTS

    def take(path: Path) -> None:
        layout = read_layout(path.name, path.parent)
        layout.of_hand("left").is_as(layout)

    return _files("layout", {"layout.yaml": first}, take, more=more, structured=True, share=0.3)


def _model() -> Target:
    first, *more = sample_tables.MODELS
    return _files(
        "model",
        {"model.yaml": first},
        lambda path: read_model(path.name, path.parent),
        more=more,
        structured=True,
        share=1.5,
    )


def _mapping() -> Target:
    mappings = [recording().mapping for recording in RECORDINGS.values()]
    first, *more = (json.dumps(mapping, indent=1).encode() for mapping in mappings if mapping is not None)
    return _files("mapping", {"mapping.yaml": first}, read_mapping, more=more, structured=True, share=1.5)


EVENT_FILES = {name: name.rpartition(".")[2] for name in event_files.SAMPLES}
_DECODERS = dict.fromkeys(" ".join(name.split(" ")[:2] if "(" in name else [name]) for name in streams(1))
_TARGETS: Mapping[str, Callable[[], Target]] = {
    **{f"stream {kind}": partial(_decoder, kind) for kind in _DECODERS},
    "stream settings": _settings,
    "archive": _archive,
    "archive settings": _archive_settings,
    **{f"file {name}": partial(_reader, name) for name in RECORDINGS},
    "file xdf, packed": _packed_xdf,
    **{
        f"inspect {name}": partial(_inspection, name)
        for name in RECORDINGS
        if name not in ("xdf", "sequence")
    },
    "inspect tables": _inspect_table,
    "import": _import,
    "tables": _tables,
    "table metadata": _table_metadata,
    **{f"events {ending}": partial(_events, name) for name, ending in EVENT_FILES.items()},
    "plan": _plan,
    "study": _study,
    "sheets": _sheets,
    "layout": _layout,
    "model": _model,
    "mapping": _mapping,
}

TARGETS = tuple(_TARGETS)
"""Everything that is fuzzed, by name."""


@cache
def target(name: str) -> Target:
    """Give what a name of TARGETS stands for, the inputs that failed once among its seeds."""
    from dataclasses import replace

    made = _TARGETS[name]()
    folder = FOLDER_OF_SEEDS / name.replace(" ", "_")
    stored = sorted(folder.iterdir()) if folder.is_dir() else []
    return replace(made, seeds=(*made.seeds, *(path.read_bytes() for path in stored)))


def random_input(name: str, seed: int, number: int) -> bytes:
    """The damaged input of that number, the same every time."""
    chance = random.Random(f"{seed} {name} {number}")
    return target(name).damage(chance.choice(target(name).seeds), chance)
