"""Read and open text files, with one clear sentence of error for anything that is not text."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from shukotsu.errors import InputError
from shukotsu.tables.limits import check_regular, read_whole

_OTHER_KINDS = (
    (b"%PDF", "is a PDF document", "text"),
    (b"PK\x03\x04", "is a spreadsheet or another packed file (.xlsx, .ods, .zip)", "CSV"),
    (b"\xd0\xcf\x11\xe0", "is an old spreadsheet or document (.xls, .doc)", "CSV"),
    (b"\x1f\x8b", "is packed by gzip", "text"),
    (b"PAR1", "is a Parquet file", "text"),
)
"""First bytes of other kinds of files, their description, and the format in which to save them instead."""
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
"""First bytes of UTF-16 text, which Excel saves as Unicode text."""
NO_VALUE = (
    r"|[+-]?nan(\(\w*\))?|#?n/?a|n\.a\.?|<na>|none|null|nil|nat|missing|\.+|\?|[+-]?1\.#(qnan|snan|ind|nan)\w*"
    "|#(num|null|value|div/0)!|[-\N{MINUS SIGN}\N{EN DASH}\N{EM DASH}]+"
)
"""Pattern of cells that mean "no value", to be matched without regard to case."""


def read_text(path: Path, expected: str, most_bytes: int | None = None, remedy: str = "") -> str:
    """Read a UTF-8 text file, without a byte order mark and with all line ends as line feeds.

    Parameters
    ----------
    path : Path
        The file.
    expected : str
        What it should be, for the error message.
    most_bytes : int, optional
        Largest accepted size.
    remedy : str
        How to obtain the file if it does not exist.

    Returns
    -------
    str
        Its text.

    Raises
    ------
    InputError
        If the file does not exist, is too large, of another kind or not UTF-8.

    """
    with reading(path, expected, remedy):
        text = decode_text(path, read_whole(path, expected, most_bytes), expected)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def decode_text(path: Path, data: bytes, expected: str) -> str:
    """Decode the bytes of a text file. Raises InputError if they are of another kind or not UTF-8."""
    refuse_other_kind(path, data[:8], expected)
    data = utf8_bytes(path, data)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise undecodable(path, line) from error


def utf8_bytes(path: Path, data: bytes) -> bytes:
    """Convert UTF-16 text, recognised by its first bytes, to UTF-8; return other bytes unchanged.

    Raises InputError if text that begins as UTF-16 cannot be decoded.
    """
    try:
        return data.decode("utf-16").encode() if data.startswith(_UTF_16) else data
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: begins as UTF-16 text but is not valid; save it as UTF-8") from error


def undecodable(path: Path, line: int) -> InputError:
    """Return an InputError for the first line that is not UTF-8."""
    return InputError(f"{path}: line {line}: is not UTF-8 text; save it as UTF-8")


def refuse_other_kind(path: Path, start: bytes, expected: str) -> None:
    """Raise InputError if the first bytes of a file are those of a kind that is not text."""
    for signature, what, save in _OTHER_KINDS:
        if start.startswith(signature):
            raise InputError(f"{path}: {what}; expected {expected}: save it as {save}")


def open_text(path: Path, expected: str = "a recording") -> BinaryIO:
    """Open a text file for reading its bytes; UTF-16 is converted to UTF-8.

    Raises InputError if it is of another kind, and OSError as `open` does.
    """
    check_regular(path, expected)
    stream = path.open("rb")
    try:
        start = stream.read(8)
        refuse_other_kind(path, start, expected)
        stream.seek(0)
        if start.startswith(_UTF_16):
            with stream:
                return io.BytesIO(utf8_bytes(path, stream.read()))
    except InputError:
        stream.close()
        raise
    return stream


@contextmanager
def reading(path: Path, expected: str = "a recording", remedy: str = "") -> Iterator[None]:
    """Convert errors of opening or reading a file, within the `with` block, into an InputError."""
    try:
        yield
    except FileNotFoundError as error:
        what = remedy or f"expected {expected}"
        raise InputError(f"{path}: no such file; {what}{slash_hint(str(path))}") from error
    except OSError as error:
        why = error.strerror or error
        raise InputError(f"{path}: cannot be read ({why}); expected {expected}") from error


def slash_hint(path: str) -> str:
    """Return a hint for a path with the separators of another system, or "" for any other path."""
    return "; folders are separated by / and not by \\" if "\\" in path else ""


def replaced_between(page: str, start: str, end: str, text: str) -> str:
    """Return the page with the text between two marks replaced. Raises InputError if a mark is missing."""
    before, opened, rest = page.partition(start)
    _, closed, after = rest.partition(end)
    if not (opened and closed):
        raise InputError(f"the page lacks {start} or {end}; insert the marks where the text belongs")
    return f"{before}{start}\n\n{text}\n\n{end}{after}"
