"""What a person can put right: bad input or bad configuration."""

from __future__ import annotations

import difflib
from collections.abc import Sequence


class InputError(Exception):
    """Bad input or configuration, told in one sentence that names the place and says what to do.

    Command lines print the sentence and end with exit code 2; nothing else does. A line break or a run of
    blanks in what is quoted (another library's message) becomes one blank.
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


class TableError(InputError):
    """A table of the pipeline is not what it should be: damaged, of another version, or somebody else's.

    No result of a subject's own data, so a stage that meets it fails and does not record it as one.
    """


def no_such_file(path: object, what: str = "file") -> str:
    """Say that a file is not there, and what may be wrong with how it is written."""
    hint = "; folders are separated by / and not by \\" if "\\" in str(path) else ""
    return f"{path}: no such {what}{hint}"


def guess(word: str, known: Sequence[str]) -> str:
    """Say what a word that is not known may stand for: the nearest known one, or else all of them."""
    close = difflib.get_close_matches(word, known, 1)
    return f"did you mean {close[0]!r}?" if close else f"expected one of {', '.join(known)}"
