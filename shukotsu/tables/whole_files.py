"""Files: written completely or not at all, and identified by their bytes."""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

from shukotsu.errors import InputError, StorageError
from shukotsu.tables.limits import FILE_NAME_BYTES


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`, which replaces `path` at the end.

    If writing fails, `path` is unchanged and the temporary file is removed; temporary files of killed
    processes are removed first. After a power failure the name holds either the old or the new file,
    complete: the bytes are synced to disk before the rename, and the folder before this returns. A file must
    have only one writer at a time.

    Raises
    ------
    StorageError
        Where the file cannot be written.
    InputError
        Where no file can have the name.

    """
    if not path.name:
        raise InputError(f"{path}: is a folder; expected the name of a file to write")
    stem = path.name
    if len(os.fsencode(stem)) > FILE_NAME_BYTES - 20:  # with what stands around it, too long for a file
        stem = hashlib.sha256(os.fsencode(stem)).hexdigest()
    temporary = path.with_name(f".{stem}.{os.getpid()}.tmp")
    try:
        if path.exists() and not path.is_file():
            raise StorageError(f"{path}: cannot be written (is a folder or a device); name a file")
        path.parent.mkdir(parents=True, exist_ok=True)
        left = re.compile(re.escape(f".{stem}.") + r"\d+\.tmp")
        with suppress(OSError):  # a folder that cannot be written to: opening the file will say so
            for beside in path.parent.iterdir():
                if left.fullmatch(beside.name):
                    beside.unlink(missing_ok=True)
        yield temporary
        _sync(temporary, os.O_RDWR)  # Windows syncs only files opened for writing
        temporary.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else error  # rather than Arrow's message
        kind = InputError if error.errno == errno.ENAMETOOLONG else StorageError  # no disk accepts the name
        raise kind(f"{path}: cannot be written ({why})") from error
    finally:
        with suppress(OSError):  # where a component of the path is a file, that was reported above
            temporary.unlink(missing_ok=True)


def sync_folder(path: Path) -> None:
    """Sync the entries of a folder to disk, where the system supports it."""
    with suppress(OSError):  # without it, files are still complete under the old or the new name
        _sync(path, os.O_RDONLY)


def _sync(path: Path, mode: int) -> None:
    """Sync a file or folder to disk."""
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def remedy_of(path: Path) -> str:
    """Say what to do about a damaged table or plan: one beside the plan of a study's run is made again, any
    other may be somebody's recording.
    """
    beside = [folder / "plan.json" for folder in path.absolute().parents[:4]]
    is_made = any(map(Path.is_file, (*beside, *path.absolute().parent.glob("sub-*/plan.json"))))
    return "remove it and run the study again" if is_made else "name one that this program made"


def files_in(folder: Path) -> list[Path]:
    """Files of a folder by name, without hidden ones, which editors and unfinished writers leave."""
    return sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file with line feeds, completely or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, "utf-8", newline="\n")


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, read in pieces and cached by the file's state."""
    return _sha256(path, *file_state(path))


def file_state(path: Path) -> tuple[int, int, int, int, int]:
    """Numbers that change whenever a file changes: device, inode, size, and the times of content and of the
    entry.

    The time of the entry, in ns and last, is set by the system alone; it reveals a change after which the
    others were restored.
    """
    status = path.stat()
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


@lru_cache(maxsize=4096)
def _sha256(path: Path, *_: int) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
