"""Errors that a user can correct: bad input or bad configuration."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

MOST_LETTERS = 400
"""Length of the longest message. It begins with the place and ends with the remedy, so its middle is cut."""

INTERNAL = "internal error in"
"""Beginning of the reason why a part failed if it is a bug; the name of the stage follows."""


class InputError(Exception):
    """Bad input or configuration, described in one sentence that names the place and the remedy.

    Command lines print the sentence and end with exit code 2, which is used for nothing else. The message is
    put on one line by `on_one_line`, since it may quote other libraries.
    """

    def __init__(self, message: str) -> None:
        self.message = on_one_line(message)
        super().__init__(self.message)


def on_one_line(text: str) -> str:
    """Return text as one line of printable characters, at most MOST_LETTERS long.

    Each run of white space becomes a single space, and each unprintable character a question mark.
    """
    printable = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return shorten(printable, MOST_LETTERS)


def shorten(text: str, most: int) -> str:
    """Return a text with its middle cut out if it is longer than `most` characters."""
    if len(text) <= most:
        return text
    cut, end = " [...] ", most // 3
    return f"{text[: most - end - len(cut)].rstrip()}{cut}{text[-end:].lstrip()}"


class TableError(InputError):
    """A table of the pipeline is damaged, of another version, or of another subject.

    A subject's data cannot cause this, so the stage fails (see `reading_user_tables` for an exception).
    """


class StorageError(TableError):
    """A file could not be written because the disk is full, a quota is used up or a folder is read-only.

    The file is then missing, so the next run makes it.
    """


@contextmanager
def reading_user_tables() -> Iterator[None]:
    """Turn a TableError in the block into a plain InputError, for tables that the user supplied."""
    try:
        yield
    except StorageError:
        raise
    except TableError as error:
        raise InputError(error.message) from error


def join_reasons(reasons: Iterable[str]) -> str:
    """Join the different non-empty reasons with semicolons."""
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def count_of(n: int, noun: str, verb: str = "") -> str:
    """Return a number with its noun and verb in agreement ("1 row is", "2 rows are"); verb : its plural."""
    singular = {"": "", "are": " is", "have": " has"}.get(verb, f" {verb}s")
    return f"{n} {noun}{singular}" if n == 1 else f"{n} {noun}s {verb}".rstrip()


def list_names(names: Sequence[str], most: int = 8) -> str:
    """List the first `most` names and the number of the others, or "none" if there is no name.

    The middle of long names is cut out unless two of them would then be the same.
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    shown = names[:most]
    short = [name if len(name) <= 40 else f"{name[:12]}...{name[-25:]}" for name in shown]
    short = short if len({*short}) == len({*shown}) else [*shown]
    return (", ".join(short) or "none") + more


def guess(word: str, words: Sequence[str]) -> str:
    """Ask whether the most similar of the words was meant, or list all of them if none is similar."""
    return nearest(word, words, "") or f"expected one of {', '.join(words)}"


def nearest(word: str, words: Iterable[str], before: str = "; ") -> str:
    """Return the question whether the most similar word was meant, or an empty string if none is similar.

    Case is ignored. before : text to put before the question.
    """
    by_lower = {other.lower(): other for other in words}
    close = difflib.get_close_matches(word.lower(), by_lower, 1)
    return f"{before}did you mean {by_lower[close[0]]!r}?" if close else ""
