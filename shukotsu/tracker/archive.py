"""The raw archive: every byte received from a tracker and every command sent to it.

An archive is an Arrow IPC stream (`.arrows`), which any Arrow reader can open. A row is one piece of this
traffic: see COLUMNS and KINDS. Complete batches are appended and synced to disk about once a second; a
recorder that is killed loses only the data since the last sync. The reader recovers every complete batch,
also those after a damaged one.
"""

from __future__ import annotations

import json
import mmap
import os
import struct
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from shukotsu.errors import InputError
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables import limits, text_files, typed_table, whole_files

SCHEMA_NAME, SCHEMA_VERSION = "capture", 2
RECEIVED, SENT, SETTINGS, EVENT, END = range(5)
KINDS = {
    RECEIVED: "bytes that came from the tracker",
    SENT: "bytes that were sent to it",
    SETTINGS: "JSON: how the stream is to be read",
    EVENT: "JSON: something happened to the recording (a note, a clock that jumped, the tracker gone)",
    END: "JSON: the recording was ended, and how",
}

_OF_ROW = "CRC-32 of row, host_ns, utc_offset_ns, kind and crc32, eight bytes each, the lowest first"
COLUMNS = (
    ("host_ns", pa.int64(), "ns", "the host's monotonic clock when the bytes had come or were sent"),
    ("utc_offset_ns", pa.int64(), "ns", "the host's UTC minus its monotonic clock, about then"),
    ("kind", pa.int8(), "", "; ".join(f"{number}: {text}" for number, text in KINDS.items())),
    ("data", pa.binary(), "", "the bytes, or JSON in UTF-8"),
    ("crc32", pa.uint32(), "", "CRC-32 of data"),
    ("row", pa.int64(), "", "the row's number in the recording, from 0"),
    ("row_crc32", pa.uint32(), "", _OF_ROW),
)
_SCHEMA = pa.schema(
    [pa.field(name, kind, False, {"unit": unit, "description": text}) for name, kind, unit, text in COLUMNS]
)

SYNC_SECONDS = 1.0
_AS_THEY_ARE: int = getattr(os, "O_BINARY", 0)
"""Flag without which Windows would write a line feed as two bytes."""
_CONTINUATION, _END_OF_STREAM = b"\xff\xff\xff\xff", b"\xff\xff\xff\xff\x00\x00\x00\x00"
_MOST_HEAD_BYTES = 1 << 20
"""Largest size of an archive's schema message, which contains its description."""
_WINDOW_BYTES = 8 << 20
_STRETCH_BYTES = 64 << 20
"""Part of a growing file that is read at once; must be at least twice the longest batch."""


class ArchiveWriter:
    """Writer of a new archive. After every `flush` the file is a readable archive.

    about : description of the recording (port, the program's options, note) as JSON types; stored in the
    schema. utc_offset_ns : returns UTC minus monotonic time; a constant makes archives reproducible.
    waiting_bytes : bytes of data that the next `flush` will append.

    Raises InputError if the file exists already or cannot be written. If the disk is full, `flush` raises
    OSError and the file ends with the last complete batch.
    """

    def __init__(
        self,
        path: Path,
        about: Mapping[str, Any],
        utc_offset_ns: Callable[[], int] = lambda: time.time_ns() - time.perf_counter_ns(),
    ) -> None:
        self.path = path
        self._utc_offset_ns = utc_offset_ns
        self._rows: list[tuple[int, int, int, bytes]] = []
        self.waiting_bytes = self._written_rows = self._length = 0
        self._synced = 0.0
        whole = {
            "schema": SCHEMA_NAME,
            "schema_version": SCHEMA_VERSION,
            "program": PROGRAM,
            "program_version": VERSION,
            "columns": {name: {"unit": unit, "description": text} for name, _, unit, text in COLUMNS},
            "about": about,
            "about_crc32": zlib.crc32(_json_bytes(about)),
        }
        self._schema = _SCHEMA.with_metadata({typed_table.METADATA_KEY: _json_bytes(whole)})
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _AS_THEY_ARE, 0o644)
        except FileExistsError as error:
            raise InputError(f"{path}: exists already; a recording is never written over") from error
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror})") from error
        self._append(self._schema.serialize().to_pybytes())
        self._sync()
        whole_files.sync_folder(path.parent)

    def received(self, data: bytes, host_ns: int) -> None:
        """Record bytes that were received."""
        self._add(RECEIVED, data, host_ns)

    def sent(self, data: bytes, host_ns: int) -> None:
        """Record bytes that were sent."""
        self._add(SENT, data, host_ns)

    def settings(self, settings: Mapping[str, Any], host_ns: int) -> None:
        """Record the settings by which the stream is decoded (`StreamSettings.to_json`)."""
        self._add(SETTINGS, _json_bytes(settings), host_ns)

    def event(self, name: str, host_ns: int, /, **details: Any) -> None:
        """Record an event."""
        self._add(EVENT, _json_bytes({**details, "event": name}), host_ns)

    def flush(self) -> None:
        """Append the rows added since the last call as one batch; sync to disk about once a second."""
        if self._rows:
            host_ns, offsets, kinds, data = zip(*self._rows, strict=True)
            crcs = [zlib.crc32(piece) for piece in data]
            numbers = range(self._written_rows, self._written_rows + len(data))
            row_crcs = _row_crcs(numbers, host_ns, offsets, kinds, crcs)
            columns = zip((host_ns, offsets, kinds, data, crcs, numbers, row_crcs), self._schema, strict=True)
            arrays = [pa.array(values, column.type) for values, column in columns]
            self._written_rows += len(data)
            self._append(pa.record_batch(arrays, schema=self._schema).serialize().to_pybytes())
            self._rows.clear()
            self.waiting_bytes = 0
        if time.perf_counter() - self._synced >= SYNC_SECONDS:
            self._sync()

    def close(self, summary: Mapping[str, Any], host_ns: int) -> None:
        """Append a row with the summary of the recording, and close the file."""
        self._add(END, _json_bytes(summary), host_ns)
        try:
            self.flush()
            self._append(_END_OF_STREAM)
            self._sync()
        finally:
            os.close(self._file)

    def discard(self) -> None:
        """Remove the file, because nothing was recorded; the next attempt may reuse the name."""
        os.close(self._file)
        self.path.unlink(missing_ok=True)

    def _add(self, kind: int, data: bytes, host_ns: int) -> None:
        self._rows.append((host_ns, self._utc_offset_ns(), kind, data))
        self.waiting_bytes += len(data)

    def _append(self, data: bytes) -> None:
        """Write the data completely or not at all: a partial batch would hide the following ones."""
        written = 0
        try:
            while written < len(data):
                written += os.write(self._file, data[written:])
        except OSError:
            os.ftruncate(self._file, self._length)
            os.lseek(self._file, self._length, os.SEEK_SET)
            raise
        self._length += written

    def _sync(self) -> None:
        os.fsync(self._file)
        self._synced = time.perf_counter()


def _row_crcs(*columns: Sequence[int] | npt.NDArray[Any]) -> list[int]:
    """Return the CRC-32 of each row of the columns, as eight-byte little-endian integers."""
    rows = np.stack([np.asarray(column, "<i8") for column in columns], -1).tobytes()
    size = 8 * len(columns)
    return [zlib.crc32(rows[at : at + size]) for at in range(0, len(rows), size)]


def _json_bytes(value: Any) -> bytes:
    return json.dumps(value, ensure_ascii=False, sort_keys=True).encode()


@dataclass(frozen=True)
class Piece:
    """Rows of an archive: host_ns, utc_offset_ns and kind, all (N,), and the data of each row.

    Rows with a wrong checksum are left out. spoilt_bytes : size of their data. unreadable_bytes : number of
    bytes before this piece that belong to no batch. missing_rows : number of rows missing before and within
    this piece.
    """

    host_ns: npt.NDArray[np.int64]
    utc_offset_ns: npt.NDArray[np.int64]
    kind: npt.NDArray[np.int8]
    data: list[bytes]
    spoilt_bytes: int = 0
    unreadable_bytes: int = 0
    missing_rows: int = 0


@dataclass(frozen=True)
class Archive:
    """An archive open for reading."""

    path: Path
    about: Mapping[str, Any]
    _mapped: mmap.mmap
    _first: int
    _schema: pa.Schema

    def pieces(self) -> Iterator[Piece]:
        """Yield the batches in order; a last, empty piece may report trailing bytes outside any batch."""
        forgotten = 0
        for piece, at, _ in _pieces(pa.py_buffer(self._mapped), self._first, self._schema, 0, final=True):
            yield piece
            end = at // mmap.PAGESIZE * mmap.PAGESIZE
            if end - forgotten > _WINDOW_BYTES and hasattr(mmap, "MADV_DONTNEED"):
                self._mapped.madvise(mmap.MADV_DONTNEED, forgotten, end - forgotten)  # frees pages read
                forgotten = end


class FollowedArchive:
    """An archive that another process, perhaps on another computer, is still writing; read as it grows.

    about : description of the recording; None until it has been read. ended : whether the archive's end was
    read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.about: Mapping[str, Any] | None = None
        self.ended = False
        self._schema: pa.Schema | None = None
        self._head = b""
        self._at = self._next_row = 0

    def read(self, *, final: bool = False) -> list[Piece]:
        """Return the complete batches since the last call, at most a limited amount of data.

        Bytes after the last valid batch may be incomplete and are left for the next call, unless they are
        longer than any batch.

        Parameters
        ----------
        final : bool
            Whether the writer has finished. Then a missing file, or one that does not begin as an archive, is
            an error, and trailing bytes are counted as unreadable.

        Returns
        -------
        list of Piece
            The batches, in order.

        Raises
        ------
        InputError
            If the file was replaced, became shorter than the part already read, or is not an archive.

        """
        try:
            with self.path.open("rb") as file:
                head = file.read(len(self._head) or _MOST_HEAD_BYTES)
                size = file.seek(0, os.SEEK_END)
                if self._schema is None:
                    schema, first = _schema_at_start(pa.py_buffer(head))
                    if schema is not None or final or len(head) >= _MOST_HEAD_BYTES:
                        self.about = _checked_about(self.path, schema)
                        self._schema, self._head, self._at = schema, head[:first], first
                elif head != self._head or size < self._at:
                    raise InputError(
                        f"{self.path}: was replaced or cut while it was read; read the new one from its start"
                    )
                file.seek(self._at)
                stretch = file.read(min(size - self._at, _STRETCH_BYTES)) if self._schema else b""
        except FileNotFoundError as error:
            if self._schema is None and not final:
                return []
            raise InputError(f"{self.path}: no longer exists; expected a recording's archive") from error
        except OSError as error:
            raise InputError(f"{self.path}: cannot be read ({error.strerror}); try again") from error
        final &= self._at + len(stretch) >= size
        pieces = self._sound(stretch, final=final)
        if not pieces and len(stretch) == _STRETCH_BYTES:  # a valid batch may begin in the second half
            pieces = self._sound(stretch[: _STRETCH_BYTES // 2], final=True)
        return pieces

    def _sound(self, stretch: bytes, *, final: bool) -> list[Piece]:
        if self._schema is None or not stretch:
            return []
        batches = list(_pieces(pa.py_buffer(stretch), 0, self._schema, self._next_row, final=final))
        # on network drives, zeros may appear before the data are transferred
        while batches and not final and batches[-1][0].spoilt_bytes:
            batches.pop()
        _, read, self._next_row = batches[-1] if batches else (None, 0, self._next_row)
        self._at += read
        pieces = [piece for piece, _, _ in batches]
        self.ended |= stretch[read:] == _END_OF_STREAM or any(END in piece.kind for piece in pieces)
        return pieces


def _pieces(
    buffer: pa.Buffer, at: int, schema: pa.Schema, next_row: int, *, final: bool
) -> Iterator[tuple[Piece, int, int]]:
    """Yield each batch, the position of its end in the buffer, and the number of the next row.

    final : whether nothing follows; then an empty last piece reports trailing bytes that belong to no batch.
    """
    lost, view = 0, memoryview(buffer).cast("B")
    while at + 8 <= len(view):
        if view[at : at + 8] == _END_OF_STREAM:
            at += 8
            continue
        batch, size = _batch_at(buffer, at, schema)
        if batch is None:  # batches start at multiples of 8 bytes
            first = at + 1 + -(at + 1) % 8
            words = np.frombuffer(view[first : len(view) - (len(view) - first) % 8], "<u4")[::2]
            starts = np.flatnonzero(words == 0xFFFFFFFF)
            following = first + 8 * int(starts[0]) if len(starts) else len(view)
            lost += following - at
            at = following
            continue
        piece, next_row = _piece(batch, lost, next_row)
        at, lost = at + size, 0
        yield piece, at, next_row
    lost += len(view) - at
    if lost and final:
        empty = np.empty(0, np.int64)
        yield Piece(empty, empty, empty.astype(np.int8), [], unreadable_bytes=lost), len(view), next_row


def open_archive(path: Path) -> Archive:
    """Open an archive. Raises InputError if the file does not exist or does not begin as an archive."""
    with text_files.reading(path, "a raw capture"):
        if not limits.check_regular(path, "a raw capture"):
            raise InputError(f"{path}: is empty; expected a raw capture")
        with path.open("rb") as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    schema, first = _schema_at_start(pa.py_buffer(mapped))
    return Archive(path, _checked_about(path, schema), mapped, first, schema)


def _checked_about(path: Path, schema: pa.Schema | None) -> Mapping[str, Any]:
    """Return the description of an archive. Raises InputError if its schema is not that of an archive."""
    not_one = InputError(f"{path}: does not begin as a raw capture does; expected what `record` writes")
    if schema is None:
        raise not_one
    try:
        whole = json.loads((schema.metadata or {})[typed_table.METADATA_KEY])
        named = (whole["schema"], whole["schema_version"])
        about = dict(whole["about"])
        sound = whole.get("about_crc32") == zlib.crc32(_json_bytes(about))
    except (KeyError, ValueError, TypeError, RecursionError) as error:
        raise not_one from error
    if named != (SCHEMA_NAME, SCHEMA_VERSION):
        raise InputError(
            f"{path}: is {named[0]!r} version {named[1]!r}; expected {SCHEMA_NAME} version {SCHEMA_VERSION}"
        )
    if not schema.equals(_SCHEMA, check_metadata=False):
        raise not_one
    if not sound:  # the description is only for people; the recording itself may be intact
        return {"damaged": "the description of this recording has a wrong checksum; left out"}
    return about


def _schema_at_start(buffer: pa.Buffer) -> tuple[pa.Schema | None, int]:
    size = _message_bytes(memoryview(buffer).cast("B"), 0)
    if size is None:
        return None, 0
    try:
        return pa.ipc.read_schema(buffer.slice(0, size)), size
    except (pa.ArrowException, OSError, ValueError):
        return None, 0


def _message_bytes(view: memoryview, at: int) -> int | None:
    """Return the length of a message's prefix and metadata; None if no message starts at `at`."""
    if at + 8 > len(view) or view[at : at + 4] != _CONTINUATION:
        return None
    size = int.from_bytes(view[at + 4 : at + 8], "little", signed=True)
    return 8 + size if 0 < size <= len(view) - at - 8 and size % 8 == 0 else None


def _batch_at(buffer: pa.Buffer, at: int, schema: pa.Schema) -> tuple[pa.RecordBatch | None, int]:
    """Return the batch that starts at `at`, and its length; None and 0 if no complete valid batch does."""
    head = _message_bytes(memoryview(buffer).cast("B"), at)
    if head is None:
        return None, 0
    try:
        message = pa.ipc.read_message(buffer.slice(at))
        if _is_compressed(message.metadata.to_pybytes()):  # this program never compresses
            return None, 0
        batch = pa.ipc.read_record_batch(message, schema)
        batch.validate(full=True)
    except (pa.ArrowException, OSError, ValueError, struct.error):
        return None, 0
    if any(column.null_count for column in batch.columns):
        return None, 0
    return batch, head + (message.body.size if message.body is not None else 0)


def _piece(batch: pa.RecordBatch, lost: int, next_row: int) -> tuple[Piece, int]:
    """Return a batch's valid rows and the number of the next row; next_row : expected number of the first."""
    host_ns, offset_ns, kind, data, crc32, row, row_crc32 = batch.columns
    pieces = data.to_pylist()
    sound = np.fromiter(map(zlib.crc32, pieces), np.int64, len(pieces)) == crc32.to_numpy()
    sound &= np.array(_row_crcs(row, host_ns, offset_ns, kind, crc32), np.int64) == row_crc32.to_numpy()
    starts, missing = row.to_numpy()[sound] - np.flatnonzero(sound), 0
    if len(starts):
        missing = 0 if lost else int(np.abs(starts - next_row).max())
        next_row = int(starts[-1])
    numbers = [column.to_numpy()[sound] for column in (host_ns, offset_ns, kind)]
    spoilt = sum(len(piece) for piece, good in zip(pieces, sound, strict=True) if not good)
    kept = [piece for piece, good in zip(pieces, sound, strict=True) if good]
    return Piece(numbers[0], numbers[1], numbers[2], kept, spoilt, lost, missing), next_row + len(pieces)


def _is_compressed(metadata: bytes) -> bool:
    """Return whether a record batch's message is compressed. Raises struct.error if it is damaged.

    Compressed buffers are refused because Arrow would unpack them to any size. In the message's flatbuffer
    the batch is the third field, and its compression is the batch's fourth. A flatbuffer table starts with
    the distance back to its vtable, which lists the offsets of its fields.
    """

    def field_at(table: int, number: int) -> int:
        fields = table - struct.unpack_from("<i", metadata, table)[0]
        length = struct.unpack_from("<H", metadata, fields)[0]
        if 6 + 2 * number > length:
            return 0
        offset: int = struct.unpack_from("<H", metadata, fields + 4 + 2 * number)[0]
        return table + offset if offset else 0

    header_at = field_at(struct.unpack_from("<I", metadata, 0)[0], 2)
    return field_at(header_at + struct.unpack_from("<I", metadata, header_at)[0], 3) != 0
