"""A figure with its caption, and how both become files: the same figure, the same bytes."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from schemas import PROGRAM, VERSION
from schemas.files import replacing, write_text
from schemas.study import Recording
from stages.report.print_figures.style import ONE_COLUMN_MM, SMALL_PT, applied, new_figure, wrapped
from stages.report.study_results import StudyResults
from stages.report.table_cells import counted
from stages.report.wording import plain, say, tidied


def study_text(results: StudyResults) -> str:
    """Which study it is, how many subjects and hands it has, and whether its recordings are real."""
    subjects, hands = counted(len(results.subjects), "subject"), counted(len(results.hands), "hand")
    kind = say("simulated recordings of ") if results.simulated else ""
    each = say(" (counted in each session)") if results.has_sessions else ""
    return say(
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
    trial = say(", trial {trial}", trial=recording.trial) if recording.trial else ""
    return say("{hand}, {task}{trial}", hand=recording.hand, task=recording.task, trial=trial)


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
    with applied():
        try:
            figure, caption = draw()
        except NoDataError as error:
            return _without_data(name, str(error))
    versions = say(
        "Drawn by {PROGRAM} {VERSION} with matplotlib {version}.",
        PROGRAM=PROGRAM,
        VERSION=VERSION,
        version=matplotlib.__version__,
    )
    return Drawing(name, figure, plain(tidied(f"{caption} {versions}")))


def not_drawn(name: str, reason: str) -> Drawing:
    """A figure that says why there is none."""
    with applied():
        return _without_data(name, reason)


def save(folder: Path, drawing: Drawing) -> None:
    """Write NAME.svg, NAME.pdf and NAME.txt, each whole or not at all. Raises InputError where it cannot."""
    base = folder / drawing.name
    with applied():
        _write(_with(base, "svg"), drawing.figure, {"Date": None})
        drawing.figure.set_layout_engine(None)  # panels have found their places; to search again takes long
        _write(_with(base, "pdf"), drawing.figure, {"CreationDate": None})
    write_text(_with(base, "txt"), drawing.caption + "\n")


def _write(path: Path, figure: Figure, metadata: dict[str, None]) -> None:
    """Draw into memory first: matplotlib says more than one sentence of a disk that is full."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix[1:], metadata=metadata)
    with replacing(path) as temporary:
        temporary.write_bytes(drawn.getvalue())


def _with(base: Path, kind: str) -> Path:
    return base.with_name(f"{base.name}.{kind}")


def _without_data(name: str, reason: str) -> Drawing:
    sentence = plain(tidied(say("Not drawn: {reason}.", reason=reason.rstrip("."))))
    lines = wrapped(sentence, 52)
    figure = new_figure(ONE_COLUMN_MM, 10.0 + 4.0 * len(lines))
    figure.text(0.5, 0.5, "\n".join(lines), ha="center", va="center", fontsize=SMALL_PT)
    return Drawing(name, figure, sentence, sentence)
