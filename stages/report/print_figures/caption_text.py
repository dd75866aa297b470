"""Sentences that several captions share."""

from __future__ import annotations

from collections.abc import Iterable

from schemas.study import Recording
from stages.report.study_results import StudyResults
from stages.report.table_cells import counted


def study_text(results: StudyResults) -> str:
    """Which study it is, how many subjects and hands it has, and whether its recordings are real."""
    subjects, hands = counted(len(results.subjects), "subject"), counted(len(results.hands), "hand")
    kind = "simulated recordings of " if results.simulated else ""
    return f"Study {results.name}: {kind}{subjects}, {hands}."


def count_range(counts: Iterable[int]) -> str:
    """The numbers of subjects or hands behind several marks: one number, or from which to which."""
    low, high = min(counts := list(counts)), max(counts)
    return f"{low}" if low == high else f"{low}–{high}"


def capital(text: str) -> str:
    """The text with a capital first letter and without underscores."""
    words = text.replace("_", " ")
    return words[:1].upper() + words[1:]


def recording_text(recording: Recording) -> str:
    """The recording in words."""
    trial = f", trial {recording.trial}" if recording.trial else ""
    return f"subject {recording.hand.subject}, {recording.hand.hand} hand, {recording.task}{trial}"
