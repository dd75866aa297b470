"""What the Snakefile asks of a study: which files a job reads, and the words of its command line."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from schemas.config_files import read_config
from schemas.errors import InputError
from schemas.model import SkeletonModel, read_model
from schemas.results import FIT_TABLES, HAND_TABLES, MOTION_TABLES, SCORE_TABLES, STUDY_TABLES, Results
from schemas.study import Hand, Recording, Study, path_token, read_participants, read_study
from stages.draw_figures.names import KINDS, STUDY_FIGURES

Wildcards = Any
"""Snakemake's wildcards: attributes subject, hand, recording, model, as they stand in paths."""


class Wiring:
    """One study, asked by the wildcards of a job."""

    def __init__(self, study_file: Path) -> None:
        self.file = _relative(study_file)
        self.study: Study = read_study(Path(self.file))
        self.results = Results.of(self.study.name)
        self.models = {name: _relative(path) for name, path in self.study.models.items()}
        self._sizes = {
            row["subject"]: {name: row[name] for name in ("hand_length_mm", "hand_breadth_mm")}
            for row in read_participants(self.study.sheets.get("participants"))
        }
        self._skeleton_models = {
            name: read_model(Path(path).absolute()) for name, path in self.models.items()
        }
        self._fitted = [name for name, model in self._skeleton_models.items() if model.fitting is not None]
        self._hands = {(path_token(h.subject), h.hand): h for h in self.study.hands}
        self._recordings = {
            (path_token(r.hand.subject), r.hand.hand, r.name): r for r in self.study.recordings
        }

    @classmethod
    def of(cls, study_files: Sequence[Path], config: Mapping[str, Any], default: Path) -> Wiring:
        """Read the study of Snakemake's --configfile, or the default one.

        Raises InputError where there are several, or where --config would change what the file says: the
        stages read that file, and results that it does not explain would be worse than none.
        """
        if len(study_files) > 1:
            raise InputError("--configfile: names several files; a run is of one study")
        path = Path(study_files[0]) if study_files else default
        if config and dict(config) != _as_written(path):
            raise InputError(f"--config: a study is described by its file alone; write it into {path}")
        return cls(path)

    # --- simulate -------------------------------------------------------------------------------------

    @property
    def simulated(self) -> str:
        """Path of a simulated recording, with wildcards; a path that nothing asks for where none is."""
        folder = self.study.simulation.folder if self.study.simulation else Path(os.devnull, "none")
        return _relative(folder / "sub-{subject}_hand-{hand}_task-{task}.parquet")

    @property
    def streamed(self) -> str:
        """Path of a simulated recording as its tracker's raw capture, with wildcards."""
        return self.simulated.removesuffix(".parquet") + ".arrows"

    def simulate(self, wildcards: Wildcards) -> str:
        """Words of simulate's command line."""
        assert self.study.simulation is not None
        hand = self._hands[wildcards.subject, wildcards.hand]
        seed = str(self.study.simulation.seed)
        return shlex.join(
            ["--subject", hand.subject, "--hand", hand.hand, "--task", wildcards.task, "--seed", seed]
        )

    # --- capture --------------------------------------------------------------------------------------

    def recording_file(self, wildcards: Wildcards) -> list[str]:
        """The recording, if it is there or can be simulated; a missing one must not stop the others."""
        recording = self._recording(wildcards)
        names = {"subject": wildcards.subject, "hand": wildcards.hand, "task": recording.task}
        file = _relative(recording.file)
        made = [path.format(**names) for path in (self.simulated, self.streamed)]
        return [file] if recording.file.exists() or file in made else []

    def mapping(self, wildcards: Wildcards) -> list[str]:
        """The recording's mapping, if it has one and it is there; a missing one must not stop the others."""
        mapping = self._recording(wildcards).mapping
        return [_relative(mapping)] if mapping is not None and mapping.exists() else []

    def capture(self, wildcards: Wildcards) -> str:
        """Words of capture's command line."""
        r = self._recording(wildcards)
        words = {"in": _relative(r.file), "layout": _relative(r.layout), "format": r.format}
        words |= {} if r.mapping is None else {"mapping": _relative(r.mapping)}
        words |= {"subject": r.hand.subject, "hand": r.hand.hand, "task": r.task, "trial": r.trial}
        repair = ["--repair-hemisphere"] if r.hemisphere == "repair" else []
        return shlex.join([*(f"--{name}={word}" for name, word in words.items()), *repair])

    # --- a hand under a model ---------------------------------------------------------------------------

    def model(self, wildcards: Wildcards) -> str:
        """The skeleton model's file."""
        return self.models[wildcards.model]

    def layout(self, wildcards: Wildcards) -> str:
        """The hand's layout file."""
        return _relative(self.study.layout_of(self._hand(wildcards)))

    def calibration(self, wildcards: Wildcards) -> list[str]:
        """Poses that the hand's joints are solved from under this model."""
        return self._calibration(self._hand(wildcards), wildcards)

    def other_calibration(self, wildcards: Wildcards) -> list[str]:
        """Poses that calibrate the same person's other hand, where the model shares what they have alike."""
        own = self._hand(wildcards)
        fitting = self._model(wildcards.model).fitting
        others = [h for h in self.study.hands if h.subject == own.subject and h.hand != own.hand]
        if fitting is None or not fitting.share_lengths or not others:
            return []
        if self.study.layout_of(others[0]) != self.study.layout_of(own):
            return []
        return self._calibration(others[0], wildcards)

    def evaluated(self, wildcards: Wildcards) -> list[str]:
        """Poses that the hand's tips are evaluated on; of a task that was left out, that task's."""
        recordings = self.study.evaluated(self._hand(wildcards))
        without = _left_out(wildcards)
        return self._poses(r for r in recordings if not without or path_token(r.task) == without)

    def whose(self, wildcards: Wildcards) -> str:
        """Words that say whose hand it is, and how long, where the participants sheet has it."""
        hand = self._hand(wildcards)
        words = [f"--subject={hand.subject}", f"--hand={hand.hand}"]
        return shlex.join([*words, *self._size_words(hand, "hand_length_mm")])

    def sizes(self, wildcards: Wildcards) -> str:
        """Words that say how large the hand is, where the participants sheet has it."""
        return shlex.join(self._size_words(self._hand(wildcards), "hand_length_mm", "hand_breadth_mm"))

    def sheet(self, name: str) -> list[str]:
        """A sheet of the study, if it has one."""
        path = self.study.sheets.get(name)
        return [] if path is None else [_relative(path)]

    def joints(self, wildcards: Wildcards) -> str:
        """The joints that the hand is built from: of the whole hand's fit, or one by one."""
        name = "projected_joints" if self._model(wildcards.model).fitting is None else "fitted_joints"
        return self._beside(wildcards, name)

    def fitted(self, table: str) -> Callable[[Wildcards], list[str]]:
        """A table of the whole hand's fit, for a model that has one."""

        def of(wildcards: Wildcards) -> list[str]:
            fitting = self._model(wildcards.model).fitting
            return [] if fitting is None else [self._beside(wildcards, table)]

        return of

    def corrections(self, wildcards: Wildcards) -> list[str]:
        """The sheet of corrections, for a model that applies it."""
        return self.sheet("corrections") if self._model(wildcards.model).corrections else []

    # --- a hand under all models ------------------------------------------------------------------------

    def skeletons(self, wildcards: Wildcards) -> list[str]:
        """Folders of the hand's skeletons: every model's, and made without each task that it is scored on."""
        return [str(folder) for folder, _ in self._skeletons(self._hand(wildcards))]

    def skeleton_tables(self, wildcards: Wildcards) -> list[str]:
        """Tables in these folders."""
        return [
            str(folder / f"{table}.parquet")
            for folder, model in self._skeletons(self._hand(wildcards))
            for table in (*HAND_TABLES, *(("bone_poses", "posed_tips") if self._model(model).fitting else ()))
        ]

    def calibrating(self, wildcards: Wildcards) -> list[str]:
        """Poses of every recording that may calibrate the hand."""
        return self._poses(self.study.calibrating(self._hand(wildcards), "all"))

    def truth(self, wildcards: Wildcards) -> list[str]:
        """Folders of the truth beside the hand's simulated recordings."""
        if self.study.simulation is None:
            return []
        names = [
            self.simulated.format(subject=wildcards.subject, hand=wildcards.hand, task=recording.task)
            for recording in self.study.of(self._hand(wildcards), ("calibration", "evaluation", "both"))
        ]
        return [name.removesuffix(".parquet") + "_truth" for name in dict.fromkeys(names)]

    # --- exports --------------------------------------------------------------------------------------

    def exported(self, wildcards: Wildcards) -> list[str]:
        """The hand's tables that its skeleton and motion are exported from."""
        fitted = wildcards.model in self._fitted
        tables = [
            "joint_centres",
            "bone_lengths",
            *(("bone_poses", "posed_tips") if fitted else ("metacarpals",)),
        ]
        return [self._beside(wildcards, table) for table in tables]

    def export(self, wildcards: Wildcards) -> str:
        """Words of export's command line."""
        recording = self._recording(wildcards)
        words = ["--subject", recording.hand.subject, "--hand", recording.hand.hand]
        words += ["--recording", recording.name, "--model", wildcards.model]
        words += ["--formats", ",".join(name for name in self.study.exports if name != "bids")]
        return shlex.join([*words, *self._export_settings()])

    def export_dataset(self, _: Wildcards) -> str:
        """Words of the command line that exports the whole study as one dataset."""
        return shlex.join(
            ["--models", ",".join(self.study.export_settings["models"]), *self._export_settings()]
        )

    def _export_settings(self) -> list[str]:
        """Options of both command lines, those that the study says."""
        settings = {name: value for name, value in self.study.export_settings.items() if name != "models"}
        return [
            f"--{name.replace('_', '-')}={value}"
            for name, value in settings.items()
            if value not in ("", None)
        ]

    @property
    def exports(self) -> list[str]:
        """Folders of everything that the study exports."""
        models, formats = self.study.export_settings["models"], self.study.exports
        each = [self.results.exports(model, recording) for model in models for recording in self.study.shown]
        dataset = [self.results.dataset] if "bids" in formats else []
        return [str(folder) for folder in [*(each if {*formats} - {"bids"} else []), *dataset]]

    @property
    def dataset_sources(self) -> list[str]:
        """Everything that the dataset is made from."""
        fit = [(model, model in self._fitted) for model in self.study.export_settings["models"]]
        tables = [
            str(self.results.hand_table(model, hand, table))
            for model, fitted in fit
            for hand in dict.fromkeys(recording.hand for recording in self.study.shown)
            for table in (
                "joint_centres",
                "bone_lengths",
                *(MOTION_TABLES[:2] if fitted else ("metacarpals",)),
            )
        ]
        return [*self._poses(self.study.shown), *tables]

    # --- the study --------------------------------------------------------------------------------------

    study_tables = STUDY_TABLES
    figure_names = STUDY_FIGURES

    @property
    def figures(self) -> list[str]:
        """The study's figures for print, and their captions."""
        return [str(self.results.figures / f"{name}.{kind}") for name in STUDY_FIGURES for kind in KINDS]

    @property
    def poses(self) -> list[str]:
        """Poses of every recording that is not excluded."""
        return self._poses(recording for recording in self.study.recordings if not recording.exclude)

    @property
    def every_table(self) -> list[str]:
        """Every table that the study's are gathered from."""
        return [
            str(part.path)
            for table in (*HAND_TABLES, *FIT_TABLES, *SCORE_TABLES)
            for part in self.results.parts(table, self.study.hands, self.models, self._fitted)
        ]

    def of_subject(self, wildcards: Wildcards) -> list[str]:
        """Everything that a subject's pages of the report show: its poses, and its hands' tables."""
        own = self.study.of_subject(self._subject(wildcards))
        parts = [
            str(part.path)
            for table in (*HAND_TABLES, *FIT_TABLES, *SCORE_TABLES)
            for part in self.results.parts(table, own.hands, self.models, self._fitted)
        ]
        behind = [
            str(self.results.hand_table(model, hand, table))
            for hand in own.hands
            for model in self.models
            for table in ("joint_solutions", *(MOTION_TABLES if model in self._fitted else ()))
        ]
        return [*self._poses(r for r in own.recordings if not r.exclude), *parts, *behind]

    def subject(self, wildcards: Wildcards) -> str:
        """Words that say whose pages they are."""
        return shlex.join([f"--subject={self._subject(wildcards)}"])

    def rows_of_subject(self, wildcards: Wildcards) -> list[str]:
        """What a subject's pages show of the recordings sheet; the rest of it may change without them."""
        return [
            "\t".join((r.hand.hand, r.task, r.trial, r.role, r.file_as_written, r.exclude))
            for r in self.study.of_subject(self._subject(wildcards)).recordings
        ]

    @property
    def subject_pages(self) -> list[str]:
        """Folders of the subjects' pages of the report."""
        return [str(self.results.subject_pages(subject)) for subject in self.study.subjects]

    @property
    def configuration(self) -> list[str]:
        """The study file and its sheets."""
        return [self.file, *map(_relative, self.study.sheets.values())]

    def _hand(self, wildcards: Wildcards) -> Hand:
        return self._hands[wildcards.subject, wildcards.hand]

    def _subject(self, wildcards: Wildcards) -> str:
        return next(s for s in self.study.subjects if path_token(s) == wildcards.subject)

    def _model(self, name: str) -> SkeletonModel:
        return self._skeleton_models[name]

    def _calibration(self, hand: Hand, wildcards: Wildcards) -> list[str]:
        calibration, without = self._model(wildcards.model).calibration, _left_out(wildcards)
        tasks = {path_token(r.task): r.task for r in self.study.recordings}
        return self._poses(self.study.calibrating(hand, calibration, tasks.get(without, "")))

    def _beside(self, wildcards: Wildcards, table: str) -> str:
        """A table in the folder of the job's own skeleton."""
        folder = self.results.skeleton(wildcards.model, self._hand(wildcards), _left_out(wildcards))
        return str(folder / f"{table}.parquet")

    def _skeletons(self, hand: Hand) -> list[tuple[Path, str]]:
        """Folders of the hand's skeletons, and the model of each."""
        return [
            (self.results.skeleton(model, hand, without), model)
            for model in self.models
            for without in ("", *map(path_token, self.study.left_out(hand, self._model(model).calibration)))
        ]

    def _size_words(self, hand: Hand, *names: str) -> list[str]:
        sizes = self._sizes.get(hand.subject, {})
        return [
            f"--{name.replace('_', '-')}={sizes[name]:g}" for name in names if sizes.get(name) is not None
        ]

    def _recording(self, wildcards: Wildcards) -> Recording:
        return self._recordings[wildcards.subject, wildcards.hand, wildcards.recording]

    def _poses(self, recordings: Iterable[Recording]) -> list[str]:
        return [str(self.results.poses(recording)) for recording in recordings]


def _left_out(wildcards: Wildcards) -> str:
    """The task, as in paths, that the job's skeleton is made without; empty for none."""
    return str(getattr(wildcards, "without", "")).removeprefix("/without-")


def _as_written(path: Path) -> dict[str, Any]:
    return read_config(path, "study", with_defaults=False)


def _relative(path: str | Path) -> str:
    return os.path.relpath(path)
