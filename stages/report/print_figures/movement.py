"""The study's figure of ranges of motion: a row a joint angle, a dot a subject."""

from __future__ import annotations

from matplotlib.figure import Figure

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.movement_results import OF_ANGLE, RANGE, Movement
from shukotsu.stages.report.palette import INK, Look, digit_looks
from shukotsu.stages.report.plots.panels import Panel, print_figure
from shukotsu.stages.report.plots.rows import Group, Row, rows_panel, value_scale
from shukotsu.stages.report.plots.style import ONE_COLUMN_MM
from shukotsu.stages.report.print_figures.drawing import NoDataError, study_text
from shukotsu.stages.report.recording_results import ANGLES
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import capital


def ranges_panel(movement: Movement) -> Panel:
    """Return the panel of ranges of motion: joints below each of ANGLES, in the colour of their digit."""
    means = movement.subject_means.groupby([*OF_ANGLE, "subject"], sort=False)[RANGE].mean()
    joints = list(dict.fromkeys(means.index.get_level_values("joint")))
    digits = list(dict.fromkeys(joint.partition("_")[0] for joint in joints if "_" in joint))
    looks, plain = digit_looks(digits), Look(INK, "o")
    groups = []
    for angle in ANGLES:
        rows = [
            Row(
                joint,
                Look(looks.get(joint.partition("_")[0], plain).colour, "o"),
                means[joint, angle].to_dict(),
            )
            for joint in joints
            if (joint, angle) in means.index
        ]
        groups += [Group(capital(word(angle)), tuple(rows))] if rows else []
    scale = value_scale(means.to_numpy())
    title = tr("Range of motion by joint.")
    n_subjects = movement.ranges["subject"].nunique()
    return rows_panel("", title, tr("Range of motion [deg]"), scale, groups, of_all=n_subjects)


def ranges_of_motion(results: StudyResults, movement: Movement) -> tuple[Figure, str]:
    """Draw the ranges of motion. Raises NoDataError without joint angles."""
    if movement.ranges.empty:
        raise NoDataError(movement.why_nothing)
    return print_figure([[ranges_panel(movement)]], figure_mm=ONE_COLUMN_MM), (
        tr(
            "Range of motion (2.5th to 97.5th percentile) of every joint angle [deg]. {study_text} Model "
            "{model}. A dot is a subject, the mean over recordings; mark: median; bar: quartiles. Hands "
            "with a suspect finding are left out.",
            study_text=study_text(results),
            model=movement.model,
        )
    )
