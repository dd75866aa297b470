"""Pages of which a command writes one part anew, between two marks, and leaves the rest."""

from __future__ import annotations

from shukotsu.errors import InputError


def replaced_between(page: str, start: str, end: str, text: str) -> str:
    """The page with what is between its marks replaced; InputError where it lacks a mark."""
    before, opened, rest = page.partition(start)
    _, closed, after = rest.partition(end)
    if not (opened and closed):
        raise InputError(f"the page lacks {start} or {end}; put the marks where the text is to be")
    return f"{before}{start}\n\n{text}\n\n{end}{after}"
