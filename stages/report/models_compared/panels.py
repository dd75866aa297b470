"""The two pictures of an answer: every subject's number under each model, and every subject's difference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from stages.report.comparison.answers import Answer
from stages.report.comparison.comparisons import ALL_DIGITS
from stages.report.comparison.paired_statistics import FEWEST_SUBJECTS
from stages.report.palette import DIGITS, INK
from stages.report.pictures.scale import Scale
from stages.report.pictures.subject_dots import (
    FEWEST_FOR_QUARTILES,
    Panel,
    Strip,
    difference_scale,
    draw_panels,
    value_scale,
)
from stages.report.table_cells import counted, listed

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
    scale = value_scale(every)
    shown = f"{answer.question.choice}, every subject under {listed(answer.names)}"
    panels = [_panel(answer, digit, shown, _strips(answer, of)) for digit, of in answer.by_digit.items()]
    places = (
        "hands, recordings and joints" if answer.question.table == "joint_errors" else "hands and recordings"
    )
    caption = f"A dot is a subject: the mean over {places}."
    if answer.n_subjects >= FEWEST_FOR_QUARTILES:
        caption += " The line is the median, the box the quartiles."
    if answer.overall:
        caption += f" In bold what the others are compared with: {answer.baseline}."
    low = scale.below(every)
    below = f"{counted(low, 'number')} below {scale.low:.2g} {answer.question.unit} at the left edge."
    return _panels(answer, caption, panels, scale, (below,) if low else ())


def difference_panels(answer: Answer) -> Panels | None:
    """Every subject's difference from the baseline, with means and intervals; None without any."""
    of_digit: dict[str, list[Strip]] = {digit: [] for digit in answer.by_digit}
    for each in (*answer.overall, *answer.digits):
        if each.statistics is not None:
            differences = {p.subject: p.difference for p in each.compared if p.difference is not None}
            strip = Strip(each.model, differences, each.statistics.mean, each.statistics.interval)
            of_digit[each.digit].append(strip)
    strips = [strip for of in of_digit.values() for strip in of]
    if not strips:
        return None
    scale = difference_scale(np.array([value for strip in strips for value in strip.numbers.values()]))
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
    return _panels(answer, caption, panels, scale)


def digit_title(digit: str) -> str:
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
    colour = INK if digit == ALL_DIGITS else DIGITS[digits.index(digit) % len(DIGITS)]
    return Panel(digit_title(digit), f"{digit_title(digit)}: {shown}.", colour, strips)


def _panels(
    answer: Answer, caption: str, panels: Sequence[Panel], scale: Scale, remarks: tuple[str, ...] = ()
) -> Panels:
    drawn = draw_panels(panels, scale, f"{answer.question.unit}{_SCALES[scale.kind]}", answer.n_subjects)
    if drawn.overlapping:
        remarks += (f"{counted(drawn.overlapping, 'dot')} of much the same number lie partly on others.",)
    names = (panel.name for panel in panels)
    return Panels(caption, tuple(zip(names, drawn.pictures, strict=True)), remarks)
