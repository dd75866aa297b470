"""Define errors that a person can put right: bad input or bad configuration."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

MOST_LETTERS = 400
"""Letters of a message; what it names stands first and what to do last, so the middle is left out."""

INTERNAL = "internal error in"
"""How the reason begins why a part cannot be had that a bug ended; the stage follows."""


class InputError(Exception):
    """Bad input or configuration, told in one sentence that names the place and says what to do.

    Command lines print the sentence and end with exit code 2; nothing else does. A line break or a run of
    blanks in what is quoted (another library's message) becomes one blank, a control character or half a
    character a question mark, and a long quotation is cut (MOST_LETTERS).
    """

    def __init__(self, message: str) -> None:
        self.message = on_one_line(message)
        super().__init__(self.message)


def on_one_line(text: str) -> str:
    """Return text as a message may quote it: one line of printable letters, not too many."""
    printable = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return shorten(printable, MOST_LETTERS)


def shorten(text: str, most: int) -> str:
    """Leave out the middle of a text that has more letters."""
    if len(text) <= most:
        return text
    cut, end = " [...] ", most // 3
    return f"{text[: most - end - len(cut)].rstrip()}{cut}{text[-end:].lstrip()}"


class TableError(InputError):
    """A table of the pipeline is not what it should be: damaged, of another version, or somebody else's.

    No result of a subject's own data (but see `reading_what_was_brought`), so a stage that meets it fails.
    """


class StorageError(TableError):
    """A file could not be written: the disk is full, a quota used up, a folder read-only.

    What would have been in it is no result either: it is made by the next run, when there is room.
    """


@contextmanager
def reading_what_was_brought() -> Iterator[None]:
    """Take a table that is not what it should be for bad input: it was brought, no stage wrote it."""
    try:
        yield
    except StorageError:
        raise
    except TableError as error:
        raise InputError(error.message) from error


def join_reasons(reasons: Iterable[str]) -> str:
    """Return several reasons as one text, each once."""
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def count_of(n: int, noun: str, verb: str = "") -> str:
    """Return so many things, with their verb, which is passed in the plural: 1 row is, 2 rows are."""
    one = {"": "", "are": " is", "have": " has"}.get(verb, f" {verb}s")
    return f"{n} {noun}{one}" if n == 1 else f"{n} {noun}s {verb}".rstrip()


def list_names(names: Sequence[str], most: int = 8) -> str:
    """Name the first of what a file holds, and how many more there are; "none" where it holds nothing."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    short = (name if len(name) <= 40 else f"{name[:37]}..." for name in names[:most])
    return (", ".join(short) or "none") + more


def guess(word: str, words: Sequence[str]) -> str:
    """Suggest a word for one that there is not: the nearest there is, or else all of them."""
    return nearest(word, words, "") or f"expected one of {', '.join(words)}"


def nearest(word: str, words: Sequence[str], before: str = "; ") -> str:
    """Ask whether the nearest of some words was meant; empty where none is near."""
    close = difflib.get_close_matches(word, words, 1)
    return f"{before}did you mean {close[0]!r}?" if close else ""
