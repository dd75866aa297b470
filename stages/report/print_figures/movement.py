"""The study's figure of ranges of motion: a row a joint angle, a dot a subject."""

from __future__ import annotations

from matplotlib.figure import Figure

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.movement_results import OF_ANGLE, RANGE, Movement
from shukotsu.stages.report.palette import INK, Look, digit_looks
from shukotsu.stages.report.plots.panels import Panel, print_figure
from shukotsu.stages.report.plots.rows import Group, Row, rows_panel, value_scale
from shukotsu.stages.report.print_figures.drawing import NoDataError, study_text
from shukotsu.stages.report.recording_results import ANGLES
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import capital


def range_panels(movement: Movement) -> list[Panel]:
    """Return a panel for each of ANGLES that any joint has: joints in the colour of their digit."""
    means = movement.subject_means.groupby([*OF_ANGLE, "subject"], sort=False)[RANGE].mean().sort_index()
    joints = list(dict.fromkeys(movement.ranges["joint"]))
    digits = list(dict.fromkeys(joint.partition("_")[0] for joint in joints if "_" in joint))
    looks, plain = digit_looks(digits), Look(INK, "o")
    panels = []
    for angle in ANGLES:
        rows = tuple(
            Row(
                joint,
                Look(looks.get(joint.partition("_")[0], plain).colour, "o"),
                means[joint, angle].to_dict(),
            )
            for joint in joints
            if (joint, angle) in means.index
        )
        title = tr("Range of motion by joint, {angle}.", angle=angle)
        axis = tr("{angle} [deg]", angle=capital(word(angle)))
        scale = value_scale([value for row in rows for value in row.values()])
        of_all = movement.ranges["subject"].nunique()
        panels += [rows_panel("", title, axis, scale, [Group("", rows)], of_all=of_all)] if rows else []
    return panels


def ranges_of_motion(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw the ranges of motion. Raises NoDataError without joint angles."""
    if movement.ranges.empty:
        raise NoDataError(movement.why_nothing)
    return print_figure([range_panels(movement)]), (
        tr(
            "Range of motion (2.5th to 97.5th percentile) of every joint angle [deg]. {study_text} Model "
            "{model}. A dot is a subject, the mean over recordings; mark: median; bar: quartiles. Hands "
            "with a suspect finding are left out.",
            study_text=study_text(results),
            model=movement.model,
        )
    )
