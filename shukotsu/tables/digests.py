"""Digests that identify files, and the digest that a Parquet file of this program contains."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

_MARK = b"SHUKOTSU SHA-256"
_DIGEST_BYTES = 32
_PIECE_BYTES = 1 << 20
_END_BYTES = 8
"""Length of the footer's size field and of the letters that end every Parquet file."""


def file_state(path: Path) -> tuple[int, int, int, int, int]:
    """Return numbers that change whenever a file changes: device, inode, size, mtime and ctime in ns.

    The ctime can only be set by the system, so it reveals a change after which the other numbers were
    restored.
    """
    status = path.stat()
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def store_digest(path: Path) -> None:
    """Insert the digest of a finished Parquet file; the file remains readable by any program."""
    with path.open("r+b") as stream:
        footer_at = _footer_at(stream)
        stream.seek(0)
        digest = hashlib.file_digest(stream, "sha256").digest()
        stream.seek(footer_at)
        footer = stream.read()
        stream.seek(footer_at)
        stream.write(_MARK + digest + footer)


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, read in pieces and cached by the file's state."""
    return _digests(path, *file_state(path))[0]


def digest_holds(path: Path) -> bool | None:
    """Return whether a file matches the digest that `store_digest` inserted; None if it has none."""
    return _digests(path, *file_state(path))[1]


@lru_cache(maxsize=4096)
def _digests(path: Path, *_: int) -> tuple[str, bool | None]:
    """Compute both digests of a file in one pass: they differ only by the last bytes before the footer."""
    stored = b""
    with path.open("rb") as stream:
        footer_at = _footer_at(stream)
        stored_at = footer_at - len(_MARK) - _DIGEST_BYTES
        if stored_at >= 0:
            stream.seek(stored_at)
            stored = stream.read(len(_MARK) + _DIGEST_BYTES)
        if not stored.startswith(_MARK):
            stream.seek(0)
            return hashlib.file_digest(stream, "sha256").hexdigest(), None
        stream.seek(0)
        digest = hashlib.sha256()
        while piece := stream.read(min(stored_at - stream.tell(), _PIECE_BYTES)):
            digest.update(piece)
        whole = digest.copy()
        whole.update(stored)
        stream.seek(footer_at)
        footer = stream.read()
        digest.update(footer)
        whole.update(footer)
    return whole.hexdigest(), digest.digest() == stored[len(_MARK) :]


def _footer_at(stream: BinaryIO) -> int:
    """Return the start of the footer by the file's last bytes; in a damaged file it may be any number."""
    end = stream.seek(0, 2)
    stream.seek(max(0, end - _END_BYTES))
    return end - _END_BYTES - int.from_bytes(stream.read(4), "little")
