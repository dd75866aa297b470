"""The two pictures of an answer: every subject's number under each model, and every subject's difference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from stages.report.comparison import ALL_DIGITS, FEWEST_SUBJECTS
from stages.report.data_table import counted, listed
from stages.report.models_compared.answers import Answer
from stages.report.models_compared.axis import Axis, difference_axis, value_axis
from stages.report.models_compared.charts import FEWEST_FOR_QUARTILES, Panel, Strip, draw

_SCALES = {"linear": "", "log": ", log scale", "asinh": ", even about 0, squeezed outward"}


@dataclass(frozen=True)
class Panels:
    """A picture: a panel a digit with its name, what is to be seen, and what else to know."""

    caption: str
    panels: tuple[tuple[str, Markup], ...]
    remarks: tuple[str, ...]


def value_panels(answer: Answer) -> Panels:
    """Every subject's number under each model and each reference."""
    every = np.array(
        [v for of in answer.by_digit.values() for numbers in of.values() for v in numbers.values()]
    )
    axis = value_axis(every)
    shown = f"{answer.question.choice}, every subject under {listed(answer.names)}"
    panels = [_panel(answer, digit, shown, _strips(answer, of)) for digit, of in answer.by_digit.items()]
    places = (
        "hands, recordings and joints" if answer.metric.table == "joint_errors" else "hands and recordings"
    )
    caption = f"A dot is a subject: the mean over {places}."
    if answer.n_subjects >= FEWEST_FOR_QUARTILES:
        caption += " The line is the median, the box the quartiles."
    if answer.overall:
        caption += f" In bold what the others are compared with: {answer.baseline}."
    low = axis.below(every)
    below = f"{counted(low, 'number')} below {axis.low:.2g} {answer.metric.unit} at the left edge."
    return _panels(answer, caption, panels, axis, (below,) if low else ())


def difference_panels(answer: Answer) -> Panels | None:
    """Every subject's difference from the baseline, with means and intervals; None without any."""
    of_digit: dict[str, list[Strip]] = {digit: [] for digit in answer.by_digit}
    for each in (*answer.overall, *answer.digits):
        if each.found is not None:
            differences = {p.subject: p.difference for p in each.compared if p.difference is not None}
            strip = Strip(each.model, differences, each.found.mean, each.found.interval)
            of_digit[each.digit].append(strip)
    strips = [strip for of in of_digit.values() for strip in of]
    if not strips:
        return None
    axis = difference_axis(np.array([value for strip in strips for value in strip.numbers.values()]))
    shown = f"{answer.question.choice}, each subject's difference from {answer.baseline}"
    panels = [_panel(answer, digit, shown, of) for digit, of in of_digit.items() if of]
    caption = (
        f"A dot is a subject: the model's number less that of {answer.baseline}, over the places in which "
        "both have one. The line is the mean"
    )
    if all(strip.interval is None for strip in strips):
        caption += f"; with fewer than {FEWEST_SUBJECTS} subjects there is no interval."
    else:
        caption += ", the bar its 95 % interval, for one comparison at a time."
    return _panels(answer, caption, panels, axis)


def title_of(digit: str) -> str:
    """The digit in words."""
    name = digit.replace("_", " ")
    return "All digits" if digit == ALL_DIGITS else name[0].upper() + name[1:]


def _strips(answer: Answer, of_model: Mapping[str, Mapping[str, float]]) -> list[Strip]:
    references = answer.question.references
    return [
        Strip(
            model=name,
            numbers=of_model.get(name, {}),
            baseline=name == answer.baseline,
            reference=name in references,
        )
        for name in answer.names
    ]


def _panel(answer: Answer, digit: str, shown: str, strips: Sequence[Strip]) -> Panel:
    digits = [name for name in answer.by_digit if name != ALL_DIGITS]
    colour = "shared" if digit == ALL_DIGITS else f"digit{digits.index(digit) % 5}"
    return Panel(title_of(digit), f"{title_of(digit)}: {shown}.", colour, strips)


def _panels(
    answer: Answer, caption: str, panels: Sequence[Panel], axis: Axis, remarks: tuple[str, ...] = ()
) -> Panels:
    drawn = draw(panels, axis, f"{answer.metric.unit}{_SCALES[axis.kind]}", answer.n_subjects)
    if drawn.overlapping:
        remarks += (f"{counted(drawn.overlapping, 'dot')} of much the same number lie partly on others.",)
    names = (panel.name for panel in panels)
    return Panels(caption, tuple(zip(names, drawn.pictures, strict=True)), remarks)
