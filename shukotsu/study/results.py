"""Paths of a study's results; no other module builds them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.tables.subjects import SubjectSession, path_token

if TYPE_CHECKING:
    from shukotsu.study.study import Recording

MEASURED_TABLES = ("ranges_of_motion", "fingertip_paths", "movement_cycles", "cycle_curves", "event_strokes")
"""Tables of a subject's movement."""

SUBJECT_TABLES = {
    "findings": "check_recordings",
    "events": "align_events",
    "clocks": "align_events",
    "joint_solutions": "solve_joints",
    "projected_joints": "project_planes",
    "joint_centres": "estimate_metacarpals",
    "bone_lengths": "estimate_metacarpals",
    "metacarpals": "estimate_metacarpals",
    "tips": "evaluate_tips",
    "tip_errors": "evaluate_tips",
    "skeleton_scores": "evaluate_skeletons",
    "joint_errors": "evaluate_skeletons",
    **dict.fromkeys(MEASURED_TABLES, "measure_movement"),
}
"""Tables of a subject, with both hands and all models, and the rule that writes each."""

FIT_TABLES = (
    "fitted_joints",
    "fitted_bones",
    "receivers",
    "moved_receivers",
    "gains",
    "length_pulls",
    "joint_angles",
    "bone_poses",
    "posed_tips",
)
"""Tables of one hand under one model that fits the whole hand."""

SKELETON_TABLES = ("joint_centres", "bone_lengths", "metacarpals")
TRUTH_TABLES = (*SKELETON_TABLES, "tips")
"""Tables of the truth beside a simulated recording."""

GATHERED_TABLES = (
    *("joint_centres", "bone_lengths", "tip_errors", "receivers", "moved_receivers", "gains"),
    *("skeleton_scores", "joint_errors", "events", "clocks", *MEASURED_TABLES),
)
"""Short tables that are gathered for the study, of whole skeletons."""

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
"""Figures of a study for print: each one's function in `report/figures/study_figures.py`, and what it takes.

One without data consists of a sentence that says so.
"""

FIGURE_KINDS = ("svg", "pdf", "txt")
"""A figure's files: two of the drawing, and its caption."""


def table_in(folder: Path, name: str, hand: str = "", model: str = "") -> Path:
    """Return a table in its subject's folder; of a fit of the whole hand that of a hand under a model."""
    fit = Path("fits", hand, path_token(model)) if name in FIT_TABLES else Path()
    return folder / fit / f"{name}.parquet"


FAILED_PAGES = "failed.txt"
"""File that lists a subject's pages that could not be made, with the reasons, a line each."""


@dataclass(frozen=True)
class Results:
    """The results folder of one study."""

    folder: Path

    @classmethod
    def of(cls, study_name: str) -> Results:
        """The study's folder in the working directory."""
        return cls(Path("results", study_name))

    @property
    def report(self) -> Path:
        """The study's report."""
        return self.folder / "report.html"

    @property
    def figures(self) -> Path:
        """Folder of the study's figures for print."""
        return self.folder / "figures"

    @property
    def resolved(self) -> Path:
        """The study as it was understood: its file, layouts and models with all defaults."""
        return self.folder / "resolved.yaml"

    def subject(self, subject: str, session: str = "") -> Path:
        """Folder of a subject's plan and tables, in one session where the sheet names any."""
        return self.folder / f"sub-{SubjectSession(subject, session).token}"

    def plan(self, subject: str, session: str = "") -> Path:
        """A subject's plan."""
        return self.subject(subject, session) / "plan.json"

    @property
    def exports(self) -> Path:
        """Folder of all skeletons and their motion in other programs' formats."""
        return self.folder / "exports"

    def subject_exports(self, subject: str, session: str = "") -> Path:
        """Folder that a subject's exports are made in."""
        return self.subject(subject, session) / "exports"

    @property
    def new_dataset(self) -> Path:
        """Folder that the Motion-BIDS dataset is made in, as `bids`."""
        return self.folder / "dataset"

    @property
    def tidy_tables(self) -> Path:
        """Folder that the study's tables are made in as CSV, as `tables`."""
        return self.folder / "tidy"

    @property
    def dataset(self) -> Path:
        """Folder of the Motion-BIDS dataset of all exported recordings."""
        return self.exports / "bids"

    def subject_pages(self, subject: str, session: str = "") -> Path:
        """Folder of the report's pages of one subject."""
        return self.folder / "report" / self.subject(subject, session).name

    def subject_page(self, subject: str, session: str = "") -> Path:
        """The report's page of one subject."""
        return self.subject_pages(subject, session) / "subject.html"

    def recording_page(self, recording: Recording) -> Path:
        """The report's page of one recording."""
        return self.folder / "report" / recording.hand.folder / f"{recording.name}.html"

    def study_table(self, table: str) -> Path:
        """A table over the whole study."""
        return self.folder / f"{table}.parquet"
