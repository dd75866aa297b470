"""Figures with their captions, and how they become files: the same figure, the same bytes."""

from __future__ import annotations

import io
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from shukotsu.errors import on_one_line
from shukotsu.report.figures.panels import lay_out
from shukotsu.report.figures.style import ONE_COLUMN_MM, SMALL_PT, apply_style, label, wrap_text
from shukotsu.report.study_results import StudyResults
from shukotsu.report.templates import plain
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.whole_files import replacing, write_text
from shukotsu.translation import ngettext, tr


class NoDataError(Exception):
    """Why a figure cannot be drawn, in a sentence without a full stop."""


@dataclass(frozen=True)
class Drawing:
    """A figure, its name in paths and its caption; `missing` says why it shows nothing but a sentence."""

    name: str
    figure: Figure
    caption: str
    missing: str = ""


def draw_figure(name: str, draw: Callable[[], tuple[Figure, str]]) -> Drawing:
    """Draw a figure in the house's style, or one that says why it cannot be drawn."""
    try:
        with apply_style():
            figure, caption = draw()
            lay_out(figure, label)
    except NoDataError as error:
        return not_drawn(name, str(error))
    except MemoryError:
        raise
    except Exception as error:  # a figure must not cost a study the others
        traceback.print_exc()
        return not_drawn(name, on_one_line(f"{type(error).__name__}: {error}"))
    versions = tr(
        "Drawn by {PROGRAM} {VERSION} with matplotlib {version}.",
        PROGRAM=PROGRAM,
        VERSION=VERSION,
        version=matplotlib.__version__,
    )
    return Drawing(name, figure, plain(f"{caption} {versions}"))


def not_drawn(name: str, reason: str) -> Drawing:
    """Draw a figure that says why there is none."""
    sentence = plain(tr("Not drawn: {reason}.", reason=reason.rstrip(".")))
    with apply_style():
        lines = wrap_text(sentence, 52)
        figure = Figure(figsize=(ONE_COLUMN_MM / 25.4, (10.0 + 4.0 * len(lines)) / 25.4))
        figure.text(0.5, 0.5, "\n".join(lines), ha="center", va="center", fontsize=SMALL_PT)
    return Drawing(name, figure, sentence, sentence)


def save(folder: Path, drawing: Drawing) -> None:
    """Write NAME.svg, NAME.pdf and NAME.txt, each whole or not at all. Raises InputError where it cannot.

    Drawn in memory first, for matplotlib says more than one sentence of a disk that is full.
    """
    for kind, date in (("svg", "Date"), ("pdf", "CreationDate")):
        written = io.BytesIO()
        with apply_style():
            drawing.figure.savefig(written, format=kind, metadata={date: None})
        with replacing(folder / f"{drawing.name}.{kind}") as temporary:
            temporary.write_bytes(written.getvalue())
    write_text(folder / f"{drawing.name}.txt", drawing.caption + "\n")


def study_text(results: StudyResults) -> str:
    """Return which study it is, how many subjects and hands it has, and whether its recordings are real."""
    return tr(
        "Study {name}: {kind}{subjects}, {hands}{each}.",
        name=results.name,
        kind=tr("simulated recordings of ") if results.simulated else "",
        subjects=ngettext("{n} subject", "{n} subjects", len(results.subjects)),
        hands=ngettext("{n} hand", "{n} hands", len(results.hands)),
        each=tr(" (counted in each session)") if results.has_sessions else "",
    )


def count_range(counts: Iterable[int]) -> str:
    """Return the numbers of subjects or hands behind several marks: a number, or from which to which."""
    low, high = min(counts := list(counts)), max(counts)
    return f"{low}" if low == high else f"{low}–{high}"
