"""Write files atomically."""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from shukotsu.errors import InputError, StorageError
from shukotsu.tables.limits import FILE_NAME_BYTES


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder, which replaces `path` at the end of the `with` block.

    If writing fails, `path` is unchanged and the temporary file is removed; temporary files of killed
    processes are removed first. After a power failure the name holds either the old or the new file,
    complete: the bytes are synced to disk before the rename, and the folder before this returns. A file must
    have only one writer at a time.

    Raises
    ------
    StorageError
        If the file cannot be written.
    InputError
        If no file can have this name.

    """
    if not path.name:
        raise InputError(f"{path}: is a folder; expected the name of a file to write")
    stem = path.name
    if len(os.fsencode(stem)) > FILE_NAME_BYTES - 20:  # too long for a temporary file's prefix and suffix
        stem = hashlib.sha256(os.fsencode(stem)).hexdigest()
    temporary = path.with_name(f".{stem}.{os.getpid()}.tmp")
    try:
        if path.exists() and not path.is_file():
            raise StorageError(f"{path}: cannot be written (is a folder or a device); name a file")
        path.parent.mkdir(parents=True, exist_ok=True)
        left = re.compile(re.escape(f".{stem}.") + r"\d+\.tmp")
        with suppress(OSError):  # if the folder is not writable, opening the file reports it
            for other in path.parent.iterdir():
                if left.fullmatch(other.name):
                    other.unlink(missing_ok=True)
        yield temporary
        _sync(temporary, os.O_RDWR)  # Windows syncs only files opened for writing
        temporary.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else error  # clearer than Arrow's message
        kind = InputError if error.errno == errno.ENAMETOOLONG else StorageError  # a bad name, not a bad disk
        raise kind(f"{path}: cannot be written ({why})") from error
    finally:
        with suppress(OSError):  # if a component of the path is a file, that was reported above
            temporary.unlink(missing_ok=True)


def sync_folder(path: Path) -> None:
    """Sync the entries of a folder to disk, if the system supports it."""
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
    """Return what to do about a damaged table or plan.

    In a study's results it can be removed and made again; elsewhere it may be an irreplaceable recording.
    """
    plans = [folder / "plan.json" for folder in path.absolute().parents[:4]]
    is_made = any(map(Path.is_file, (*plans, *path.absolute().parent.glob("sub-*/plan.json"))))
    return "remove it and run the study again" if is_made else "name one that this program made"


def files_in(folder: Path) -> list[Path]:
    """Return the files in a folder, sorted by name, without hidden ones such as temporary files."""
    return sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file with line feeds atomically."""
    with replacing(path) as temporary:
        temporary.write_text(text, "utf-8", newline="\n")
