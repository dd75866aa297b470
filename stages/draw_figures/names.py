"""What the figures are called; light, for the workflow asks before anything is drawn."""

from __future__ import annotations

STUDY_FIGURES = ("models-by-digit", "paired-differences", "joint-errors", "bone-lengths", "joint-trust")
"""Figures of a study. Each is always written: where it has no data, with the sentence that says so."""

KINDS = ("svg", "pdf", "txt")
"""A figure's files: two of the drawing, and its caption."""
