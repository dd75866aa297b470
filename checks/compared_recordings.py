"""Findings that need several recordings: one file named twice, a recording of another person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from checks.checked_recording import CheckedRecording
from schemas.findings import SUSPECT, Finding


def compared(recordings: Sequence[tuple[str, CheckedRecording]]) -> list[CheckedRecording]:
    """Add to a subject's recordings, name and findings each, in the sheet's order, what a comparison says."""
    found: list[CheckedRecording] = []
    seen: dict[str, str] = {}
    for name, own in recordings:
        first = seen.setdefault(own.digest, name)
        more = [same_file(first)] if first != name else []
        found.append(replace(own, findings=(*more, *own.findings)))
    return found


def same_file(first: str) -> Finding:
    """Say that the poses are those of another recording, `first`."""
    message = (
        f"All poses are, number by number, those of {first}: probably one file is named twice; correct the "
        "column file of the recordings sheet, or give a reason under `exclude` for one of the two."
    )
    return Finding("same-file", SUSPECT, message)
