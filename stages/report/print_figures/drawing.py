"""A figure with its caption, and how both become files: the same figure, the same bytes."""

from __future__ import annotations

import io
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from shukotsu.errors import on_one_line
from shukotsu.files.whole_files import replacing, write_text
from shukotsu.schemas import PROGRAM, VERSION
from shukotsu.schemas.study import Recording
from shukotsu.sentences.translation import ngettext, tr
from shukotsu.stages.report.plots.style import ONE_COLUMN_MM, SMALL_PT, applied, label, rewrite, wrapped
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.wording import plain


def study_text(results: StudyResults) -> str:
    """Return which study it is, how many subjects and hands it has, and whether its recordings are real."""
    subjects = ngettext("{n} subject", "{n} subjects", len(results.subjects))
    hands = ngettext("{n} hand", "{n} hands", len(results.hands))
    kind = tr("simulated recordings of ") if results.simulated else ""
    each = tr(" (counted in each session)") if results.has_sessions else ""
    return tr(
        "Study {name}: {kind}{subjects}, {hands}{each}.",
        name=results.name,
        kind=kind,
        subjects=subjects,
        hands=hands,
        each=each,
    )


def count_range(counts: Iterable[int]) -> str:
    """The numbers of subjects or hands behind several marks: one number, or from which to which."""
    low, high = min(counts := list(counts)), max(counts)
    return f"{low}" if low == high else f"{low}–{high}"


def recording_text(recording: Recording) -> str:
    """The recording in words."""
    trial = tr(", trial {trial}", trial=recording.trial) if recording.trial else ""
    return tr("{hand}, {task}{trial}", hand=recording.hand, task=recording.task, trial=trial)


class NoDataError(Exception):
    """Why a figure cannot be drawn, in a sentence without a full stop."""


@dataclass(frozen=True)
class Drawing:
    """A figure, its name in paths and its caption; `missing` says why it shows nothing but a sentence."""

    name: str
    figure: Figure
    caption: str
    missing: str = ""


def drawn(name: str, draw: Callable[[], tuple[Figure, str]]) -> Drawing:
    """Draw a figure in the house's style, or one that says why it cannot be drawn."""
    try:
        with applied():
            figure, caption = draw()
            rewrite(figure, label)
            engine = figure.get_layout_engine()
            assert engine is not None
            engine.execute(figure)
            figure.set_layout_engine(None)  # it is laid out, once for all files
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
    with applied():
        lines = wrapped(sentence, 52)
        figure = Figure(figsize=(ONE_COLUMN_MM / 25.4, (10.0 + 4.0 * len(lines)) / 25.4))
        figure.text(0.5, 0.5, "\n".join(lines), ha="center", va="center", fontsize=SMALL_PT)
    return Drawing(name, figure, sentence, sentence)


def save(folder: Path, drawing: Drawing) -> None:
    """Write NAME.svg, NAME.pdf and NAME.txt, each whole or not at all. Raises InputError where it cannot."""
    base = folder / drawing.name
    with applied():
        write_figure(_with(base, "svg"), drawing.figure, {"Date": None})
        write_figure(_with(base, "pdf"), drawing.figure, {"CreationDate": None})
    write_text(_with(base, "txt"), drawing.caption + "\n")


def write_figure(path: Path, figure: Figure, metadata: dict[str, None]) -> None:
    """Write a figure whole or not at all; drawn in memory first, for matplotlib says more than one sentence
    of a disk that is full.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix[1:], metadata=metadata)
    with replacing(path) as temporary:
        temporary.write_bytes(drawn.getvalue())


def _with(base: Path, kind: str) -> Path:
    return base.with_name(f"{base.name}.{kind}")
