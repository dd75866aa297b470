"""Tip errors over time: a strip a digit above a common time axis, a line a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.palette import RULE, SOFT, Look
from stages.report.pictures.picture import Picture
from stages.report.pictures.scale import Scale, plain
from stages.report.pictures.traces import Trace, error_scale, thin, trace_band
from stages.report.table_cells import alike, listed
from stages.report.wording import say, word

Array = npt.NDArray[np.float64]
Traces = Mapping[str, Mapping[str, Trace]]
"""By digit, then by model."""

_WIDTH, _LEFT, _RIGHT, _STRIP, _GAP, _FOOT, _LEGEND_ROW, _ACROSS = (
    480.0,
    36.0,
    428.0,
    46.0,
    8.0,
    36.0,
    16.0,
    3,
)
_PAGE_COLUMNS = 150


def thinned_traces(
    frame: npt.NDArray[np.int64],
    time_s: Array,
    errors: Mapping[str, Mapping[str, Array]],
    columns: int = _PAGE_COLUMNS,
) -> dict[str, dict[str, Trace]]:
    """Thin errors (T,) by digit and model, mm; what is never known is left out."""
    made = {
        digit: {model: thin(frame.astype(float), time_s, values, columns) for model, values in own.items()}
        for digit, own in errors.items()
    }
    return {
        digit: {model: trace for model, trace in own.items() if trace is not None}
        for digit, own in made.items()
    }


def time_label(traces: Traces) -> str:
    """What stands under the time axis."""
    trace = next(trace for of in traces.values() for trace in of.values())
    return say("device time [s]") if trace.in_seconds else say("frame")


def hidden_lines(traces: Traces, models: Sequence[str]) -> str:
    """Models whose lines are the same in every digit, so that the last hides the others."""
    lines = {
        model: [of[model].high_mm.tobytes() if model in of else b"" for of in traces.values()]
        for model in models
    }
    hidden = [listed(group) for group in alike(lines) if len(group) > 1]
    return (
        say("Equal, so that the last hides the others: {hidden}.", hidden="; ".join(hidden)) if hidden else ""
    )


def tip_error_picture(title: str, traces: Traces, looks: Mapping[str, Look]) -> Markup:
    """The strips for a page; every strip's span is the recording's. `title` is the text alternative."""
    models = [model for model in looks if any(model in of for of in traces.values())]
    top = 18 + _LEGEND_ROW * -(-max(1, len(models)) // _ACROSS)
    foot = top + len(traces) * (_STRIP + _GAP)
    picture = Picture(title, _WIDTH, foot + _FOOT)
    everything = [trace for of in traces.values() for trace in of.values()]
    errors = error_scale(everything)
    picture.text(0, 12, f"[mm]{say(', log scale') if errors.kind == 'log' else ''}")
    _legend(picture, models, looks)
    first = min((trace.span[0] for trace in everything), default=0.0)
    last = max((trace.span[1] for trace in everything), default=0.0)
    time = Scale(first, last if last > first else first + 1.0)
    for index, (digit, of) in enumerate(traces.items()):
        strip = _Strip(picture, time, errors, top + index * (_STRIP + _GAP))
        strip.frame(digit)
        for place, (model, trace) in enumerate(of.items()):
            strip.draw(trace, looks[model], place / len(of))
        if not of:
            picture.text(_LEFT + 6, strip.top + _STRIP / 2, say("not known"), middle=True)
    if everything:
        picture.line([(_LEFT, foot - _GAP), (_RIGHT, foot - _GAP)], SOFT)
        picture.number_axis(time, (_LEFT, _RIGHT), foot - _GAP, foot - _GAP, time_label(traces))
    return picture.markup()


def _legend(picture: Picture, models: Sequence[str], looks: Mapping[str, Look]) -> None:
    for index, model in enumerate(models):
        x, y = (index % _ACROSS) * _WIDTH / _ACROSS, 24 + _LEGEND_ROW * (index // _ACROSS)
        picture.line([(x, y), (x + 20, y)], looks[model].colour, 1.5)
        picture.marks(np.array([[x + 10, y]]), looks[model].marker, 6.0, looks[model].colour)
        picture.text(x + 26, y, model, middle=True)


@dataclass(frozen=True)
class _Strip:
    """A digit's place in the picture, from `top` down."""

    picture: Picture
    time: Scale
    errors: Scale
    top: float

    def frame(self, digit: str) -> None:
        """The digit's name, and the numbers of the errors with their grid."""
        self.picture.text(_RIGHT + 6, self.top + _STRIP / 2, word(digit), middle=True)
        for tick in self.errors.ticks(2, 0.28):
            y = float(self._down(tick))
            self.picture.line([(_LEFT, y), (_RIGHT, y)], RULE)
            self.picture.text(_LEFT - 4, y, plain(tick), "end", middle=True)

    def draw(self, trace: Trace, look: Look, phase: float) -> None:
        """A line through the largest errors, with marks that tell it from others and are no samples."""
        x, _, high = trace_band(trace)
        points = np.column_stack([_LEFT + self.time.share(x) * (_RIGHT - _LEFT), self._down(high)])
        self.picture.line(points, look.colour, 1.1)
        step = max(1, len(x) // 8)
        self.picture.marks(points[int(phase * step) :: step], look.marker, 4.5, look.colour)

    def _down(self, values: npt.ArrayLike) -> Array:
        return np.asarray(self.top + _STRIP * (1 - self.errors.share(values)))
