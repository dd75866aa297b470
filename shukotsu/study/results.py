"""Paths of a study's results; all other modules take them from here."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.tables.subjects import SubjectSession, path_token

if TYPE_CHECKING:
    from shukotsu.study.study import Recording

MEASURED_TABLES = ("ranges_of_motion", "fingertip_paths", "movement_cycles", "cycle_curves", "event_strokes")
"""Tables of a subject's movement."""

SKELETON_TABLES = ("joint_centres", "bone_lengths", "metacarpals")
TRUTH_TABLES = (*SKELETON_TABLES, "tips")
"""Tables of true values that accompany a simulated recording."""

SUBJECT_TABLES = {
    "findings": "check_recordings",
    **dict.fromkeys(("events", "clocks"), "align_events"),
    "joint_solutions": "solve_joints",
    "projected_joints": "project_planes",
    **dict.fromkeys(SKELETON_TABLES, "estimate_metacarpals"),
    **dict.fromkeys(("tips", "tip_errors"), "evaluate_tips"),
    **dict.fromkeys(("skeleton_scores", "joint_errors"), "evaluate_skeletons"),
    **dict.fromkeys(MEASURED_TABLES, "measure_movement"),
}
"""Tables of a subject, with both hands and all models, and the rule that writes each."""

FIT_TABLES = (
    *("fitted_joints", "fitted_bones", "receivers", "moved_receivers", "gains", "length_pulls"),
    *("joint_angles", "bone_poses", "posed_tips"),
)
"""Tables written once per hand and model by a fit of the whole hand."""

GATHERED_TABLES = (
    *("joint_centres", "bone_lengths", "tip_errors", "receivers", "moved_receivers", "gains"),
    *("skeleton_scores", "joint_errors", "events", "clocks", *MEASURED_TABLES),
)
"""Short tables whose rows of whole skeletons are gathered from all subjects of the study."""

STUDY_TABLES = (*GATHERED_TABLES, "recordings", "problems", "agreement")

MODEL_COMPARISONS = ("model_values", "model_pairs", "model_differences")
"""Comparisons of the study's models, made from its tables."""

MOVEMENT_COMPARISONS = ("movement_differences", "movement_reliability")
"""Comparisons of the subjects' movement, made from the study's tables."""


STUDY_FIGURES = {
    "models": ("models", "results"),
    "joint-errors": ("joint_errors", "results"),
    "joint-trust": ("joint_trust", "results"),
    "ranges-of-motion": ("ranges_of_motion", "results", "movement"),
    "cycle-curves": ("study_cycles", "results", "movement", "groups"),
    "groups": ("groups", "results", "study", "movement"),
}
"""Figures of a study for print: each one's function in `report/figures/study_figures.py`, and its arguments.

If there is no data for a figure, it consists of a sentence that says so.
"""

FIGURE_KINDS = ("svg", "pdf", "txt")
"""File types of a figure: the drawing in two formats, and its caption."""


def table_in(folder: Path, name: str, hand: str = "", model: str = "") -> Path:
    """Return the file of a table in its subject's folder; hand, model : used for tables of FIT_TABLES."""
    fit = Path("fits", hand, path_token(model)) if name in FIT_TABLES else Path()
    return folder / fit / f"{name}.parquet"


FAILED_PAGES = "failed.txt"
"""File that lists which of a subject's pages could not be made and why, one per line."""


class Results:
    """The results folder of one study: in a run, results/NAME in the working directory.

    Attributes
    ----------
    report
        The study's report.
    resolved
        The resolved study: its file, layouts and models with all defaults filled in.
    figures
        Folder of the study's figures for print.
    exports
        Folder of all skeletons and their motion in the formats of other programs.
    new_dataset, tidy_tables
        Folders in which the Motion-BIDS dataset and the CSV files of the study's tables are made, before they
        are collected in `exports` as `bids` and `tables`.

    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.report, self.resolved = folder / "report.html", folder / "resolved.yaml"
        self.figures, self.exports = folder / "figures", folder / "exports"
        self.new_dataset, self.tidy_tables = folder / "dataset", folder / "tidy"

    def subject(self, subject: str, session: str = "") -> Path:
        """Return the folder of a subject's plan and tables, for one session if the study has sessions."""
        return self.folder / f"sub-{SubjectSession(subject, session).token}"

    def plan(self, subject: str, session: str = "") -> Path:
        """Return the file of a subject's plan."""
        return self.subject(subject, session) / "plan.json"

    def subject_exports(self, subject: str, session: str = "") -> Path:
        """Return the folder in which a subject's exports are made, before they are collected in `exports`."""
        return self.subject(subject, session) / "exports"

    def subject_pages(self, subject: str, session: str = "") -> Path:
        """Return the folder of the report's pages of one subject."""
        return self.folder / "report" / self.subject(subject, session).name

    def subject_page(self, subject: str, session: str = "") -> Path:
        """Return the file of the report's page of one subject."""
        return self.subject_pages(subject, session) / "subject.html"

    def recording_page(self, recording: Recording) -> Path:
        """Return the file of the report's page of one recording."""
        return self.folder / "report" / recording.hand.folder / f"{recording.name}.html"

    def study_table(self, table: str) -> Path:
        """Return the file of a table of the whole study."""
        return self.folder / f"{table}.parquet"
