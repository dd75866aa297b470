"""Errors that a user can correct: bad input or bad configuration."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

MOST_LETTERS = 400
"""Longest message; the place stands first and the remedy last, so the middle is left out."""

INTERNAL = "internal error in"
"""Start of the reason for a part that failed by a bug; the stage follows."""


class InputError(Exception):
    """Bad input or configuration, described in one sentence that names the place and the remedy.

    Command lines print the sentence and end with exit code 2; nothing else does. A line break or a run of
    blanks in what is quoted (another library's message) becomes one blank, a control character or half a
    character a question mark, and a long quotation is cut (MOST_LETTERS).
    """

    def __init__(self, message: str) -> None:
        self.message = on_one_line(message)
        super().__init__(self.message)


def on_one_line(text: str) -> str:
    """Convert text for quoting in a message: one line of printable letters, cut at MOST_LETTERS."""
    printable = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return shorten(printable, MOST_LETTERS)


def shorten(text: str, most: int) -> str:
    """Cut the middle of a text that is longer than `most`."""
    if len(text) <= most:
        return text
    cut, end = " [...] ", most // 3
    return f"{text[: most - end - len(cut)].rstrip()}{cut}{text[-end:].lstrip()}"


class TableError(InputError):
    """A table of the pipeline is damaged, of another version, or of another subject.

    A subject's data cannot cause it (but see `reading_what_was_brought`), so the stage fails.
    """


class StorageError(TableError):
    """A file could not be written: the disk is full, a quota used up, a folder read-only.

    The missing file counts as not made, and the next run makes it.
    """


@contextmanager
def reading_what_was_brought() -> Iterator[None]:
    """Treat a damaged table as bad input, since the user supplied it and no stage wrote it."""
    try:
        yield
    except StorageError:
        raise
    except TableError as error:
        raise InputError(error.message) from error


def join_reasons(reasons: Iterable[str]) -> str:
    """Join different reasons into one text."""
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def count_of(n: int, noun: str, verb: str = "") -> str:
    """Return so many things, with their verb, which is passed in the plural: 1 row is, 2 rows are."""
    one = {"": "", "are": " is", "have": " has"}.get(verb, f" {verb}s")
    return f"{n} {noun}{one}" if n == 1 else f"{n} {noun}s {verb}".rstrip()


def list_names(names: Sequence[str], most: int = 8) -> str:
    """List the first few names and the number of the others; "none" where there is no name."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    short = (name if len(name) <= 40 else f"{name[:37]}..." for name in names[:most])
    return (", ".join(short) or "none") + more


def guess(word: str, words: Sequence[str]) -> str:
    """Suggest the most similar known word, or list all of them where none is similar."""
    return nearest(word, words, "") or f"expected one of {', '.join(words)}"


def nearest(word: str, words: Iterable[str], before: str = "; ") -> str:
    """Return the question whether the most similar word was meant, or an empty text where none is similar.

    Capitals count as small letters.
    """
    by_lower = {other.lower(): other for other in words}
    close = difflib.get_close_matches(word.lower(), by_lower, 1)
    return f"{before}did you mean {by_lower[close[0]]!r}?" if close else ""
