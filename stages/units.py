"""The command lines of many runs of a stage as one text, for a job that does them all in one process."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence

from schemas.errors import InputError


def pack(units: Iterable[Sequence[str]]) -> str:
    """Give the text: every word once, then the numbers of each unit's words, a line a unit.

    Once, because a shell takes a command of at most 128 KiB and most of a subject's units name the same
    recordings.
    """
    numbers: dict[str, int] = {}
    lines = [" ".join(str(numbers.setdefault(word, len(numbers))) for word in unit) for unit in units]
    return "\n".join([json.dumps(list(numbers), ensure_ascii=False), *lines])


def unpack(text: str) -> list[list[str]]:
    """Give the units' words again. Raises InputError where the text is not what `pack` gives."""
    first, *lines = text.split("\n")
    try:
        words: list[str] = json.loads(first)
        return [[words[int(number)] for number in line.split(" ")] for line in lines if line]
    except (ValueError, IndexError, TypeError) as error:
        raise InputError(
            f"units: {error}; expected a JSON list of words, then a line a unit with the numbers of its words"
        ) from error
