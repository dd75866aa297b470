"""Text files: read whole or opened, with a sentence for all that is no text file."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from shukotsu.errors import InputError
from shukotsu.tables.limits import check_regular, read_whole

_OTHER_KINDS = (
    (b"%PDF", "is a PDF document"),
    (b"PK\x03\x04", "is a spreadsheet or another packed file (.xlsx, .ods, .zip)"),
    (b"\xd0\xcf\x11\xe0", "is an old spreadsheet or document (.xls, .doc)"),
    (b"\x1f\x8b", "is packed by gzip"),
    (b"PAR1", "is a Parquet file"),
)
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
"""How text begins that Excel saves as Unicode text."""
NO_VALUE = (
    r"|[+-]?nan(\(\w*\))?|#?n/?a|n\.a\.?|<na>|none|null|nil|nat|missing|\.+|\?|[+-]?1\.#(qnan|snan|ind|nan)\w*"
    "|#(num|null|value|div/0)!|[-\N{MINUS SIGN}\N{EN DASH}\N{EM DASH}]+"
)
"""What people and programs write for "no value", in any case, as a pattern of a whole cell."""


def read_text(path: Path, expected: str, most_bytes: int | None = None, remedy: str = "") -> str:
    """Read a text file in UTF-8, a byte order mark left out, every end of a line a line feed.

    expected : what it should be, for the sentences.
    most_bytes : of a file that is never longer. remedy : how to get an absent one. Raises InputError where
    the file is absent, too long, of another kind or not in UTF-8.
    """
    with reading(path, expected, remedy):
        text = decode_text(path, read_whole(path, expected, most_bytes), expected)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def decode_text(path: Path, data: bytes, expected: str) -> str:
    """Return the text of a file's bytes. Raises InputError where they are of another kind or not in UTF-8."""
    refuse_other_kind(path, data[:8], expected)
    data = utf8_bytes(path, data)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise undecodable(path, line) from error


def utf8_bytes(path: Path, data: bytes) -> bytes:
    """Return the bytes of a text in UTF-8, where they are in UTF-16. Raises InputError where they are not."""
    try:
        return data.decode("utf-16").encode() if data.startswith(_UTF_16) else data
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: begins as UTF-16 text and is none; save it as UTF-8") from error


def undecodable(path: Path, line: int) -> InputError:
    """Name the first line that is not UTF-8."""
    return InputError(f"{path}: line {line}: is not UTF-8 text; save it as UTF-8")


def refuse_other_kind(path: Path, start: bytes, expected: str) -> None:
    """Raise InputError where a file's first bytes are those of a kind that is no text."""
    for signature, what in _OTHER_KINDS:
        if start.startswith(signature):
            save = "CSV" if "spreadsheet" in what else "text"
            raise InputError(f"{path}: {what}; expected {expected}: save it as {save}")


def open_text(path: Path, expected: str = "a recording") -> BinaryIO:
    """Open a text file to read its bytes, as UTF-8. Raises InputError where it is of another kind, and as
    `open`.
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
    """Turn what goes wrong when a file is opened or read into a sentence."""
    try:
        yield
    except FileNotFoundError as error:
        what = remedy or f"expected {expected}"
        raise InputError(f"{path}: no such file; {what}{slash_hint(str(path))}") from error
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror or error}); expected {expected}"
        ) from error


def slash_hint(path: str) -> str:
    """Return what is wrong with a path that another system writes so; empty for any other."""
    return "; folders are separated by / and not by \\" if "\\" in path else ""


def replaced_between(page: str, start: str, end: str, text: str) -> str:
    """The page with what is between its marks replaced; InputError where it lacks a mark."""
    before, opened, rest = page.partition(start)
    _, closed, after = rest.partition(end)
    if not (opened and closed):
        raise InputError(f"the page lacks {start} or {end}; put the marks where the text is to be")
    return f"{before}{start}\n\n{text}\n\n{end}{after}"
