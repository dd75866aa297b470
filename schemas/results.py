"""Where a study's files are: the one place that knows the scheme of its paths."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from schemas.study import Hand, Recording, path_token

HAND_TABLES = {
    "joint_centres": "estimate_metacarpals",
    "bone_lengths": "estimate_metacarpals",
    "metacarpals": "estimate_metacarpals",
    "tips": "evaluate_tips",
    "tip_errors": "evaluate_tips",
}
"""The study's tables and the stage that writes each."""

FIT_TABLES = {"receivers": "fit_hand", "gains": "fit_hand"}
"""The same for models that fit the whole hand."""

MOTION_TABLES = ("bone_poses", "posed_tips", "joint_angles")
"""Tables of a hand as posed with a model that fits the whole hand; they stay with the hand."""

SCORE_TABLES = {
    "skeleton_scores": "evaluate_skeletons",
    "joint_errors": "evaluate_skeletons",
    "calibration_advice": "check_calibration",
}
"""Tables of a hand under all models together, or under none, and the stage that writes each."""

STUDY_TABLES = (*HAND_TABLES, *FIT_TABLES, *SCORE_TABLES, "recordings", "problems")


@dataclass(frozen=True)
class Part:
    """One hand's share of a study's table: whose it is, in words, the stage that writes it, and its file."""

    whose: str
    stage: str
    path: Path


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
    def made(self) -> Path:
        """Folder of what each job says it made; the workflow goes by it."""
        return self.folder / "made"

    @property
    def dataset(self) -> Path:
        """Folder of the Motion-BIDS dataset of all exported recordings."""
        return self.folder / "exports" / "bids"

    @property
    def dataset_failures(self) -> Path:
        """What is not in that dataset, a line each; beside it, for it may hold its own files alone."""
        return self.dataset.with_name("bids.failed.txt")

    def exports(self, model: str, recording: Recording) -> Path:
        """Folder of one recording's skeleton and motion in other programs' formats."""
        return self.folder / "exports" / model / recording.hand.folder / recording.name

    def subject_pages(self, subject: str) -> Path:
        """Folder of the report's pages of one subject."""
        return self.folder / "report" / f"sub-{path_token(subject)}"

    def subject_page(self, subject: str) -> Path:
        """The report's page of one subject."""
        return self.subject_pages(subject) / "subject.html"

    def recording_page(self, recording: Recording) -> Path:
        """The report's page of one recording."""
        return self.folder / "report" / recording.hand.folder / f"{recording.name}.html"

    @property
    def resolved(self) -> Path:
        """The study as it was understood: its file, layouts and models with every default filled in."""
        return self.folder / "resolved.yaml"

    def poses(self, recording: Recording) -> Path:
        """A recording's poses."""
        return self.folder / recording.hand.folder / recording.name / "poses.parquet"

    def hand_table(self, model: str, hand: Hand, table: str) -> Path:
        """A table of one hand under one skeleton model."""
        return self.skeleton(model, hand) / f"{table}.parquet"

    def skeleton(self, model: str, hand: Hand, without: str = "") -> Path:
        """Folder of one hand under one model, made `without` a task's recordings where one is named."""
        folder = self.folder / "models" / model / hand.folder
        return folder / f"without-{without}" if without else folder

    def score_table(self, hand: Hand, table: str) -> Path:
        """A table of one hand that no single model is behind."""
        return self.folder / "hands" / hand.folder / f"{table}.parquet"

    def study_table(self, table: str) -> Path:
        """A table over the whole study."""
        return self.folder / f"{table}.parquet"

    def parts(
        self, table: str, hands: Iterable[Hand], models: Iterable[str], fitted: Collection[str]
    ) -> list[Part]:
        """What a study's table is put together from, model by model.

        fitted : those of the models that fit the whole hand; only they have FIT_TABLES.
        """
        hands = list(hands)
        if table in SCORE_TABLES:
            stage = SCORE_TABLES[table]
            return [Part(_whose(hand), stage, self.score_table(hand, table)) for hand in hands]
        stage = {**HAND_TABLES, **FIT_TABLES}[table]
        return [
            Part(f"{_whose(hand)}, model {model}", stage, self.hand_table(model, hand, table))
            for model in models
            for hand in hands
            if table in HAND_TABLES or model in fitted
        ]


def _whose(hand: Hand) -> str:
    return f"subject {hand.subject}, {hand.hand} hand"
