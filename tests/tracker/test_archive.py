"""The raw archive: flushed rows can be read after truncation, damage or a kill, and while the file grows."""

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from shukotsu.errors import InputError
from shukotsu.tracker.archive import (
    END,
    EVENT,
    RECEIVED,
    SENT,
    SETTINGS,
    ArchiveWriter,
    FollowedArchive,
    Piece,
    open_archive,
)


def written(path: Path, batches: int = 6, rows: int = 4) -> Path:
    chance = np.random.default_rng(3)
    writer = ArchiveWriter(path, {"port": "made up"}, utc_offset_ns=lambda: 7)
    for batch in range(batches):
        for row in range(rows):
            writer.received(chance.bytes(100), 1000 * batch + row)
        writer.flush()
    writer.close({"reason": "key"}, 99_000)
    return path


def data_of(path: Path) -> list[bytes]:
    return [data for piece in open_archive(path).pieces() for data in piece.data]


def test_every_archived_row_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "a.arrows"
    writer = ArchiveWriter(path, {"note": "é"}, utc_offset_ns=lambda: 5)
    writer.sent(b"P", 1)
    writer.received(b"\0\xff\n", 2)
    writer.settings({"unit": "cm"}, 3)
    writer.event("note", 4, text="left")
    writer.close({"reason": "key"}, 5)
    archive = open_archive(path)
    (piece,) = archive.pieces()
    assert archive.about == {"note": "é"}
    assert piece.kind.tolist() == [SENT, RECEIVED, SETTINGS, EVENT, END]
    assert piece.host_ns.tolist() == [1, 2, 3, 4, 5]
    assert piece.utc_offset_ns.tolist() == [5] * 5
    assert piece.data == [
        b"P",
        b"\0\xff\n",
        b'{"unit": "cm"}',
        b'{"event": "note", "text": "left"}',
        b'{"reason": "key"}',
    ]


def test_an_archive_is_a_plain_arrow_stream(tmp_path: Path) -> None:
    table = pa.ipc.open_stream(written(tmp_path / "a.arrows")).read_all()
    assert table.num_rows == 25
    assert table.column_names == ["host_ns", "utc_offset_ns", "kind", "data", "crc32", "row", "row_crc32"]
    assert table.column("row").to_pylist() == list(range(25))
    assert table.schema.field("host_ns").metadata[b"unit"] == b"ns"


def test_an_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    path = written(tmp_path / "a.arrows")
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        ArchiveWriter(path, {})
    assert path.read_bytes() == before


def test_a_truncated_archive_keeps_its_whole_batches(tmp_path: Path) -> None:
    whole = written(tmp_path / "a.arrows").read_bytes()
    rows = data_of(tmp_path / "a.arrows")
    cut = tmp_path / "cut.arrows"
    first = len(whole) - 6 * 800
    for length in range(first, len(whole), 83):
        cut.write_bytes(whole[:length])
        kept = data_of(cut)
        assert kept == rows[: len(kept)]
        assert len(kept) % 4 in (0, 1)


def test_a_damaged_batch_does_not_affect_the_others(tmp_path: Path) -> None:
    path = written(tmp_path / "a.arrows")
    whole, rows = bytearray(path.read_bytes()), data_of(path)
    begin = whole.index(rows[0])
    for offset in range(begin - 300, begin + 2500, 71):
        hurt = whole.copy()
        hurt[offset] ^= 0x5A
        path.write_bytes(hurt)
        pieces = list(open_archive(path).pieces())
        kept = [data for piece in pieces for data in piece.data]
        assert [row for row in rows if row in kept] == [data for data in kept if data in rows]
        assert all(data in rows for data in kept), "damaged bytes were read"
        assert len(kept) >= len(rows) - 4
        lost = sum(piece.spoilt_bytes + piece.unreadable_bytes for piece in pieces)
        assert (lost > 0) == (len(kept) < len(rows))
        _, pieces = followed_while_growing(bytes(hurt), tmp_path / "b.arrows", 800)
        assert [data for piece in pieces for data in piece.data] == kept, "read while it grows"
        assert sum(piece.spoilt_bytes + piece.unreadable_bytes for piece in pieces) == lost
        (tmp_path / "b.arrows").unlink()


def all_of(path: Path) -> list[object]:
    archive = open_archive(path)
    read: list[object] = [dict(archive.about)]
    for piece in archive.pieces():
        assert not piece.spoilt_bytes
        assert not piece.unreadable_bytes
        assert not piece.missing_rows
        read += zip(piece.kind, piece.host_ns, piece.utc_offset_ns, piece.data, strict=True)
    return read


def silently_wrong(path: Path, bits: Iterable[int]) -> list[int]:
    clean, expected, other = path.read_bytes(), all_of(path), []
    for bit in bits:
        data = bytearray(clean)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        with suppress(InputError, AssertionError):
            read = all_of(path)
            ended = read[-1][0] == END  # type: ignore[index]
            if read != expected and "damaged" not in read[0] and ended:  # type: ignore[operator]
                other.append(bit)
    return other


@pytest.mark.slow
def test_a_flipped_bit_never_gives_a_wrong_row(tmp_path: Path) -> None:
    path = written(tmp_path / "a.arrows")
    bits = random.Random(1).sample(range(8 * path.stat().st_size), 700)
    assert silently_wrong(path, bits) == []


CHILD = """
import sys, time
from pathlib import Path
from shukotsu.tracker.archive import ArchiveWriter
writer = ArchiveWriter(Path(sys.argv[1]), {})
for number in range(10**6):
    writer.received(number.to_bytes(4, "little") * 64, time.monotonic_ns())
    if number % 10 == 9:
        writer.flush()
        print(number, flush=True)
"""


def test_a_killed_writer_leaves_every_flushed_row(tmp_path: Path) -> None:
    path = tmp_path / "a.arrows"
    with subprocess.Popen([sys.executable, "-c", CHILD, path], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        for _ in range(20):
            flushed = int(child.stdout.readline())
        os.kill(child.pid, signal.SIGKILL)
    kept = data_of(path)
    assert [int.from_bytes(data[:4], "little") for data in kept] == list(range(len(kept)))
    assert len(kept) > flushed


def followed_while_growing(
    whole: bytes, path: Path, step: int, hidden: range = range(0)
) -> tuple[FollowedArchive, list[Piece]]:
    """Follow a file that grows in steps; the bytes `hidden` are zeros until the bytes after them are
    written.
    """
    followed, pieces = FollowedArchive(path), []
    assert followed.read() == []
    for length in [*range(0, len(whole), step), len(whole)]:
        shown = bytearray(whole[:length])
        if length < hidden.stop:
            shown[hidden.start : length] = bytes(max(0, length - hidden.start))
        path.write_bytes(shown)
        pieces += followed.read()
    return followed, pieces + followed.read(final=True)


@pytest.mark.parametrize(("step", "hidden"), [(41, range(0)), (800, range(0)), (41, range(4000, 4300))])
def test_following_a_growing_archive_gives_the_same_rows(tmp_path: Path, step: int, hidden: range) -> None:
    path = written(tmp_path / "a.arrows")
    followed, pieces = followed_while_growing(path.read_bytes(), tmp_path / "b.arrows", step, hidden)
    assert [data for piece in pieces for data in piece.data] == data_of(path)
    assert sum(piece.spoilt_bytes + piece.unreadable_bytes + piece.missing_rows for piece in pieces) == 0
    assert followed.about == {"port": "made up"}
    assert followed.ended


@pytest.mark.parametrize("event", ["cut", "gone"])
def test_following_refuses_a_replaced_or_truncated_archive(tmp_path: Path, event: str) -> None:
    path = written(tmp_path / "a.arrows")
    followed = FollowedArchive(path)
    assert followed.read()
    path.unlink() if event == "gone" else os.truncate(path, path.stat().st_size - 1000)
    with pytest.raises(InputError, match=r"was replaced or cut|no longer exists"):
        followed.read()
    path.write_text("hello")
    with pytest.raises(InputError, match="does not begin"):
        FollowedArchive(path).read(final=True)
